"""The middle of a sheet shown whole, between its left and right border: an estimate of its material line.

A cloth model's material line is fixed to the cloth and hangs from the gripper to the farthest point below it. What is
seen in the plane x = x_gripper is another line as soon as the sheet leans sideways or hangs beside the gripper. Of a
sheet of constant width that is seen whole, the middle between the borders is that line; of anything else it is not, and
none is given.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from garment_dataset.vision.depth.cloud import band_limits_mm
from garment_dataset.vision.depth.robust import robust_polynomials
from garment_dataset.vision.depth.smoothing import adaptive_mean, middle, seconds_apart

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, DepthImage, FloatArray, IntArray
    from garment_dataset.vision.depth.chain import Track
    from garment_dataset.vision.depth.cloud import Intrinsics, Point
    from garment_dataset.vision.depth.profile import Profile

_ROW_STEP_PX = 2
"""Every second row is looked at: borders of neighbouring rows share their errors."""

_INSET_PX = 8
_INSET_HALF_PX = 4
"""Depth at the borders is taken 8 px inside, from 9 columns: nearer pixels are often missing or mixed."""

_MARGIN_PX = 12
"""A border so near the image's edge may be the image's: the sensor's last columns are dead."""

_LEAST_FILLED = 0.85
"""Share of valid pixels between the borders of a row."""

_WIDTH_TOLERANCE = 0.05
"""Of the width: by more it is not constant."""

_LEAST_ROWS = 0.85
"""Share of rows that must show both borders at the right distance, from the first row of cloth to the hem."""

_BULGE_M = 0.03
"""Cloth whose middle is farther than that from the line between its borders is folded."""

_X_DEGREE, _LEAN_DEGREE = 3, 1
"""Of the polynomials over height: a cubic has room for the S of cloth that swings sideways."""

_LEAST_FRAMES = 0.5
"""Of the frames with cloth: what only some frames show as a sheet is none."""

_RASTER_M: FloatArray = 0.02 * np.arange(101, dtype=np.float64)
"""Heights below the gripper's end point, for all recordings: no garment is longer. Below the hem values are held."""


@dataclass(frozen=True, slots=True, eq=False)
class MaterialLine:
    """The middle of the sheet in one image, on a raster of 2 cm below the gripper's end point.

    Parameters
    ----------
    x_m : (k,) float64
        Relative to the gripper's.
    lean : (k,) float64
        dz/dx from border to border.
    width_m : float
        Median distance of the borders.
    """

    x_m: FloatArray
    lean: FloatArray
    width_m: float


def trace_material_lines(
    images: Sequence[tuple[DepthImage, Point, Profile]], intrinsics: Intrinsics, *, band_half_width_m: float
) -> list[MaterialLine | None]:
    """Find the borders of the garment row by row, and their middle, in each of some images.

    Parameters
    ----------
    images : sequence of ((H, W) uint16, (x, y, z), Profile)
        Depth in millimetres, where 0 means no return; end point of the gripper; what the image shows of the garment
        below it.
    intrinsics : Intrinsics
        Of these images.
    band_half_width_m : float
        Depth from the gripper's that is looked at, eq. (5.8).

    Returns
    -------
    list of MaterialLine or None
        None when the image does not show a sheet of constant width, whole, in one layer.
    """
    sheets = [_sheet(*image, intrinsics, band_half_width_m) for image in images]
    found = [sheet for sheet in sheets if sheet is not None]
    if not found:
        return [None] * len(images)
    below_m, heights_m = [sheet.below_m for sheet in found], np.stack([sheet.heights_m for sheet in found])
    x_m = robust_polynomials(below_m, [sheet.x_m for sheet in found], _X_DEGREE, heights_m)
    lean = robust_polynomials(below_m, [sheet.lean for sheet in found], _LEAN_DEGREE, heights_m)
    lines = iter(zip(x_m, lean, strict=True))
    return [None if sheet is None else MaterialLine(*next(lines), sheet.width_m) for sheet in sheets]


@dataclass(frozen=True, slots=True, eq=False)
class _Sheet:
    """The middle of a sheet and its lean, (n,), by distance below the end point; where they are wanted, (k,)."""

    below_m: FloatArray
    x_m: FloatArray
    lean: FloatArray
    heights_m: FloatArray
    width_m: float


def _sheet(
    depth_mm: DepthImage, gripper_m: Point, profile: Profile, intrinsics: Intrinsics, band_half_width_m: float
) -> _Sheet | None:
    """Find the rows of one image that show both borders of a sheet of constant width."""
    first_px, last_px = intrinsics.cy_px + intrinsics.fy_px * profile.y_m[[0, -1]] / profile.z_m[[0, -1]]
    if profile.ends_at_gap or last_px > depth_mm.shape[0] - 1:
        return None
    # the first node is on a row: which one must not depend on how y / z is rounded
    v = np.arange(int(np.ceil(first_px - 1e-6)), int(last_px + 1e-6), _ROW_STEP_PX)
    if v.size <= 2 * (_X_DEGREE + 1):
        return None
    z_m = np.interp(v, intrinsics.cy_px + intrinsics.fy_px * profile.y_m / profile.z_m, profile.z_m)
    y_m = (v - intrinsics.cy_px) / intrinsics.fy_px * z_m
    near_mm, far_mm = band_limits_mm(gripper_m[2], band_half_width_m)
    rows_mm = depth_mm[v[0] : v[-1] + 1 : _ROW_STEP_PX]
    cloth = rows_mm - np.uint16(near_mm) <= np.uint16(far_mm - near_mm)  # unsigned: one comparison for two
    x_m, edge_z_m, good = _borders(rows_mm, cloth, intrinsics)
    good &= np.abs(edge_z_m.mean(axis=0) - z_m) <= _BULGE_M
    if not good.any():
        return None
    width_m = np.hypot(x_m[1] - x_m[0], edge_z_m[1] - edge_z_m[0])
    usual_m = middle(width_m[good])
    good &= np.abs(width_m - usual_m) <= _WIDTH_TOLERANCE * usual_m
    if good.mean() < _LEAST_ROWS:
        return None
    x_m, edge_z_m, below_m = x_m[:, good], edge_z_m[:, good], y_m[good] - gripper_m[1]
    heights_m = np.minimum(_RASTER_M, profile.end_y_m - gripper_m[1])
    x_m -= gripper_m[0]
    return _Sheet(below_m, x_m.mean(axis=0), (edge_z_m[1] - edge_z_m[0]) / (x_m[1] - x_m[0]), heights_m, usual_m)


