"""Smoothing of series in time, as far as the data allow it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import FloatArray, IntArray

NOISE_FRAMES = 5
"""Length of the fits whose residuals tell the noise."""

_CONFIDENCE = 2.0
"""Half width of the confidence intervals that have to meet, in standard deviations."""

_JUMP_CONFIDENCE = 4.0
"""A value farther than that from the shortest fit is a jump, not noise: a fold that passes."""

_UNREST_FRAMES = 9
_UNUSUAL = 3.0
"""Mean squares of residuals over 9 frames that exceed the median by this factor are no chance."""


def adaptive_mean(
    time_s: FloatArray, values: FloatArray, frames: Sequence[int], *, degree: int
) -> tuple[FloatArray, FloatArray]:
    """Smooth series in time by the longest local polynomials that agree with the shorter ones.

    Parameters
    ----------
    time_s : (T,) float64
        Ascending, all different.
    values : (T, n) float64
        Series without gaps.
    frames : sequence of int
        Lengths to try, rising, each larger than ``degree + 1``; none leaves the values as they are.
    degree : int
        Of the polynomials.

    Returns
    -------
    smooth, std : (T, n) float64
        The values, and the standard deviation of their noise; larger where the series is restless.
    """
    shortest, gain = local_fit(time_s, values, NOISE_FRAMES, degree)
    noise = 1.4826 * np.median(np.abs(values - shortest) / np.sqrt(np.maximum(1 - gain, 1e-3))[:, None], axis=0)
    restless = unrest(values - shortest)
    best, std = values.copy(), np.broadcast_to(noise, values.shape).copy()
    low, high = values - _JUMP_CONFIDENCE * noise, values + _JUMP_CONFIDENCE * noise
    alive = np.ones(values.shape, dtype=np.bool_)
    for length in frames:
        smooth, gain = local_fit(time_s, values, length, degree)
        own_std = noise * np.sqrt(gain)[:, None]
        low = np.maximum(low, smooth - _CONFIDENCE * own_std)
        high = np.minimum(high, smooth + _CONFIDENCE * own_std)
        alive &= low <= high
        best, std = np.where(alive, smooth, best), np.where(alive, own_std, std)
        if length >= time_s.size or not alive.any():
            break
    return best, np.hypot(std, restless)


def unrest(residual: FloatArray) -> FloatArray:
    """Return by how much residuals around each frame exceed what is usual in their series, (T, n); 0 where they do not.

    Where folds pass or the cloth is seen badly, a series is less certain than its median noise says.

    Parameters
    ----------
    residual : (T, n) float64
        Of short fits.
    """
    frames = min(_UNREST_FRAMES, residual.shape[0])
    sums = np.concatenate([np.zeros((1, residual.shape[1])), (residual**2).cumsum(axis=0)])
    first = np.clip(np.arange(residual.shape[0]) - frames // 2, 0, residual.shape[0] - frames)
    mean_square = (sums[first + frames] - sums[first]) / frames
    usual = np.median(mean_square, axis=0)
    excess: FloatArray = np.sqrt(np.maximum(mean_square - _UNUSUAL * usual, 0))
    return excess


def seconds_apart(stamp_ns: IntArray) -> FloatArray:
    """Return the time since the first of rising stamps, in seconds, (T,).

    Frames of one stamp are kept apart by a nanosecond each: polynomials through them stay solvable.
    """
    return np.asarray((stamp_ns - stamp_ns[0]) / 1e9 + 1e-9 * np.arange(len(stamp_ns)))


def local_fit(time_s: FloatArray, values: FloatArray, frames: int, degree: int) -> tuple[FloatArray, FloatArray]:
    """Fit polynomials to the frames around each; return their values and how much of the noise's variance is left.

    Parameters
    ----------
    time_s : (T,) float64
        Ascending, all different.
    values : (T, n) float64
        Series without gaps.
    frames, degree : int
        Of the fits; near the ends the frame is not in their middle.

    Returns
    -------
    smooth : (T, n) float64
    gain : (T,) float64
    """
    count = min(frames, time_s.size)
    degree = min(degree, count - 1)
    first = np.clip(np.arange(time_s.size) - count // 2, 0, time_s.size - count)
    neighbour = first[:, None] + np.arange(count)
    away_s = time_s[neighbour] - time_s[:, None]
    half_s = np.maximum(np.abs(away_s).max(axis=1, keepdims=True), 1e-9)
    powers = np.ones((time_s.size, degree + 1, count))
    for power in range(1, degree + 1):
        np.multiply(powers[:, power - 1], away_s / half_s, out=powers[:, power])
    normal = powers @ powers.transpose(0, 2, 1)
    terms = np.linalg.solve(normal, np.eye(degree + 1)[:, :1])
    weight = (terms.transpose(0, 2, 1) @ powers)[:, 0]
    gain = np.einsum("ij,ij->i", weight, weight)
    if values.shape[1] == 1:
        return (weight * values[neighbour, 0]).sum(axis=1)[:, None], gain
    smooth = np.zeros_like(values)
    for place in range(count):  # a product with the whole (T, T) matrix would not do for long recordings
        smooth += weight[:, place, None] * values[neighbour[:, place]]
    return smooth, gain


def middle(values: FloatArray) -> float:
    """Return the median of a few finite values, (n,), n > 0, in a tenth of the time that ``np.median`` takes."""
    ordered = np.sort(values)
    return float((ordered[(values.size - 1) // 2] + ordered[values.size // 2]) / 2)
