"""Planes fitted to inverse depth in windows around every row of a profile."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.vision.depth.cloud import LEVEL_SPACING_PER_M, NOISE_LEVELS, PIXELS_PER_INDEPENDENT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, FloatArray, IntArray
    from garment_dataset.vision.depth.cloud import Intrinsics

_AGREEMENT = 2.0
"""So many standard uncertainties two windows may differ by; the larger one fades out up to one more."""


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
class Planes:
    """What the planes around the rows of a profile say of it.

    Parameters
    ----------
    inverse : (k,) float64
        Inverse depth on the profile, 1/m.
    down : (k,) float64
        Its slope down the rows, 1/m per pixel.
    lean : (k,) float64
        Slope dz/dx of the sheet.
    pixels : (k,) int64
        Number of pixels that the fits rest on.
    """

    inverse: FloatArray
    down: FloatArray
    lean: FloatArray
    pixels: IntArray


def fit_windows(
    rows: ProfileRows,
    index: IntArray,
    piece: IntArray,
    intrinsics: Intrinsics,
    gripper_x_m: float,
    windows_px: Sequence[tuple[int, int]],
) -> Planes:
    """Fit planes in windows of several sizes, and keep for every row the largest that agrees with the smaller ones.

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
        Half widths and half heights, rising.

    Returns
    -------
    Planes
        One for each of these rows.
    """
    first = index[np.searchsorted(piece, piece, side="left")]
    stop = index[np.searchsorted(piece, piece, side="right") - 1] + 1
    usable = np.zeros(rows.v.size, dtype=np.bool_)
    usable[index] = True
    v = rows.v - rows.v.mean()
    fits = []
    for (_, half_height), moments in zip(windows_px, _row_moments(rows, usable, windows_px), strict=True):
        low, high = np.maximum(index - half_height, first), np.minimum(index + half_height + 1, stop)
        fits.append(_planes(moments, v, index, low, high))
    best, pixels, best_gain = fits[0]
    share = np.ones(index.size)
    for plane, count, gain in fits[1:]:
        noise = LEVEL_SPACING_PER_M * NOISE_LEVELS * np.sqrt(PIXELS_PER_INDEPENDENT * best_gain)
        share = share * np.clip(_AGREEMENT + 1 - np.abs(plane[0] - best[0]) / noise, 0, 1)
        best = best + share * (plane - best)
        pixels, best_gain = pixels + share * (count - pixels), best_gain + share * (gain - best_gain)
    at_column, across, down = best
    # u - c_x = f_x x_g q and q = a + b (u - u_0), u_0 the column at which a holds
    offset_px = intrinsics.fx_px * gripper_x_m / rows.middle_m[index]
    inverse = (at_column - across * offset_px) / (1 - across * intrinsics.fx_px * gripper_x_m)
    lean = -across * intrinsics.fx_px / (inverse - across * offset_px)
    return Planes(inverse, down, lean, np.rint(pixels).astype(np.int64))


def _row_moments(rows: ProfileRows, usable: BoolArray, windows_px: Sequence[tuple[int, int]]) -> FloatArray:
    """Sum 1, u, u², q and u q over the pixels of each row, (windows, 5, n), u from the profile's column."""
    reach = (rows.weight.shape[1] - 1) // 2
    step = np.arange(-reach, reach + 1, dtype=np.float64)
    inside = np.stack([np.abs(step) <= half_width for half_width, _ in windows_px], axis=1).astype(np.float64)
    powers = step[:, None] ** np.arange(3)
    basis = (inside[:, :, None] * powers[:, None, :]).reshape(step.size, -1)
    n, s_u, s_uu = (rows.weight @ basis).reshape(-1, len(windows_px), 3).transpose(2, 1, 0) * usable
    s_q, s_uq, _ = (rows.inverse @ basis).reshape(-1, len(windows_px), 3).transpose(2, 1, 0) * usable
    # the pixels lie at whole columns, the profile between two
    shift = rows.shift_px
    return np.stack([n, s_u + shift * n, s_uu + 2 * shift * s_u + shift**2 * n, s_q, s_uq + shift * s_q], axis=1)


def _planes(
    moments: FloatArray, v: FloatArray, index: IntArray, low: IntArray, high: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit q = a + b du + c dv by least squares to the window of every row.

    Returns
    -------
    plane : (3, k) float64
        a, b, c.
    pixels : (k,) float64
        Number of pixels in the window.
    gain : (k,) float64
        Variance of a over that of one pixel, if these were independent.
    """
    n, s_u, s_uu, s_q, s_uq = moments
    columns = np.stack([n, s_u, s_uu, s_q, s_uq, v * n, v * s_u, v * v * n, v * s_q])
    sums = np.concatenate([np.zeros((9, 1)), columns.cumsum(axis=1)], axis=1)
    n, s_u, s_uu, s_q, s_uq, s_v, s_uv, s_vv, s_vq = sums[:, high] - sums[:, low]
    own = v[index]
    s_vv = s_vv - 2 * own * s_v + own**2 * n
    s_uv, s_vq, s_v = s_uv - own * s_u, s_vq - own * s_q, s_v - own * n
    # a hair of damping keeps windows of one row or one column solvable: their slope is then 0
    s_uu, s_vv = s_uu + 1e-3 * n, s_vv + 1e-3 * n
    # the symmetric 3 x 3 system by cofactors
    c_nn, c_nu, c_nv = s_uu * s_vv - s_uv**2, s_v * s_uv - s_u * s_vv, s_u * s_uv - s_v * s_uu
    c_uu, c_uv, c_vv = n * s_vv - s_v**2, s_u * s_v - n * s_uv, n * s_uu - s_u**2
    determinant = n * c_nn + s_u * c_nu + s_v * c_nv
    plane = np.stack(
        [
            c_nn * s_q + c_nu * s_uq + c_nv * s_vq,
            c_nu * s_q + c_uu * s_uq + c_uv * s_vq,
            c_nv * s_q + c_uv * s_uq + c_vv * s_vq,
        ]
    )
    return plane / determinant, n, c_nn / determinant
