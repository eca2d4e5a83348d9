"""A path between its samples, with a bound on how far it may be from what is said of it: pure functions."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_EVEN = 3.0  # the longest of three spans over the shortest: beyond, curvatures at the two ends mean different things


class Knot(NamedTuple):
    """One sample of a path."""

    stamp_ns: int
    position_m: NDArray[np.float64]


class Interpolated(NamedTuple):
    """A position on the path, shape (3,), metres, and a bound of its error per axis; NaN where none is known."""

    position_m: NDArray[np.float64]
    bound_m: NDArray[np.float64]


def path_at(earlier: Knot | None, before: Knot, after: Knot, later: Knot | None, stamp_ns: int) -> Interpolated:
    r"""Return the path between two neighbouring samples, with the help of the next one on either side.

    Parameters
    ----------
    earlier, before, after, later : Knot
        Samples in order of time; `stamp_ns` lies between the two in the middle. The outer ones may be missing.
    stamp_ns : int
        The time asked for, in nanoseconds.

    Returns
    -------
    Interpolated

    Notes
    -----
    With :math:`a` and :math:`b` the times from the samples before and after, a chord misses a path of curvature
    (second time derivative) :math:`c` by :math:`c a b / 2`. The curvatures :math:`c_0, c_1` at the two samples are
    second divided differences. With both, and three spans of which none is over three times another, the miss is taken
    off: :math:`c = (b c_0 + a c_1) / (a + b)`, which is the cubic Hermite of Catmull and Rom for uneven samples; its
    bound is :math:`|c_1 - c_0| a b / 2`. Otherwise the chord stands, with the greater of the known curvatures as bound.
    """
    since_s, until_s = _seconds(before.stamp_ns, stamp_ns), _seconds(stamp_ns, after.stamp_ns)
    span_s = since_s + until_s
    chord_m = (until_s * before.position_m + since_s * after.position_m) / span_s
    miss_s2 = since_s * until_s / 2
    known = [] if earlier is None else [_curvature(earlier, before, after)]
    known += [] if later is None else [_curvature(before, after, later)]
    if earlier is not None and later is not None and _even(earlier, before, after, later):
        left, right = known
        position_m = chord_m - miss_s2 * (until_s * left + since_s * right) / span_s
        return Interpolated(position_m, miss_s2 * np.abs(right - left))
    if not known:
        return Interpolated(chord_m, np.full(3, np.nan))
    return Interpolated(chord_m, miss_s2 * np.abs(known).max(axis=0))


def standard_uncertainty_m(bound_m: NDArray[np.float64], floor_m: float) -> NDArray[np.float64]:
    """Return the standard uncertainty of a value that lies anywhere within a bound, with a floor added in quadrature.

    Parameters
    ----------
    bound_m : (..., 3) float64
        Greatest error of the interpolation; an even distribution within it has the standard deviation bound / √3.
    floor_m : float
        Standard uncertainty of a sample itself.
    """
    uncertainty_m: NDArray[np.float64] = np.hypot(bound_m / math.sqrt(3.0), floor_m)
    return uncertainty_m


def _seconds(begin_ns: int, end_ns: int) -> float:
    return (end_ns - begin_ns) * 1e-9


def _even(*knots: Knot) -> bool:
    spans_ns = [after.stamp_ns - before.stamp_ns for before, after in pairwise(knots)]
    return max(spans_ns) <= _EVEN * min(spans_ns)


def _curvature(first: Knot, middle: Knot, last: Knot) -> NDArray[np.float64]:
    """Return twice the second divided difference, shape (3,), m/s²."""
    rise = (last.position_m - middle.position_m) / _seconds(middle.stamp_ns, last.stamp_ns)
    rise -= (middle.position_m - first.position_m) / _seconds(first.stamp_ns, middle.stamp_ns)
    curvature: NDArray[np.float64] = 2.0 * rise / _seconds(first.stamp_ns, last.stamp_ns)
    return curvature
