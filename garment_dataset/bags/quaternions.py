"""Vectors and unit quaternions as plain numbers: faster than arrays of three and four."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""Components x, y, z, w; of unit length."""


def lerp(a: Vector, b: Vector, ratio: float) -> Vector:
    """Go from ``a`` (ratio 0) to ``b`` (ratio 1) along the straight line."""
    rest = 1.0 - ratio
    return (rest * a[0] + ratio * b[0], rest * a[1] + ratio * b[1], rest * a[2] + ratio * b[2])


def slerp(a: Quaternion, b: Quaternion, ratio: float) -> Quaternion:
    """Turn from ``a`` to ``b`` along the shorter way, as ``tf2::Quaternion::slerp``; unit quaternions."""
    cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    angle = math.acos(min(abs(cosine), 1.0))
    if angle == 0.0:
        return a
    weight_a = math.sin((1.0 - ratio) * angle) / math.sin(angle)
    weight_b = math.copysign(math.sin(ratio * angle) / math.sin(angle), cosine)
    return (
        weight_a * a[0] + weight_b * b[0],
        weight_a * a[1] + weight_b * b[1],
        weight_a * a[2] + weight_b * b[2],
        weight_a * a[3] + weight_b * b[3],
    )


def rotate(q: Quaternion, v: Vector) -> Vector:
    """Turn ``v`` by ``q``."""
    x, y, z, w = q
    turn_x, turn_y, turn_z = 2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])
    return (
        v[0] + w * turn_x + y * turn_z - z * turn_y,
        v[1] + w * turn_y + z * turn_x - x * turn_z,
        v[2] + w * turn_z + x * turn_y - y * turn_x,
    )


def multiply(outer: Quaternion, inner: Quaternion) -> Quaternion:
    """Return the rotation that turns by ``inner`` first, then by ``outer``."""
    ax, ay, az, aw = outer
    bx, by, bz, bw = inner
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def conjugate(q: Quaternion) -> Quaternion:
    """Return the rotation back."""
    return (-q[0], -q[1], -q[2], q[3])


def normalised(q: Quaternion, squared_norm_tolerance: float) -> Quaternion | None:
    """Scale ``q`` to unit length; None when it is no rotation: not finite, or too far from that length."""
    squared_norm = sum(component * component for component in q)
    if not abs(squared_norm - 1.0) <= squared_norm_tolerance:  # false for NaN, too
        return None
    scale = 1.0 / math.sqrt(squared_norm)
    return (q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale)


def without_flips(rotations: Iterable[Quaternion | None]) -> list[Quaternion | None]:
    """Choose between ``q`` and ``-q``, which are the same rotation, so that none jumps from the one before it.

    The first has no negative ``w``; missing ones are passed over.
    """
    chosen: list[Quaternion | None] = []
    previous: Quaternion = (0.0, 0.0, 0.0, 1.0)
    for q in rotations:
        if q is None:
            chosen.append(None)
            continue
        flipped = sum(a * b for a, b in zip(previous, q, strict=True)) < 0
        previous = (-q[0], -q[1], -q[2], -q[3]) if flipped else q
        chosen.append(previous)
    return chosen
