"""What is measured of a build while it runs: what is at work, how fast each stage is, how long the rest will take."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.engine.events import Ending

if TYPE_CHECKING:
    from collections.abc import Iterable

    from garment_dataset.engine.events import Event
    from garment_dataset.engine.graph import NodeId

_COUNTED = "frame"
"""The key column that a stage's speed is told in."""


class Left(NamedTuple):
    """Time that is left, s; ``is_least``: stages of which nothing was measured yet come on top."""

    seconds: float
    is_least: bool


class Pace:
    """The pace of one build, all times by one clock that never goes back.

    Parameters
    ----------
    nodes : iterable of NodeId
        What is to end.
    """

    def __init__(self, nodes: Iterable[NodeId]) -> None:
        self._open = Counter(node.stage for node in nodes)
        self.total = self._open.total()
        self.ended = 0
        self._running: dict[NodeId, float] = {}
        self._began_s: float | None = None
        self._built: Counter[str] = Counter()
        self._seconds: dict[str, float] = {}
        self._frames: Counter[str] = Counter()
        self._frames_seconds: dict[str, float] = {}

    @property
    def running(self) -> dict[NodeId, float]:
        """What is at work, longest first, and when it began, s."""
        return dict(self._running)

    def begin(self, node: NodeId, now_s: float) -> None:
        """Count a node as at work; one whose source was read first has begun already."""
        self._running.setdefault(node, now_s)
        if self._began_s is None:
            self._began_s = now_s

    def end(self, event: Event) -> None:
        """Count a node as ended, and what it took where it was built."""
        stage, seconds = event.node.stage, event.seconds
        self.ended += 1
        self._open[stage] -= 1
        self._running.pop(event.node, None)
        if event.ending is not Ending.BUILT:
            return
        self._built[stage] += 1
        self._seconds[stage] = self._seconds.get(stage, 0.0) + seconds
        if frames := event.counts.get(_COUNTED):
            self._frames[stage] += frames
            self._frames_seconds[stage] = self._frames_seconds.get(stage, 0.0) + seconds

    def frames_per_s(self, stage: str) -> float | None:
        """Return how many frames of a stage one worker has done a second, in this build; None before the first."""
        seconds = self._frames_seconds.get(stage, 0.0)
        return self._frames[stage] / seconds if seconds > 0 else None

    def left(self, now_s: float) -> Left | None:
        """Return how long the rest will take if it goes on as it went; None while nothing was built.

        Each open node costs what its stage has cost on average, less what those at work have spent; as many are at
        work at a time as were on average.
        """
        spent_s = {node: now_s - began_s for node, began_s in self._running.items()}
        if not self._built or self._began_s is None or now_s <= self._began_s:
            return None
        usual_s = {stage: self._seconds[stage] / count for stage, count in self._built.items()}
        work_s = sum(usual_s.get(stage, 0.0) * max(0, count) for stage, count in self._open.items())
        work_s -= sum(min(seconds, usual_s.get(node.stage, 0.0)) for node, seconds in spent_s.items())
        at_a_time = (sum(self._seconds.values()) + sum(spent_s.values())) / (now_s - self._began_s)
        is_least = any(count > 0 and stage not in usual_s for stage, count in self._open.items())
        return Left(max(0.0, work_s) / at_a_time, is_least) if at_a_time > 0 else None
