"""What a result depends on: the pre-image of its key, and how two of them differ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.canonical import digest
from garment_dataset.engine.index import FORMAT
from garment_dataset.engine.stage import NOTES

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from garment_dataset.engine.code import Code
    from garment_dataset.engine.graph import Node, NodeId
    from garment_dataset.engine.index import Result


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
        "stage": node.stage.name,
        "subject": node.subject,
        "params": node.params.model_dump(mode="json"),
        "code": code.digest,
        "libraries": dict(code.libraries),
        "labels": {label.column.name: label.value for label in node.labels},
        "partition": node.partition,
        "inputs": dict(inputs),
    }
    return facts | {NOTES: {name: list(said) for name, said in notes.items()}} if node.stage.takes_notes else facts


def notes_of(node: Node, results: Mapping[NodeId, Result]) -> dict[str, tuple[str, ...]]:
    """Return what the nodes that feed one said, by their stage."""
    found = {feeder.stage: results[feeder].notes for feeder in node.feeders if feeder in results}
    return dict(sorted(found.items())) if node.stage.takes_notes else {}


def node_key(facts: Mapping[str, Any]) -> str:
    """Name a result by everything it depends on: equal keys mean equal results."""
    return digest("node/1", facts)


def fact_reasons(old: Mapping[str, Any], new: Mapping[str, Any], node: Node, code: Code) -> tuple[Reason, ...]:
    """Return every difference between the facts of a published result and of the one wanted now."""
    reasons = [
        *_changed("parameter", old["params"], new["params"]),
        *_changed("library", old["libraries"], new["libraries"]),
        *_changed("label", old["labels"], new["labels"]),
    ]
    if old["code"] != new["code"]:
        reasons += [Reason("code", symbol, new=how) for symbol, how in code.changes_since(old["code"])]
    for name in sorted(set(old["inputs"]) | set(new["inputs"])):
        if _OF in name:
            reasons += _member_reasons(name, old["inputs"], new["inputs"])
        elif (before := old["inputs"].get(name)) != (now := new["inputs"].get(name)):
            kind = "source" if name in node.stage.sources else "input"
            reasons.append(Reason(kind, name, before and before[:12], now and now[:12]))
    for stage in sorted({*old.get(NOTES, {}), *new.get(NOTES, {})}):
        if old.get(NOTES, {}).get(stage) != new.get(NOTES, {}).get(stage):
            reasons.append(Reason("note", stage, new="it says something else"))
    if old["partition"] != new["partition"]:
        reasons.append(Reason("label", "partition", old["partition"], new["partition"]))
    if old["format"] != new["format"]:
        reasons.append(Reason("code", "format of the store", str(old["format"]), str(new["format"])))
    return tuple(reasons)


def _member_reasons(name: str, old: Mapping[str, str | None], new: Mapping[str, str | None]) -> Iterator[Reason]:
    """Yield how a member of a group differs: added, gone, no longer or again to be had, or changed."""
    if name not in old or name not in new:
        yield Reason("member", name, new="added" if name in new else "gone")
    elif old[name] != new[name]:
        before, now = ("left out" if digest is None else digest[:12] for digest in (old[name], new[name]))
        yield Reason("member", name, before, now)


def _changed(kind: str, old: Mapping[str, Any], new: Mapping[str, Any]) -> list[Reason]:
    return [
        Reason(kind, name, _text(old, name), _text(new, name))
        for name in sorted(set(old) | set(new))
        if old.get(name) != new.get(name) or (name in old) != (name in new)
    ]


def _text(values: Mapping[str, Any], name: str) -> str:
    return str(values[name]) if name in values else "(none)"
