"""What becomes of the nodes of a run, as it happens and in sum."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

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


@dataclass
class Report:
    """All endings of a run, in the order they happened."""

    events: dict[NodeId, Event] = field(default_factory=dict)

    def of(self, ending: Ending) -> list[Event]:
        """Return the events with this ending."""
        return [event for event in self.events.values() if event.ending is ending]
