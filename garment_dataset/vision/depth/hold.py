"""Where the cloth leads above the first row that is seen of it: to the gripper's end point, or past it.

The fingers hide the first centimetre. Drawn up from below, cloth that bends at the jaws seems to pass the end point by
millimetres, though it is held there; cloth that hangs from the outside of the jaws does pass it. Lines of different
length tell one from the other.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from garment_dataset.vision.depth.smoothing import adaptive_mean

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, FloatArray
    from garment_dataset.vision.depth.profile import Profile

_FRAMES = (5, 9, 17, 33, 65, 129, 257)
"""How the cloth is held changes little, so it may be followed over the whole recording."""

_LONG_M, _SHORT_M = 0.04, 0.02
_MIN_ROWS = 5

_FARTHEST_M = 0.03
"""Cloth that seems farther from the gripper's end point is not held there: its line upwards means nothing."""


class Hold(NamedTuple):
    """How a garment is held, frame by frame.

    ``past_m``, (T,), is z of the cloth at the height of the end point, relative to it, 0 where the way down is
    straight; ``noise_m``, (T,), the standard deviation of its noise; ``held``, (T,), whether the cloth leads to the end
    point.
    """

    past_m: FloatArray
    noise_m: FloatArray
    held: BoolArray

    @property
    def distance_m(self) -> FloatArray:
        """Length of the way from the end point to the cloth at its height, (T,); 0 where it is not held."""
        return np.abs(self.past_m) * self.held


def follow_hold(profiles: Sequence[Profile], gripper_m: FloatArray, time_s: FloatArray, *, over_time: bool) -> Hold:
    """Find how far past the end point the cloth leads, by several estimates, each followed over time.

    Parameters
    ----------
    profiles : sequence of Profile, length T
        In the order of time.
    gripper_m : (T, 3) float64
        End point of the gripper.
    time_s : (T,) float64
        Ascending, all different.
    over_time : bool
        Whether anything is smoothed over time.

    Returns
    -------
    Hold
    """
    each_m = np.stack([drawn_up_m(profile, gripper_m[row]) for row, profile in enumerate(profiles)])
    tops_m, noise_m = adaptive_mean(time_s, each_m, _FRAMES if over_time else (), degree=1)
    held = np.abs(tops_m[:, 0]) < _FARTHEST_M
    return Hold(np.where(held, agreed_m(tops_m), tops_m[:, 0]), noise_m[:, 0], held)


def drawn_up_m(profile: Profile, gripper_m: FloatArray) -> FloatArray:
    """Return z, relative to the gripper's, of the first cloth drawn up to the height of the end point, (3,).

    By the line through its first 4 cm, by that through the first 2 cm, and by the parabola through 4 cm: of the
    smallest window, as larger ones straighten what bends at the jaws. Of too little cloth a mean and twice 0.
    """
    z_m = profile.window_z_m[0]
    y_m = profile.y_m / profile.z_m * z_m - gripper_m[1]
    first = (profile.piece == 0) & (y_m <= y_m[0] + _LONG_M)
    y_m, z_m = y_m[first], z_m[first] - gripper_m[2]
    short = y_m <= y_m[0] + _SHORT_M
    if y_m[-1] - y_m[0] < _SHORT_M or short.sum() < _MIN_ROWS:
        return np.array([z_m.mean(), 0.0, 0.0])
    fits = ((y_m, z_m, 1), (y_m[short], z_m[short], 1), (y_m, z_m, 2))
    return np.array([np.polynomial.polynomial.polyfit(*fit)[0] for fit in fits])


def agreed_m(tops_m: FloatArray) -> FloatArray:
    """Return what several estimates, (T, n), agree on at least, (T,): 0 where they point to both sides."""
    agreed = (np.sign(tops_m) == np.sign(tops_m[:, :1])).all(axis=1)
    least_m: FloatArray = np.sign(tops_m[:, 0]) * np.abs(tops_m).min(axis=1) * agreed
    return least_m
