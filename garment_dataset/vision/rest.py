"""What a garment shows as a whole: how it scatters and hangs at rest, how long it is, how it scatters in motion.

Positions are ``(T, r, 3)`` float64 in metres, of the points on the garment, NaN where one was not found.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.vision.correlation import mean_of_known
from garment_dataset.vision.depth.smoothing import local_fit

if TYPE_CHECKING:
    from garment_dataset.arrays import FloatArray

_FIT_FRAMES, _FIT_DEGREE = 11, 3


def rest_noise_m(position_m: FloatArray) -> float:
    """Return the root mean square scatter of coordinates about their means; NaN when none was seen twice."""
    count = np.isfinite(position_m).sum(axis=0)
    squares = np.nansum((position_m - mean_of_known(position_m)) ** 2, axis=0)[count > 1]
    return float(np.sqrt((squares / (count[count > 1] - 1)).mean())) if squares.size else float("nan")


def moving_noise_m(time_s: FloatArray, position_m: FloatArray) -> float:
    """Return the root mean square scatter of coordinates about cubics over 11 frames; NaN when there are no more.

    Frames in which a point is missing are passed over. Times are ascending, all different.
    """
    whole = np.isfinite(position_m).all(axis=(1, 2))
    if position_m.shape[1] == 0 or whole.sum() <= _FIT_FRAMES:
        return float("nan")
    values_m = position_m[whole].reshape(int(whole.sum()), -1)
    smooth_m, gain = local_fit(time_s[whole], values_m, _FIT_FRAMES, _FIT_DEGREE)
    return float(np.sqrt(((values_m - smooth_m) ** 2 / (1 - gain)[:, None]).mean()))


def hanging_direction(position_m: FloatArray) -> FloatArray:
    """Return the unit vector from the first to the last point, (3,); NaN when either is not known."""
    if position_m.shape[1] < 2:
        return np.full(3, np.nan)
    mean_m = mean_of_known(position_m)
    way_m = mean_m[-1] - mean_m[0]
    direction: FloatArray = way_m / np.linalg.norm(way_m)
    return direction


def length_std_m(y_std_m: FloatArray) -> float:
    r"""Return the standard uncertainty of the garment's length, from those of its points' y.

    Parameters
    ----------
    y_std_m : (T, r) float64
        At rest, when the garment hangs along y.

    Returns
    -------
    float
        Metres; NaN when that of the first or the last point is not known.

    Notes
    -----
    The variance of y at the share s of the length is :math:`(s h)^2 + ((1 - s) g)^2`, with h the error of the hem and g
    that at the gripper; the length's is :math:`h^2 + g^2`. The shares of the first and the last point add up to 1, so
    the sum of their variances is that of the length times :math:`s^2 + (1 - s)^2`. These errors stand still: a mean
    over the rest is no better.
    """
    share = 0.5 / y_std_m.shape[1]
    variance = mean_of_known(y_std_m**2)[[0, -1]].sum()
    return float(np.sqrt(variance / (share**2 + (1 - share) ** 2)))
