"""Vectors and unit quaternions as plain numbers: faster than arrays of three and four."""

from __future__ import annotations

import math

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
