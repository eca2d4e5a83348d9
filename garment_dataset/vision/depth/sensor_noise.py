"""What a recording says of its own depth sensor: noise, its correlations, the step of its levels.

All is in inverse depth, 1/m, where a sensor that measures disparity errs alike at every distance. Noise is what differs
between frames in which nothing moves; what does not differ is in :mod:`~garment_dataset.vision.depth.pattern`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, DepthImage, FloatArray

_FULL = 0.8
_HALF_PX = 12
MIN_WINDOWS = 12
"""Fewer means say nothing of how they scatter."""

_JUMP_PER_M = 0.03
"""Pixels that change by more between two frames, 3 cm at 1 m, see another surface."""

_MIN_PAIRS = 500
_MIN_COUNT_SHARE = 0.002


@dataclass(frozen=True, slots=True, eq=False)
class TimeNoise:
    """What differs between frames of a scene in which nothing moves.

    Parameters
    ----------
    std_per_m : float
        Standard deviation of a pixel.
    correlation : float
        With the next frame.
    pixels_per_independent : float
        So many neighbouring pixels tell as much as one independent pixel would.
    """

    std_per_m: float
    correlation: float
    pixels_per_independent: float


def level_step_per_m(frames: Sequence[DepthImage], table: FloatArray, near_mm: int, far_mm: int) -> float | None:
    """Return the distance of the levels that a sensor reports between two depths; None when it shows too few.

    Parameters
    ----------
    frames : sequence of (H, W) uint16
        Images in millimetres.
    table : (65536,) float64
        Inverse depth by millimetres.
    near_mm, far_mm : int
        The range that is looked at.
    """
    counts = np.zeros(1 << 16, np.int64)
    for frame in frames:
        counts += np.bincount(frame.ravel(), minlength=1 << 16)
    inside = counts[near_mm : far_mm + 1]
    # millimetres that hardly occur lie between levels: what an image holds by mistake
    often = np.flatnonzero(inside > max(_MIN_COUNT_SHARE * inside.sum(), 1)) + near_mm
    if often.size < 3:
        return None
    return float(np.median(np.abs(np.diff(table[often]))))


def time_noise(inverse: Sequence[FloatArray], region: BoolArray) -> TimeNoise | None:
    r"""Measure noise in time on consecutive frames.

    Parameters
    ----------
    inverse : sequence, length T, of (H, W) float64
        Inverse depth of frames in which nothing moves; NaN where there is none.
    region : (H, W) bool
        Where to look.

    Returns
    -------
    TimeNoise or None
        None for fewer than three frames or too few pixels.

    Notes
    -----
    With d the difference of consecutive frames of a first-order process of correlation :math:`\rho`,
    :math:`\operatorname{var} d = 2 \sigma^2 (1 - \rho)` and :math:`\operatorname{cov}(d_t, d_{t+1}) = -\sigma^2
    (1 - \rho)^2`. Pixels per independent one: the variance of the mean of d over 25 x 25 pixels, times their number,
    over that of single pixels.
    """
    if len(inverse) < 3 or not region.any():
        return None
    part = _around(region)
    outside = ~region[part]
    squares, products = np.zeros(2), np.zeros(2)
    means: list[FloatArray] = []
    before: FloatArray | None = None
    for first, second in pairwise(inverse):
        change = second[part] - first[part]
        change[outside | ~(np.abs(change) < _JUMP_PER_M)] = np.nan
        squares += _sum_and_number(change * change)
        if before is not None:
            products += _sum_and_number(change * before)
        means.append(window_means(change, _HALF_PX, _HALF_PX)[0].ravel())
        before = change
    if squares[1] < _MIN_PAIRS:
        return None
    variance = float(squares[0] / squares[1])
    if variance == 0:
        return TimeNoise(0.0, 0.0, 1.0)
    ratio = float(np.clip(-products[0] / products[1] / variance, 0.05, 0.5)) if products[1] else float("nan")
    correlation = 1 - 2 * ratio
    known = np.concatenate(means)
    known = known[np.isfinite(known)]
    together = 625 * float(np.mean(known**2)) / variance if known.size >= MIN_WINDOWS else 25.0
    return TimeNoise(float(np.sqrt(variance / (2 * (1 - correlation)))), correlation, max(together, 1.0))


def _around(region: BoolArray) -> tuple[slice, slice]:
    """Return the part of an image that holds a region, and all windows with enough of it where they were."""
    places = (np.flatnonzero(region.any(axis=axis)) for axis in (1, 0))
    rows, columns = (slice(int(at[0]) // _HALF_PX * _HALF_PX, int(at[-1]) + 2 * _HALF_PX + 1) for at in places)
    return rows, columns


def _sum_and_number(values: FloatArray) -> tuple[float, int]:
    known = values[np.isfinite(values)]
    return float(known.sum()), known.size


def window_means(values: FloatArray, half_width: int, half_height: int) -> tuple[FloatArray, int]:
    """Return means over windows half a window apart, and how many pixels a window has.

    Parameters
    ----------
    values : (H, W) float64
        NaN where there is none.
    half_width, half_height : int
        Of the windows, in pixels.

    Returns
    -------
    means : (n, m) float64
        NaN where less than 80 % of a window is known.
    size : int
    """
    width, height = 2 * half_width + 1, 2 * half_height + 1
    known = np.isfinite(values)
    steps = slice(None, None, max(half_height, 1)), slice(None, None, max(half_width, 1))
    total, count = (
        (sums[height:, width:][steps] - sums[:-height, width:][steps])
        - (sums[height:, :-width][steps] - sums[:-height, :-width][steps])
        for sums in map(cv2.integral, (np.where(known, values, 0.0), known.view(np.uint8)))
    )
    size = width * height
    return np.where(count >= _FULL * size, total / np.maximum(count, 1), np.nan), size