def _borders(rows_mm: DepthImage, cloth: BoolArray, intrinsics: Intrinsics) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return x and z of the left and right border, (2, n) each, and the rows in which both can be trusted.

    The line from one border to the other is drawn out from where depth is taken to the borders. Where the sheet is
    turned, the middle of the borders in the image is not the middle of the sheet: the nearer half is wider.
    """
    last, byte = cloth.shape[1] - 1, cloth.view(np.uint8)
    u = np.stack([cloth.argmax(axis=1), last - np.asarray(cv2.flip(byte, 1)).view(np.bool_).argmax(axis=1)])
    width_px = u[1] - u[0] + 1
    filled_px = np.asarray(cv2.reduce(byte, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32S))[:, 0]
    good = (filled_px >= _LEAST_FILLED * width_px) & (width_px > 4 * _INSET_PX)
    good &= (u[0] >= _MARGIN_PX) & (u[1] <= last - _MARGIN_PX)
    inside = np.array([[_INSET_PX], [-_INSET_PX]])
    columns = np.clip((u + inside)[:, :, None] + np.arange(-_INSET_HALF_PX, _INSET_HALF_PX + 1), 0, last)
    row = np.arange(rows_mm.shape[0])[:, None]
    valid = cloth[row, columns]
    count = valid.sum(axis=2)
    good &= (count > _INSET_HALF_PX).all(axis=0)
    inner_m = np.where(valid, rows_mm[row, columns], 0).sum(axis=2) / np.maximum(count, 1) / 1000
    half_m = (inner_m[1] - inner_m[0]) / 2 * width_px / np.maximum(width_px - 2 * _INSET_PX, 1)
    z_m = inner_m.mean(axis=0) + np.stack([-half_m, half_m])
    return (u - intrinsics.cx_px) / intrinsics.fx_px * z_m, z_m, good


def smooth_material_lines(
    lines: Sequence[MaterialLine | None], stamp_ns: IntArray, *, frames: Sequence[int]
) -> list[MaterialLine | None]:
    """Smooth the middles of a recording over time; drop them when they are not those of one sheet.

    Parameters
    ----------
    lines : sequence of MaterialLine or None, length T
        On one raster, in any order of their stamps.
    stamp_ns : (T,) int64
        When they were seen.
    frames : sequence of int
        Lengths of the polynomials in time, see :func:`~garment_dataset.vision.depth.smoothing.adaptive_mean`.

    Returns
    -------
    list of MaterialLine or None, length T
        None where there was none, where the width is not the usual one, and everywhere when less than half are left.
    """
    usual_m = np.median([line.width_m for line in lines if line is not None] or [np.nan])
    seen = {
        index: line
        for index, line in enumerate(lines)
        if line is not None and abs(line.width_m - usual_m) <= _WIDTH_TOLERANCE * usual_m
    }
    smoothed: list[MaterialLine | None] = [None] * len(lines)
    if not seen or len(seen) < _LEAST_FRAMES * len(lines):
        return smoothed
    order = sorted(seen, key=lambda index: int(stamp_ns[index]))
    time_s = seconds_apart(stamp_ns[order])
    values = np.stack([np.concatenate([seen[index].x_m, seen[index].lean]) for index in order])
    for index, row in zip(order, adaptive_mean(time_s, values, frames, degree=2)[0], strict=True):
        x_m, lean = np.split(row, 2)
        smoothed[index] = MaterialLine(x_m, lean, seen[index].width_m)
    return smoothed


def divide_material_line(line: MaterialLine, track: Track, gripper_m: Point, point_count: int) -> FloatArray:
    """Put points in the middles of equal segments of the material line, (3, r), in the optical frame.

    Parameters
    ----------
    line : MaterialLine
        Smoothed.
    track : Track
        The profile of the same frame: its heights, and z, which the lean carries over to the middle.
    gripper_m : (x, y, z)
        End point of the gripper: at its height the line begins.
    point_count : int
        r.
    """
    _, y_m, z_m = track.chain.position_m
    x_m, lean = (np.interp(y_m - gripper_m[1], _RASTER_M, values) for values in (line.x_m, line.lean))
    nodes_m = np.stack([gripper_m[0] + x_m, y_m, z_m + lean * x_m])
    arc_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(nodes_m, axis=1), axis=0)))
    wanted_m = (np.arange(point_count) + 0.5) / point_count * arc_m[-1]
    return np.stack([np.interp(wanted_m, arc_m, axis) for axis in nodes_m])
