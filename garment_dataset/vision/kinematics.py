"""Displacement from rest, velocity and acceleration of tracked points: thesis 5.3.5.

Positions are ``(T, P, 3)`` float64 in metres, NaN where a point was not found; stamps are ``(T,)`` int64 nanoseconds,
ascending. Stamps are only subtracted as integers: a float64 cannot hold nanoseconds since 1970.
"""

from __future__ import annotations

from bisect import bisect_left
from math import factorial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import BoolArray, FloatArray, IntArray

MEDIAN_STD = 1.2533
"""Standard deviation of a median over that of a mean, of many normal values: sqrt(pi / 2)."""


FIXED_REACH_M = 0.05
"""Way over which errors that are fixed in the image change: half a window of 20 px at 1 m, 4 cm, and the pattern."""


def increasing(stamp_ns: IntArray) -> BoolArray:
    """Say which stamps to keep so that they rise: as many as can be, of two that exclude each other the first.

    Parameters
    ----------
    stamp_ns : (T,) int64
        In the order in which the frames came.

    Returns
    -------
    (T,) bool
        The longest strictly rising subsequence: one wrong stamp takes none with it.
    """
    stamps = stamp_ns.tolist()
    lowest: list[int] = []  # last stamp of a rising subsequence of each length, as low as can be
    length = np.zeros(len(stamps), np.int64)
    for index, stamp in enumerate(stamps):
        place = bisect_left(lowest, stamp)
        lowest[place : place + 1] = [stamp]
        length[index] = place + 1
    kept = np.zeros(len(stamps), np.bool_)
    after, end = None, len(stamps)
    for wanted in range(len(lowest), 0, -1):
        fitting = np.flatnonzero(length[:end] == wanted)
        end = next(int(index) for index in fitting if after is None or stamps[index] < after)
        after, kept[end] = stamps[end], True
    return kept


