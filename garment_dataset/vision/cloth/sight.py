"""What one depth image shows of the garment: smoothed depth, its slopes, and the outline by rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray, DepthImage, FloatArray
    from garment_dataset.vision.depth.cloud import Intrinsics

    ColumnImage = NDArray[np.int16]

_WINDOW_PX = 5
_LEAST_PIXELS = 9
_LARGEST_SPREAD_M = 0.008
"""Depths within a window that scatter by more are of two layers, and their mean is on neither."""

_MARGIN_PX = 3
"""Beside what is seen: an edge of the cloth must not be one of the crop."""

_SHORTEST_BREAK_PX = 3
"""Shorter runs without depth are missing pixels; where layers meet, a window's width of them is left out."""


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """How millimetres are read, and where a garment can be.

    Parameters
    ----------
    table_per_m : (65536,) float64
        Inverse depth by millimetres, from :func:`~garment_dataset.vision.depth.flat_field.inverse_depth_table`.
    offset_per_m : (W,) float64 or None
        What the columns add to it, from :func:`~garment_dataset.vision.depth.flat_field.column_offsets`.
    band_half_width_m, reach_m : float
        Depth and x from the gripper's that a garment can have.
    """

    table_per_m: FloatArray
    offset_per_m: FloatArray | None
    band_half_width_m: float
    reach_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """One image within a crop.

    Parameters
    ----------
    z_m : (h, w) float32
        Depth of the garment, averaged over 5 x 5 pixels; NaN where there is none or layers meet.
    before_px, after_px : (h, w) int16
        For every pixel the first and the last column of the layer that it is on, in its row.
    corner_px : (column, row)
        Of the crop in the image.
    """

    z_m: NDArray[np.float32]
    before_px: ColumnImage
    after_px: ColumnImage
    corner_px: tuple[int, int]


def look(depth_mm: DepthImage, intrinsics: Intrinsics, gripper_m: FloatArray, reading: Reading) -> Sight:
    """Take the pixels that can be the garment: below the gripper, near it in depth and in x.

    Parameters
    ----------
    depth_mm : (H, W) uint16
        Depth image in millimetres; 0 means no return.
    intrinsics : Intrinsics
        Of this image.
    gripper_m : (3,) float64
        End point of the gripper.
    reading : Reading
        See there.
    """
    x_m, y_m, z_m = gripper_m.tolist()
    height, width = depth_mm.shape
    u0 = int(np.clip(intrinsics.cx_px + intrinsics.fx_px * (x_m - reading.reach_m) / z_m, 0, width - 2))
    u1 = int(np.clip(intrinsics.cx_px + intrinsics.fx_px * (x_m + reading.reach_m) / z_m, u0 + 2, width))
    v0 = int(np.clip(intrinsics.cy_px + intrinsics.fy_px * y_m / z_m, 0, height - 2))
    inverse = reading.table_per_m[depth_mm[v0:, u0:u1]]
    if reading.offset_per_m is not None:
        inverse = np.where(inverse > 0, inverse - reading.offset_per_m[u0:u1], 0.0)
    near, far = 1 / (z_m + reading.band_half_width_m), 1 / max(z_m - reading.band_half_width_m, 1e-3)
    garment = (inverse > near) & (inverse < far)
    raw = np.where(garment, 1 / np.where(garment, inverse, 1.0), 0.0)
    count, total, squares = (
        cv2.boxFilter(values, -1, (_WINDOW_PX, _WINDOW_PX), normalize=False, borderType=cv2.BORDER_CONSTANT)
        for values in (garment.astype(np.float64), raw, raw**2)
    )
    some = np.maximum(count, 1)
    mean = total / some
    good = (count >= _LEAST_PIXELS) & (squares / some - mean**2 <= _LARGEST_SPREAD_M**2)
    before_px, after_px = layers(good)
    return Sight(
        np.where(good, mean, np.nan).astype(np.float32),
        before_px,
        after_px,
        (u0, v0),
    )


def trimmed(sight: Sight) -> Sight:
    """Return the part of a crop that shows something, with a margin: the same to whoever samples it, in less memory."""
    seen = np.isfinite(sight.z_m)
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    if rows.size == 0:
        return sight
    v0, u0 = (max(int(places[0]) - _MARGIN_PX, 0) for places in (rows, columns))
    part = np.s_[v0 : int(rows[-1]) + _MARGIN_PX + 1, u0 : int(columns[-1]) + _MARGIN_PX + 1]
    first, last = (np.array(values[part]) - np.int16(u0) for values in (sight.before_px, sight.after_px))
    corner_px = sight.corner_px[0] + u0, sight.corner_px[1] + v0
    return Sight(np.array(sight.z_m[part]), first, last, corner_px)


def layers(good: BoolArray) -> tuple[ColumnImage, ColumnImage]:
    """Return the first and last column of the run of good pixels that each pixel is in, missing pixels bridged."""
    bridged = cv2.morphologyEx(good.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((1, _SHORTEST_BREAK_PX), np.uint8)) > 0
    width = good.shape[1]
    column = np.arange(width, dtype=np.int16)
    before = np.maximum.accumulate(np.where(bridged, -1, column), axis=1) + 1
    after = np.minimum.accumulate(np.where(bridged, width, column)[:, ::-1], axis=1)[:, ::-1] - 1
    return before.astype(np.int16), after.astype(np.int16)


def of_the_cloth(edge_px: FloatArray, width_px: int) -> BoolArray:
    """Return which columns where a layer ends are edges of the cloth, and not of a crop that is so wide."""
    within: BoolArray = (edge_px >= _MARGIN_PX) & (edge_px < width_px - _MARGIN_PX)
    return within


def sample(image: NDArray[np.float32], u: FloatArray, v: FloatArray) -> FloatArray:
    """Return an image between its pixels, bilinearly; NaN outside and beside a NaN."""
    height, width = image.shape
    i, j = np.floor(u), np.floor(v)
    inside = (i >= 0) & (j >= 0) & (i < width - 1) & (j < height - 1)
    i, j = np.where(inside, i, 0).astype(np.int64), np.where(inside, j, 0).astype(np.int64)
    s, t = u - i, v - j
    rows = (1 - s) * image[j, i] + s * image[j, i + 1], (1 - s) * image[j + 1, i] + s * image[j + 1, i + 1]
    return np.where(inside, (1 - t) * rows[0] + t * rows[1], np.nan)
