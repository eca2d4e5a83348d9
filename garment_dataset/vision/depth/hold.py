"""Where the cloth leads above the first row that is seen of it: to the gripper's end point, or past it.

The fingers hide the first centimetre. Drawn up from below, cloth that bends at the jaws seems to pass the end point by
millimetres, though it is held there; cloth that hangs from the outside of the jaws does pass it. Curves of different
reach and degree tell one from the other: the more they disagree, the less they count.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from garment_dataset.vision.depth.pattern import usual_pattern
from garment_dataset.vision.depth.smoothing import adaptive_mean

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, FloatArray
    from garment_dataset.vision.depth.profile import Profile

_FRAMES = (5, 9, 17, 33, 65, 129, 257)
"""Whether the cloth is held at all changes little, so it may be followed over the whole recording."""

_CURVES = ((1, 0.04), (2, 0.04), (2, 0.08), (2, 0.12))
"""Degree of a curve, and how much cloth it is drawn up from, in metres. The first tells whether cloth is held."""

_SINGULAR = 1e-12
"""Share of the largest eigenvalue of normal equations below which one is 0."""

_LEAST_M = 0.02
_LEAST_ROWS = 8

_EXPECTED_M = 0.001
"""Standard deviation of the way past the end point before anything is seen: jaws are some millimetres thick."""

_FLAT_STD_M, _BENT_STD_M = 0.0003, 0.0012
"""Standard errors of all curves alike for cloth whose bend none of them follows: in windows as large as any farther
down, where it is flat, and in ones far smaller, where it is gathered. With the pattern that is 1 mm for towels held by
a corner, collars and waistbands, as measured on the draws that the method was chosen on."""

_LEVERAGE = 1.5
"""So many times as large as in its first windows the error of a curve is 12 mm above them."""

_FARTHEST_M = 0.03
"""Cloth that seems farther from the gripper's end point is not held there: its line upwards means nothing."""


_USUAL = usual_pattern()


class Hold(NamedTuple):
    """How a garment is held, frame by frame.

    ``past_m``, (T,), is z of the cloth at the height of the end point, relative to it, 0 where the way down is
    straight; ``noise_m``, (T,), its standard uncertainty; ``held``, (T,), whether the cloth leads to the end point.
    """

    past_m: FloatArray
    noise_m: FloatArray
    held: BoolArray

    @property
    def distance_m(self) -> FloatArray:
        """Length of the way from the end point to the cloth at its height, (T,); 0 where it is not held."""
        return np.abs(self.past_m) * self.held


def follow_hold(profiles: Sequence[Profile], gripper_m: FloatArray, time_s: FloatArray, *, over_time: bool) -> Hold:
    """Find how far past the end point the cloth leads, from curves drawn up from below.

    Parameters
    ----------
    profiles : sequence of Profile, length T
        In the order of time, with the depths of the windows that fit best: where the cloth is flat, the largest, which
        average the sensor's pattern.
    gripper_m : (T, 3) float64
        End point of the gripper.
    time_s : (T,) float64
        Ascending, all different.
    over_time : bool
        Whether anything is smoothed over time. Then the way past the end point is one for the whole recording, as jaws
        stay closed: that of the median of every curve, over the frames in which the cloth is held.

    Returns
    -------
    Hold
    """
    each_m = drawn_up_m(profiles, gripper_m)
    shared_m = np.array([shared_std_m(profile) for profile in profiles])
    line_m, noise_m = adaptive_mean(time_s, each_m[:, :1], _FRAMES if over_time else (), degree=1)
    held = np.abs(line_m[:, 0]) < _FARTHEST_M
    if over_time and held.any():
        each_m = np.broadcast_to(np.median(each_m[held], axis=0), each_m.shape)
        shared_m = np.full(shared_m.size, np.median(shared_m[held]))
    past_m, std_m = weighed_m(each_m, shared_m)
    return Hold(np.where(held, past_m, line_m[:, 0]), np.where(held, std_m, noise_m[:, 0]), held)


