"""The recorded transforms as one tree that answers for any moment of the recording, by the rules of ROS' tf2.

The rules are those of ``tf2::BufferCore`` and ``tf2::TimeCache`` (ros/geometry2, 0.7), with three differences that an
offline tree allows: nothing is forgotten, a leading slash is dropped in look-ups too, and quaternions that tf2 would
let through a little too long or short are normalised, as it would scale lengths by their squared norm.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from garment_dataset.bags.poses import IDENTITY, Pose, compose, inverse
from garment_dataset.bags.quaternions import lerp, normalised, slerp
from garment_dataset.errors import TransformError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

SQUARED_NORM_TOLERANCE = 1e-2
"""How far the squared norm of a quaternion may be from 1 (tf2's ``QUATERNION_NORMALIZATION_TOLERANCE``)."""

FailureKind = Literal["past", "future", "unknown frame", "not connected", "loop"]
"""Why a look-up has no answer: before the first or after the last sample of a link, or a matter of the tree itself."""


class LookupFailedError(TransformError):
    """A look-up without an answer.

    Parameters
    ----------
    kind : str
        Why, as one of :data:`FailureKind`.
    what, where, hint
        As in :class:`~garment_dataset.errors.GarmentError`.
    """

    def __init__(self, kind: FailureKind, what: str, *, where: object = None, hint: str | None = None) -> None:
        super().__init__(what, where=where, hint=hint)
        self.kind: FailureKind = kind


@dataclass(frozen=True, eq=False, slots=True)
class Transform:
    """A rigid motion that takes coordinates in ``source`` to coordinates in ``target``.

    Parameters
    ----------
    translation : (3,) float64
        Origin of ``source`` in ``target``, in metres.
    quaternion_xyzw : (4,) float64
        Rotation, of unit norm.
    nearest_sample_gap_ns : int
        Distance in time from the stamp asked for to the nearest sample, of the link where it is largest; links of
        ``/tf_static`` hold at all times and count 0.
    bracket_ns : int
        Longest time between two unequal samples that were interpolated between; 0 when there were none. The two
        samples of a fixed link are equal, however rarely it is published.
    """

    translation: NDArray[np.float64]
    quaternion_xyzw: NDArray[np.float64]
    nearest_sample_gap_ns: int
    bracket_ns: int

    def apply(self, points_m: ArrayLike) -> NDArray[np.float64]:
        """Take points of ``source`` into ``target``.

        Parameters
        ----------
        points_m : array-like, shape (..., 3)
            In metres.

        Returns
        -------
        (..., 3) float64
        """
        points = np.asarray(points_m, dtype=np.float64)
        axis, w = self.quaternion_xyzw[:3], self.quaternion_xyzw[3]
        turn = 2.0 * np.cross(axis, points)
        moved: NDArray[np.float64] = points + w * turn + np.cross(axis, turn) + self.translation
        return moved


class _Sample(NamedTuple):
    """Where a frame is in its parent, at one time."""

    parent: str
    pose: Pose


class _Stop(NamedTuple):
    """Why a walk towards the root of the tree ended before it."""

    kind: FailureKind
    why: str


@dataclass(slots=True)
class _Link:
    """All that was said about one child frame."""

    samples: dict[int, _Sample] = field(default_factory=dict)
    stamps_ns: list[int] = field(default_factory=list)  # the sorted keys of `samples`; out of date while shorter
    static: _Sample | None = None

    @property
    def parents(self) -> set[str]:
        """The frames it was ever said to hang on."""
        return {self.static.parent} if self.static else {sample.parent for sample in self.samples.values()}

    @property
    def moves(self) -> bool:
        """Whether two of its samples differ."""
        return self.static is None and len({sample.pose for sample in self.samples.values()}) > 1

    def at(self, stamp_ns: int) -> _Sample | _Stop:
        """Return the pose in the parent at ``stamp_ns``, as ``tf2::TimeCache::getData``."""
        if (known := self.static or self.samples.get(stamp_ns)) is not None:
            return known
        if len(self.stamps_ns) != len(self.samples):
            self.stamps_ns = sorted(self.samples)
        following = bisect_right(self.stamps_ns, stamp_ns)
        if following == 0:
            return _Stop("past", f"{stamp_ns} ns is before its first sample, {self.stamps_ns[0]} ns")
        if following == len(self.stamps_ns):
            return _Stop("future", f"{stamp_ns} ns is after its last sample, {self.stamps_ns[-1]} ns")
        return self._between(self.stamps_ns[following - 1], stamp_ns, self.stamps_ns[following])

    def _between(self, before_ns: int, stamp_ns: int, after_ns: int) -> _Sample:
        before, after = self.samples[before_ns], self.samples[after_ns]
        if before.parent != after.parent:
            return _Sample(before.parent, before.pose._replace(gap_ns=stamp_ns - before_ns))
        gap_ns = min(stamp_ns - before_ns, after_ns - stamp_ns)
        if before.pose == after.pose:
            return _Sample(before.parent, before.pose._replace(gap_ns=gap_ns))
        ratio = (stamp_ns - before_ns) / (after_ns - before_ns)
        translation = lerp(before.pose.translation, after.pose.translation, ratio)
        quaternion = slerp(before.pose.quaternion, after.pose.quaternion, ratio)
        return _Sample(before.parent, Pose(translation, quaternion, gap_ns, after_ns - before_ns))


class TransformTree:
    """Recorded transforms, to be asked for the pose of any frame in any other at any time.

    Parameters
    ----------
    name : str, optional
        Where the transforms come from, for error messages.

    Attributes
    ----------
    refused : int
        Number of malformed transforms that :meth:`add` did not take.

    Notes
    -----
    Between two samples of a link the translation is interpolated linearly and the rotation by slerp along the shorter
    way; nothing is extrapolated, so a link with one sample answers for that very time only. Only the links between the
    two frames and their nearest common ancestor are needed.
    """

    def __init__(self, name: str | None = None) -> None:
        self.name = name
        self.refused = 0
        self._links: dict[str, _Link] = {}
        self._frames: set[str] = set()

    def add(
        self,
        parent: str,
        child: str,
        stamp_ns: int,
        translation: Sequence[float],
        quaternion_xyzw: Sequence[float],
        *,
        static: bool = False,
    ) -> bool:
        """Take one transform, in any order of time; return whether it was taken.

        Parameters
        ----------
        parent, child : str
            Frame ids; leading slashes do not count.
        stamp_ns : int
            Header stamp; without meaning for a static transform.
        translation : sequence of float, shape (3,)
            Origin of ``child`` in ``parent``, in metres.
        quaternion_xyzw : sequence of float, shape (4,)
            Rotation that takes coordinates in ``child`` to coordinates in ``parent``.
        static : bool
            Whether it holds at all times, as on ``/tf_static``. A link that was ever given so stays so, and the last
            one given counts.

        Returns
        -------
        bool
            False for a second transform of the same link and stamp, where the first one stays, and for a malformed one:
            numbers that are not finite, a squared quaternion norm off by more than 1e-2, a frame without name or its
            own parent. Malformed ones are counted in :attr:`refused`.
        """
        parent, child = parent.lstrip("/"), child.lstrip("/")
        x, y, z = map(float, translation)
        qx, qy, qz, qw = map(float, quaternion_xyzw)
        quaternion = normalised((qx, qy, qz, qw), SQUARED_NORM_TOLERANCE)
        if quaternion is None or not math.isfinite(x + y + z) or not parent or not child or parent == child:
            self.refused += 1
            return False
        sample = _Sample(parent, Pose((x, y, z), quaternion))
        self._frames.update((parent, child))
        link = self._links.setdefault(child, _Link())
        if static:
            link.static = sample
            return True
        return link.samples.setdefault(stamp_ns, sample) is sample

    def lookup(self, target: str, source: str, stamp_ns: int) -> Transform:
        """Return the transform that takes points of ``source`` into ``target`` at ``stamp_ns``.

        Parameters
        ----------
        target, source : str
            Frame ids; leading slashes do not count. A frame in itself is the identity, known or not.
        stamp_ns : int
            Header time.

        Raises
        ------
        LookupFailedError
            With its ``kind`` from :data:`FailureKind`.
        """
        target, source = target.lstrip("/"), source.lstrip("/")
        if target == source:
            return Transform(np.zeros(3), np.array(IDENTITY.quaternion), 0, 0)
        for frame in (target, source):
            if frame not in self._frames:
                what = f"no transform names the frame {frame!r}"
                raise LookupFailedError("unknown frame", what, where=self.name, hint=self._hint())
        source_in, source_stop = self._walk(source, stamp_ns)
        target_in, target_stop = self._walk(target, stamp_ns)
        common = next((frame for frame in target_in if frame in source_in), None)
        if common is None:
            stop = target_stop or source_stop or _Stop("not connected", "they have no common ancestor")
            what = f"no transform from {source!r} to {target!r}: {stop.why}"
            raise LookupFailedError(stop.kind, what, where=self.name)
        pose = compose(inverse(target_in[common]), source_in[common])
        return Transform(np.array(pose.translation), np.array(pose.quaternion), pose.gap_ns, pose.bracket_ns)

    def knots_ns(self, target: str, source: str) -> list[int]:
        """Return when the links between two frames that move were sampled, sorted.

        Parameters
        ----------
        target, source : str
            As for :meth:`lookup`.

        Returns
        -------
        list of int
            Stamps in nanoseconds; none where nothing moves, nothing connects the frames, or a link on the way changed
            its parent.
        """
        target_above, source_above = (self._ancestry(frame.lstrip("/")) for frame in (target, source))
        if not set(target_above) & set(source_above):
            return []
        moving = [self._links[frame] for frame in {*target_above} ^ {*source_above} if frame in self._links]
        stamps_ns = {stamp_ns for link in moving if link.moves for stamp_ns in link.samples}
        return sorted(stamps_ns)

    def _ancestry(self, frame: str) -> list[str]:
        """Return a frame and all above it, as far as each has one parent at all times."""
        frames: list[str] = []
        while frame not in frames:
            frames.append(frame)
            link = self._links.get(frame)
            parents = set() if link is None else link.parents
            if len(parents) != 1:
                return frames
            (frame,) = parents
        return frames

    def _walk(self, frame: str, stamp_ns: int) -> tuple[dict[str, Pose], _Stop | None]:
        """Walk up as far as the time allows: the pose of ``frame`` in itself and each ancestor, nearest first."""
        poses: dict[str, Pose] = {}
        pose = IDENTITY
        while frame not in poses:
            poses[frame] = pose
            if (link := self._links.get(frame)) is None:
                return poses, None
            step = link.at(stamp_ns)
            if isinstance(step, _Stop):
                return poses, _Stop(step.kind, f"for frame {frame!r}, {step.why}")
            frame, pose = step.parent, compose(step.pose, pose)
        return poses, _Stop("loop", f"frame {frame!r} is its own ancestor")

    def _hint(self) -> str:
        names = sorted(self._frames)
        shown = ", ".join(names[:20]) + (", …" if len(names) > 20 else "")
        return f"Known frames: {shown}" if names else "There are no transforms at all"
