"""Where the gripper is in a camera's optical frame at the time of each of its images.

The recorder's own topics (``/r2_ee_to_depth``, ``/r2_ee_to_rgb``) say it directly, on stamps of their own; where they
are silent, the point is the origin of the gripper's frame, computed from the recorded transforms as those topics' node
did (thesis 5.3.2).
"""

from __future__ import annotations

import warnings
from bisect import bisect_left
from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from garment_dataset.bags.transforms import LookupFailedError, TransformTree
from garment_dataset.errors import DataWarning

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from numpy.typing import NDArray

    from garment_dataset.bags.bag import Bag
    from garment_dataset.bags.messages import Message

Source = Literal["auto", "topic", "tf"]
"""Whom to ask; ``auto``: the topic, and the transforms for the frames where it has no answer."""


@dataclass(frozen=True, eq=False, slots=True)
class GripperTrack:
    """End point of the gripper at given times.

    Parameters
    ----------
    x_m, y_m, z_m : (N,) float64
        In the camera's optical frame, metres; NaN where there is no answer.
    source : tuple of str or None, length N
        ``topic`` or ``tf``.
    gap_ns : tuple of int or None, length N
        Distance in time to the nearest sample the point rests on; of several links, the largest.
    reason : tuple of str or None, length N
        Why there is no point, for each source asked: ``topic: gap; tf: past``. The words are ``no samples``, ``past``
        and ``future`` (outside the samples), ``gap`` (between samples too far apart), and those of
        :data:`~garment_dataset.bags.transforms.FailureKind`.
    """

    x_m: NDArray[np.float64]
    y_m: NDArray[np.float64]
    z_m: NDArray[np.float64]
    source: tuple[str | None, ...]
    gap_ns: tuple[int | None, ...]
    reason: tuple[str | None, ...]


class _Point(NamedTuple):
    """A position, and how far in time the nearest sample behind it is."""

    position_m: NDArray[np.float64]
    gap_ns: int


class _NoPoint(NamedTuple):
    """Why there is none: in a word for the table, in full for the warning."""

    reason: str
    detail: str


class _Row(NamedTuple):
    """What is known at one time."""

    position_m: NDArray[np.float64]
    source: str | None
    gap_ns: int | None
    reason: str | None
    detail: str | None


@dataclass(eq=False)
class RecordedTransforms:
    """The transforms of a bag, read when first asked for, and then kept for whoever else asks.

    Parameters
    ----------
    bag : Bag
        An open recording.
    tf_topic, tf_static_topic : str
        Messages of type ``tf2_msgs/TFMessage`` or ``tf/tfMessage``.
    """

    bag: Bag
    tf_topic: str = "/tf"
    tf_static_topic: str = "/tf_static"

    @property
    def recorded(self) -> bool:
        """Whether the bag has any such topic."""
        return self.tf_topic in self.bag.topics or self.tf_static_topic in self.bag.topics

    @cached_property
    def tree(self) -> TransformTree:
        """The tree of all of them; a :class:`~garment_dataset.errors.DataWarning` tells of those left out."""
        tree, left_out = TransformTree(), Counter[str]()
        for message in self.bag.messages(self.tf_topic, self.tf_static_topic):
            if message.type not in _TRANSFORMS:
                left_out[f"{message.topic}, of type {message.type} instead of {' or '.join(_TRANSFORMS)}"] += 1
                continue
            for stamped in message.data.transforms:
                move, turn = stamped.transform.translation, stamped.transform.rotation
                tree.add(
                    stamped.header.frame_id,
                    stamped.child_frame_id,
                    _stamp_ns(stamped),
                    (move.x, move.y, move.z),
                    (turn.x, turn.y, turn.z, turn.w),
                    static=message.topic == self.tf_static_topic,
                )
        if tree.refused:
            text = f"{self.bag.path.name}: {tree.refused} malformed transforms left out"
            warnings.warn(text, DataWarning, stacklevel=2)
        _warn_of_left_out(self.bag, left_out)
        return tree


