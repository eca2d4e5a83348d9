"""When which recording is built while bags arrive: a state machine without a clock, files or builds.

It is told what a look at the folder showed (:meth:`Watching.see`), whether bags that have settled are final
(:meth:`Watching.judge`), and what was built (:meth:`Watching.built`); it says what is to be built
(:meth:`Watching.due`). Its laws:

- a bag is judged when it has stood still for a while, and once in each state;
- a recording is due when its bag, and every bag that is there and that it is built with, is judged final;
- it is built once with the same states of these bags, whatever came of it;
- a bag that vanishes is forgotten.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.engine.events import Ending, Event, Report
from garment_dataset.engine.plan import State

if TYPE_CHECKING:
    from collections.abc import Collection, Hashable, Mapping
    from pathlib import Path

    from garment_dataset.engine.graph import Graph, NodeId
    from garment_dataset.engine.plan import Plan

Needs = dict[str, frozenset[str]]
"""The recordings that are wanted, each with the other bags, present ones, that it is built with."""


class Seen(NamedTuple):
    """What a look at the folder shows: which bags have changed since the last one, and which are to be judged."""

    changed: tuple[str, ...]
    settled: tuple[str, ...]


class Batch(NamedTuple):
    """Recordings that are built together.

    Parameters
    ----------
    due : tuple of str
        What is new, or has changed.
    along : tuple of str
        What was built before and did not fail: what is made of several recordings needs them all.
    """

    due: tuple[str, ...]
    along: tuple[str, ...]


@dataclass(slots=True)
class _Bag:
    """One bag in one state; ``tried`` has the states that it was last built in and with."""

    state: Hashable
    since_s: float
    is_judged: bool = False
    is_final: bool = False
    tried: Mapping[str, Hashable] = field(default_factory=dict)
    has_failed: bool = False


class Watching:
    """What is known of the bags of a folder.

    Parameters
    ----------
    settle_s : float
        How long a bag has to stand still before it is looked into.
    """

    def __init__(self, settle_s: float) -> None:
        self._settle_s = settle_s
        self._bags: dict[str, _Bag] = {}

    def see(self, now_s: float, states: Mapping[str, Hashable]) -> Seen:
        """Take in one look at the folder.

        Parameters
        ----------
        now_s : float
            When, on any clock that never goes back.
        states : mapping of str to hashable
            All bags that are there; equal states mean that nobody has written meanwhile.
        """
        changed = tuple(name for name, bag in self._bags.items() if states.get(name, bag.state) != bag.state)
        kept = {name: bag for name, bag in self._bags.items() if name not in changed}
        self._bags = {name: kept.get(name) or _Bag(state, now_s) for name, state in states.items()}
        settled = (
            name for name, bag in self._bags.items() if not bag.is_judged and now_s - bag.since_s >= self._settle_s
        )
        return Seen(changed, tuple(settled))

    def judge(self, verdicts: Mapping[str, bool]) -> None:
        """Take in which of the bags that have settled are final: closed, indexed and whole."""
        for name, is_final in verdicts.items():
            self._bags[name].is_judged, self._bags[name].is_final = True, is_final

    def due(self, needs: Needs) -> Batch:
        """Return what is to be built now."""
        ready = [name for name in needs if self._is_final(name) and not self._unfinished(needs[name])]
        # a bag that is gone is no reason to build anew: nothing better would come of it
        due = [name for name in ready if not self._states(name, needs).items() <= self._bags[name].tried.items()]
        along = (name for name in ready if name not in due and not self._bags[name].has_failed)
        return Batch(tuple(due), tuple(along) if due else ())

    def built(self, batch: Batch, needs: Needs, failed: Collection[str] = ()) -> None:
        """Take in that a batch has been built, and which of it failed: it is due again when a bag of its changes."""
        for name in batch.due:
            bag = self._bags[name]
            bag.tried, bag.has_failed = self._states(name, needs), name in failed

    def held(self, needs: Needs) -> dict[str, tuple[str, ...]]:
        """Return the recordings whose own bags are final and that wait for others, with these."""
        waiting = {name: self._unfinished(needs[name]) for name in needs if self._is_final(name)}
        return {name: others for name, others in waiting.items() if others}

    def _states(self, name: str, needs: Needs) -> dict[str, Hashable]:
        return {each: self._bags[each].state for each in (name, *needs[name])}

    def _is_final(self, name: str) -> bool:
        return name in self._bags and self._bags[name].is_final

    def _unfinished(self, names: Collection[str]) -> tuple[str, ...]:
        return tuple(sorted(name for name in names if not self._is_final(name)))


def needs_of(graph: Graph, wanted: Collection[str], names: Mapping[Path, str]) -> Needs:
    """Return which other bags recordings are built with: those of their empty scenes.

    Parameters
    ----------
    graph : Graph
        Of all bags that are there.
    wanted : collection of str
        The recordings; those that no node is of need nothing.
    names : mapping of Path to str
        What bags are called.
    """
    behind: dict[NodeId, frozenset[str]] = {}
    needs: Needs = dict.fromkeys(wanted, frozenset())
    for node in graph:  # what feeds a node comes before it
        own = frozenset(names[path] for path in node.sources.values() if path in names)
        behind[node.id] = own.union(*(behind[feeder] for feeder in node.inputs.values()))
        if node.subject in needs:
            needs[node.subject] |= behind[node.id] - {node.subject}
    return needs


def idle_report(plan: Plan, graph: Graph) -> Report | None:
    """Return the report of a build that has nothing to do; None where there is something."""
    report = Report()
    for decision in plan:
        if decision.state is State.FRESH:
            event = Event(decision.node, Ending.FRESH, notes=decision.notes)
        elif decision.state is State.BLOCKED:
            why = graph[decision.node].blocked or ", ".join(map(str, decision.reasons))
            event = Event(decision.node, Ending.BLOCKED, message=why)
        else:
            return None
        report.events[decision.node] = event
    return report


class Outcome(NamedTuple):
    """What became of one recording in a build.

    Parameters
    ----------
    word : {"built", "fresh", "failed", "waiting"}
        waiting: something that is not there keeps a stage from being run.
    text : str
        How many results there are; or what failed, or is lacking.
    seconds : float
        What its stages took, on all workers together.
    """

    word: str
    text: str
    seconds: float = 0.0


def outcome_of(report: Report, graph: Graph, recording: str) -> Outcome:
    """Sum up what became of the nodes of a recording, and of those that feed them."""
    own = [node for node in graph if node.subject == recording]
    if not own:
        return Outcome("waiting", "no pipeline names it")
    feeders = [node.id for node in graph.restricted_to(node.id for node in own)]
    events = [report.events[node_id] for node_id in feeders if node_id in report.events]
    for event in events:
        if event.ending is Ending.FAILED:
            again = " (as before; `garment build --failed` tries again)" if event.is_repeated else ""
            return Outcome("failed", f"{event.node}: {event.message}{again}")
    made = [event for event in events if event.node.subject == recording]
    obstacles = [event.message for event in events if event.ending is Ending.BLOCKED]
    done = [event for event in made if event.ending is not Ending.BLOCKED]
    is_new = any(event.ending is not Ending.FRESH for event in done)
    text = f"{len(done)} result{'s' * (len(done) != 1)}"
    seconds = sum(event.seconds for event in made)
    if obstacles:
        return Outcome("waiting", f"{obstacles[0]} ({text} without it)", seconds)
    return Outcome("built" if is_new else "fresh", text, seconds)
