"""What was said about one frame: where it hangs in its parent, from sample to sample, by the rules of ROS' tf2."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from garment_dataset.bags.poses import IDENTITY, Pose, Poses, arranged
from garment_dataset.bags.quaternions import lerp, slerp

if TYPE_CHECKING:
    from numpy.typing import NDArray

FailureKind = Literal["past", "future", "unknown frame", "not connected", "loop"]
"""Why a look-up has no answer: before the first or after the last sample of a link, or a matter of the tree itself."""


class Sample(NamedTuple):
    """Where a frame is in its parent, at one time."""

    parent: str
    pose: Pose


class Stop(NamedTuple):
    """Why a walk towards the root of the tree ended before it."""

    kind: FailureKind
    why: str


@dataclass(slots=True)
class Link:
    """All that was said about one child frame."""

    samples: dict[int, Sample] = field(default_factory=dict)
    stamps_ns: list[int] = field(default_factory=list)  # the sorted keys of `samples`; out of date while shorter
    static: Sample | None = None
    last: tuple[object, Sample] | None = None  # what was said last, and what it became: fixed links repeat it
    runs: list[Sample] = field(default_factory=list)  # its samples, repeated ones once: of a fixed link there is one

    def take(self, stamp_ns: int, sample: Sample) -> bool:
        """Add a sample; return False if there is one of that time, which stays."""
        if stamp_ns in self.samples:
            return False
        self.samples[stamp_ns] = sample
        if not self.runs or self.runs[-1] is not sample:
            self.runs.append(sample)
        return True

    @property
    def parents(self) -> set[str]:
        """The frames it was ever said to hang on."""
        return {self.static.parent} if self.static else {each.parent for each in self.runs}

    @property
    def moves(self) -> bool:
        """Whether two of its samples differ."""
        return self.static is None and len({each.pose for each in self.runs}) > 1

    def at(self, stamp_ns: int) -> Sample | Stop:
        """Return the pose in the parent at ``stamp_ns``, as ``tf2::TimeCache::getData``."""
        if (known := self.static or self.samples.get(stamp_ns)) is not None:
            return known
        known_ns = self._sorted_stamps_ns()
        following = bisect_right(known_ns, stamp_ns)
        if following == 0:
            return Stop("past", f"{stamp_ns} ns is before its first sample, {known_ns[0]} ns")
        if following == len(known_ns):
            return Stop("future", f"{stamp_ns} ns is after its last sample, {known_ns[-1]} ns")
        return self._between(known_ns[following - 1], stamp_ns, known_ns[following])

    def _sorted_stamps_ns(self) -> list[int]:
        if len(self.stamps_ns) != len(self.samples):
            self.stamps_ns = sorted(self.samples)
        return self.stamps_ns

    def _between(self, before_ns: int, stamp_ns: int, after_ns: int) -> Sample:
        before, after = self.samples[before_ns], self.samples[after_ns]
        if before.parent != after.parent:
            return Sample(before.parent, before.pose._replace(gap_ns=stamp_ns - before_ns))
        gap_ns = min(stamp_ns - before_ns, after_ns - stamp_ns)
        if before.pose == after.pose:
            return Sample(before.parent, before.pose._replace(gap_ns=gap_ns))
        ratio = (stamp_ns - before_ns) / (after_ns - before_ns)
        translation = lerp(before.pose.translation, after.pose.translation, ratio)
        quaternion = slerp(before.pose.quaternion, after.pose.quaternion, ratio)
        return Sample(before.parent, Pose(translation, quaternion, gap_ns, after_ns - before_ns))

    def at_all(self, stamps_ns: NDArray[np.int64]) -> tuple[Poses, NDArray[np.bool_]]:
        """Return what :meth:`at` returns at many times, and at which of them it has no answer.

        Parameters
        ----------
        stamps_ns : (N,) int64
            Header times.

        Returns
        -------
        Poses
            Of a link that never moves, plain numbers: they hold for all.
        (N,) bool
            Where there is none: the pose is then without meaning.
        """
        if self.static is not None:
            return Poses(*self.static.pose), np.zeros(len(stamps_ns), bool)
        if not self.moves:
            return self._fixed_at(stamps_ns)
        steps = [self.at(stamp_ns) for stamp_ns in stamps_ns.tolist()]
        missing = np.array([isinstance(step, Stop) for step in steps], bool)
        return arranged([IDENTITY if isinstance(step, Stop) else step.pose for step in steps]), missing

    def _fixed_at(self, stamps_ns: NDArray[np.int64]) -> tuple[Poses, NDArray[np.bool_]]:
        """Return the one pose that all samples have; only the time to the nearest of them differs."""
        known_ns = np.array(self._sorted_stamps_ns(), np.int64)
        following = np.searchsorted(known_ns, stamps_ns, side="right")
        before_ns, after_ns = known_ns[following - 1], known_ns[np.minimum(following, len(known_ns) - 1)]
        missing = (following == 0) | ((following == len(known_ns)) & (before_ns != stamps_ns))
        gaps_ns = np.where(before_ns == stamps_ns, 0, np.minimum(stamps_ns - before_ns, after_ns - stamps_ns))
        pose = next(iter(self.samples.values())).pose
        return Poses(pose.translation, pose.quaternion, gaps_ns, 0), missing