def read_gripper(
    bag: Bag,
    stamps_ns: Iterable[int],
    *,
    camera_frame: str,
    gripper_frame: str = "r2_ee",
    source: Source = "auto",
    topic: str = "/r2_ee_to_depth",
    transforms: RecordedTransforms | None = None,
    max_gap_s: float = 0.1,
    stream: str = "depth",
) -> GripperTrack:
    """Read the end point of the gripper at given times.

    Parameters
    ----------
    bag : Bag
        An open recording.
    stamps_ns : iterable of int, length N
        Header stamps of the images.
    camera_frame, gripper_frame : str
        Optical frame of the camera; frame whose origin is the end point.
    source : {"auto", "topic", "tf"}
        Whom to ask.
    topic : str
        Messages of ``geometry_msgs`` type PointStamped, PoseStamped, TransformStamped or Vector3Stamped.
    transforms : RecordedTransforms, optional
        Those of the bag; by default its ``/tf`` and ``/tf_static``. Whoever asks for both cameras reads them once.
    max_gap_s : float
        Longest time between two samples, in seconds, that is interpolated across.
    stream : str
        What the images are called in warnings.

    Returns
    -------
    GripperTrack

    Notes
    -----
    A message of exactly the frame's stamp is taken as it is; between two messages the point is interpolated linearly;
    before the first and after the last one there is no answer, as nothing says how far the gripper moved there. A
    message in another frame than the camera's is first taken there through the transforms at its own time; one
    without a frame is taken to be in the camera's. A :class:`~garment_dataset.errors.DataWarning` tells of messages
    that were left out and of frames without a point.
    """
    camera = _Camera(transforms or RecordedTransforms(bag), camera_frame.lstrip("/"), round(max_gap_s * 1e9))
    asked: dict[str, Callable[[int], _Point | _NoPoint]] = {}
    if source != "tf":
        samples = _read_topic(bag, topic, camera)
        asked["topic"] = partial(_interpolate, samples, sorted(samples), camera.max_gap_ns)
    if source != "topic":
        asked["tf"] = partial(camera.see, gripper_frame, np.zeros(3))
    rows = [_first_answer(asked, int(stamp_ns)) for stamp_ns in stamps_ns]
    _warn_of_left_out(bag, camera.left_out)
    if failed := [index for index, row in enumerate(rows) if row.detail]:
        text = f"{bag.path.name}: no gripper position at {len(failed)} of {len(rows)} {stream} frames"
        warnings.warn(f"{text}, first at {failed[0]}: {rows[failed[0]].detail}", DataWarning, stacklevel=2)
    x_m, y_m, z_m = np.array([row.position_m for row in rows]).reshape(-1, 3).T
    return GripperTrack(
        x_m=x_m,
        y_m=y_m,
        z_m=z_m,
        source=tuple(row.source for row in rows),
        gap_ns=tuple(row.gap_ns for row in rows),
        reason=tuple(row.reason for row in rows),
    )


@dataclass(eq=False)
class _Camera:
    """The frame that everything is wanted in, and the transforms that lead there."""

    transforms: RecordedTransforms
    frame: str
    max_gap_ns: int
    left_out: Counter[str] = field(default_factory=Counter)

    def see(self, frame: str, position_m: NDArray[np.float64], stamp_ns: int) -> _Point | _NoPoint:
        """Take a position in ``frame`` into the camera's frame."""
        if frame.lstrip("/") == self.frame:
            return _Point(position_m, 0)
        try:
            transform = self.transforms.tree.lookup(self.frame, frame, stamp_ns)
        except LookupFailedError as error:
            return _NoPoint(error.kind, str(error))
        if transform.bracket_ns > self.max_gap_ns:
            return _too_far_apart(stamp_ns, transform.bracket_ns)
        return _Point(transform.apply(position_m), transform.nearest_sample_gap_ns)

    def read(self, message: Message) -> _Point | _NoPoint:
        """Read one message of the gripper's topic; without a frame it is taken to be in the camera's."""
        if (vector_of := _VECTORS.get(message.type)) is None:
            return _NoPoint(f"of type {message.type} instead of {' or '.join(_VECTORS)}", "")
        stamped, stamp_ns = message.data, _stamp_ns(message.data)
        vector, frame = vector_of(stamped), stamped.header.frame_id.lstrip("/") or self.frame
        position_m = np.array([vector.x, vector.y, vector.z], dtype=np.float64)
        if not np.isfinite(position_m).all():
            return _NoPoint("with numbers that are not finite", "")
        if message.type == _TRANSFORM_STAMPED and stamped.child_frame_id.lstrip("/") == self.frame:
            # the camera as the gripper sees it: the inverse has the gripper as the camera sees it
            turn, tree = stamped.transform.rotation, TransformTree()
            if not tree.add(frame, self.frame, stamp_ns, position_m.tolist(), (turn.x, turn.y, turn.z, turn.w)):
                return _NoPoint("with a rotation that is none", "")
            return _Point(tree.lookup(self.frame, frame, stamp_ns).translation, 0)
        point = self.see(frame, position_m, stamp_ns)
        if isinstance(point, _Point):
            return point
        return _NoPoint(f"in frame {frame!r} with no way to {self.frame!r} ({point.reason})", point.detail)


