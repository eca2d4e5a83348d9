"""What messages of transforms state, as plain numbers."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from garment_dataset.bags.quaternions import Quaternion, Vector

TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
"""Types of the transforms' topics."""

_UINT32 = struct.Struct("<I")
_STAMP_AND_LENGTH = struct.Struct("<4xiII")  # behind the sequence number: seconds, nanoseconds, length of the frame id
_POSE = struct.Struct("<7d")


class StatedTransform(NamedTuple):
    """One transform: where ``child`` is in ``parent``, as said, not checked."""

    parent: str
    child: str
    stamp_ns: int
    translation: Vector
    quaternion: Quaternion


def stated_transforms(message: Any) -> list[StatedTransform]:  # noqa: ANN401 - a deserialised message
    """Return the transforms of a deserialised message."""
    found = []
    for stamped in message.transforms:
        stamp, move, turn = stamped.header.stamp, stamped.transform.translation, stamped.transform.rotation
        stamp_ns = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
        translation, quaternion = (move.x, move.y, move.z), (turn.x, turn.y, turn.z, turn.w)
        frames = stamped.header.frame_id, stamped.child_frame_id
        found.append(StatedTransform(*frames, stamp_ns, translation, quaternion))
    return found


def read_stated_transforms(data: memoryview) -> list[StatedTransform] | None:
    """Return the transforms of a message in ROS 1 serialisation, of the common definition; None if it is no such one.

    Parameters
    ----------
    data : memoryview
        The whole message.
    """
    found: list[StatedTransform] = []
    try:
        (count,) = _UINT32.unpack_from(data)
        position = _UINT32.size
        for _ in range(count):
            seconds, nanoseconds, length = _STAMP_AND_LENGTH.unpack_from(data, position)
            position += _STAMP_AND_LENGTH.size + length
            parent = str(data[position - length : position], "utf-8")
            (length,) = _UINT32.unpack_from(data, position)
            position += _UINT32.size + length
            child = str(data[position - length : position], "utf-8")
            x, y, z, qx, qy, qz, qw = _POSE.unpack_from(data, position)
            position += _POSE.size
            stamp_ns = seconds * 1_000_000_000 + nanoseconds
            found.append(StatedTransform(parent, child, stamp_ns, (x, y, z), (qx, qy, qz, qw)))
    except (struct.error, UnicodeDecodeError):
        return None
    return found if position == len(data) else None
