"""The recorded transforms as one tree that answers for any moment of the recording, by the rules of ROS' tf2.

The rules are those of ``tf2::BufferCore`` and ``tf2::TimeCache`` (ros/geometry2, 0.7), with three differences that an
offline tree allows: nothing is forgotten, a leading slash is dropped in look-ups too, and quaternions that tf2 would
let through a little too long or short are normalised, as it would scale lengths by their squared norm.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.bags.links import FailureKind, Link, Sample, Stop
from garment_dataset.bags.poses import (
    IDENTITY,
    Pose,
    Poses,
    Transform,
    columns,
    compose,
    compose_all,
    inverse,
    inverse_all,
)
from garment_dataset.bags.quaternions import normalised
from garment_dataset.errors import TransformError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

SQUARED_NORM_TOLERANCE = 1e-2
"""How far the squared norm of a quaternion may be from 1 (tf2's ``QUATERNION_NORMALIZATION_TOLERANCE``)."""


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
        self._links: dict[str, Link] = {}
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
        said = (parent, x, y, z, qx, qy, qz, qw)
        link = self._links.get(child)
        if link is not None and link.last is not None and link.last[0] == said:
            sample = link.last[1]
        else:
            quaternion = normalised((qx, qy, qz, qw), SQUARED_NORM_TOLERANCE)
            if quaternion is None or not math.isfinite(x + y + z) or not parent or not child or parent == child:
                self.refused += 1
                return False
            sample = Sample(parent, Pose((x, y, z), quaternion))
            self._frames.update((parent, child))
            link = self._links.setdefault(child, Link())
            link.last = said, sample
        if static:
            link.static = sample
            return True
        return link.take(stamp_ns, sample)

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
            stop = target_stop or source_stop or Stop("not connected", "they have no common ancestor")
            what = f"no transform from {source!r} to {target!r}: {stop.why}"
            raise LookupFailedError(stop.kind, what, where=self.name)
        pose = compose(inverse(target_in[common]), source_in[common])
        return Transform(np.array(pose.translation), np.array(pose.quaternion), pose.gap_ns, pose.bracket_ns)

    def lookups(self, target: str, source: str, stamps_ns: Sequence[int]) -> list[Transform | LookupFailedError]:
        """Do as :meth:`lookup` at many times, far faster, with the same results to the last bit.

        Parameters
        ----------
        target, source : str
            As for :meth:`lookup`.
        stamps_ns : sequence of int
            Header times.

        Returns
        -------
        list of Transform or LookupFailedError
            One per time; the error where :meth:`lookup` would raise it.
        """
        found: list[Transform | LookupFailedError] = []
        at_once = self._at_once(target.lstrip("/"), source.lstrip("/"), np.array(stamps_ns, np.int64))
        for stamp_ns, known in zip(stamps_ns, at_once, strict=True):
            try:
                found.append(known or self.lookup(target, source, stamp_ns))
            except LookupFailedError as error:
                found.append(error)
        return found

    def _at_once(self, target: str, source: str, stamps_ns: NDArray[np.int64]) -> Sequence[Transform | None]:
        """Return the transforms that hold at these times, None where each has to be walked for.

        So it is where a frame on the way has changed its parent, or is its own ancestor.
        """
        target_above, source_above = self._ancestry(target), self._ancestry(source)
        common = next((frame for frame in target_above if frame in source_above), None)
        roots = {target_above[-1], source_above[-1]}
        if target == source or common is None or not roots.isdisjoint(self._links):
            return [None] * len(stamps_ns)
        up, up_missing = self._climb(source_above[: source_above.index(common)], stamps_ns)
        down, down_missing = self._climb(target_above[: target_above.index(common)], stamps_ns)
        poses = compose_all(inverse_all(down), up)
        translations, quaternions = (
            columns(poses.translation, len(stamps_ns)),
            columns(poses.quaternion, len(stamps_ns)),
        )
        times_ns = columns((poses.gap_ns, poses.bracket_ns), len(stamps_ns)).tolist()
        return [
            None if missing else Transform(translation, quaternion, *of_one)
            for missing, translation, quaternion, of_one in zip(
                up_missing | down_missing, translations, quaternions, times_ns, strict=True
            )
        ]

    def _climb(self, frames: Sequence[str], stamps_ns: NDArray[np.int64]) -> tuple[Poses, NDArray[np.bool_]]:
        """Return the pose of the first of these frames in the parent of the last, and when a link has none."""
        poses, missing = Poses(*IDENTITY), np.zeros(len(stamps_ns), bool)
        for frame in frames:
            step, never = self._links[frame].at_all(stamps_ns)
            poses, missing = compose_all(step, poses), missing | never
        return poses, missing

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

    def _walk(self, frame: str, stamp_ns: int) -> tuple[dict[str, Pose], Stop | None]:
        """Walk up as far as the time allows: the pose of ``frame`` in itself and each ancestor, nearest first."""
        poses: dict[str, Pose] = {}
        pose = IDENTITY
        while frame not in poses:
            poses[frame] = pose
            if (link := self._links.get(frame)) is None:
                return poses, None
            step = link.at(stamp_ns)
            if isinstance(step, Stop):
                return poses, Stop(step.kind, f"for frame {frame!r}, {step.why}")
            frame, pose = step.parent, compose(step.pose, pose)
        return poses, Stop("loop", f"frame {frame!r} is its own ancestor")

    def _hint(self) -> str:
        names = sorted(self._frames)
        shown = ", ".join(names[:20]) + (", …" if len(names) > 20 else "")
        return f"Known frames: {shown}" if names else "There are no transforms at all"
