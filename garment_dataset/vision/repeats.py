"""How far repeats of one movement are from each other, and what of it their stated uncertainties explain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.vision.chi_squared import std_interval

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, FloatArray

_REACH_S = 0.1
"""Values farther apart in time are not interpolated between: three frames of 30 a second."""


@dataclass(frozen=True, slots=True, eq=False)
class Repeat:
    """One quantity of one recording over time.

    Parameters
    ----------
    time_s : (T,) float64
        Since the onset, increasing.
    value, std : (T,) float64
        And its standard uncertainty; NaN where there is none. A value without one is compared all the same.
    """

    time_s: FloatArray
    value: FloatArray
    std: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Several repeats at common times, each array (K,); NaN where fewer than two repeats have a value.

    Parameters
    ----------
    mean, std : float64
        Over the repeats; the standard deviation is divided by n - 1.
    stated : float64
        What the repeats' uncertainties alone would make of it: the root of their mean square.
    repeats : int64
        How many have a value.
    """

    mean: FloatArray
    std: FloatArray
    stated: FloatArray
    repeats: FloatArray


@dataclass(frozen=True, slots=True)
class Summary:
    """A spread in few numbers, over the times at which all repeats have a value.

    Parameters
    ----------
    rms, rms_low, rms_high : float
        Standard deviation between repeats, root of its mean square over time, and the 95 % interval of that.
    largest, largest_time_s : float
        The greatest standard deviation, and when.
    stated_rms : float
        What the stated uncertainties explain, likewise.
    degrees : float
        Degrees of freedom of the rms.
    """

    rms: float
    rms_low: float
    rms_high: float
    largest: float
    largest_time_s: float
    stated_rms: float
    degrees: float


def at_times(repeat: Repeat, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Interpolate a value and its uncertainty linearly; neither beyond its ends nor over long gaps.

    Parameters
    ----------
    repeat : Repeat
        What was seen.
    time_s : (K,) float64
        When it is wanted.

    Returns
    -------
    value, std : (K,) float64
        NaN where there is none.
    """
    there = np.isfinite(repeat.value) & np.isfinite(repeat.time_s)
    seen_s = repeat.time_s[there]
    if len(seen_s) < 2:
        return np.full(len(time_s), np.nan), np.full(len(time_s), np.nan)
    after = np.clip(np.searchsorted(seen_s, time_s, side="left"), 1, len(seen_s) - 1)
    near = (seen_s[after] - seen_s[after - 1] <= _REACH_S) & (time_s >= seen_s[0]) & (time_s <= seen_s[-1])
    value, std = (
        np.where(near, np.interp(time_s, seen_s, column[there]), np.nan) for column in (repeat.value, repeat.std)
    )
    return value, std


def spread_of(repeats: Sequence[Repeat], time_s: FloatArray) -> tuple[Spread, FloatArray]:
    """Compare repeats at common times.

    Parameters
    ----------
    repeats : sequence of Repeat, length n
        Each in its own times since its own onset.
    time_s : (K,) float64
        When they are compared.

    Returns
    -------
    Spread
        See there.
    values : (n, K) float64
        The repeats at these times.
    """
    values, stds = (np.stack(arrays) for arrays in zip(*(at_times(each, time_s) for each in repeats), strict=True))
    count = np.isfinite(values).sum(axis=0).astype(np.float64)
    some = np.where(count >= 2, count, np.nan)
    mean = np.nansum(values, axis=0) / some
    std = np.sqrt(np.nansum((values - mean) ** 2, axis=0) / (some - 1))
    stated = np.sqrt(np.where(np.isfinite(values), stds**2, 0).sum(axis=0) / some)
    return Spread(mean, std, stated, count), values


def summarise(spread: Spread, values: FloatArray, time_s: FloatArray) -> Summary | None:
    r"""Put a spread into few numbers; None where the repeats have no time in common.

    Parameters
    ----------
    spread, values
        As :func:`spread_of` gives them.
    time_s : (K,) float64
        The times.

    Notes
    -----
    The variance averaged over time is a sum of correlated :math:`\chi^2`. Its degrees of freedom are those of
    Satterthwaite (1946), :math:`\nu (\operatorname{tr} C)^2 / \operatorname{tr} C^2` with :math:`\nu = n - 1` and C
    the covariance over time: :math:`\nu` where all times say the same, more where they do not. C is taken from the n
    repeats themselves, which gives at most :math:`\nu^2`: the interval is rather too wide than too narrow.
    """
    common: BoolArray = np.asarray(np.isfinite(values).all(axis=0))
    if len(values) < 2 or not common.any():
        return None
    variance, nu = spread.std[common] ** 2, len(values) - 1
    apart = values[:, common] - spread.mean[common]
    trace = float(variance.sum())
    seen = float(((apart @ apart.T / nu) ** 2).sum())
    degrees = nu * trace**2 / seen if seen > 0 else float(nu)
    rms = float(np.sqrt(variance.mean()))
    low, high = std_interval(rms, degrees)
    at = int(np.argmax(variance))
    stated = float(np.sqrt((spread.stated[common] ** 2).mean()))
    return Summary(rms, low, high, float(np.sqrt(variance[at])), float(time_s[common][at]), stated, degrees)


def common_times_s(repeats: Sequence[FloatArray], step_s: float) -> FloatArray:
    """Return multiples of a step at which at least two repeats were under way.

    Parameters
    ----------
    repeats : sequence of (T,) float64
        Their times since the onset, NaN where unknown.
    step_s : float
        Distance of the times.
    """
    ends = [(np.nanmin(each), np.nanmax(each)) for each in repeats if np.isfinite(each).any()]
    if len(ends) < 2:
        return np.empty(0)
    first, last = (sorted(column) for column in zip(*ends, strict=True))
    start, stop = np.ceil(first[1] / step_s - 1e-9), np.floor(last[-2] / step_s + 1e-9)
    return np.asarray(np.arange(start, stop + 1) * step_s, np.float64)
