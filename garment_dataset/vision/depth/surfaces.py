r"""Second-order surfaces fitted to inverse depth in windows around every row of a profile.

Cloth is curved: a plane is biased on it as soon as it is large, and noisy when it is small. A surface of six terms,
:math:`q = a + b u + c v + d u^2 + e u v + f v^2`, follows a bend within its window and can be larger.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.vision.depth.cloud import LEVEL_SPACING_PER_M, NOISE_LEVELS, PIXELS_PER_INDEPENDENT
from garment_dataset.vision.depth.support import HIDDEN_CURVATURE_PER_M

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, FloatArray, IntArray
    from garment_dataset.vision.depth.cloud import Intrinsics

_POWERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
"""Of u and v, term by term."""

_STANDARD_SLOPE = 1.0
"""Of the sheet against the image plane, before anything is seen of it: that keeps windows of few rows solvable."""


@dataclass(frozen=True, slots=True, eq=False)
class ProfileRows:
    """Pixels around the profile, by image row: weight and inverse depth."""

    v: FloatArray  # (n,)
    weight: FloatArray  # (n, m), 1 or 0
    inverse: FloatArray  # (n, m), 0 where the weight is
    shift_px: FloatArray  # (n,), from the profile's column to the middle column of the pixels
    column_px: FloatArray  # (n,), the profile's column in the image
    middle_m: FloatArray  # (n,), median depth there; NaN where there is none
    filled: BoolArray  # (n,)


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """What the surfaces around the rows of a profile say of it, one row of each array per surface.

    Parameters
    ----------
    inverse : (w, k) float64
        Inverse depth on the profile, 1/m.
    down : (w, k) float64
        Its slope down the rows, 1/m per pixel.
    lean : (w, k) float64
        Slope dz/dx of the sheet.
    pixels : (w, k) int64
        Number of pixels in the window.
    gain : (w, k) float64
        Variance of the inverse depth over that of one pixel, if these were independent.
    """

    inverse: FloatArray
    down: FloatArray
    lean: FloatArray
    pixels: IntArray
    gain: FloatArray


def fit_surfaces(
    rows: ProfileRows,
    index: IntArray,
    piece: IntArray,
    intrinsics: Intrinsics,
    gripper_x_m: float,
    windows_px: Sequence[tuple[int, int]],
) -> Surfaces:
    r"""Fit second-order surfaces to the windows around every row.

    Parameters
    ----------
    rows : ProfileRows
        Pixels of all rows.
    index : (k,) int64
        The rows that show cloth.
    piece : (k,) int64
        Which piece of the profile each belongs to, rising: no window reaches from one into another.
    intrinsics : Intrinsics
        Of the image.
    gripper_x_m : float
        Where the plane x = x_gripper is.
    windows_px : sequence of (int, int)
        Half widths and half heights, w of them.

    Returns
    -------
    Surfaces
        One for each of these rows: by window, and last the plane in the last window.

    Notes
    -----
    Least squares, with what is known of cloth beforehand as a small weight on the terms: its slopes are about 1, its
    curvatures about 20 / m. That matters where a window holds few pixels. The sums over a window are differences of
    running sums of the rows' moments, so that its size costs nothing.
    """
    first = index[np.searchsorted(piece, piece, side="left")]
    stop = index[np.searchsorted(piece, piece, side="right") - 1] + 1
    usable = np.zeros(rows.v.size, dtype=np.bool_)
    usable[index] = True
    middle_m = rows.middle_m[index]
    fits = []
    for half_px in windows_px:
        half_width, half_height = half_px
        low, high = np.maximum(index - half_height, first), np.minimum(index + half_height + 1, stop)
        moments = _row_moments(rows, usable, half_width)
        normal, right = _normal_equations(moments, rows.v / half_height, index, low, high)
        prior = _prior(half_px, middle_m, intrinsics)
        fits.append(_solve(normal, right, prior, half_px))
    # the terms of first order come first: a plane in the largest window costs no more sums
    fits.append(_solve(normal[:, :3, :3], right[:, :3], prior[:, :3], windows_px[-1]))
    at_column, across, down, pixels, gain = (np.stack(part) for part in zip(*fits, strict=True))
    # u - c_x = f_x x_g q and q = a + b (u - u_0), u_0 the column at which a holds
    offset_px = intrinsics.fx_px * gripper_x_m / middle_m
    inverse = (at_column - across * offset_px) / (1 - across * intrinsics.fx_px * gripper_x_m)
    lean = -across * intrinsics.fx_px / (inverse - across * offset_px)
    return Surfaces(inverse, down, lean, np.rint(pixels).astype(np.int64), gain)


def _row_moments(rows: ProfileRows, usable: BoolArray, half_width: int) -> FloatArray:
    """Sum 1, u to u⁴, and q, u q, u² q over the pixels of each row, (8, n); u from the profile, in half widths."""
    reach = (rows.weight.shape[1] - 1) // 2
    inside = slice(reach - half_width, reach + half_width + 1)
    step = np.arange(-half_width, half_width + 1, dtype=np.float64) / half_width
    powers = step[:, None] ** np.arange(5)
    ones, values = rows.weight[:, inside] @ powers, rows.inverse[:, inside] @ powers[:, :3]
    # the pixels lie at whole columns, the profile between two
    shift = rows.shift_px / half_width
    sums = np.concatenate([_shifted(ones.T, shift), _shifted(values.T, shift)])
    moments: FloatArray = sums * usable
    return moments


def _shifted(sums: FloatArray, shift: FloatArray) -> FloatArray:
    """Return the sums of (u + shift)^p from those of u^p, (p, n)."""
    result = np.zeros_like(sums)
    for power in range(sums.shape[0]):
        choose = 1.0
        for lower in range(power, -1, -1):
            result[power] += choose * shift ** (power - lower) * sums[lower]
            choose = choose * lower / (power - lower + 1)
    return result


def _normal_equations(
    moments: FloatArray, v: FloatArray, index: IntArray, low: IntArray, high: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return the normal equations of the six terms in the window of every row: (k, 6, 6) and (k, 6)."""
    order = {(p, s): place for place, (p, s) in enumerate((p, s) for p in range(5) for s in range(5 - p))}
    own = v - v.mean()
    powers = own ** np.arange(5)[:, None]
    columns = [moments[p] * powers[s] for p, s in order]
    columns += [moments[5 + p] * powers[s] for p, s in _POWERS]
    sums = np.concatenate([np.zeros((len(columns), 1)), np.cumsum(columns, axis=1)], axis=1)
    window = sums[:, high] - sums[:, low]
    away = -own[index]
    ones = np.empty((len(order), index.size))
    for p in range(5):
        block = [order[p, s] for s in range(5 - p)]
        ones[block] = _shifted(window[block], away)
    values = np.empty((len(_POWERS), index.size))
    place = {power: len(order) + i for i, power in enumerate(_POWERS)}
    for p in range(3):
        block = [place[p, s] for s in range(3 - p)]
        values[[i - len(order) for i in block]] = _shifted(window[block], away)
    table = [[order[p + q, s + t] for q, t in _POWERS] for p, s in _POWERS]
    return ones[table].transpose(2, 0, 1), values.T


