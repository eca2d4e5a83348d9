"""Means over windows of a cloud, at equal steps down from the gripper: thesis eqs. (5.9) and (5.10)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import FloatArray, IntArray
    from garment_dataset.vision.depth.cloud import Cloud


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """The sample points s^i of thesis eq. (5.10), from the gripper down.

    Parameters
    ----------
    position_m : (3, k) float64
        x and z are means over the window, NaN where it is empty; y is its middle.
    pixels : (k,) int64
        Number of pixels in the window.
    z_spread_m : (k,) float64
        Sample standard deviation of z in the window (divided by n - 1); NaN for fewer than two pixels.
    """

    position_m: FloatArray
    pixels: IntArray
    z_spread_m: FloatArray


def sample_windows(cloud: Cloud, top_y_m: float, *, step_m: float, half_height_m: float) -> Samples:
    r"""Average the pixels over overlapping windows: thesis eqs. (5.9) and (5.10).

    Parameters
    ----------
    cloud : Cloud
        Pixels of the strip, none above ``top_y_m``.
    top_y_m : float
        Height :math:`ee_y` of the gripper's end point.
    step_m : float
        :math:`\Delta y_{us}`: the samples are at :math:`y^i = ee_y + i \Delta y_{us}`, i = 0, 1, …, down to the last
        pixel.
    half_height_m : float
        :math:`\Delta y`: a pixel belongs to sample i if :math:`y^i - \Delta y < y < y^i + \Delta y`.

    Returns
    -------
    Samples
        Without any sample when the cloud is empty.

    Notes
    -----
    Pixels are counted once, by where they lie among the edges of the windows, and a window is the difference of two
    running sums. When its height is a whole multiple of the step, its bottom is the top of a later one, and one count
    serves for both. Sums of z are sums of whole millimetres, and exact.
    """
    if cloud.y_m.size == 0:
        return Samples(np.empty((3, 0)), np.empty(0, np.int64), np.empty(0))
    last_y_m = float(cloud.y_m.max())
    y_m = top_y_m + step_m * np.arange(int((last_y_m - top_y_m) / step_m) + 2)
    y_m = y_m[: int(np.searchsorted(y_m, last_y_m, side="right"))]
    index = np.arange(y_m.size)
    height_in_steps = 2 * half_height_m / step_m
    whole_steps = round(height_in_steps)
    sums = _running_sums(cloud, top_y_m - half_height_m, step_m)
    if abs(height_in_steps - whole_steps) < 1e-9:
        sums_of_bottoms, bottom = sums, index + whole_steps
    else:
        sums_of_bottoms, bottom = _running_sums(cloud, top_y_m + half_height_m, step_m), index
    # Beyond the last pixel the sums stay what they are there.
    to_bottom = sums_of_bottoms.take(2 * bottom, axis=1, mode="clip")
    number, sum_x, sum_z, sum_zz = to_bottom - sums.take(2 * index + 1, axis=1, mode="clip")
    some = np.where(number > 0, number, np.nan)  # an empty window has no mean, and one pixel no spread
    position_m = np.stack([sum_x / some, y_m, sum_z / some / 1000])
    pairs = np.where(number > 1, number * (number - 1), np.nan)
    z_spread_m = np.sqrt(np.maximum(number * sum_zz - sum_z**2, 0) / pairs) / 1000
    return Samples(position_m, number.astype(np.int64), z_spread_m)


def _running_sums(cloud: Cloud, origin_m: float, step_m: float) -> FloatArray:
    """Sum 1, x, z and z² of the pixels above each edge ``origin_m + j * step_m``, in (4, n).

    Column ``2 j`` holds what is above edge j, column ``2 j + 1`` also what lies on it.
    """
    edges = np.maximum((cloud.y_m - origin_m) / step_m, -0.5)
    column = (np.floor(edges) + np.ceil(edges)).astype(np.intp) + 1  # 2 j + 1: on edge j; 2 j + 2: below it
    weights = (None, cloud.x_m, cloud.z_mm, cloud.z_mm**2)
    return np.array([np.bincount(column, weight) for weight in weights], dtype=np.float64).cumsum(axis=1)
