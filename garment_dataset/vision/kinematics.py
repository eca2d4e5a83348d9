"""Onset of motion, displacement from rest and velocity of tracked points: thesis 5.3.5.

Positions are ``(T, P, 3)`` float64 in metres, NaN where a point was not found; stamps are ``(T,)`` int64 nanoseconds,
ascending. Stamps are only subtracted as integers: a float64 cannot hold nanoseconds since 1970.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import BoolArray, FloatArray, IntArray

MEDIAN_STD = 1.2533
"""Standard deviation of a median over that of a mean, of many normal values: sqrt(pi / 2)."""


def motion_onset(position_m: FloatArray, *, threshold_m: float, rest_frames: int, lasting_frames: int) -> int | None:
    """Find the frame at which a path leaves its rest.

    Parameters
    ----------
    position_m : (T, 3) float64
        Path of the gripper; frames with NaN are passed over.
    threshold_m : float
        Distance from rest that counts as motion.
    rest_frames : int
        The rest is the median position of so many frames from the first.
    lasting_frames : int
        So many frames in a row have to be farther from rest than the threshold: one wrong position is no motion.

    Returns
    -------
    int or None
        Index of the first of the lasting frames. None without motion, or when the path leaves before ``rest_frames``
        frames have passed: then its rest was not seen.

    Notes
    -----
    The onset is late by the time that the path needs to reach the threshold, by less than one frame more, and never
    early. A path that drifts by less than the threshold within ``rest_frames`` frames is taken to rest.
    """
    found = np.flatnonzero(_found(position_m))
    if found.size < rest_frames + lasting_frames:
        return None
    path_m = position_m[found]
    away = np.linalg.norm(path_m - np.median(path_m[:rest_frames], axis=0), axis=1) > threshold_m
    lasting = np.convolve(away, np.ones(lasting_frames), mode="valid") >= lasting_frames
    first = int(lasting.argmax())
    return int(found[first]) if lasting[first] and first >= rest_frames else None


def displacement(position_m: FloatArray, std_m: FloatArray, onset: int) -> tuple[FloatArray, FloatArray]:
    """Subtract the rest position: the median of the frames before the onset.

    Parameters
    ----------
    position_m, std_m : (T, P, 3) float64
        Positions and their standard uncertainties; an uncertainty of NaN means unknown.
    onset : int
        First frame in motion, from :func:`motion_onset`.

    Returns
    -------
    displacement_m, displacement_std_m : (T, P, 3) float64
        NaN for a point that was never found at rest.

    Notes
    -----
    Errors are taken as independent from frame to frame. Those that are fixed in the image cancel in part, so the
    standard uncertainty is rather too large.
    """
    rest_m, rest_std_m = np.full(position_m.shape[1:], np.nan), np.full(position_m.shape[1:], np.nan)
    seen = _found(position_m[:onset])
    for point in np.flatnonzero(seen.any(axis=0)):
        at_rest = np.flatnonzero(seen[:, point])
        rest_m[point] = np.median(position_m[at_rest, point], axis=0)
        mean_variance = (std_m[at_rest, point] ** 2).mean(axis=0) / at_rest.size
        rest_std_m[point] = np.sqrt(mean_variance) * (MEDIAN_STD if at_rest.size > 2 else 1)
    return position_m - rest_m, np.hypot(std_m, rest_std_m)


def differences(
    stamp_ns: IntArray, position_m: FloatArray, std_m: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Divide the way to the next frame by its time, as the thesis does.

    Parameters
    ----------
    stamp_ns : (T,) int64
        Ascending.
    position_m, std_m : (T, P, 3) float64
        Positions and their standard uncertainties.

    Returns
    -------
    velocity_stamp_ns : (T,) int64
        Middle between a frame and the next, where the difference is the velocity up to second order.
    velocity_m_s, velocity_std_m_s : (T, P, 3) float64
        NaN in the last frame, where either position is NaN, and between equal stamps.
    """
    interval_ns = np.diff(stamp_ns, append=stamp_ns[-1:])
    interval_s = np.where(interval_ns > 0, interval_ns / 1e9, np.nan)[:, None, None]
    after = np.minimum(np.arange(stamp_ns.size) + 1, stamp_ns.size - 1)
    velocity_m_s = (position_m[after] - position_m) / interval_s
    return stamp_ns + interval_ns // 2, velocity_m_s, np.hypot(std_m[after], std_m) / interval_s


