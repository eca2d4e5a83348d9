r"""The garment's profile in the plane x = x_gripper, by fitting planes to the inverse depth around it.

In a pinhole image a plane is linear in inverse depth: :math:`q = 1/z = a + b\,(u - u_0) + c\,(v - v_0)`. The profile is
where that meets the plane through the gripper, :math:`u - c_x = f_x x_g q`. Around every image row planes are fitted to
windows of several sizes, and the largest is used that agrees with the smaller ones. A window never reaches over an edge
of the cloth or a fold: pixels count as far as they are connected.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Literal

import numpy as np

from garment_dataset.vision.depth.cloud import band_limits_mm, possible_region
from garment_dataset.vision.depth.hem import hem_row
from garment_dataset.vision.depth.pieces import doubtful_islands, pieces, without_islands
from garment_dataset.vision.depth.row_pixels import MEDIAN_PX, Block, gather_rows
from garment_dataset.vision.depth.surfaces import Cloth, Surfaces, cloth_of, fit_surfaces, joined

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import DepthImage, FloatArray, IntArray
    from garment_dataset.vision.depth.cloud import Intrinsics, Point
    from garment_dataset.vision.depth.surfaces import ProfileRows

_MIN_ROWS = 5

_ABOUT_PX = 5
"""Columns to each side of the profile whose mean stands for a row: few, as cloth is bent across it."""


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """What one image shows of the profile, from the gripper down: one node per row, pieces between jumps.

    Parameters
    ----------
    y_m, z_m : (n,) float64
        Nodes; y rises.
    piece : (n,) int64
        Number of the piece that a node belongs to, from 0; between pieces depth jumps.
    pixels : (n,) int64
        Number of pixels that the node's plane rests on.
    z_spread_m : (n,) float64
        Sample standard deviation of z in the row's pixels; NaN for fewer than two.
    lean : (n,) float64
        Slope dz/dx of the sheet out of the plane.
    measured_m : (n,) float64
        Depth of the pixel of the node's row; NaN for nodes that only draw a piece out towards the next.
    end_y_m : float
        Where the garment ends.
    ends_at_gap : bool
        Whether more follows after a gap too long to cross.
    window_z_m, window_gain, window_pixels : (w, n) float64, float64, int64
        By window: depth of the node, variance of its inverse depth over that of one pixel if these were independent,
        and number of pixels.
    islands_m : (2, m) float64
        Where another layer may graze the profile, see :func:`~garment_dataset.vision.depth.pieces.doubtful_islands`:
        y, and the length of the way to it and back.
    end_std_m : float
        Standard uncertainty of its end because nothing is seen right below.
    row_z_m : (n,) float64
        Mean depth of the few pixels of the node's row about the profile; NaN for nodes that only draw a piece out.
    above_px : (n,) float64
        Rows of pixels from the node down to the end.
    hidden_std_m : float
        Standard uncertainty of its length because of cloth beyond the end that may be turned along the ray.
    """

    y_m: FloatArray
    z_m: FloatArray
    piece: IntArray
    pixels: IntArray
    z_spread_m: FloatArray
    lean: FloatArray
    measured_m: FloatArray
    end_y_m: float
    ends_at_gap: bool
    window_z_m: FloatArray
    window_gain: FloatArray
    window_pixels: IntArray
    islands_m: FloatArray = field(default_factory=lambda: np.empty((2, 0)))
    end_std_m: float = 0.0
    row_z_m: FloatArray = field(default_factory=lambda: np.empty(0))
    above_px: FloatArray = field(default_factory=lambda: np.empty(0))
    hidden_std_m: float = 0.0

    def end_m(self, gripper_x_m: float) -> Point:
        """Return where the profile ends, in space."""
        return gripper_x_m, float(self.y_m[-1]), float(self.z_m[-1])

    def measured_position_m(self, gripper_x_m: float) -> FloatArray:
        """Return the pixels on the profile, (3, m), each on the ray of its node."""
        real = np.isfinite(self.measured_m)
        z_m = self.measured_m[real]
        return np.stack([np.full(z_m.size, gripper_x_m), self.y_m[real] / self.z_m[real] * z_m, z_m])


@dataclass(frozen=True, slots=True)
class ProfileSettings:
    """Where a profile can be, and what counts as one surface.

    Parameters
    ----------
    band_half_width_m : float
        Depth from the gripper's that is looked at, eq. (5.8).
    clearance_m : float
        So far below the end point the gripper's fingers can be in the way; nothing above that is used.
    jump_m : float
        Neighbouring depths that differ by more are not the same surface.
    max_gap_m : float
        The longest stretch without pixels that the profile crosses.
    hold_reach_m : float
        The garment begins no farther from the gripper's end point than that, in space.
    windows_px : sequence of (int, int)
        Half widths and half heights of the windows, rising.
    """

    band_half_width_m: float
    clearance_m: float
    jump_m: float
    max_gap_m: float
    hold_reach_m: float
    windows_px: Sequence[tuple[int, int]]


@dataclass(frozen=True, slots=True, eq=False)
class DepthScale:
    """What makes inverse depth of the values of a depth image.

    Parameters
    ----------
    table_per_m : (65536,) float64
        Inverse depth by millimetres, from :func:`~garment_dataset.vision.depth.flat_field.inverse_depth_table`.
    offset_per_m : (W,) or (H, W) float64 or None
        What the columns add to it, from :func:`~garment_dataset.vision.depth.flat_field.column_offsets`, or what every
        pixel adds.
    """

    table_per_m: FloatArray
    offset_per_m: FloatArray | None = None


def find_profiles(
    images: Sequence[tuple[DepthImage, Point]], intrinsics: Intrinsics, scale: DepthScale, settings: ProfileSettings
) -> list[Profile | Literal["no_pixels", "few_pixels", "not_held"]]:
    """Follow the profile through images, each on its own.

    Parameters
    ----------
    images : sequence of ((H, W) uint16, (x, y, z))
        Distance along the optical axis in millimetres, where 0 means no return, and end point of the gripper. Some ten
        at once take less time than one by one.
    intrinsics : Intrinsics
        Of these images.
    scale : DepthScale
        Of the recording.
    settings : ProfileSettings
        See there.

    Returns
    -------
    list of Profile or str
        ``no_pixels`` when the band is empty below the gripper, ``few_pixels`` when no five rows show cloth,
        ``not_held`` when the first that does is too far from the end point.
    """
    looked = [_look(depth_mm, intrinsics, gripper_m, scale, settings) for depth_mm, gripper_m in images]
    seen = [each for each in looked if isinstance(each, _Seen)]
    if not seen:
        return [each for each in looked if not isinstance(each, _Seen)]
    surfaces = fit_surfaces(joined([each.cloth for each in seen]), intrinsics, settings.windows_px)
    stops = np.cumsum([each.cloth.row.size for each in seen])[:-1]
    profiles = (_profile(each, own, intrinsics) for each, own in zip(seen, _split(surfaces, stops), strict=True))
    return [next(profiles) if isinstance(each, _Seen) else each for each in looked]


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """What one image shows before surfaces are fitted.

    ``spread_per_m``, (k,), is the sample standard deviation of inverse depth in the pixels of each row of cloth, NaN
    for fewer than two; ``row_z_m``, (k,), the mean depth of a few about the profile; ``last_v``, ``last_std_px`` are
    the row where the garment ends and its standard uncertainty.
    """

    cloth: Cloth
    spread_per_m: FloatArray
    row_z_m: FloatArray
    last_v: float
    last_std_px: float
    ends_at_gap: bool
    islands_m: FloatArray


def _look(
    depth_mm: DepthImage, intrinsics: Intrinsics, gripper_m: Point, scale: DepthScale, settings: ProfileSettings
) -> _Seen | Literal["no_pixels", "few_pixels", "not_held"]:
    """Find the rows of one image that show the profile."""
    band_mm = band_limits_mm(gripper_m[2], settings.band_half_width_m)
    reach_px = settings.windows_px[-1][0]
    reach_m = (reach_px + MEDIAN_PX) * (gripper_m[2] + settings.band_half_width_m) / intrinsics.fx_px
    top_m = (gripper_m[0], gripper_m[1] + settings.clearance_m, gripper_m[2])
    lines, columns = possible_region((depth_mm.shape[0], depth_mm.shape[1]), intrinsics, top_m, band_mm, reach_m)
    block = depth_mm[lines, columns]
    inside = block - np.uint16(band_mm[0]) <= np.uint16(band_mm[1] - band_mm[0])  # unsigned: one comparison for two
    if not inside.any():
        return "no_pixels"
    masked = block * inside
    added = np.zeros(depth_mm.shape[1]) if scale.offset_per_m is None else scale.offset_per_m
    offset = added[None, columns] if added.ndim == 1 else np.ascontiguousarray(added[lines, columns])
    rows = gather_rows(
        Block(masked, lines.start, columns.start, scale.table_per_m, offset),
        intrinsics,
        gripper_m,
        settings.jump_m,
        reach_px,
    )
    below = (rows.v - intrinsics.cy_px) / intrinsics.fy_px * rows.middle_m >= top_m[1]
    index, ends_at_gap = _linked(np.flatnonzero(rows.filled & below), rows, intrinsics, settings.max_gap_m)
    if index.size < _MIN_ROWS:
        return "few_pixels"
    if _reach_m(rows, index[0], intrinsics, gripper_m) > settings.hold_reach_m:
        return "not_held"
    whole, index = index, without_islands(index, rows.middle_m[index], settings.jump_m)
    island, way_m = doubtful_islands(whole, index, rows.middle_m, settings.jump_m)
    island_y_m = (rows.v[island] - intrinsics.cy_px) / intrinsics.fy_px * rows.middle_m[island]
    piece = pieces(rows.middle_m[index], settings.jump_m)
    cloth = cloth_of(rows, index, piece, gripper_m[0], settings.windows_px)
    last_v, last_std_px = hem_row(block, rows, index[-1], settings.jump_m) or (depth_mm.shape[0] - 0.5, 0.0)
    spread_per_m, row_z_m = _spread(rows)[index], _row_z_m(rows)[index]
    return _Seen(cloth, spread_per_m, row_z_m, last_v, last_std_px, ends_at_gap, np.stack([island_y_m, way_m]))


def _reach_m(rows: ProfileRows, first: int, intrinsics: Intrinsics, gripper_m: Point) -> float:
    """Return how far the first row of cloth is from the end point, in the plane of the profile, which holds both."""
    z_m = rows.middle_m[first]
    return float(
        np.hypot((rows.v[first] - intrinsics.cy_px) / intrinsics.fy_px * z_m - gripper_m[1], z_m - gripper_m[2])
    )


def _linked(index: IntArray, rows: ProfileRows, intrinsics: Intrinsics, max_gap_m: float) -> tuple[IntArray, bool]:
    """Return the rows down to the first gap that is too long, and whether there is one."""
    gap_m = (np.diff(index) - 1) * rows.middle_m[index[:-1]] / intrinsics.fy_px
    too_long = np.flatnonzero(gap_m > max_gap_m)
    return (index, False) if too_long.size == 0 else (index[: too_long[0] + 1], True)


def _split(surfaces: Surfaces, stops: IntArray) -> list[Surfaces]:
    """Return the surfaces of each image."""
    parts = (np.split(getattr(surfaces, each.name), stops, axis=1) for each in fields(surfaces))
    return [Surfaces(*own) for own in zip(*parts, strict=True)]


def _profile(seen: _Seen, surfaces: Surfaces, intrinsics: Intrinsics) -> Profile:
    """Make nodes of the rows; pieces are drawn out to the middle of what is between them, and the last to the hem."""
    piece, v, last_v = seen.cloth.piece, seen.cloth.v, seen.last_v
    kept = v < last_v - 0.01
    kept[0] = True
    breaks = np.flatnonzero(np.diff(piece) > 0)
    middle = (v[breaks] + v[breaks + 1]) / 2
    source = np.concatenate([np.flatnonzero(kept), breaks, breaks + 1, [np.flatnonzero(kept)[-1]]])
    measured_m = seen.cloth.middle_m[source]
    measured_m[kept.sum() : -1] = np.nan
    at_v = np.concatenate([v[kept], middle, middle, [max(last_v, v[kept][-1])]])
    order = np.lexsort((at_v, piece[source]))
    source, at_v, measured_m = source[order], at_v[order], measured_m[order]
    window_z_m = 1 / (surfaces.inverse[:, source] + surfaces.down[:, source] * (at_v - v[source]))
    z_m = window_z_m[0]
    y_m = (at_v - intrinsics.cy_px) / intrinsics.fy_px * z_m
    spread_m = seen.spread_per_m / surfaces.inverse[0] ** 2
    row_z_m = np.where(np.isfinite(measured_m), seen.row_z_m[source], np.nan)
    row_z_m[-1] = np.nan
    return Profile(
        y_m,
        z_m,
        piece[source],
        surfaces.pixels[0, source],
        spread_m[source],
        surfaces.lean[0, source],
        measured_m,
        float(y_m[-1]),
        seen.ends_at_gap,
        window_z_m,
        surfaces.gain[:, source],
        surfaces.pixels[:, source],
        seen.islands_m,
        seen.last_std_px / intrinsics.fy_px * float(z_m[-1]),
        row_z_m,
        at_v[-1] - at_v,
    )


def _row_z_m(rows: ProfileRows) -> FloatArray:
    """Return the mean depth of the pixels of each row about the profile, (n,); NaN where there is none."""
    middle = (rows.weight.shape[1] - 1) // 2
    about = slice(max(middle - _ABOUT_PX, 0), middle + _ABOUT_PX + 1)
    number, inverse = rows.weight[:, about].sum(axis=1), rows.inverse[:, about].sum(axis=1)
    z_m: FloatArray = np.where(number > 0, number, np.nan) / np.where(number > 0, inverse, 1.0)
    return z_m


def _spread(rows: ProfileRows) -> FloatArray:
    """Return the sample standard deviation of inverse depth in each row, (n,); NaN for fewer than two pixels."""
    ones = np.ones(rows.weight.shape[1])
    number = rows.weight @ ones
    away = rows.inverse - rows.weight * (rows.inverse @ ones / np.maximum(number, 1))[:, None]
    square = np.einsum("ij,ij->i", away, away)
    spread: FloatArray = np.sqrt(square / np.where(number > 1, number - 1, np.nan))
    return spread
