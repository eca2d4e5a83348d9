"""Who knows where the gripper is: the recorder's own topic, and the recorded transforms."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from garment_dataset.bags.interpolation import Interpolated, Knot, path_at
from garment_dataset.bags.poses import Transform
from garment_dataset.bags.quaternions import Quaternion, conjugate, multiply, normalised, rotate, slerp
from garment_dataset.bags.recorded_transforms import header_stamp_ns
from garment_dataset.bags.stamps import SAMPLE_DISORDER_S, Stamped, check_stamps, summarise
from garment_dataset.bags.transforms import SQUARED_NORM_TOLERANCE, LookupFailedError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from garment_dataset.bags.messages import Message
    from garment_dataset.bags.recorded_transforms import RecordedTransforms


class Answer(NamedTuple):
    """Where the gripper is in the camera's frame at one time."""

    position_m: NDArray[np.float64]
    """Shape (3,)."""
    bound_m: NDArray[np.float64]
    """Greatest error of the interpolation per axis, shape (3,); NaN where not known."""
    quaternion_xyzw: Quaternion | None
    gap_ns: int
    """Distance in time to the nearest sample behind it; of several links, the largest."""


class NoAnswer(NamedTuple):
    """Why there is none: in a word for the table, in full for the warning."""

    reason: str
    detail: str


class GripperSource(Protocol):
    """Anyone who may know."""

    def at(self, stamp_ns: int) -> Answer | NoAnswer:
        """Say where the gripper is at a time."""


@dataclass(eq=False)
class CameraFrame:
    """The frame that everything is wanted in, and the transforms that lead there.

    Parameters
    ----------
    transforms : RecordedTransforms
        Of the recording.
    frame : str
        Optical frame of the camera, without leading slash.
    max_gap_ns : int
        Longest time between two samples that is interpolated across.
    """

    transforms: RecordedTransforms
    frame: str
    max_gap_ns: int

    def see_all(self, frame: str, stamps_ns: Sequence[int]) -> list[Transform | NoAnswer]:
        """Do as :meth:`see` at many times, far faster."""
        if frame == self.frame:
            return [self.see(frame, stamp_ns) for stamp_ns in stamps_ns]
        found = self.transforms.tree.lookups(self.frame, frame, stamps_ns)
        return [self._judged(each, stamp_ns) for each, stamp_ns in zip(found, stamps_ns, strict=True)]

    def see(self, frame: str, stamp_ns: int) -> Transform | NoAnswer:
        """Return the transform that takes ``frame`` into the camera's frame; a frame is itself, known or not."""
        if frame == self.frame:
            return Transform(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), 0, 0)
        return self.see_all(frame, [stamp_ns])[0]

    def _judged(self, found: Transform | LookupFailedError, stamp_ns: int) -> Transform | NoAnswer:
        if isinstance(found, LookupFailedError):
            return NoAnswer(found.kind, str(found))
        if found.bracket_ns > self.max_gap_ns:
            return too_far_apart(stamp_ns, found.bracket_ns)
        return found


def too_far_apart(stamp_ns: int, bracket_ns: int) -> NoAnswer:
    """Say that nothing is interpolated across so long a time."""
    return NoAnswer("gap", f"the samples around {stamp_ns} ns are {bracket_ns / 1e9:.3f} s apart")