def _warn_of_left_out(bag: Bag, left_out: Mapping[str, int]) -> None:
    for reason, count in left_out.items():
        warnings.warn(f"{bag.path.name}: {count} messages left out: {reason}", DataWarning, stacklevel=3)


def _read_topic(bag: Bag, topic: str, camera: _Camera) -> dict[int, _Point]:
    """Return the topic's points in the camera by stamp, of several with one stamp the first."""
    samples: dict[int, _Point] = {}
    for message in bag.messages(topic):
        answer = camera.read(message)
        if isinstance(answer, _Point):
            samples.setdefault(_stamp_ns(message.data), answer)
        else:
            camera.left_out[f"{topic}, {answer.reason}"] += 1
    return samples


def _first_answer(asked: Mapping[str, Callable[[int], _Point | _NoPoint]], stamp_ns: int) -> _Row:
    failures: dict[str, _NoPoint] = {}
    for name, at in asked.items():
        answer = at(stamp_ns)
        if isinstance(answer, _Point):
            return _Row(answer.position_m, name, answer.gap_ns, None, None)
        failures[name] = answer
    reason = "; ".join(f"{name}: {failure.reason}" for name, failure in failures.items())
    detail = "; ".join(f"{name}: {failure.detail}" for name, failure in failures.items())
    return _Row(np.full(3, np.nan), None, None, reason, detail)


def _interpolate(
    samples: Mapping[int, _Point], ordered_ns: list[int], max_gap_ns: int, stamp_ns: int
) -> _Point | _NoPoint:
    """Interpolate linearly between the two samples around ``stamp_ns``; a sample of that very time as it is."""
    if (same := samples.get(stamp_ns)) is not None:
        return same
    if not ordered_ns:
        return _NoPoint("no samples", "no usable message")
    following = bisect_left(ordered_ns, stamp_ns)
    if following == 0:
        return _NoPoint("past", f"{stamp_ns} ns is before the first message, {ordered_ns[0]} ns")
    if following == len(ordered_ns):
        return _NoPoint("future", f"{stamp_ns} ns is after the last message, {ordered_ns[-1]} ns")
    before_ns, after_ns = ordered_ns[following - 1], ordered_ns[following]
    if after_ns - before_ns > max_gap_ns:
        return _too_far_apart(stamp_ns, after_ns - before_ns)
    before, after = samples[before_ns], samples[after_ns]
    ratio = (stamp_ns - before_ns) / (after_ns - before_ns)
    position_m = (1 - ratio) * before.position_m + ratio * after.position_m
    nearest_ns = min(stamp_ns - before_ns, after_ns - stamp_ns)
    return _Point(position_m, max(nearest_ns, before.gap_ns, after.gap_ns))


def _too_far_apart(stamp_ns: int, bracket_ns: int) -> _NoPoint:
    return _NoPoint("gap", f"the samples around {stamp_ns} ns are {bracket_ns / 1e9:.3f} s apart")


def _stamp_ns(stamped: Any) -> int:  # noqa: ANN401 - a deserialised message
    stamp = stamped.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


_TRANSFORM_STAMPED = "geometry_msgs/msg/TransformStamped"

_VECTORS: Mapping[str, Callable[[Any], Any]] = {
    "geometry_msgs/msg/PointStamped": lambda stamped: stamped.point,
    "geometry_msgs/msg/PoseStamped": lambda stamped: stamped.pose.position,
    _TRANSFORM_STAMPED: lambda stamped: stamped.transform.translation,
    "geometry_msgs/msg/Vector3Stamped": lambda stamped: stamped.vector,
}
"""Where the types of the gripper's topic keep the position."""

_TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
"""Types of the transforms' topics."""
