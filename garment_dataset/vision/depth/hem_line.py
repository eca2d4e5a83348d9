r"""The lower edge of cloth around a profile, as one straight line or as two that meet in a tip.

Every column of pixels around the profile ends somewhere. A hem ends them on a line; a towel that is held by its corner
ends in a tip, and a line through both sides of that would pass well above it. Both are fitted robustly, and the better
explanation wins.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import FloatArray

_COST_BOUND = 9.0
"""The most that one column adds: three standard deviations away it is torn, or belongs to something else."""

_UNSEEN_COST = 0.05
"""Of every missing pixel that would be cloth: little, as those of the background are missing as often."""

_END_STD_PX = 0.5
"""Ends of whole columns about the edge: uniform within a pixel (0.29), and the raggedness of edges of depth."""

_LEAST_COLUMNS = 5
_LEAST_SIDE = 4
_LEAST_SPAN_PX = 4.0
_REFINEMENTS = 3
_TIP_PARAMETERS = 3.0
"""Two lines have so many parameters more than one: a slope, a level, and where they meet."""


def edge_row(away_px: FloatArray, lowest: FloatArray, highest: FloatArray) -> float | None:
    r"""Return the row in which the edge of cloth crosses the profile, from where the columns around it end.

    Parameters
    ----------
    away_px : (n,) float64
        Columns, from the profile's, rising.
    lowest, highest : (n,) float64
        The rows between which each has its last row of cloth: the last that is seen, and the last before something
        else is.

    Returns
    -------
    float or None
        None for too few columns.

    Notes
    -----
    Lines through all pairs of ends are tried; the cost of a line is the sum of squared distances from these intervals
    over 0.5 px, each bounded. Two lines that meet have the cost of the best left and the best right one, for the best
    place to meet, and win if they save more than :math:`3 \ln n`, the price of their parameters after Schwarz. The
    profile is on one of them: that of the column nearest to it.
    """
    count = away_px.size
    if count < _LEAST_COLUMNS or away_px[-1] - away_px[0] < _LEAST_SPAN_PX:
        return None
    first, second = np.nonzero(away_px - away_px[:, None] >= _LEAST_SPAN_PX)
    slope = (lowest[second] - lowest[first]) / (away_px[second] - away_px[first])
    level = lowest[first] - slope * away_px[first]
    below = slope * away_px[:, None] + (level - lowest[:, None])
    unseen = np.minimum(np.maximum(below, 0), (highest - lowest)[:, None])
    below -= unseen
    below *= below / _END_STD_PX**2
    below += _UNSEEN_COST * unseen
    # running sums over the columns, by a product: faster than one addition after another
    cost = np.tri(count) @ np.minimum(below, _COST_BOUND, out=below)
    ends = np.stack([away_px, lowest, highest])
    whole = int(cost[-1].argmin())
    splits = np.arange(_LEAST_SIDE, count - _LEAST_SIDE + 1)
    if splits.size == 0:
        return _refined(ends, level[whole], slope[whole])
    left = cost[_LEAST_SIDE - 1 : count - _LEAST_SIDE]
    right = cost[-1] - left
    both = left.min(axis=1) + right.min(axis=1)
    best = int(both.argmin())
    if both[best] + _TIP_PARAMETERS * np.log(count) >= cost[-1, whole]:
        return _refined(ends, level[whole], slope[whole])
    split, sides = int(splits[best]), (int(left[best].argmin()), int(right[best].argmin()))
    if int(np.abs(away_px).argmin()) < split:
        return _refined(ends[:, :split], level[sides[0]], slope[sides[0]])
    return _refined(ends[:, split:], level[sides[1]], slope[sides[1]])


def _refined(ends: FloatArray, level: float, slope: float) -> float:
    """Return the level of the least squares through the ends near a line, each where it is nearest."""
    for _ in range(_REFINEMENTS):
        line = level + slope * ends[0]
        nearest = np.minimum(np.maximum(line, ends[1]), ends[2])
        near = np.abs(line - nearest) <= 2 * _END_STD_PX
        away_px, row = ends[0, near], nearest[near]
        if row.size < _LEAST_SIDE - 1:
            break
        middle_px = away_px.sum() / row.size
        away_px = away_px - middle_px
        slope = float(away_px @ row / max(float(away_px @ away_px), 1e-9))
        level = float(row.sum() / row.size - slope * middle_px)
    return float(level)
