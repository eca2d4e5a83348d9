"""Plan, then act: one decision per node, with every reason, before anything is run.

The same decisions drive ``status``, ``why``, ``build --dry-run`` and ``build``.
"""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.facts import Reason, fact_reasons, input_digests, node_facts, node_key, notes_of
from garment_dataset.engine.showing import counts_text, html_table
from garment_dataset.engine.sources import SourceStat, stat_source
from garment_dataset.engine.stage import NOTES

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from garment_dataset.engine.code import Code
    from garment_dataset.engine.graph import Graph, Node, NodeId
    from garment_dataset.engine.results import Failure, Result
    from garment_dataset.engine.store import Store


class State(StrEnum):
    """What is known of a node before anything is run."""

    FRESH = "fresh"
    STALE = "stale"
    MISSING = "missing"
    BLOCKED = "blocked"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class Decision:
    """What is to be done with a node, and why.

    Parameters
    ----------
    node : NodeId
        Which one.
    state : State
        What is known.
    reasons : tuple of Reason
        Empty for a fresh node.
    key : str or None
        The key of the result wanted; None while an input is not known yet.
    stored : bool
        The wanted result lies in the store: it is linked, not made.
    certain : bool
        False when an input may turn out unchanged, and nothing is to be done then.
    notes : tuple of str
        What the stage said of data that it left out, of a fresh node.
    facts : mapping or None
        What the result wanted depends on, the pre-image of the key; of a fresh node it is not kept.
    """

    node: NodeId
    state: State
    reasons: tuple[Reason, ...] = ()
    key: str | None = None
    stored: bool = False
    certain: bool = True
    notes: tuple[str, ...] = ()
    facts: Mapping[str, Any] | None = field(default=None, compare=False, repr=False)

    def to_json(self) -> dict[str, Any]:
        """Return the decision as JSON-like data."""
        reasons = [
            {"kind": reason.kind, "name": reason.name, "old": reason.old, "new": reason.new} for reason in self.reasons
        ]
        return {
            "stage": self.node.stage,
            "subject": self.node.subject,
            "variant": self.node.variant,
            "state": self.state.value,
            "certain": self.certain,
            "stored": self.stored,
            "key": self.key,
            "reasons": reasons,
            "notes": list(self.notes),
        }


class Plan:
    """The decisions of a graph, in its order."""

    def __init__(self, decisions: Mapping[NodeId, Decision]) -> None:
        self._decisions = dict(decisions)

    def __iter__(self) -> Iterator[Decision]:
        return iter(self._decisions.values())

    def __getitem__(self, node_id: NodeId) -> Decision:
        return self._decisions[node_id]

    def __repr__(self) -> str:
        return f"<Plan of {len(self._decisions)} results: {counts_text(self.counts())}>"

    def _repr_html_(self) -> str:
        """Return how many results of each stage are in which state, and why."""
        counts = self.counts()
        found = Counter((decision.node.stage, decision.state) for decision in self)
        states = [state for state in State if counts[state]]
        rows = [
            [stage, *(found[stage, state] for state in states)]
            for stage in dict.fromkeys(decision.node.stage for decision in self)
        ]
        title = f"{len(self._decisions)} results: {counts_text(counts)}"
        reasons = Counter((decision.node.stage, str(reason)) for decision in self for reason in decision.reasons)
        why = [[count, *key] for key, count in reasons.items()]
        parts = [html_table(["stage", *states], rows, title=title, more="stages")]
        parts += [html_table(["results", "stage", "reason"], why, more="reasons")] if why else []
        return "\n".join(parts)

    def counts(self) -> dict[State, int]:
        """Return how many nodes are in each state."""
        found = Counter(decision.state for decision in self)
        return {state: found[state] for state in State}

    @property
    def is_fresh(self) -> bool:
        """Whether nothing is to be done."""
        return all(decision.state is State.FRESH for decision in self)


@dataclass(frozen=True)
class Known:
    """What the index holds, read once per plan, and the states of the sources."""

    results: Mapping[str, Result]
    published: Mapping[tuple[str, ...], str]
    failures: Mapping[tuple[str, ...], Failure]
    sources: Mapping[str, tuple[SourceStat, str]]
    stats: dict[Path, SourceStat | None] = field(default_factory=dict)

    @classmethod
    def of(cls, store: Store) -> Known:
        """Read the index."""
        index = store.index
        return cls(store.results, index.published(), index.failures(), index.source_digests())

    def source_digest(self, path: Path) -> str | None:
        """Return a source's digest if its state is the one it was computed for, else None."""
        stat, known = self.sources.get(str(path), (None, None))
        return known if stat is not None and stat == self.stat(path) else None

    def stat(self, path: Path) -> SourceStat | None:
        """Return the state of a source, looked at once."""
        if path not in self.stats:
            self.stats[path] = stat_source(path)
        return self.stats[path]


def make_plan(graph: Graph, codes: Mapping[str, Code], store: Store) -> Plan:
    """Decide about every node; nothing is run, written or read of any source's content."""
    planner = _Planner(codes, store, Known.of(store))
    for node in graph:
        planner.decide(node)
    return Plan(planner.decisions)


_UNKNOWN = ""
"""Stands for a digest that will be known only when something has been run or read."""