class TransformSource:
    """The recorded transforms: the gripper is the origin of its frame.

    Parameters
    ----------
    camera : CameraFrame
        Where the point is wanted.
    frame : str
        The gripper's, without leading slash.
    stamps_ns : sequence of int
        The times that will be asked for: looked up together.

    Notes
    -----
    The rotation is tf2's. So is the position, less what its even motion between two samples misses: where all moving
    links were sampled at the same times, by :func:`~garment_dataset.bags.interpolation.path_at` on the whole chain at
    those times; otherwise the miss is not taken off, and its bound is that of a chord across the longest span.
    """

    def __init__(self, camera: CameraFrame, frame: str, stamps_ns: Sequence[int] = ()) -> None:
        self.camera = camera
        self.frame = frame
        self._seen = dict(zip(stamps_ns, camera.see_all(frame, stamps_ns), strict=True))

    def at(self, stamp_ns: int) -> Answer | NoAnswer:
        """Say where the gripper is at a time."""
        seen = self._see(stamp_ns)
        if isinstance(seen, NoAnswer):
            return seen
        position_m, bound_m = self._path(seen, stamp_ns)
        return Answer(position_m, bound_m, _quaternion(seen), seen.nearest_sample_gap_ns)

    @cached_property
    def _knots_ns(self) -> list[int]:
        return self.camera.transforms.tree.knots_ns(self.camera.frame, self.frame)

    @cached_property
    def _knots(self) -> list[Knot | None]:
        """The gripper at the times of the samples; None where there is no way at that time."""
        seen = self.camera.see_all(self.frame, self._knots_ns)
        return [
            Knot(stamp_ns, each.translation) if isinstance(each, Transform) else None
            for stamp_ns, each in zip(self._knots_ns, seen, strict=True)
        ]

    def _see(self, stamp_ns: int) -> Transform | NoAnswer:
        return self._seen.get(stamp_ns) or self.camera.see(self.frame, stamp_ns)

    def _path(self, seen: Transform, stamp_ns: int) -> Interpolated:
        if seen.bracket_ns == 0:
            return Interpolated(seen.translation, np.zeros(3))
        following = bisect_right(self._knots_ns, stamp_ns)
        earlier, before, after, later = (self._knot(following + step) for step in (-2, -1, 0, 1))
        if before is not None and after is not None and after.stamp_ns - before.stamp_ns == seen.bracket_ns:
            return path_at(earlier, before, after, later, stamp_ns)
        around = [self._see(stamp_ns + step) for step in (-seen.bracket_ns, seen.bracket_ns)]
        ends_m = [each.translation for each in around if isinstance(each, Transform)]
        if len(ends_m) < 2:
            return Interpolated(seen.translation, np.full(3, np.nan))
        return Interpolated(seen.translation, np.abs(ends_m[0] - 2 * seen.translation + ends_m[1]) / 8)

    def _knot(self, position: int) -> Knot | None:
        """Return the gripper at the time of a sample; None where there is no such sample, or no way at that time."""
        return self._knots[position] if 0 <= position < len(self._knots) else None


