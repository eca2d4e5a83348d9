"""Where the garment ends on the profile, and whether that end was seen."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from garment_dataset.vision.depth.cloud import band_limits_mm

if TYPE_CHECKING:
    from garment_dataset.arrays import DepthImage
    from garment_dataset.vision.depth.cloud import Intrinsics, Point
    from garment_dataset.vision.depth.planes import ProfileRows

LengthReason = Literal["image_edge", "gap", "occluded", "beyond_band"]
"""Why the length of the garment is not known: its hem was not seen.

``image_edge``: cloth is seen down to the edge of the image. ``gap``: there is more below a gap too long to cross, and
no background is seen where the cloth seems to end. ``occluded``: something nearer hides what is below. ``beyond_band``:
the surface goes on outside of the band of eq. (5.8).
"""

_MIN_COLUMNS = 3
_HEM_HALF_WIDTH_PX = 10
_HEM_REACH_PX = 12
_EARLY_PX, _LATE_PX = 0.75, 2.0
"""How far before and behind the line of the hem a column may end: whole ones end half a row about it."""

_DEAD_SHARE = 1 / 24
"""Share of an image's rows at its bottom that may be dead: registered ones of 480 rows have up to 17 (measured)."""

_BELOW_HEM_PX = (2, 8)
"""Rows below the hem that are looked at: the next one may be mixed."""

_BESIDE_HEM_PX = 3


def hem_row(masked_mm: DepthImage, rows: ProfileRows, last: int, jump_m: float) -> float | None:
    """Return the row, in pixels of the image, at which the garment ends on the profile; None at the image's edge.

    The ends of the columns around it are put on a line, robustly: a missing pixel ends a column early. A column whose
    last pixel is in row v ends anywhere between v and v + 1.
    """
    if last >= rows.v.size - 1:
        return None
    first_row, stop_row = max(last - _HEM_REACH_PX, 0), min(last + _HEM_REACH_PX, rows.v.size)
    columns = np.rint(rows.column_px[last]).astype(np.int64) + np.arange(-_HEM_HALF_WIDTH_PX, _HEM_HALF_WIDTH_PX + 1)
    columns = columns[(columns >= 0) & (columns < masked_mm.shape[1])]
    around_mm = masked_mm[first_row:stop_row, columns].astype(np.float64)
    cloth = np.abs(around_mm / 1000 - rows.middle_m[last]) <= jump_m
    seen = cloth.any(axis=0)
    ends = (stop_row - 1 - np.argmax(cloth[::-1], axis=0))[seen].astype(np.float64)
    away = (columns - rows.column_px[last])[seen]
    end = float(last)
    if ends.size >= 5:
        kept = np.ones(ends.size, dtype=np.bool_)
        for _ in range(5):
            centred = away[kept] - away[kept].mean()
            slope = (centred * ends[kept]).sum() / max((centred**2).sum(), 1e-9)
            level = ends[kept].mean() - slope * away[kept].mean()
            beyond = ends - level - slope * away
            kept = (beyond >= -_EARLY_PX) & (beyond <= _LATE_PX)
            if kept.sum() < _MIN_COLUMNS:
                break
        end = level if abs(level - last) <= _HEM_REACH_PX / 2 else end
    return end + 0.5 + float(rows.v[0])


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
