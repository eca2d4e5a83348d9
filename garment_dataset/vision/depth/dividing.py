"""Divide each frame's own profile, then smooth its points over time.

A raster smoothed over time before it is divided moves points where folds are: there a height belongs to one layer now
and to another in the next frame. So every frame is divided by its own arc length, which needs no raster, and what is
smoothed are the places of its points below the gripper.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.vision.depth.smoothing import adaptive_mean

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import FloatArray
    from garment_dataset.vision.depth.profile import Profile

_DEGREE = 2


def divide_profile(
    profile: Profile, gripper_m: FloatArray, top_m: float, point_count: int, *, held: bool
) -> FloatArray:
    r"""Put points in the middles of equal segments of one frame's profile.

    Parameters
    ----------
    profile : Profile
        Its nodes are joined straight, also where depth jumps: the way between two layers is that between their ends.
    gripper_m : (3,) float64
        End point of the gripper, where the way begins.
    top_m : float
        Where the cloth leads past the end point: its z at that height, relative to it. 0 where the way to the first
        node is straight.
    point_count : int
        r; point q = 1..r is at :math:`(2 q - 1) / (2 r)` of the length.
    held : bool
        Whether the cloth leads to the end point; otherwise the way begins on the cloth, at the height of that.

    Returns
    -------
    (2 r + 1,) float64
        y of the points, then z, relative to the gripper's; then the length.
    """
    y_m = np.concatenate([[0.0, 0.0], profile.y_m - gripper_m[1]])
    z_m = np.concatenate([[0.0 if held else top_m, top_m], profile.z_m - gripper_m[2]])
    arc_m = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(y_m), np.diff(z_m)))])
    wanted_m = (np.arange(point_count) + 0.5) / point_count * arc_m[-1]
    return np.concatenate([np.interp(wanted_m, arc_m, y_m), np.interp(wanted_m, arc_m, z_m), arc_m[-1:]])


def smooth_points(
    time_s: FloatArray, divided_m: FloatArray, frames: Sequence[int]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Smooth the points of a recording over time.

    Parameters
    ----------
    time_s : (T,) float64
        Ascending, all different.
    divided_m : (T, 2 r + 1) float64
        From :func:`divide_profile`.
    frames : sequence of int
        Lengths of the parabolas, see :func:`~garment_dataset.vision.depth.smoothing.adaptive_mean`.

    Returns
    -------
    y_m, z_m : (T, r) float64
    length_m : (T,) float64
    """
    smooth_m, _ = adaptive_mean(time_s, divided_m, frames, degree=_DEGREE)
    count = (divided_m.shape[1] - 1) // 2
    return smooth_m[:, :count], smooth_m[:, count:-1], smooth_m[:, -1]