class TopicSource:
    """The recorder's topic, of type PointStamped, PoseStamped, TransformStamped or Vector3Stamped.

    Parameters
    ----------
    camera : CameraFrame
        Where the points are wanted. A message in another frame is taken there through the transforms at its own time;
        one without a frame is taken to be there.
    topic : str
        Its name.
    max_stamp_offset_s : float
        How far header stamp less record time may be from its median, in seconds.

    Attributes
    ----------
    left_out : Counter of str
        How many messages were left out, by reason.
    """

    def __init__(self, camera: CameraFrame, topic: str, max_stamp_offset_s: float) -> None:
        self.left_out = Counter[str]()
        self._camera = camera
        read: list[tuple[Stamped, Answer]] = []
        for message in camera.transforms.bag.messages(topic):
            answer = self._read(message)
            if isinstance(answer, Answer):
                times = Stamped(message.index, header_stamp_ns(message.data), message.record_stamp_ns)
                read.append((times, answer))
            else:
                self.left_out[f"{topic}, {answer.reason}"] += 1
        faults = check_stamps(
            [times for times, _ in read], max_offset_s=max_stamp_offset_s, disorder_s=SAMPLE_DISORDER_S
        )
        if faults:
            self.left_out[f"{topic}, {summarise(faults)}"] = len(faults)
        sound = {times.stamp_ns: answer for times, answer in read if times.number not in faults}
        self._samples = dict(sorted(sound.items()))
        self._stamps_ns = list(self._samples)

    def at(self, stamp_ns: int) -> Answer | NoAnswer:
        """Say where the gripper is at a time; a sample of that very time is taken as it is."""
        if (same := self._samples.get(stamp_ns)) is not None:
            return same
        if not self._stamps_ns:
            return NoAnswer("no samples", "no usable message")
        following = bisect_left(self._stamps_ns, stamp_ns)
        if following == 0:
            return NoAnswer("past", f"{stamp_ns} ns is before the first message, {self._stamps_ns[0]} ns")
        if following == len(self._stamps_ns):
            return NoAnswer("future", f"{stamp_ns} ns is after the last message, {self._stamps_ns[-1]} ns")
        before_ns, after_ns = self._stamps_ns[following - 1 : following + 1]
        if after_ns - before_ns > self._camera.max_gap_ns:
            return too_far_apart(stamp_ns, after_ns - before_ns)
        return self._between(following, stamp_ns)

    def _between(self, following: int, stamp_ns: int) -> Answer:
        before_ns, after_ns = self._stamps_ns[following - 1 : following + 1]
        before, after = self._samples[before_ns], self._samples[after_ns]
        position_m, bound_m = path_at(
            self._knot(following - 2),
            Knot(before_ns, before.position_m),
            Knot(after_ns, after.position_m),
            self._knot(following + 1),
            stamp_ns,
        )
        turn = None
        if before.quaternion_xyzw is not None and after.quaternion_xyzw is not None:
            ratio = (stamp_ns - before_ns) / (after_ns - before_ns)
            turn = slerp(before.quaternion_xyzw, after.quaternion_xyzw, ratio)
        nearest_ns = min(stamp_ns - before_ns, after_ns - stamp_ns)
        return Answer(position_m, bound_m, turn, max(nearest_ns, before.gap_ns, after.gap_ns))

    def _knot(self, position: int) -> Knot | None:
        if not 0 <= position < len(self._stamps_ns):
            return None
        stamp_ns = self._stamps_ns[position]
        return Knot(stamp_ns, self._samples[stamp_ns].position_m)

    def _read(self, message: Message) -> Answer | NoAnswer:
        """Read one message."""
        if message.type not in _FIELDS:
            return NoAnswer(f"of type {message.type} instead of {' or '.join(_FIELDS)}", "")
        stamped, camera = message.data, self._camera
        frame = stamped.header.frame_id.lstrip("/") or camera.frame
        position_m, turn = _position_and_turn(message)
        if not np.isfinite(position_m).all():
            return NoAnswer("with numbers that are not finite", "")
        if message.type == _TRANSFORM_STAMPED and stamped.child_frame_id.lstrip("/") == camera.frame:
            # the camera as the gripper sees it: the inverse has the gripper as the camera sees it
            if turn is None:
                return NoAnswer("with a rotation that is none", "")
            back = conjugate(turn)
            x, y, z = position_m.tolist()
            return Answer(-np.array(rotate(back, (x, y, z))), np.zeros(3), back, 0)
        seen = camera.see(frame, header_stamp_ns(stamped))
        if isinstance(seen, NoAnswer):
            return NoAnswer(f"in frame {frame!r} with no way to {camera.frame!r} ({seen.reason})", seen.detail)
        turned = None if turn is None else multiply(_quaternion(seen), turn)
        return Answer(seen.apply(position_m), np.zeros(3), turned, seen.nearest_sample_gap_ns)


def _position_and_turn(message: Message) -> tuple[NDArray[np.float64], Quaternion | None]:
    """Return what a message says, in metres; without a rotation where it says none, or one that is none."""
    vector_of, turn_of = _FIELDS[message.type]
    vector = vector_of(message.data)
    position_m = np.array([vector.x, vector.y, vector.z], dtype=np.float64)
    if turn_of is None:
        return position_m, None
    turn = turn_of(message.data)
    return position_m, normalised((turn.x, turn.y, turn.z, turn.w), SQUARED_NORM_TOLERANCE)


def _quaternion(transform: Transform) -> Quaternion:
    x, y, z, w = transform.quaternion_xyzw.tolist()
    return x, y, z, w


_TRANSFORM_STAMPED = "geometry_msgs/msg/TransformStamped"

_FIELDS: Mapping[str, tuple[Any, Any]] = {
    "geometry_msgs/msg/PointStamped": (lambda stamped: stamped.point, None),
    "geometry_msgs/msg/PoseStamped": (lambda stamped: stamped.pose.position, lambda stamped: stamped.pose.orientation),
    _TRANSFORM_STAMPED: (lambda stamped: stamped.transform.translation, lambda stamped: stamped.transform.rotation),
    "geometry_msgs/msg/Vector3Stamped": (lambda stamped: stamped.vector, None),
}
"""Where the types of the gripper's topic keep the position, and the rotation if they have one."""
