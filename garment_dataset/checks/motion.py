"""What the gripper did: along which axis, by which angle, how fast. Pure functions on arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from garment_dataset.bags.quaternions import conjugate, multiply

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from garment_dataset.bags.joints import JointSample

_CLEAR = 2.0  # the extent along one axis is this many times that along the other
_LEAST_TRAVEL_M = 0.02
_LEAST_RANGE_RAD = 0.02
_SMOOTH_S = 0.1  # rates are slopes over so long a time: encoders are read with noise


class Turn(NamedTuple):
    """What one joint, or the gripper as a whole, did."""

    joint: str
    swing_rad: float
    """Half of the range of its angle."""
    speed_rad_s: float
    """Greatest angular speed, as the slope over 0.1 s."""


def swing_axis(position_m: NDArray[np.float64]) -> Literal["R", "B"] | None:
    """Return along which axis a gripper moved, by the convention of table 4.2.

    Parameters
    ----------
    position_m : (N, 3) float64
        Its end points in the optical frame of the camera, finite.

    Returns
    -------
    {"R", "B"} or None
        R: along the optical axis (z), B: across it (x); None when it hardly moves, or along both.
    """
    if len(position_m) < 2:
        return None
    across_m, _, along_m = np.ptp(position_m, axis=0)
    if max(along_m, across_m) < _LEAST_TRAVEL_M:
        return None
    if along_m >= _CLEAR * across_m:
        return "R"
    return "B" if across_m >= _CLEAR * along_m else None


def turn_of_joints(samples: Iterable[JointSample]) -> Turn | None:
    """Return what the joint did that moved most; None when none moved by 0.02 rad."""
    by_joint: dict[str, list[JointSample]] = {}
    for sample in samples:
        if sample.position_rad is not None and np.isfinite(sample.position_rad):
            by_joint.setdefault(sample.joint, []).append(sample)
    turns = [
        _turn(joint, [each.stamp_ns for each in found], [each.position_rad or 0.0 for each in found])
        for joint, found in by_joint.items()
    ]
    return max(filter(None, turns), key=lambda turn: turn.swing_rad, default=None)


def turn_of_gripper(stamp_ns: NDArray[np.int64], quaternion_xyzw: NDArray[np.float64]) -> Turn | None:
    """Return by how much the gripper turned about the one axis that it turned most about; None when not known.

    Parameters
    ----------
    stamp_ns : (N,) int64
        When.
    quaternion_xyzw : (N, 4) float64
        Its orientation then; NaN where not known.
    """
    known = np.isfinite(quaternion_xyzw).all(axis=1)
    if known.sum() < 2:
        return None
    quaternions = [(x, y, z, w) for x, y, z, w in quaternion_xyzw[known].tolist()]
    back = conjugate(quaternions[0])
    turned = np.array([multiply(each, back) for each in quaternions])
    turned = np.where(turned[:, 3:] < 0, -turned, turned)
    sine = np.linalg.norm(turned[:, :3], axis=1)
    axis = turned[sine.argmax(), :3] / max(sine.max(), 1e-12)
    angle_rad = 2 * np.arctan2(turned[:, :3] @ axis, turned[:, 3])
    return _turn("gripper", stamp_ns[known].tolist(), angle_rad.tolist())


def _turn(joint: str, stamp_ns: list[int], angle_rad: list[float]) -> Turn | None:
    times_ns, places = np.unique(np.array(stamp_ns, np.int64), return_index=True)
    angles_rad = np.array(angle_rad)[places]
    if len(times_ns) < 3 or np.ptp(angles_rad) < _LEAST_RANGE_RAD:
        return None
    time_s = (times_ns - times_ns[0]) / 1e9
    begins_s = np.arange(0, time_s[-1] - _SMOOTH_S, _SMOOTH_S / 10)
    ends_rad, starts_rad = (np.interp(begins_s + shift_s, time_s, angles_rad) for shift_s in (_SMOOTH_S, 0.0))
    speed_rad_s = float(np.abs(ends_rad - starts_rad).max() / _SMOOTH_S) if len(begins_s) else 0.0
    return Turn(joint, float(np.ptp(angles_rad)) / 2, speed_rad_s)
