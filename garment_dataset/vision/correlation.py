r"""How errors of one quantity hang together over the frames of a recording.

A part :math:`s` of their variance stands still, the rest moves on like an autoregressive process: between frames i and
j the correlation is :math:`s + (1 - s) \rho^{|i - j|}`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import FloatArray


def effective_frames(frames: int, standing_share: float, moving_lag1: float) -> float:
    r"""Return how many independent frames the mean over so many is worth.

    Parameters
    ----------
    frames : int
        n, consecutive, at least 1.
    standing_share : float
        s, 0 to 1.
    moving_lag1 : float
        :math:`\rho`, 0 to less than 1.

    Returns
    -------
    float
        1 to n.

    Notes
    -----
    The variance of the mean over that of one frame is :math:`s + (1 - s) \bar\rho`, with
    :math:`\bar\rho = n^{-2} \sum_{ij} \rho^{|i - j|}
    = \left(n (1 + \rho) - 2 \rho (1 - \rho^n) / (1 - \rho)\right) / \left(n^2 (1 - \rho)\right)`.
    """
    rho = moving_lag1
    mean = (frames * (1 + rho) - 2 * rho * (1 - rho**frames) / (1 - rho)) / (frames**2 * (1 - rho))
    return 1 / (standing_share + (1 - standing_share) * mean)


def lag1_autocorrelation(values: FloatArray) -> FloatArray:
    r"""Return the correlation of series about their means with themselves one frame later.

    Parameters
    ----------
    values : (n, ...) float64
        Consecutive; pairs with a NaN are passed over.

    Returns
    -------
    (...) float64
        NaN where there are fewer than three pairs, or nothing scatters. Of n frames it is too low by some
        :math:`(1 + 3 \rho) / n`, because the mean is taken from them, too.
    """
    known = np.isfinite(values)
    away = np.where(known, values - mean_of_known(values), 0)
    pairs = (known[1:] & known[:-1]).sum(axis=0)
    variance = (away**2).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    covariance = (away[1:] * away[:-1]).sum(axis=0) / np.maximum(pairs, 1)
    told = (pairs >= 3) & (variance > 0)
    found: FloatArray = np.where(told, covariance / np.where(told, variance, 1), np.nan)
    return found


def mean_of_known(values: FloatArray) -> FloatArray:
    """Return the mean over the first axis of what is not NaN; NaN where nothing is known."""
    known = np.isfinite(values)
    count = known.sum(axis=0)
    mean: FloatArray = np.where(count > 0, np.where(known, values, 0).sum(axis=0) / np.maximum(count, 1), np.nan)
    return mean


def along_standing_share(below: float, x_std_m: FloatArray, y_std_m: FloatArray, standing_share: float) -> float:
    """Return the standing share of the error of y: the gripper's, which stands still, and a part of the rest.

    Parameters
    ----------
    below : float
        Share of the gripper's error that a point takes along the garment: less, the lower it is.
    x_std_m, y_std_m : (T,) float64
        Standard uncertainties of the point; that of x is the gripper's.
    standing_share : float
        Of what is not the gripper's.
    """
    known = np.isfinite(x_std_m) & (y_std_m > 0)
    of_gripper = 0.0
    if known.any():
        of_gripper = min(1.0, float(((below * x_std_m[known]) ** 2).mean() / (y_std_m[known] ** 2).mean()))
    return of_gripper + (1 - of_gripper) * standing_share
