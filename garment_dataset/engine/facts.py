"""What a result depends on: the pre-image of its key, and how two of them differ."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.canonical import digest
from garment_dataset.engine.results import FORMAT, WRITER
from garment_dataset.engine.stage import NOTES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    from garment_dataset.engine.code import Code
    from garment_dataset.engine.graph import Node, NodeId
    from garment_dataset.engine.results import Result
    from garment_dataset.engine.table import Column


@dataclass(frozen=True, slots=True)
class Reason:
    """One difference between what is published and what would be made now.

    Parameters
    ----------
    kind : str
        ``parameter``, ``code``, ``library``, ``source``, ``input``, ``member``, ``note``, ``label``, ``output``,
        ``upstream``, ``failure``, ``absent`` or ``new``.
    name : str
        Which one: a parameter's name, a function's, a table's …
    old, new : str or None
        The two sides, where there are two.
    """

    kind: str
    name: str
    old: str | None = None
    new: str | None = None

    def __str__(self) -> str:
        text = f"{self.kind} {self.name}"
        if self.old is not None and self.new is not None:
            return f"{text}: {self.old} -> {self.new}"
        if self.new is not None:
            return f"{text}: {self.new}"
        return text if self.old is None else f"{text}: was {self.old}"


def member_input(table: str, subject: str) -> str:
    """Return the name under which one subject's table stands among the inputs of a node that gathers several."""
    return f"{table}{_OF}{subject}"


_OF = " of "
_ORDER = "order"
_DECLARED = {
    "tables": "tables and sources that the stage declares",
    "identity": "identity columns",
    "writer": "how tables are written",
    "format": "format of the store",
}
_LABELLING = frozenset({"subject", "identity", "labels", "partition"})


def input_digests(
    node: Node, of_source: Callable[[Path], str], of_table: Callable[[NodeId, str, bool], str | None]
) -> dict[str, str | None]:
    """Return the content digests of all that a node reads, by the names that stand in its facts."""
    found: dict[str, str | None] = {name: of_source(path) for name, path in node.sources.items()}
    labelled = node.stage.reads_identity
    found |= {table: of_table(feeder, table, labelled) for table, feeder in node.inputs.items()}
    for table, members in node.gathers.items():
        found |= {member_input(table, feeder.subject): of_table(feeder, table, True) for feeder in members}
    return found


def node_facts(
    node: Node, code: Code, inputs: Mapping[str, str | None], notes: Mapping[str, Sequence[str]]
) -> dict[str, Any]:
    """Return everything that a node's result depends on: the pre-image of its key.

    Parameters
    ----------
    node : Node
        Which run.
    code : Code
        Fingerprint and library versions of its stage.
    inputs : mapping of str to str or None
        Content digests of its sources and input tables, by argument name; of gathered tables by :func:`member_input`,
        None for one that cannot be had.
    notes : mapping of str to sequence of str
        What the stages that feed it said, by stage; it counts where the stage takes it.
    """
    facts = {
        "format": FORMAT,
        "writer": WRITER,
        "stage": node.stage.name,
        "tables": node.stage.declaration,
        "subject": node.subject,
        "params": node.params.model_dump(mode="json"),
        "code": code.digest,
        "libraries": dict(code.libraries),
        "identity": _columns_digest(tuple(label.column for label in node.labels)),
        "labels": {label.column.name: label.value for label in node.labels},
        "partition": node.partition,
        "inputs": dict(inputs),
    }
    if node.gathers:
        facts[_ORDER] = {table: [feeder.subject for feeder in members] for table, members in node.gathers.items()}
    if node.stage.takes_notes:
        facts[NOTES] = {name: list(said) for name, said in notes.items()}
    return facts


@functools.cache
def _columns_digest(columns: tuple[Column, ...]) -> str:
    return digest("columns/1", [column.describe() for column in columns])


def notes_of(node: Node, results: Mapping[NodeId, Result]) -> dict[str, tuple[str, ...]]:
    """Return what the nodes that feed one said, by their stage; those of several subjects name the subject."""
    if not node.stage.takes_notes:
        return {}
    single = set(node.inputs.values())
    found: dict[str, tuple[str, ...]] = {}
    for feeder in node.feeders:
        if feeder in results:
            said = results[feeder].notes
            named = said if feeder in single else tuple(f"{feeder.subject}: {note}" for note in said)
            found[feeder.stage] = (*found.get(feeder.stage, ()), *named)
    return dict(sorted(found.items()))


def node_key(facts: Mapping[str, Any]) -> str:
    """Name a result by everything it depends on: equal keys mean equal results."""
    return digest("node/1", facts)


def body_digest(facts: Mapping[str, Any]) -> str:
    """Name what a stage's function makes, before it is labelled: it is never told whose it is, or where it goes."""
    return digest("body/1", {name: value for name, value in facts.items() if name not in _LABELLING})


def fact_reasons(old: Mapping[str, Any], new: Mapping[str, Any], node: Node, code: Code) -> tuple[Reason, ...]:
    """Return every difference between the facts of a published result and of the one wanted now."""
    reasons = [
        *_changed("parameter", old["params"], new["params"]),
        *_changed("library", old["libraries"], new["libraries"]),
        *_changed("label", old["labels"], new["labels"]),
    ]
    if old["code"] != new["code"]:
        reasons += [Reason("code", symbol, new=how) for symbol, how in code.changes_since(old["code"])]
    reasons += _input_reasons(old["inputs"], new["inputs"], node)
    if not any(reason.kind == "member" for reason in reasons) and old.get(_ORDER) != new.get(_ORDER):
        reasons.append(Reason("member", _ORDER, new="changed"))
    for stage in sorted({*old.get(NOTES, {}), *new.get(NOTES, {})}):
        if old.get(NOTES, {}).get(stage) != new.get(NOTES, {}).get(stage):
            reasons.append(Reason("note", stage, new="it says something else"))
    if old["partition"] != new["partition"]:
        reasons.append(Reason("label", "partition", old["partition"], new["partition"]))
    for name, what in _DECLARED.items():
        if old[name] != new[name]:
            reasons.append(Reason("code", what, new="changed"))
    return tuple(reasons)


def _input_reasons(old: Mapping[str, str | None], new: Mapping[str, str | None], node: Node) -> Iterator[Reason]:
    """Yield how each input differs: added, gone, no longer or again to be had, or changed."""
    for name in sorted({*old, *new}):
        kind = "member" if _OF in name else "source" if name in node.stage.sources else "input"
        if name not in old or name not in new:
            yield Reason(kind, name, new="added" if name in new else "gone")
        elif old[name] != new[name]:
            before, now = ("left out" if digest is None else digest[:12] for digest in (old[name], new[name]))
            yield Reason(kind, name, before, now)


def _changed(kind: str, old: Mapping[str, Any], new: Mapping[str, Any]) -> list[Reason]:
    return [
        Reason(kind, name, _text(old, name), _text(new, name))
        for name in sorted(set(old) | set(new))
        if old.get(name) != new.get(name) or (name in old) != (name in new)
    ]


def _text(values: Mapping[str, Any], name: str) -> str:
    return str(values[name]) if name in values else "(none)"
