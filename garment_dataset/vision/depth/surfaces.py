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
class Cloth:
    """What is to be known of the rows that show cloth, of one image or of several one after another.

    Parameters
    ----------
    image, row : (k,) int64
        Rising; rows within each image.
    piece : (k,) int64
        Which piece of its image's profile each belongs to, rising: no window reaches from one into another.
    v : (k,) float64
        Of the row, in pixels.
    middle_m : (k,) float64
        Median depth on the profile.
    gripper_x_m : (k,) float64
        Where the plane x = x_gripper is.
    moments : (w, 8, k) float64
        By window, sums of 1, u to u⁴, and q, u q, u² q over the pixels of the row; u from the profile, in half widths.
    """

    image: IntArray
    row: IntArray
    piece: IntArray
    v: FloatArray
    middle_m: FloatArray
    gripper_x_m: FloatArray
    moments: FloatArray


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


def cloth_of(
    rows: ProfileRows, index: IntArray, piece: IntArray, gripper_x_m: float, windows_px: Sequence[tuple[int, int]]
) -> Cloth:
    """Sum up the rows of one image.

    Parameters
    ----------
    rows : ProfileRows
        Pixels of all rows.
    index, piece : (k,) int64
        The rows that show cloth, and the pieces they belong to.
    gripper_x_m : float
        Where the plane x = x_gripper is.
    windows_px : sequence of (int, int)
        Half widths and half heights.
    """
    moments = np.stack([row_moments(rows, half_width).take(index, axis=1) for half_width, _ in windows_px])
    same = np.zeros(index.size, dtype=np.int64)
    x_m = np.full(index.size, gripper_x_m)
    return Cloth(same, index, piece, rows.v[index], rows.middle_m[index], x_m, moments)


def joined(cloths: Sequence[Cloth]) -> Cloth:
    """Put the rows of several images one after another."""
    image = np.repeat(np.arange(len(cloths)), [cloth.row.size for cloth in cloths])
    row, piece, v, middle_m, gripper_x_m = (
        np.concatenate([getattr(cloth, name) for cloth in cloths])
        for name in ("row", "piece", "v", "middle_m", "gripper_x_m")
    )
    moments = np.concatenate([cloth.moments for cloth in cloths], axis=2)
    return Cloth(image, row, piece, v, middle_m, gripper_x_m, moments)


def fit_surfaces(cloth: Cloth, intrinsics: Intrinsics, windows_px: Sequence[tuple[int, int]]) -> Surfaces:
    r"""Fit second-order surfaces to the windows around every row.

    Parameters
    ----------
    cloth : Cloth
        The k rows that show cloth. Of several images at once: each gets the same surfaces as alone.
    intrinsics : Intrinsics
        Of the images.
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
    fits = []
    for half_px, moments in zip(windows_px, cloth.moments, strict=True):
        normal, right = _normal_equations(moments, cloth, half_px[1])
        prior = _prior(half_px, cloth.middle_m, intrinsics)
        # the terms of first order come first: a plane in the same window costs no more sums
        plane = normal[:3, :3].copy(), right[:3].copy(), prior[:3], half_px
        fits.append(_solve(normal, right, prior, half_px))
    fits.append(_solve(*plane))
    at_column, across, down, pixels, gain = (np.stack(part) for part in zip(*fits, strict=True))
    # u - c_x = f_x x_g q and q = a + b (u - u_0), u_0 the column at which a holds
    offset_px = intrinsics.fx_px * cloth.gripper_x_m / cloth.middle_m
    inverse = (at_column - across * offset_px) / (1 - across * intrinsics.fx_px * cloth.gripper_x_m)
    lean = -across * intrinsics.fx_px / (inverse - across * offset_px)
    return Surfaces(inverse, down, lean, np.rint(pixels).astype(np.int64), gain)


def row_moments(rows: ProfileRows, half_width: int) -> FloatArray:
    """Sum 1, u to u⁴, and q, u q, u² q over the pixels of each row, (8, n); u from the profile, in half widths."""
    reach = (rows.weight.shape[1] - 1) // 2
    inside = slice(reach - half_width, reach + half_width + 1)
    step = np.arange(-half_width, half_width + 1, dtype=np.float64) / half_width
    powers = np.vander(step, 5, increasing=True)
    moments = np.empty((8, rows.v.size))
    moments[:5] = (rows.weight[:, inside] @ powers).T
    moments[5:] = (rows.inverse[:, inside] @ powers[:, :3]).T
    # the pixels lie at whole columns, the profile between two
    shift = rows.shift_px / half_width
    _shift(moments[:5], shift)
    _shift(moments[5:], shift)
    return moments


def _shift(sums: FloatArray, shift: FloatArray) -> None:
    """Make sums of (u + shift)^p of those of u^p, (p, n), in place: Pascal's triangle, one row after another."""
    for power in range(1, sums.shape[0]):
        sums[power:] += shift * sums[power - 1 : -1]


