"""Rigid motions as plain numbers, with what they rest on in time."""

from __future__ import annotations

from typing import NamedTuple

from garment_dataset.bags.quaternions import Quaternion, Vector, conjugate, multiply, rotate


class Pose(NamedTuple):
    """A rigid motion from one frame to another.

    Parameters
    ----------
    translation : Vector
        In metres.
    quaternion : Quaternion
        Of unit length.
    gap_ns, bracket_ns : int
        Distance in time to the nearest sample, and length of the span that was interpolated across.
    """

    translation: Vector
    quaternion: Quaternion
    gap_ns: int = 0
    bracket_ns: int = 0


IDENTITY = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def compose(outer: Pose, inner: Pose) -> Pose:
    """Apply ``inner`` first, then ``outer``."""
    moved, origin = rotate(outer.quaternion, inner.translation), outer.translation
    return Pose(
        (moved[0] + origin[0], moved[1] + origin[1], moved[2] + origin[2]),
        multiply(outer.quaternion, inner.quaternion),
        max(outer.gap_ns, inner.gap_ns),
        max(outer.bracket_ns, inner.bracket_ns),
    )


def inverse(pose: Pose) -> Pose:
    """Return the motion back."""
    back = conjugate(pose.quaternion)
    moved = rotate(back, pose.translation)
    return Pose((-moved[0], -moved[1], -moved[2]), back, pose.gap_ns, pose.bracket_ns)
