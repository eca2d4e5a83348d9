"""What a depth sensor always adds to means over windows: by how much a still plane seems bent in all frames.

An error that is the same in all pixels cannot be told from where things are, and is not in here; neither is what whole
columns share, which is corrected apart (:mod:`~garment_dataset.vision.depth.flat_field`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.vision.depth.backdrop import backdrop, static_inverse
from garment_dataset.vision.depth.cloud import LEVEL_SPACING_PER_M
from garment_dataset.vision.depth.sensor_noise import MIN_WINDOWS, window_means

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, DepthImage, FloatArray

_FINE_PATTERN_LEVELS = 0.25
"""Standard deviation of the fixed error that differs from pixel to pixel, in level spacings.

An assumption, the same as the simulated sensor's: real planes are rougher than noise in time explains, but how much
of that is fixed was not measured apart.
"""

_FINE_PATTERN_BLOB_PX = 113.0
"""Pixels of a window that tell as much about that pattern as one independent pixel would.

White noise smoothed by a Gaussian of 3 px, as simulated, has 4 pi 3^2 px to a blob.
"""

_CURTAIN_PX = np.array(625.0)
_CURTAIN_PER_M = 0.6 * LEVEL_SPACING_PER_M
"""Means over 25 x 25 pixels that scatter by more are no sensor's: a curtain, a wall of stones."""

WINDOWS_PX = ((0, 0), (2, 2), (4, 7), (8, 8), (12, 12), (18, 12), (36, 12), (36, 24), (70, 20))
"""Half widths and half heights of the windows over which errors are averaged to see how fast they fade."""


@dataclass(frozen=True, slots=True, eq=False)
class FixedPattern:
    """How large the mean over a window is that a sensor always adds.

    Parameters
    ----------
    pixels : (k,) float64
        Sizes of the windows, rising.
    std_per_m : (k,) float64
        Standard deviation of the mean over such a window, falling.
    """

    pixels: FloatArray
    std_per_m: FloatArray

    def at(self, pixels: FloatArray) -> FloatArray:
        """Return the standard deviation of means over windows of these sizes, interpolated in their logarithms."""
        std_per_m: FloatArray = np.interp(np.log(np.maximum(pixels, 1.0)), np.log(self.pixels), self.std_per_m)
        return std_per_m


def measured_pattern(
    frames: Sequence[DepthImage], table: FloatArray, offset_per_m: FloatArray | None, *, beyond_m: float
) -> FixedPattern | None:
    """Measure what is always added, on the largest plane that stands still behind the garment.

    Parameters
    ----------
    frames : sequence of (H, W) uint16
        Images spread over the recording, in millimetres.
    table : (65536,) float64
        Inverse depth by millimetres.
    offset_per_m : (W,) float64 or None
        What columns add, from :func:`~garment_dataset.vision.depth.flat_field.column_offsets`. Where it is 0 a column
        was not corrected, and says nothing of those that were.
    beyond_m : float
        Nothing nearer is looked at.

    Returns
    -------
    FixedPattern or None
        None without such a plane, or when what is seen on it is as large as the folds of a curtain.
    """
    plane = backdrop(static_inverse(frames, table, beyond_m)) if len(frames) >= 2 else None
    if plane is None:
        return None
    halves = [frames[: len(frames) // 2], frames[len(frames) // 2 :]]
    added = 0.0 if offset_per_m is None else offset_per_m
    first, second = (static_inverse(half, table, beyond_m) - added for half in halves)
    if offset_per_m is not None and offset_per_m.any():
        plane &= offset_per_m != 0
    found = fixed_pattern(first, second, plane)
    return None if found is None or found.at(_CURTAIN_PX) > _CURTAIN_PER_M else found


def fixed_pattern(first: FloatArray, second: FloatArray, plane: BoolArray) -> FixedPattern | None:
    """Measure what is always added, on a plane, from two means over different frames.

    Parameters
    ----------
    first, second : (H, W) float64
        Mean inverse depth over different frames, less what is corrected anyway.
    plane : (H, W) bool
        Pixels of a plane that stands still.

    Returns
    -------
    FixedPattern or None
        None when no window of 25 pixels finds room on the plane.

    Notes
    -----
    A paraboloid is taken off first: a lean is the plane's, and walls are bent. What both means share is fixed, as the
    noise is not the same in them: the variance is the mean product of their window means.
    """
    seen = plane & np.isfinite(first) & np.isfinite(second)
    if not seen.any():
        return None
    flat = [_less_paraboloid(mean, seen) for mean in (first, second)]
    sizes, stds = [], []
    for half_width, half_height in WINDOWS_PX:
        means, full = zip(*(window_means(values, half_width, half_height) for values in flat), strict=True)
        both = means[0] * means[1]
        both = both[np.isfinite(both)]
        if both.size >= MIN_WINDOWS:
            sizes.append(float(full[0]))
            stds.append(float(np.sqrt(max(both.mean(), 0.0))))
    if len(sizes) < 2:
        return None
    # the mean over more pixels errs no more: what seems so is chance
    return FixedPattern(np.array(sizes), np.maximum.accumulate(np.array(stds)[::-1])[::-1])


def less_known(pattern: FixedPattern, known_per_m: FloatArray) -> FixedPattern:
    """Return what is left of a pattern when a part of it is taken off pixel by pixel.

    Parameters
    ----------
    pattern : FixedPattern
        With windows of :data:`WINDOWS_PX`.
    known_per_m : (H, W) float64
        What is taken off: the pattern as far as it can be predicted, so that its variance is that much of the
        pattern's. NaN elsewhere.
    """
    left = pattern.std_per_m.copy()
    sizes = pattern.pixels.tolist()
    for half_width, half_height in WINDOWS_PX:
        means, size = window_means(known_per_m, half_width, half_height)
        means = means[np.isfinite(means)]
        if size in sizes and means.size >= MIN_WINDOWS:
            place = sizes.index(size)
            left[place] = np.sqrt(max(left[place] ** 2 - float(np.mean(means**2)), 0.0))
    return FixedPattern(pattern.pixels, np.maximum.accumulate(left[::-1])[::-1])


def _less_paraboloid(values: FloatArray, seen: BoolArray) -> FloatArray:
    v, u = np.nonzero(seen)
    x, y = 2 * u / values.shape[1] - 1, 2 * v / values.shape[0] - 1
    basis = np.stack([np.ones(u.size), x, y, x * x, x * y, y * y], axis=1)
    known = values[v, u]
    fit = np.linalg.lstsq(basis.T @ basis, basis.T @ known, rcond=None)[0]
    residual = np.full(values.shape, np.nan)
    residual[v, u] = known - basis @ fit
    return residual


def usual_pattern() -> FixedPattern:
    """Return the fixed pattern, columns aside, of a sensor of which nothing is known: an OpenNI camera's."""
    blobs = np.array([1.0, 4.0, 16.0, 64.0, 256.0])
    return FixedPattern(_FINE_PATTERN_BLOB_PX * blobs, _FINE_PATTERN_LEVELS * LEVEL_SPACING_PER_M / np.sqrt(blobs))
