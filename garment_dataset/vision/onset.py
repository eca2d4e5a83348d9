"""When a path leaves its rest: the frame in which it surely has, and the instant at which it began to.

Positions are ``(T, 3)`` float64 in metres, NaN where unknown; stamps are ``(T,)`` int64 nanoseconds, ascending, all
different.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import FloatArray, IntArray

OnsetReason = Literal["no_gripper", "no_rest", "no_motion"]
"""Why there is no onset.

``no_gripper``: too few frames in which the gripper is known. ``no_rest``: it moves before its rest was seen.
``no_motion``: it never moves.
"""

_POWERS = np.arange(1.0, 3.51, 0.25)
"""Of time, with which a path leaves its rest: 1 a jump of speed, 2 of acceleration, 3 of jerk, as smooth drives do."""

_FLATTENING = np.arange(0.0, 0.41, 0.1)
"""Share by which a rise falls behind its power at the end of the fit: no drive speeds up for ever."""

_STEP_S = 0.002
"""Between the instants that are tried."""

_LOOK_BACK_NS = 2_000_000_000
"""How much of the rest and the rise is looked at: to reach the threshold takes no drive as long."""

_SIGNIFICANT = 4.0
"""Noises that a position has to be from rest, to be part of the rise for certain."""


@dataclass(frozen=True, slots=True)
class Onset:
    """When a path leaves its rest.

    Parameters
    ----------
    stamp_ns : int
        The instant, on the clock of the stamps.
    std_s : float
        Its standard uncertainty.
    """

    stamp_ns: int
    std_s: float


@dataclass(frozen=True, slots=True)
class OnsetSettings:
    """What counts as motion, and what its beginning is told from.

    Parameters
    ----------
    threshold_m : float
        Distance from rest that counts as motion.
    rest_frames : int
        So many frames have to show the path at rest.
    lasting_frames : int
        So many frames in a row have to be farther from rest than the threshold.
    rise_frames : int
        So many frames after the first that is surely away from rest make up the rise.
    noise_m : float
        Standard deviation below which differences of positions mean nothing.
    """

    threshold_m: float
    rest_frames: int
    lasting_frames: int
    rise_frames: int
    noise_m: float


def find_onset(stamp_ns: IntArray, position_m: FloatArray, settings: OnsetSettings) -> Onset | OnsetReason:
    """Estimate the instant at which a path leaves its rest.

    Parameters
    ----------
    stamp_ns : (T,) int64
        Ascending, all different.
    position_m : (T, 3) float64
        Path of the gripper; frames with NaN are passed over.
    settings : OnsetSettings
        See there.

    Returns
    -------
    Onset, or in a word why there is none.

    Notes
    -----
    First the frame is found in which the path is surely in motion, as :func:`motion_frame` says; that is late by up to
    0.2 s where a drive starts softly. From there the rise is followed back to the rest, see :func:`rise_start`: the
    displacement along the way to the end of the rise, from the rest to some frames after it stands out of its noise.
    """
    found = np.flatnonzero(np.logical_and.reduce(np.isfinite(position_m), axis=-1))
    path_m, times_ns = position_m[found], stamp_ns[found]
    moving = motion_frame(
        path_m,
        threshold_m=settings.threshold_m,
        rest_frames=settings.rest_frames,
        lasting_frames=settings.lasting_frames,
    )
    if isinstance(moving, str):
        return moving
    away_m, noise_m = _along_rise(path_m, moving, settings)
    rest_m = np.median(away_m[: settings.rest_frames])
    within = np.flatnonzero(away_m[: moving + 1] - rest_m < _SIGNIFICANT * noise_m)
    last = min(int(within[-1] if within.size else 0) + 1 + settings.rise_frames, found.size - 1)
    seen = slice(int(np.searchsorted(times_ns, times_ns[last] - _LOOK_BACK_NS)), last + 1)
    start_s, std_s = rise_start((times_ns[seen] - times_ns[last]) / 1e9, away_m[seen], settings.noise_m)
    onset = Onset(int(times_ns[last]) + round(start_s * 1e9), std_s)
    return onset if (times_ns < onset.stamp_ns).sum() >= settings.rest_frames else "no_rest"


def motion_frame(path_m: FloatArray, *, threshold_m: float, rest_frames: int, lasting_frames: int) -> int | OnsetReason:
    """Find the frame from which a path without gaps is surely away from its rest.

    Parameters
    ----------
    path_m : (T, 3) float64
        Without NaN.
    threshold_m : float
        Distance from rest that counts as motion.
    rest_frames : int
        The rest is the median position of so many frames from the first.
    lasting_frames : int
        So many frames in a row have to be farther from rest than the threshold: one wrong position is no motion.

    Returns
    -------
    int or str
        Index of the first of the lasting frames; in a word why there is none: ``no_rest`` when the path leaves before
        ``rest_frames`` frames have passed.

    Notes
    -----
    A path that drifts by less than the threshold within ``rest_frames`` frames is taken to rest.
    """
    if path_m.shape[0] < rest_frames + lasting_frames:
        return "no_gripper"
    away = np.linalg.norm(path_m - np.median(path_m[:rest_frames], axis=0), axis=1) > threshold_m
    lasting = np.convolve(away, np.ones(lasting_frames), mode="valid") >= lasting_frames
    first = int(lasting.argmax())
    if not lasting[first]:
        return "no_motion"
    return first if first >= rest_frames else "no_rest"


def _along_rise(path_m: FloatArray, moving: int, settings: OnsetSettings) -> tuple[FloatArray, float]:
    """Return how far a path is from its rest in the direction in which it leaves, (T,), and the noise of that."""
    rest_m = np.median(path_m[: settings.rest_frames], axis=0)
    way_m = path_m[min(moving + settings.lasting_frames, path_m.shape[0]) - 1] - rest_m
    away_m = (path_m - rest_m) @ (way_m / np.linalg.norm(way_m))
    steps_m = np.abs(np.diff(away_m[: moving + 1]))
    # of the steps between frames at rest and early in the rise, the median is one at rest; normal: 0.954 noises
    return away_m, max(settings.noise_m, float(np.median(steps_m)) / 0.954)


def rise_start(time_s: FloatArray, away_m: FloatArray, noise_m: float) -> tuple[float, float]:
    r"""Extrapolate a rise back to where it leaves the rest.

    Parameters
    ----------
    time_s : (n,) float64
        Ascending, the last is 0.
    away_m : (n,) float64
        Displacement, of the rest and the beginning of the rise.
    noise_m : float
        Standard deviation below which differences mean nothing.

    Returns
    -------
    start_s, std_s : float
        On the clock of ``time_s``, and its standard uncertainty.

    Notes
    -----
    Of :math:`b + a u^p (1 - c u^2)` with :math:`u = \max(t - t_0, 0) / (t_n - t_0)`, level b and height a are fitted
    for every :math:`t_0`, power p and flattening c of a grid. With a flat prior on these and an unknown noise, every
    cell weighs :math:`(S / n + \sigma_0^2)^{-(n - 2) / 2}`, S the sum of its squared residuals; mean and standard
    deviation of :math:`t_0` over the grid are the result. The step of the grid is part of the uncertainty.
    """
    starts_s = np.arange(time_s[0], time_s[-2], _STEP_S)[:, None, None, None]
    share = np.maximum(time_s - starts_s, 0) / -starts_s
    rise = share ** _POWERS[:, None, None] * (1 - _FLATTENING[:, None] * share**2)
    rise -= rise.mean(axis=-1, keepdims=True)
    rest_m = away_m - away_m.mean()
    explained = (rise @ rest_m) ** 2 / (rise**2).sum(axis=-1)
    variance = np.maximum((rest_m**2).sum() - explained, 0) / away_m.size + noise_m**2
    log_weight = -(away_m.size - 2) / 2 * np.log(variance)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    start_s = float((weight * starts_s[..., 0]).sum())
    std_s = float(np.sqrt((weight * (starts_s[..., 0] - start_s) ** 2).sum()))
    return start_s, float(np.hypot(std_s, _STEP_S))
