r"""Which window a profile's surfaces are taken from, decided over time.

A large window averages the sensor's noise and its fixed pattern; a small one follows cloth that is bent more than a
surface of second order can be. Noise goes away when profiles are smoothed over time, the error of a window too large
does not, so it has to be found before: differences between windows are pooled over time and along the cloth, and what
is more in them than noise and pattern explain is bend.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import FloatArray
    from garment_dataset.vision.depth.pattern import FixedPattern
    from garment_dataset.vision.depth.profile import Profile

_STEP_M = 0.005
_POOLED_FRAMES = 17
_POOLED_SAMPLES = 15
"""Half a second, and 7.5 cm of cloth: one and a half times the smallest window."""

_NOISE_LEFT = float(np.sqrt(0.255))
"""Share of the noise that is left by the parabola through 9 frames."""

_CONFIDENCE = 2.0
"""So many standard deviations of pattern and noise a difference may have. Fewer would take the small window just where
its own pattern is worst."""

_FADE = 0.5


def choose_windows(
    profiles: Sequence[Profile], gripper_m: FloatArray, pattern: FixedPattern, noise_per_m: float
) -> list[Profile]:
    r"""Give every profile the depths of the windows that fit it best.

    Parameters
    ----------
    profiles : sequence of Profile, length T
        In the order of time, each with the depths of w windows.
    gripper_m : (T, 3) float64
        End point of the gripper.
    pattern : FixedPattern
        What the sensor always adds.
    noise_per_m : float
        Of one pixel in a window of such ones, if all were independent.

    Returns
    -------
    list of Profile, length T
        With depths of one window, or of something between two.

    Notes
    -----
    With :math:`P_k` the variance that pattern and smoothed noise leave in the window k, a window k larger than i is
    better by :math:`P_i - P_k` and worse by the square of its bias b. The difference of both has the mean square
    :math:`b^2 + P_i - P_k`, less the noise that is left of it, which is known from its scatter over time. So k is taken
    where that is below four times what the pattern gains, two standard deviations, and what the noise does, and fades
    out up to half more.
    """
    windows = profiles[0].window_z_m.shape[0]
    if windows == 1 or len(profiles) < 2:
        return [_taken(profile, np.zeros((windows - 1, profile.z_m.size))) for profile in profiles]
    below_m = [profile.y_m - gripper_m[i, 1] for i, profile in enumerate(profiles)]
    raster_m: FloatArray = _STEP_M * np.arange(int(max(float(y[-1]) for y in below_m) / _STEP_M) + 2, dtype=np.float64)
    inverse = _on_raster(raster_m, below_m, [1 / profile.window_z_m for profile in profiles])
    gain = _on_raster(raster_m, below_m, [profile.window_gain for profile in profiles])
    # the mean over so many pixels would have the same noise; noise counts once, as that of the differences is taken off
    noise = (_NOISE_LEFT * noise_per_m / _CONFIDENCE) ** 2 * gain
    variance = pattern.at(1 / np.maximum(gain, 1e-9)) ** 2 + noise
    best, best_variance = inverse[:, 0], variance[:, 0]
    shares = np.empty_like(inverse[:, 1:])
    for k in range(1, windows):
        gained = np.maximum(best_variance - variance[:, k], 0)
        excess = _pooled_square(inverse[:, k] - best) / np.maximum(_CONFIDENCE**2 * _along(gained), 1e-30)
        shares[:, k - 1] = np.clip((1 + _FADE - excess) / _FADE, 0, 1)
        best = best + shares[:, k - 1] * (inverse[:, k] - best)
        best_variance = best_variance - shares[:, k - 1] * gained
    return [
        _taken(profile, np.stack([np.interp(below_m[i], raster_m, share) for share in shares[i]]))
        for i, profile in enumerate(profiles)
    ]


def _on_raster(raster_m: FloatArray, below_m: Sequence[FloatArray], values: Sequence[FloatArray]) -> FloatArray:
    """Return values of windows and nodes at a raster, (T, w, m)."""
    return np.stack(
        [np.stack([np.interp(raster_m, y, row) for row in rows]) for y, rows in zip(below_m, values, strict=True)]
    )


def _pooled_square(difference: FloatArray) -> FloatArray:
    """Return the mean square, over time and along the cloth, of what differences are but for their noise, (T, m)."""
    frames = min(_POOLED_FRAMES, difference.shape[0])
    mean = _over_time(difference, frames)
    # successive frames share little of their noise, so half of their changes' square is its variance
    change = np.diff(difference, axis=0) ** 2 / 2
    noise = np.concatenate([change, change[-1:]])
    noise = _over_time(np.minimum(noise, 4 * np.median(noise, axis=0)), frames) / frames
    return _along(np.maximum(mean**2 - noise, 0))


def _over_time(values: FloatArray, frames: int) -> FloatArray:
    """Return means over so many frames about each, near the ends over the first or last."""
    sums = np.concatenate([np.zeros((1, values.shape[1])), values.cumsum(axis=0)])
    first = np.clip(np.arange(values.shape[0]) - frames // 2, 0, values.shape[0] - frames)
    mean: FloatArray = (sums[first + frames] - sums[first]) / frames
    return mean


def _along(values: FloatArray) -> FloatArray:
    """Return means over the samples about each, along the cloth."""
    half = _POOLED_SAMPLES // 2
    padded = np.pad(values, ((0, 0), (half, half)), mode="edge")
    sums = np.concatenate([np.zeros((values.shape[0], 1)), padded.cumsum(axis=1)], axis=1)
    mean: FloatArray = (sums[:, _POOLED_SAMPLES:] - sums[:, :-_POOLED_SAMPLES]) / _POOLED_SAMPLES
    return mean


def _taken(profile: Profile, shares: FloatArray) -> Profile:
    """Return a profile that goes, window by window, so far to the next larger one."""
    inverses, pixels = 1 / profile.window_z_m, profile.window_pixels[0].astype(np.float64)
    inverse = inverses[0]
    for share, larger, count in zip(shares, inverses[1:], profile.window_pixels[1:], strict=True):
        inverse = inverse + share * (larger - inverse)
        pixels = pixels + share * (count - pixels)
    z_m = 1 / inverse
    y_m = profile.y_m / profile.z_m * z_m
    return replace(profile, y_m=y_m, z_m=z_m, pixels=np.rint(pixels).astype(np.int64), end_y_m=float(y_m[-1]))
