"""Where one surface ends and another begins, among neighbouring depths."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import BoolArray, DepthImage, FloatArray, IntArray

_ISLAND_ROWS = 5
"""9 mm at 1.07 m."""

_ALONE = 2
"""So many times larger than its neighbours a step is no slope."""


def breaks(step: FloatArray | DepthImage, jump: float) -> BoolArray:
    """Return which steps between neighbours, along the last axis, lead to another surface.

    Parameters
    ----------
    step : (..., n) array
        Sizes of the steps; whole numbers stay below 32768.
    jump : float
        A larger step does. One of half that does if it stands alone: on a steep slope its neighbours are alike.
    """
    beside = np.zeros_like(step)
    np.maximum(step[..., :-2], step[..., 2:], out=beside[..., 1:-1])
    beside[..., :1], beside[..., -1:] = step[..., 1:2], step[..., -2:-1]
    half = jump / 2
    if step.dtype.kind == "u":  # a comparison with whole numbers stays one of short integers
        jump, half = math.floor(jump), math.floor(half)
    broken: BoolArray = (step > jump) | ((step > half) & (step > _ALONE * beside))
    return broken


def pieces(middle_m: FloatArray, jump_m: float) -> IntArray:
    """Return the numbers, from 0, of the pieces that the rows of a profile are on, (n,), by their depths, (n,)."""
    return np.concatenate([[0], np.cumsum(breaks(np.abs(middle_m[1:] - middle_m[:-1]), jump_m))])


def _inner(middle_m: FloatArray, jump_m: float) -> list[tuple[int, int]]:
    """Return where every piece but the first and the last begins, and where the next one does."""
    begins: list[int] = (np.flatnonzero(breaks(np.abs(middle_m[1:] - middle_m[:-1]), jump_m)) + 1).tolist()
    return list(pairwise(begins))


def without_islands(index: IntArray, middle_m: FloatArray, jump_m: float) -> IntArray:
    """Leave out pieces of few rows between two rows of one surface.

    There the edge of another layer grazes the plane of the profile: half a pixel to the side it would not be on it, yet
    the way to it and back would count twice.

    Parameters
    ----------
    index : (n,) int64
        Rows of the profile, from the gripper down.
    middle_m : (n,) float64
        Their depths.
    jump_m : float
        See :func:`breaks`.
    """
    kept = np.ones(middle_m.size, dtype=np.bool_)
    for start, end in _inner(middle_m, jump_m):
        if end - start <= _ISLAND_ROWS and abs(middle_m[end] - middle_m[start - 1]) <= jump_m:
            kept[start:end] = False
    return index[kept]


def doubtful_islands(
    index: IntArray, kept: IntArray, middle_m: FloatArray, jump_m: float
) -> tuple[IntArray, FloatArray]:
    """Find what may be an island or not: those left out, and those up to twice as high that were not.

    Parameters
    ----------
    index, kept : (n,), (k,) int64
        Rows of the profile before and after :func:`without_islands`.
    middle_m : (h,) float64
        Depth by row.
    jump_m : float
        See :func:`breaks`.

    Returns
    -------
    row : (m,) int64
        Their first rows.
    way_m : (m,) float64
        Length of the way to each and back, which the profile has or not.
    """
    depth_m = middle_m[index]
    row, way_m = [], []
    for start, end in _inner(depth_m, jump_m):
        before_m, after_m = depth_m[start - 1], depth_m[end]
        left_out = index[start] not in kept
        if left_out or (end - start <= 2 * _ISLAND_ROWS and abs(after_m - before_m) <= jump_m):
            island_m = float(np.median(depth_m[start:end]))
            row.append(int(index[start]))
            way_m.append(float(abs(island_m - before_m) + abs(island_m - after_m)))
    return np.array(row, np.int64), np.array(way_m, np.float64)
