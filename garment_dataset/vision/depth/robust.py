"""Polynomials through values of which some are outliers, several series at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, FloatArray

_OUTLIER = 3.0
_ROUNDS = 3


def robust_polynomials(
    at: Sequence[FloatArray], values: Sequence[FloatArray], degree: int, raster: FloatArray
) -> FloatArray:
    """Return polynomials of least squares through values, outliers left out, each on a raster of its own.

    Parameters
    ----------
    at, values : sequences, length s, of (n,) float64
        Where each value was seen, and the value; n differs from series to series.
    degree : int
        Of the polynomials.
    raster : (s, k) float64
        Where their values are wanted.

    Returns
    -------
    (s, k) float64

    Notes
    -----
    Places are scaled to [-1, 1], so that the normal equations of a cubic lose no more than four of sixteen digits.
    What is farther away than three standard deviations, by the median distance, is left out, twice.
    """
    size = np.array([each.size for each in values])
    seen = np.arange(size.max()) < size[:, None]
    place, value = np.zeros(seen.shape), np.zeros(seen.shape)
    place[seen], value[seen] = np.concatenate(at), np.concatenate(values)
    highest = np.where(seen, place, -np.inf).max(axis=1, keepdims=True)
    lowest = np.where(seen, place, np.inf).min(axis=1, keepdims=True)
    middle, half = (highest + lowest) / 2, (highest - lowest) / 2
    powers = _powers((place - middle) / half, degree)
    kept = seen
    for _ in range(_ROUNDS):
        used = powers * kept[:, None]
        terms = np.linalg.solve(used @ powers.transpose(0, 2, 1), used @ value[:, :, None])
        away = np.abs(value - (terms.transpose(0, 2, 1) @ powers)[:, 0])
        kept = seen & (away <= _OUTLIER * 1.4826 * _medians(away, seen, size) + 1e-9)
    on_raster: FloatArray = (terms.transpose(0, 2, 1) @ _powers((raster - middle) / half, degree))[:, 0]
    return on_raster


def _powers(x: FloatArray, degree: int) -> FloatArray:
    """Return x to the power 0, 1, …, ``degree``, (s, degree + 1, n)."""
    powers = np.ones((x.shape[0], degree + 1, x.shape[1]))
    for power in range(1, degree + 1):
        powers[:, power] = powers[:, power - 1] * x
    return powers


def _medians(values: FloatArray, seen: BoolArray, size: FloatArray) -> FloatArray:
    """Return the medians of what is seen of each series, (s, 1)."""
    ordered, series = np.sort(np.where(seen, values, np.inf), axis=1), np.arange(size.size)
    medians: FloatArray = (ordered[series, (size - 1) // 2] + ordered[series, size // 2])[:, None] / 2
    return medians
