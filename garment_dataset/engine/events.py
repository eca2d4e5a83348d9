"""What becomes of the nodes of a run, as it happens and in sum."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

from garment_dataset.engine.showing import counts_text, html_table

if TYPE_CHECKING:
    from collections.abc import Mapping

    from garment_dataset.engine.graph import NodeId


class Ending(StrEnum):
    """What became of a node in a build.

    ``linked``: it was in the store; ``relabelled``: another subject's was, made of the same inputs.
    """

    FRESH = "fresh"
    BUILT = "built"
    LINKED = "linked"
    RELABELLED = "relabelled"
    FAILED = "failed"
    BLOCKED = "blocked"


@dataclass(frozen=True, slots=True)
class Event:
    """One node's ending, as it happens.

    ``is_repeated``: a failure that was not tried again. ``counts``: of what was built, how many different values each
    key column of its tables has.
    """

    node: NodeId
    ending: Ending
    seconds: float = 0.0
    message: str = ""
    notes: tuple[str, ...] = ()
    is_repeated: bool = False
    counts: Mapping[str, int] = field(default_factory=dict, hash=False)


@dataclass(repr=False)
class Report:
    """All endings of a run, in the order they happened."""

    events: dict[NodeId, Event] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<Report of {len(self.events)} results: {counts_text(self.counts())}>"

    def _repr_html_(self) -> str:
        """Return how many results of each stage ended how, and what failed or was noted."""
        found = Counter((event.node.stage, event.ending) for event in self.events.values())
        endings = [ending for ending in Ending if self.of(ending)]
        stages = dict.fromkeys(event.node.stage for event in self.events.values())
        rows = [[stage, *(found[stage, ending] for ending in endings)] for stage in stages]
        title = f"{len(self.events)} results: {counts_text(self.counts())}"
        told = [[event.node, event.message] for event in self.of(Ending.FAILED)]
        told += [[event.node, note] for event in self.events.values() for note in event.notes]
        parts = [html_table(["stage", *endings], rows, title=title, more="stages")]
        parts += [html_table(["result", "what is to be known"], told, more="remarks")] if told else []
        return "\n".join(parts)

    def counts(self) -> dict[str, int]:
        """Return how many nodes ended how."""
        return {ending.value: len(self.of(ending)) for ending in Ending}

    def of(self, ending: Ending) -> list[Event]:
        """Return the events with this ending."""
        return [event for event in self.events.values() if event.ending is ending]