def local_polynomial(
    stamp_ns: IntArray, position_m: FloatArray, std_m: FloatArray, *, frames: int, degree: int
) -> tuple[FloatArray, FloatArray]:
    r"""Fit a polynomial in the true stamps around every frame, and take its slope there.

    Parameters
    ----------
    stamp_ns : (T,) int64
        Ascending; of frames with one stamp only the first is used.
    position_m, std_m : (T, P, 3) float64
        Positions and their standard uncertainties.
    frames : int
        Odd number of frames that a fit is made of. The frame itself is in their middle, except near the ends.
    degree : int
        Of the polynomial; motion that is such a polynomial gets its exact velocity.

    Returns
    -------
    velocity_m_s, velocity_std_m_s : (T, P, 3) float64
        NaN where the position is, and where fewer than ``degree + 1`` positions are left around the frame.

    Notes
    -----
    Least squares, unweighted, on :math:`\tau = (t_k - t_i) / T` with T the half width of the fit: the slope is
    :math:`\sum_k c_k p_k` with :math:`c = (A^T A)^{-1}_{1,:} A^T / T`, its variance :math:`\sum_k c_k^2 \sigma_k^2`.
    Where the positions scatter more about the polynomial than they should, as where a fold passes, the variance is
    :math:`s^2 \sum_k c_k^2` instead, with :math:`s^2` the sum of squared residuals over the degrees of freedom (Birge,
    1932).
    """
    fresh = np.diff(stamp_ns, prepend=stamp_ns[:1] - 1) > 0
    found = _found(position_m)
    first = np.clip(np.arange(stamp_ns.size) - frames // 2, 0, max(stamp_ns.size - frames, 0))
    neighbour = first[:, None] + np.arange(min(frames, stamp_ns.size))
    used = fresh[neighbour][:, :, None] & found[neighbour]
    elapsed_s = (stamp_ns[neighbour] - stamp_ns[:, None]) / 1e9

    frame, point = np.nonzero(found & (used.sum(axis=1) > degree))
    weight = used[frame, :, point]
    coefficients = _slope_coefficients(elapsed_s[frame], weight.astype(np.float64), degree)[:, :, None]
    own_m = position_m[frame, point][:, None, :]
    others = neighbour[frame], point[:, None]
    away_m = np.where(weight[:, :, None], position_m[others] - own_m, 0)
    velocity_m_s, velocity_std_m_s = np.full_like(position_m, np.nan), np.full_like(position_m, np.nan)
    velocity_m_s[frame, point] = (coefficients * away_m).sum(axis=1)
    others_std_m = np.where(weight[:, :, None], std_m[others], 0)
    stated = ((coefficients * others_std_m) ** 2).sum(axis=1)
    seen = (coefficients**2).sum(axis=1) * _scatter_m2(elapsed_s[frame], weight, away_m, degree)
    velocity_std_m_s[frame, point] = np.sqrt(np.maximum(stated, seen))
    return velocity_m_s, velocity_std_m_s


def _slope_coefficients(elapsed_s: FloatArray, weight: FloatArray, degree: int) -> FloatArray:
    """Return what each position counts in the slope at time 0 of the fitted polynomial, (K, n) as both inputs."""
    powers, half_width_s = _powers(elapsed_s, weight, degree)
    first_derivative = np.zeros((elapsed_s.shape[0], degree + 1, 1))
    first_derivative[:, 1] = 1
    inverse_row = np.linalg.solve(powers.transpose(0, 2, 1) @ powers, first_derivative)
    coefficients: FloatArray = (powers @ inverse_row)[:, :, 0] / half_width_s
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
