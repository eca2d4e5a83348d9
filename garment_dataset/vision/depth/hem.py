"""Where the garment ends on the profile, and whether that end was seen."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from garment_dataset.vision.depth.cloud import band_limits_mm
from garment_dataset.vision.depth.hem_line import edge_row
from garment_dataset.vision.depth.smoothing import middle

if TYPE_CHECKING:
    from garment_dataset.arrays import DepthImage, FloatArray
    from garment_dataset.vision.depth.cloud import Intrinsics, Point
    from garment_dataset.vision.depth.surfaces import ProfileRows

LengthReason = Literal["image_edge", "gap", "occluded", "beyond_band"]
"""Why the length of the garment is not known: its hem was not seen.

``image_edge``: cloth is seen down to the edge of the image. ``gap``: there is more below a gap too long to cross, and
no background is seen where the cloth seems to end. ``occluded``: something nearer hides what is below. ``beyond_band``:
the surface goes on outside of the band of eq. (5.8).
"""

_HEM_HALF_WIDTH_PX = 14
_HEM_RISE_PX, _HEM_REACH_PX = 24, 16
"""So many rows above and below the last one of the profile its neighbours may end."""

_DEAD_SHARE = 1 / 24
"""Share of an image's rows at its bottom that may be dead: registered ones of 480 rows have up to 17 (measured)."""

_EARLY_PX = 3.0

_BELOW_HEM_PX = (2, 8)
"""Rows below the hem that are looked at: the next one may be mixed."""

_BESIDE_HEM_PX = 3


def hem_row(block_mm: DepthImage, rows: ProfileRows, last: int, jump_m: float) -> tuple[float, float] | None:
    """Return the row, in pixels of the image, at which the garment ends on the profile, and its standard uncertainty.

    A cloth whose last pixel is in row v ends anywhere between v and v + 1. Nothing is seen for some rows beyond it, of
    columns near the profile at the median: there it may end as well. None at the image's edge.
    """
    if last >= rows.v.size - 1:
        return None
    away_px, lowest, highest = column_ends(block_mm, rows, last, jump_m)
    edge = edge_row(away_px, lowest, highest)
    near = np.abs(away_px) <= _BESIDE_HEM_PX
    unseen = middle((highest - lowest)[near]) if near.any() else 0.0
    # a hole at the profile's own column may hide its last rows, but rows that are seen are there
    end = float(last) if edge is None or not -_EARLY_PX <= edge - last <= _HEM_REACH_PX else edge
    return end + 0.5 + float(rows.v[0]), float(unseen / np.sqrt(12))


def column_ends(
    block_mm: DepthImage, rows: ProfileRows, last: int, jump_m: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the columns around the profile, and between which rows of the block each has its last pixel of cloth.

    A column goes on as long as any pixel below has the depth of its last connected one: missing ones do not end it. It
    ends somewhere among the missing ones behind its last, before background or another surface is seen.

    Parameters
    ----------
    block_mm : (h, w) uint16
        The part of an image in which the garment can be, and what is behind it.
    rows : ProfileRows
        Pixels around its profile.
    last : int
        Last row that shows the profile.
    jump_m : float
        Depths that differ by more are two surfaces.

    Returns
    -------
    away_px, lowest, highest : (n,) float64
        Columns from the profile's; the last row seen, and the last before anything else is seen.
    """
    top, bottom = max(last - _HEM_RISE_PX, 0), min(last + _HEM_REACH_PX, rows.v.size)
    middle = (rows.weight.shape[1] - 1) // 2
    half = min(_HEM_HALF_WIDTH_PX, middle)
    step = np.arange(-half, half + 1)
    columns = np.rint(rows.column_px[last]).astype(np.int64) + step
    connected = rows.weight[top : last + 1, middle + step] > 0
    known = connected.any(axis=0) & (columns >= 0) & (columns < block_mm.shape[1])
    columns, connected = columns[known], connected[:, known]
    from_row = connected.shape[0] - 1 - np.argmax(connected[::-1], axis=0)
    around_m, row = block_mm[top:bottom, columns] / 1000, np.arange(bottom - top)[:, None]
    own_m = around_m[from_row, np.arange(columns.size)]
    cloth = (np.abs(around_m - own_m) <= jump_m) & (row >= from_row)
    lowest = bottom - top - 1 - np.argmax(cloth[::-1], axis=0)
    other = (around_m > 0) & (row > lowest)
    missing = np.where(other.any(axis=0), np.argmax(other, axis=0), bottom - top) - lowest - 1
    away_px, seen = columns - rows.column_px[last], (top + lowest).astype(np.float64)
    return away_px, seen, seen + missing


def doubt_hem(
    depth_mm: DepthImage,
    intrinsics: Intrinsics,
    end_m: Point,
    gripper_z_m: float,
    *,
    band_half_width_m: float,
    jump_m: float,
    ends_at_gap: bool,
) -> LengthReason | None:
    """Look below the end of a chain; return why it may not be the hem, or None.

    Parameters
    ----------
    depth_mm : (H, W) uint16
        Depth image in millimetres; 0 means no return.
    intrinsics : Intrinsics
        Of this image.
    end_m : (x, y, z)
        Where the chain ends.
    gripper_z_m, band_half_width_m : float
        The band of eq. (5.8).
    jump_m : float
        Neighbouring depths that differ by more are two surfaces.
    ends_at_gap : bool
        Whether more of the garment, or something else, follows farther down.
    """
    x_m, y_m, z_m = end_m
    v = int(intrinsics.cy_px + intrinsics.fy_px * y_m / z_m)
    u = round(intrinsics.cx_px + intrinsics.fx_px * x_m / z_m)
    columns = slice(max(u - _BESIDE_HEM_PX, 0), max(u + _BESIDE_HEM_PX + 1, 0))
    if v >= depth_mm.shape[0] * (1 - _DEAD_SHARE):
        rest_mm = depth_mm[v + 1 :, columns].astype(np.float64)
        if not ((rest_mm > 0) & (np.abs(rest_mm / 1000 - z_m) > jump_m)).any():
            return "image_edge"
    below_mm = depth_mm[v + _BELOW_HEM_PX[0] : v + _BELOW_HEM_PX[1], columns].astype(np.float64)
    if below_mm.size == 0:
        return None
    beyond_m = np.where(below_mm > 0, below_mm / 1000 - z_m, np.nan)
    most = below_mm.size / 2
    if np.count_nonzero(beyond_m > jump_m) > most:
        return None
    if np.count_nonzero(beyond_m < -jump_m) > most:
        return "occluded"
    near_mm, far_mm = band_limits_mm(gripper_z_m, band_half_width_m)
    outside = (below_mm < near_mm) | (below_mm > far_mm)
    if np.count_nonzero(outside & (np.abs(beyond_m) <= jump_m)) > most:
        return "beyond_band"
    return "gap" if ends_at_gap else None