def _prior(half_px: tuple[int, int], middle_m: FloatArray, intrinsics: Intrinsics) -> FloatArray:
    """Return the weight of what is known beforehand of each term, in pixels, (k, 6); of the level nothing is."""
    noise = LEVEL_SPACING_PER_M * NOISE_LEVELS
    half_m = np.array(half_px)[:, None] * middle_m / np.array([[intrinsics.fx_px], [intrinsics.fy_px]])
    slope_m, bend_m = _STANDARD_SLOPE * half_m, HIDDEN_CURVATURE_PER_M * half_m**2 / 2
    mixed_m = HIDDEN_CURVATURE_PER_M * half_m[0] * half_m[1]
    expected = np.stack([slope_m[0], slope_m[1], bend_m[0], mixed_m, bend_m[1]]) / middle_m**2
    weight = np.zeros((middle_m.size, 6))
    weight[:, 1:] = (PIXELS_PER_INDEPENDENT * (noise / expected) ** 2).T
    return weight


def _solve(
    normal: FloatArray, right: FloatArray, prior: FloatArray, half_px: tuple[int, int]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return level, slopes across and down in 1/m per pixel, number of pixels, and the level's gain, each (k,)."""
    pixels = normal[:, 0, 0].copy()
    damped = normal + prior[:, :, None] * np.eye(prior.shape[1])
    unit = np.zeros_like(right)
    unit[:, 0] = 1
    solved = np.linalg.solve(damped, np.stack([right, unit], axis=2))
    terms: FloatArray = solved[:, :, 0].astype(np.float64)
    gain: FloatArray = np.maximum(solved[:, 0, 1], 0).astype(np.float64)
    return terms[:, 0], terms[:, 1] / half_px[0], terms[:, 2] / half_px[1], pixels, gain