class _Planner:
    """Decides node after node; what feeds a node has been decided before it."""

    def __init__(self, codes: Mapping[str, Code], store: Store, known: Known) -> None:
        self.codes = codes
        self.store = store
        self.known = known
        self.decisions: dict[NodeId, Decision] = {}

    def decide(self, node: Node) -> None:
        self.decisions[node.id] = self._blocked(node) or self._uncertain(node) or self._certain(node)

    def _blocked(self, node: Node) -> Decision | None:
        if node.blocked is not None:
            return Decision(node.id, State.BLOCKED, (Reason("absent", node.blocked),))
        absent = [path for path in node.sources.values() if self.known.stat(path) is None]
        if absent:
            return Decision(node.id, State.BLOCKED, tuple(Reason("absent", str(path)) for path in absent))
        stuck = [feeder for feeder in dict.fromkeys(node.inputs.values()) if self._is_stuck(feeder)]
        for members in node.gathers.values():
            if all(map(self._is_stuck, members)):
                stuck += members
        reasons = [Reason("absent", empty) for empty in node.empty_groups]
        reasons += [Reason("upstream", str(feeder), new=self.decisions[feeder].state.value) for feeder in stuck]
        return Decision(node.id, State.BLOCKED, tuple(reasons)) if reasons else None

    def _is_stuck(self, node_id: NodeId) -> bool:
        return self.decisions[node_id].state in {State.BLOCKED, State.FAILED}

    def _uncertain(self, node: Node) -> Decision | None:
        reasons = [
            Reason("upstream", str(feeder), new=self.decisions[feeder].state.value)
            for feeder in node.feeders
            if not self._is_stuck(feeder) and self._result_of(feeder) is None
        ]
        for name, path in node.sources.items():
            if self.known.source_digest(path) is None:
                seen = str(path) in self.known.sources
                reasons.append(
                    Reason("source" if seen else "new", name, new="touched since it was read" if seen else None)
                )
        if not reasons:
            return None
        published = self.known.published.get(node.id)
        reasons += self._passing_failure(node)
        if published is None:
            return Decision(node.id, State.MISSING, tuple(reasons))
        facts = self.store.facts(published) or {}
        own = self._own_reasons(facts, node) if facts else ()
        return Decision(node.id, State.STALE, (*own, *reasons), certain=bool(own))

    def _own_reasons(self, old: Mapping[str, Any], node: Node) -> tuple[Reason, ...]:
        """Return how a node differs from a result's facts for certain: as if all that is unknown came out as it was."""
        inputs = {
            name: old["inputs"].get(name) if found == _UNKNOWN else found for name, found in self._digests(node).items()
        }
        code = self.codes[node.stage.name]
        return fact_reasons(old, node_facts(node, code, inputs, old.get(NOTES, {})), node, code)

    def _what_is_lost(self, result: Result, node: Node) -> str:
        found = (
            self.store.feature_path(table, result.partition, node.subject, node.variant) for table in result.outputs
        )
        return "changed where users look" if all(map(os.path.isfile, found)) else "not where users look"

    def _passing_failure(self, node: Node) -> tuple[Reason, ...]:
        """Return how a node failed last time, where that says nothing of what would come of it now."""
        failure = self.known.failures.get(node.id)
        passing = {"", *map(str, node.sources.values())}
        if failure is None or failure.key not in passing:
            return ()
        return (Reason("failure", failure.kind, new=failure.message),)

    def _result_of(self, node_id: NodeId) -> Result | None:
        decision = self.decisions[node_id]
        settled = decision.state is State.FRESH or decision.stored
        return self.known.results[decision.key] if settled and decision.key is not None else None

    def _digests(self, node: Node) -> dict[str, str | None]:
        """Return what is known of a node's inputs; None for one that cannot be had."""
        return input_digests(node, lambda path: self.known.source_digest(path) or _UNKNOWN, self._content)

    def _content(self, feeder: NodeId, table: str, labelled: bool) -> str | None:
        if self._is_stuck(feeder):
            return None
        result = self._result_of(feeder)
        return _UNKNOWN if result is None else result.outputs[table].digest(labelled=labelled)

    def _certain(self, node: Node) -> Decision:
        code = self.codes[node.stage.name]
        fed = {feeder: result for feeder in node.feeders if (result := self._result_of(feeder)) is not None}
        facts = node_facts(node, code, self._digests(node), notes_of(node, fed))
        decision = self._compared(node, code, facts)
        return decision if decision.state is State.FRESH else replace(decision, facts=facts)

    def _compared(self, node: Node, code: Code, facts: Mapping[str, Any]) -> Decision:
        """Compare what a node's result depends on with what there is."""
        key = node_key(facts)
        published = self.known.published.get(node.id)
        found = self.known.results.get(key)
        is_held = found is not None and self.store.holds(found)
        is_published = found is not None and published == key and self.store.is_published(found, node.variant)
        if found is not None and is_held and is_published:
            return Decision(node.id, State.FRESH, key=key, stored=True, notes=found.notes)
        old = self.store.facts(published) if published is not None else None
        reasons = fact_reasons(old, facts, node, code) if old is not None else ()
        if found is not None and (is_held or is_published):
            lost = self._what_is_lost(found, node) if is_held else "gone from the store, or damaged there"
            reasons = reasons or (Reason("output", lost),)
            return Decision(node.id, State.STALE, reasons, key=key, stored=True)
        failure = self.known.failures.get(node.id)
        if failure is not None and failure.key == key:
            return Decision(node.id, State.FAILED, (Reason("failure", failure.kind, new=failure.message),), key=key)
        passing = self._passing_failure(node)
        if published is None:
            return Decision(node.id, State.MISSING, (*passing, Reason("new", "never built")), key=key)
        reasons = (*passing, *reasons)
        return Decision(
            node.id, State.STALE, reasons or (Reason("output", "gone from the store, or damaged"),), key=key
        )