def _normal_equations(moments: FloatArray, cloth: Cloth, half_height: int) -> tuple[FloatArray, FloatArray]:
    """Return the normal equations of the six terms in the window of every row: (6, 6, k) and (6, k)."""
    top = int(cloth.row.min())
    # one line of running sums for every image: they stay small. Rows that show no cloth add nothing
    shape = int(cloth.image[-1]) + 1, int(cloth.row.max()) + 1 - top
    own = cloth.image * shape[1] + cloth.row - top
    lines, v = np.zeros((8, *shape)), np.zeros(shape)
    lines.reshape(8, -1)[:, own] = moments
    v.ravel()[own] = cloth.v / half_height
    v -= (v.sum(axis=1) / np.bincount(cloth.image))[:, None]
    running = np.zeros((shape[0], shape[1] + 1))
    along = running.ravel()
    low, high = (cloth.image * running.shape[1] + row - top for row in _windows(cloth, half_height))
    ones, values = np.empty((5, 5, low.size)), np.empty((3, 3, low.size))
    for sums, products in ((ones, lines[:5]), (values, lines[5:])):
        for p in range(len(sums)):
            for s in range(len(sums) - p):
                np.cumsum(products[p], axis=1, out=running[:, 1:])
                np.subtract(along.take(high), along.take(low), out=sums[p, s])
                products[p] *= v
            _shift(sums[p, : len(sums) - p], -v.ravel()[own])
    table = np.array(_POWERS)
    across, down = (table[:, None] + table).transpose(2, 0, 1)
    return ones[across, down], values[table[:, 0], table[:, 1]]


def _windows(cloth: Cloth, half_height: int) -> tuple[IntArray, IntArray]:
    """Return the first image row in the window of each row, and the one behind its last."""
    parted = (cloth.image[1:] != cloth.image[:-1]) | (cloth.piece[1:] != cloth.piece[:-1])
    begins = np.concatenate([[0], np.flatnonzero(parted) + 1, [parted.size + 1]])
    size = np.diff(begins)
    first, last = np.repeat(cloth.row[begins[:-1]], size), np.repeat(cloth.row[begins[1:] - 1], size)
    return np.maximum(cloth.row - half_height, first), np.minimum(cloth.row + half_height, last) + 1


def _prior(half_px: tuple[int, int], middle_m: FloatArray, intrinsics: Intrinsics) -> FloatArray:
    """Return the weight of what is known beforehand of each term, in pixels, (6, k); of the level nothing is."""
    noise = LEVEL_SPACING_PER_M * NOISE_LEVELS
    half_m = np.array(half_px)[:, None] * middle_m / np.array([[intrinsics.fx_px], [intrinsics.fy_px]])
    slope_m, bend_m = _STANDARD_SLOPE * half_m, HIDDEN_CURVATURE_PER_M * half_m**2 / 2
    mixed_m = HIDDEN_CURVATURE_PER_M * half_m[0] * half_m[1]
    expected = np.stack([slope_m[0], slope_m[1], bend_m[0], mixed_m, bend_m[1]]) / middle_m**2
    weight = np.zeros((6, middle_m.size))
    weight[1:] = PIXELS_PER_INDEPENDENT * (noise / expected) ** 2
    return weight


def _solve(
    normal: FloatArray, right: FloatArray, prior: FloatArray, half_px: tuple[int, int]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return level, slopes across and down in 1/m per pixel, number of pixels, and the level's gain, each (k,).

    Terms are eliminated from the last to the first, all rows at once: what is left of the level's own entry is one over
    its gain, and of the others only the slopes are wanted. What is given is overwritten.
    """
    terms = right.shape[0]
    pixels = normal[0, 0].copy()
    normal[range(terms), range(terms)] += prior
    for last in range(terms - 1, 0, -1):
        share = normal[:last, last] / normal[last, last]
        normal[:last, :last] -= share[:, None] * normal[last, :last]
        right[:last] -= share * right[last]
    level = right[0] / normal[0, 0]
    across = (right[1] - normal[1, 0] * level) / normal[1, 1]
    down = (right[2] - normal[2, 0] * level - normal[2, 1] * across) / normal[2, 2]
    return level, across / half_px[0], down / half_px[1], pixels, np.maximum(1 / normal[0, 0], 0)
