"""Back-projection of the depth pixels that can belong to the garment, and how uncertain their depth is.

Thesis 5.3.1 to 5.3.3 and the first step of 5.3.4. A depth image is ``(H, W)`` uint16 in millimetres, 0 where the sensor
got no return. The optical frame is x right, y down, z forward; a point of the gripper is ``(x, y, z)`` in metres.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from garment_dataset.arrays import DepthImage, FloatArray

    Point = tuple[float, float, float]

LEVEL_SPACING_PER_M = 0.1052 / 36
"""Distance of an OpenNI sensor's neighbouring levels in inverse depth: an eighth of a pixel of disparity.

It is that of the driver's table. Times z² it is their distance in depth: 3.35 mm at 1.07 m.
"""

NOISE_LEVELS = 0.64
"""Standard deviation in time of one pixel near 1.07 m, in level spacings, rounding to levels included (measured)."""

COLUMN_BAND_LEVELS = 0.43
"""Standard deviation of the fixed error that whole columns share, in level spacings (measured: 0.35 to 0.5)."""

PIXELS_PER_INDEPENDENT = 25.0
"""So many pixels of a window tell as much as one independent pixel would.

The noise comes in blobs: the measured correlations at 1, 2, 4 and 8 px (middles: 0.59, 0.45, 0.32, 0.24) give 29 for a
full window of 21 x 5 pixels and 11 for 5 x 5.
"""


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """The entries of K, thesis eq. (5.4), of the very image that is back-projected.

    Parameters
    ----------
    fx_px, fy_px : float
        Focal lengths.
    cx_px, cy_px : float
        Principal point; the centre of the first pixel is (0, 0).
    """

    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """Points in the optical frame: the set G of thesis 5.3.4, cut to the strip.

    Parameters
    ----------
    x_m, y_m : (n,) float64
        Right and down.
    z_mm : (n,) float64
        Forward, in the image's own millimetres: whole numbers, of which sums are exact.
    """

    x_m: FloatArray
    y_m: FloatArray
    z_mm: FloatArray


def select_pixels(
    depth_mm: DepthImage,
    intrinsics: Intrinsics,
    gripper_m: Point,
    *,
    band_half_width_m: float,
    strip_half_width_m: float,
) -> Cloud:
    r"""Back-project the pixels below the gripper that lie in the band and in the strip.

    Parameters
    ----------
    depth_mm : (H, W) uint16
        Distance along the optical axis in millimetres; 0 means no return.
    intrinsics : Intrinsics
        Of this image.
    gripper_m : (x, y, z)
        End point *ee* of the gripper.
    band_half_width_m : float
        :math:`\Delta z` of eq. (5.8), bounds included.
    strip_half_width_m : float
        :math:`\Delta x` of eq. (5.9), bounds excluded.

    Returns
    -------
    Cloud
        Column by column; empty where nothing qualifies.

    Notes
    -----
    Eq. (5.6): :math:`z = C(u, v)`, :math:`x = z (u - c_x) / f_x`, :math:`y = z (v - c_y) / f_y`; kept are
    :math:`ee_z - \Delta z \le z \le ee_z + \Delta z` (5.8), :math:`y \ge ee_y` and :math:`|x - ee_x| < \Delta x`.
    The thesis counts u and v from 1, as MATLAB does; its K comes from ROS, where the centre of the first pixel is
    (0, 0), and so do u and v here. Lens distortion is left alone, as in the thesis.

    Only the part of the image that the three conditions leave possible is looked at, some 5 % of it; the result is the
    same as for the whole image.
    """
    near_mm, far_mm = band_limits_mm(gripper_m[2], band_half_width_m)
    rows, columns = possible_region(
        (depth_mm.shape[0], depth_mm.shape[1]), intrinsics, gripper_m, (near_mm, far_mm), strip_half_width_m
    )
    # By columns: neighbours down a column fall into different windows, which later sums them up without waiting.
    block = np.ascontiguousarray(depth_mm[rows, columns].T)
    if block.size == 0:
        return Cloud(np.empty(0), np.empty(0), np.empty(0))
    # Unsigned subtraction wraps, so that what is nearer than the band becomes large: one comparison for two.
    kept = block - np.uint16(near_mm) <= np.uint16(far_mm - near_mm)
    z_mm = block.astype(np.float64)
    x_m = z_mm * ((np.arange(columns.start, columns.stop) - intrinsics.cx_px) / (1000 * intrinsics.fx_px))[:, None]
    y_m = z_mm * ((np.arange(rows.start, rows.stop) - intrinsics.cy_px) / (1000 * intrinsics.fy_px))
    kept &= np.abs(x_m - gripper_m[0]) < strip_half_width_m
    kept &= y_m >= gripper_m[1]
    index = np.flatnonzero(kept)
    return Cloud(x_m.ravel()[index], y_m.ravel()[index], z_mm.ravel()[index])


def band_limits_mm(gripper_z_m: float, band_half_width_m: float) -> tuple[int, int]:
    """Return the smallest and the largest depth of eq. (5.8) that an image can hold.

    The comparison is the one of ``mm / 1000`` with the bounds in metres. 0 mm, which means no return, is never inside;
    an empty band has its limits crossed.
    """
    levels = range(1, 1 << 16)
    first = bisect_left(levels, gripper_z_m - band_half_width_m, key=_metres)
    last = bisect_right(levels, gripper_z_m + band_half_width_m, key=_metres)
    return first + 1, last


def _metres(millimetres: int) -> float:
    return millimetres / 1000


def possible_region(
    shape: tuple[int, int],
    intrinsics: Intrinsics,
    gripper_m: Point,
    band_mm: tuple[int, int],
    strip_half_width_m: float,
) -> tuple[slice, slice]:
    """Return the rows and columns outside of which no pixel can qualify, whatever its depth in the band.

    A point at a fixed x moves across the columns monotonically with its depth, so the strip's extremes are at the
    band's ends; likewise for the rows. Rounding is outwards, and one column more is taken for that of the arithmetic.
    """
    near_mm, far_mm = band_mm
    if near_mm > far_mm:
        return slice(0, 0), slice(0, 0)
    x_m, y_m, _ = gripper_m
    ends_m = (near_mm / 1000, far_mm / 1000)
    sides_m = (x_m - strip_half_width_m, x_m + strip_half_width_m)
    u_px = [intrinsics.cx_px + intrinsics.fx_px * side / z for side in sides_m for z in ends_m]
    v_px = [intrinsics.cy_px + intrinsics.fy_px * y_m / z for z in ends_m]
    return _clip(min(v_px), math.inf, shape[0]), _clip(min(u_px), max(u_px), shape[1])


def _clip(lowest_px: float, highest_px: float, size_px: int) -> slice:
    start = math.floor(min(max(lowest_px, 0), size_px))
    stop = math.ceil(min(max(highest_px + 1, start), size_px))
    return slice(start, stop)


def level_spacing_m(z_m: ArrayLike) -> FloatArray:
    """Return the distance between neighbouring depth levels of an OpenNI sensor at depth ``z_m`` (any shape)."""
    spacing_m: FloatArray = np.asarray(z_m, dtype=np.float64) ** 2 * LEVEL_SPACING_PER_M
    return spacing_m


def z_std_m(z_m: ArrayLike, pixels: ArrayLike) -> FloatArray:
    r"""Return the standard uncertainty of a mean depth over a window.

    Parameters
    ----------
    z_m : array-like
        Mean depth of the window.
    pixels : array-like
        Number of its pixels, of the same shape. 0, a bridged stretch, counts as 1: at 1.07 m that is 2.6 mm, the order
        of what cloth with a radius of curvature of 10 cm departs from a chord of 4 cm (2 mm).

    Returns
    -------
    array of float64
        :math:`s \sqrt{0.64^2 / n_\mathrm{eff} + 0.43^2}` with s the level spacing and
        :math:`n_\mathrm{eff} = \max(1, n / 25)`; NaN where ``z_m`` is.

    Notes
    -----
    Measured on real Xtion frames. The first term, noise in time with the rounding to levels, shrinks with the number of
    independent pixels; the second, a fixed error common to whole columns, does not. A full window of some 105
    pixels at 1.07 m gets 1.8 mm.
    """
    independent = np.maximum(np.asarray(pixels, dtype=np.float64) / PIXELS_PER_INDEPENDENT, 1)
    return level_spacing_m(z_m) * np.sqrt(NOISE_LEVELS**2 / independent + COLUMN_BAND_LEVELS**2)