def drawn_up_m(profiles: Sequence[Profile], gripper_m: FloatArray) -> FloatArray:
    """Return z, relative to the gripper's, of the first cloth drawn up to the height of the end point, (T, 4).

    By a line through its first 4 cm, and by parabolas through 4, 8 and 12 cm. Of too little cloth the mean, each time.
    """
    size = np.array([np.searchsorted(profile.piece, 1) for profile in profiles])
    there = np.arange(size.max()) < size[:, None]
    y_m, z_m = np.zeros(there.shape), np.zeros(there.shape)
    y_m[there] = np.concatenate([profile.y_m[:count] for profile, count in zip(profiles, size, strict=True)])
    z_m[there] = np.concatenate([profile.z_m[:count] for profile, count in zip(profiles, size, strict=True)])
    y_m -= gripper_m[:, 1:2]
    z_m -= gripper_m[:, 2:3]
    first_m, last_m = y_m[:, 0], y_m[np.arange(size.size), size - 1]
    little = (last_m - first_m < _LEAST_M) | (size < _LEAST_ROWS)
    drawn_m = []
    for degree, reach_m in _CURVES:
        near = (there & (y_m <= first_m[:, None] + reach_m)).astype(np.float64)
        place = (y_m - first_m[:, None]) / reach_m
        powers = np.stack([near * place**power for power in range(degree + 1)], axis=1)
        normal, right = powers @ powers.transpose(0, 2, 1), powers @ z_m[:, :, None]
        # of rows behind a gap there may be too few for the degree: then the curve is the least steep
        terms = (np.linalg.pinv(normal, rcond=_SINGULAR, hermitian=True) @ right)[:, :, 0]
        drawn_m.append((terms * (-first_m / reach_m)[:, None] ** np.arange(degree + 1)).sum(axis=1))
    first = there & (y_m <= first_m[:, None] + _CURVES[0][1])
    mean_m = (first * z_m).sum(axis=1) / first.sum(axis=1)
    return np.where(little[:, None], mean_m[:, None], np.stack(drawn_m, axis=1))


def shared_std_m(profile: Profile) -> float:
    """Return the standard error that all curves of a profile share: the pattern in its first windows, and bend."""
    first = (profile.piece == 0) & (profile.y_m <= profile.y_m[0] + _CURVES[0][1])
    pixels = profile.pixels[first].astype(np.float64)
    pattern_m = _USUAL.at(pixels) * profile.z_m[first] ** 2
    # at the upper border even the largest window has half of its rows
    bent = 1 - np.clip(2 * pixels / max(int(profile.window_pixels[-1].max()), 1), 0, 1).mean()
    return float(np.sqrt((_LEVERAGE * pattern_m.mean()) ** 2 + _FLAT_STD_M**2 + (bent * _BENT_STD_M) ** 2))


def weighed_m(tops_m: FloatArray, shared_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    r"""Return what several estimates of the way past the end point say together, and its standard uncertainty.

    Parameters
    ----------
    tops_m : (T, n) float64
        Estimates, n > 1.
    shared_m : (T,) float64
        Standard error c that they share.

    Returns
    -------
    past_m, std_m : (T,) float64

    Notes
    -----
    Beforehand the way is 0, with the standard deviation E = 1 mm; the mean m of the estimates has the variance
    :math:`\sigma^2 = s^2 + c^2`, s their scatter. Both normal, what is known afterwards is :math:`w m` with the
    variance :math:`w \sigma^2`, :math:`w = E^2 / (E^2 + \sigma^2)`.
    """
    variance = tops_m.var(axis=1, ddof=1) + shared_m**2
    weight = _EXPECTED_M**2 / (_EXPECTED_M**2 + variance)
    past_m: FloatArray = weight * tops_m.mean(axis=1)
    std_m: FloatArray = np.sqrt(weight * variance)
    return past_m, std_m