def displacement(
    position_m: FloatArray, std_m: FloatArray, at_rest: BoolArray, fixed_m: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    r"""Subtract the rest position: the median of the frames at rest.

    Parameters
    ----------
    position_m, std_m : (T, P, 3) float64
        Positions and their standard uncertainties; an uncertainty of NaN means unknown.
    at_rest : (T,) bool
        Frames before the onset.
    fixed_m : (T, P, 3) float64, optional
        The part of the uncertainties that stays as it is as long as a point does not move; by default none.

    Returns
    -------
    displacement_m, displacement_std_m : (T, P, 3) float64
        NaN for a point that was never found at rest.

    Notes
    -----
    The rest is taken as independent from frame to frame. Fixed errors cancel while a point is where it was at rest;
    their correlation with those at rest falls with the way d as :math:`\exp(-d^2 / 2 L^2)`, L being
    :data:`FIXED_REACH_M`.
    """
    rest_m, rest_std_m, rest_fixed_m = (np.full(position_m.shape[1:], np.nan) for _ in range(3))
    fixed_m = np.zeros_like(std_m) if fixed_m is None else np.where(np.isfinite(fixed_m), fixed_m, 0.0)
    varying_m = np.sqrt(np.maximum(std_m**2 - fixed_m**2, 0))
    seen = _found(position_m) & at_rest[:, None]
    for point in np.flatnonzero(seen.any(axis=0)):
        frames = np.flatnonzero(seen[:, point])
        rest_m[point] = np.median(position_m[frames, point], axis=0)
        mean_variance = (varying_m[frames, point] ** 2).mean(axis=0) / frames.size
        rest_std_m[point] = np.sqrt(mean_variance) * (MEDIAN_STD if frames.size > 2 else 1)
        rest_fixed_m[point] = np.sqrt((fixed_m[frames, point] ** 2).mean(axis=0))
    moved_m = position_m - rest_m
    common = np.exp(-(moved_m**2).sum(axis=2, keepdims=True) / (2 * FIXED_REACH_M**2))
    changed_m2 = fixed_m**2 + rest_fixed_m**2 - 2 * common * fixed_m * rest_fixed_m
    return moved_m, np.sqrt(varying_m**2 + rest_std_m**2 + np.maximum(changed_m2, 0))


def with_fixed_errors(derivatives: Derivatives, fixed_m: FloatArray) -> Derivatives:
    """Return derivatives with what fixed errors of positions add to their uncertainties as the points move.

    Parameters
    ----------
    derivatives : Derivatives
        With the uncertainties from what varies from frame to frame.
    fixed_m : (T, P, 3) float64
        Standard uncertainty of positions by errors fixed in the image; NaN: unknown, and taken as 0.

    Notes
    -----
    An error that changes over the way L, :data:`FIXED_REACH_M`, and is met at the speed v, has derivatives of the order
    of v / L and (v / L)² of it.
    """
    velocity_m_s, velocity_std_m_s, acceleration_m_s2, acceleration_std_m_s2 = derivatives
    fixed_m = np.where(np.isfinite(fixed_m), fixed_m, 0.0)
    rate_1_s = np.sqrt((velocity_m_s**2).sum(axis=2, keepdims=True)) / FIXED_REACH_M
    return Derivatives(
        velocity_m_s,
        np.hypot(velocity_std_m_s, fixed_m * rate_1_s),
        acceleration_m_s2,
        np.hypot(acceleration_std_m_s2, fixed_m * rate_1_s**2),
    )


def differences(
    stamp_ns: IntArray, position_m: FloatArray, std_m: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Divide the way to the next frame by its time, as the thesis does.

    Parameters
    ----------
    stamp_ns : (T,) int64
        Ascending, all different.
    position_m, std_m : (T, P, 3) float64
        Positions and their standard uncertainties.

    Returns
    -------
    velocity_stamp_ns : (T,) int64
        Middle between a frame and the next, where the difference is the velocity up to second order.
    velocity_m_s, velocity_std_m_s : (T, P, 3) float64
        NaN in the last frame, and where either position is NaN.
    """
    interval_ns = np.diff(stamp_ns, append=stamp_ns[-1:])
    interval_s = np.where(interval_ns > 0, interval_ns / 1e9, np.nan)[:, None, None]  # the last has no next
    after = np.minimum(np.arange(stamp_ns.size) + 1, stamp_ns.size - 1)
    velocity_m_s = (position_m[after] - position_m) / interval_s
    return stamp_ns + interval_ns // 2, velocity_m_s, np.hypot(std_m[after], std_m) / interval_s


class Derivatives(NamedTuple):
    """What a local polynomial says, with standard uncertainties; all (T, P, 3) float64."""

    velocity_m_s: FloatArray
    velocity_std_m_s: FloatArray
    acceleration_m_s2: FloatArray
    acceleration_std_m_s2: FloatArray


def local_polynomial(
    stamp_ns: IntArray, position_m: FloatArray, std_m: FloatArray, *, frames: int, degree: int
) -> Derivatives:
    r"""Fit a polynomial in the true stamps around every frame, and take its first two derivatives there.

    Parameters
    ----------
    stamp_ns : (T,) int64
        Ascending, all different.
    position_m, std_m : (T, P, 3) float64
        Positions and their standard uncertainties.
    frames : int
        Odd number of frames that a fit is made of. The frame itself is in their middle, except near the ends.
    degree : int
        Of the polynomial; motion that is such a polynomial gets its exact velocity and acceleration. That of a line
        is not known: NaN.

    Returns
    -------
    Derivatives
        NaN where the position is, and where fewer than ``degree + 1`` positions are left around the frame.

    Notes
    -----
    Least squares, unweighted, on :math:`\tau = (t_k - t_i) / T` with T the half width of the fit: derivative n is
    :math:`\sum_k c_k p_k` with :math:`c = n! (A^T A)^{-1}_{n,:} A^T / T^n`, its variance
    :math:`\sum_k c_k^2 \sigma_k^2`. Where the positions scatter more about the polynomial than they should, as where a
    fold passes, the variance is :math:`s^2 \sum_k c_k^2` instead, with :math:`s^2` the sum of squared residuals over
    the degrees of freedom (Birge, 1932). Errors are taken as independent from frame to frame.
    """
    fits = _fits_around(stamp_ns, position_m, frames, degree)
    others_std_m = np.where(fits.weight[:, :, None], std_m[fits.others], 0)
    scatter_m2 = _scatter_m2(fits.elapsed_s, fits.weight, fits.away_m, degree)
    derivatives = _derivatives(fits, position_m.shape, degree)
    missed = _curvature_missed(derivatives, stamp_ns, position_m, frames, degree)
    stds = np.full((2, *position_m.shape), np.nan)
    for order in range(1, min(degree, 2) + 1):
        coefficients = fits.coefficients(degree, order)
        stated = ((coefficients * others_std_m) ** 2).sum(axis=1)
        seen = (coefficients**2).sum(axis=1) * scatter_m2
        stds[order - 1][fits.own] = np.sqrt(np.maximum(stated, seen) + missed[order - 1][fits.own])
    return Derivatives(derivatives[0], stds[0], derivatives[1], stds[1])


class _Fits(NamedTuple):
    """What the polynomials are fitted to, one around each of n positions that has enough others around it."""

    own: tuple[IntArray, IntArray]  # frames and points (n,)
    others: tuple[IntArray, IntArray]  # frames (n, k) around each, and points (n, 1)
    weight: BoolArray  # (n, k), whether that position was found
    elapsed_s: FloatArray  # (n, k)
    away_m: FloatArray  # (n, k, 3), 0 where it was not

    def coefficients(self, degree: int, order: int) -> FloatArray:
        """Return what a derivative is the sum of the positions with, (n, k, 1)."""
        found: FloatArray = _coefficients(self.elapsed_s, self.weight.astype(np.float64), degree, order)[:, :, None]
        return found


def _fits_around(stamp_ns: IntArray, position_m: FloatArray, frames: int, degree: int) -> _Fits:
    found = _found(position_m)
    first = np.clip(np.arange(stamp_ns.size) - frames // 2, 0, max(stamp_ns.size - frames, 0))
    neighbour = first[:, None] + np.arange(min(frames, stamp_ns.size))
    used = found[neighbour]
    frame, point = np.nonzero(found & (used.sum(axis=1) > degree))
    weight = used[frame, :, point]
    elapsed_s = ((stamp_ns[neighbour] - stamp_ns[:, None]) / 1e9)[frame]
    others = neighbour[frame], point[:, None]
    away_m = np.where(weight[:, :, None], position_m[others] - position_m[frame, point][:, None, :], 0)
    return _Fits((frame, point), others, weight, elapsed_s, away_m)


def _curvature_missed(
    derivatives: FloatArray, stamp_ns: IntArray, position_m: FloatArray, frames: int, degree: int
) -> tuple[FloatArray, FloatArray]:
    """Return the mean square by which first and second derivatives change in fits of two thirds of the length."""
    shorter = 2 * (frames // 3) + 1
    nothing = np.zeros_like(position_m)
    if shorter <= degree + 1 or shorter == frames:
        return nothing, nothing
    of_shorter = _derivatives(_fits_around(stamp_ns, position_m, shorter, degree), position_m.shape, degree)
    first, second = (
        _running_mean(np.nan_to_num((one - other) ** 2), frames)
        for one, other in zip(derivatives, of_shorter, strict=True)
    )
    return first, second


def _derivatives(fits: _Fits, shape: tuple[int, ...], degree: int) -> FloatArray:
    """Return both derivatives of the fitted polynomials, (2, T, P, 3); NaN where they cannot be had."""
    both = np.full((2, *shape), np.nan)
    for order in range(1, min(degree, 2) + 1):
        both[order - 1][fits.own] = (fits.coefficients(degree, order) * fits.away_m).sum(axis=1)
    return both


def _running_mean(values: FloatArray, frames: int) -> FloatArray:
    """Return means over so many frames around each, along the first axis; fewer at the ends."""
    sums = np.concatenate([np.zeros((1, *values.shape[1:])), values.cumsum(axis=0)])
    last = np.minimum(np.arange(values.shape[0]) + frames // 2 + 1, values.shape[0])
    first = np.maximum(np.arange(values.shape[0]) - frames // 2, 0)
    mean: FloatArray = (sums[last] - sums[first]) / (last - first).reshape(-1, *(1,) * (values.ndim - 1))
    return mean


def _coefficients(elapsed_s: FloatArray, weight: FloatArray, degree: int, order: int) -> FloatArray:
    """Return what each position counts in a derivative at time 0 of the fitted polynomial, (K, n) as both inputs."""
    powers, half_width_s = _powers(elapsed_s, weight, degree)
    wanted = np.zeros((elapsed_s.shape[0], degree + 1, 1))
    wanted[:, order] = factorial(order)
    inverse_row = np.linalg.solve(powers.transpose(0, 2, 1) @ powers, wanted)
    coefficients: FloatArray = (powers @ inverse_row)[:, :, 0] / half_width_s**order
    return coefficients


def _scatter_m2(elapsed_s: FloatArray, weight: BoolArray, away_m: FloatArray, degree: int) -> FloatArray:
    """Return the variance of positions (K, n, 3) about their polynomials, (K, 3); 0 where these have to go through."""
    powers, _ = _powers(elapsed_s, weight.astype(np.float64), degree)
    transposed = powers.transpose(0, 2, 1)
    residual_m = away_m - powers @ np.linalg.solve(transposed @ powers, transposed @ away_m)
    freedom = weight.sum(axis=1, keepdims=True) - (degree + 1)
    variance: FloatArray = (residual_m**2).sum(axis=1) * (freedom > 0) / np.maximum(freedom, 1)
    return variance


def _powers(elapsed_s: FloatArray, weight: FloatArray, degree: int) -> tuple[FloatArray, FloatArray]:
    """Return weighted powers of the times over their half width, (K, n, degree + 1), and that, (K, 1)."""
    half_width_s = np.abs(elapsed_s).max(axis=1, initial=0, keepdims=True)
    return weight[:, :, None] * (elapsed_s / half_width_s)[:, :, None] ** np.arange(degree + 1), half_width_s


def _found(position_m: FloatArray) -> BoolArray:
    found: BoolArray = np.logical_and.reduce(np.isfinite(position_m), axis=-1)
    return found
