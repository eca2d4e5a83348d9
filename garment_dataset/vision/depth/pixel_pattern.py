r"""What a depth sensor adds to single pixels, seen in an empty scene, and how much of that a recording shares.

A sensor that finds disparity by matching dots errs by a texture that stands still in the image. An empty scene shows it
wherever a surface is smooth. How much of it holds at the garment's distance is another matter: part of it belongs to
the dots, which move over the pixels as the distance changes. So a recording is asked: its garment is smooth between
folds, and what is left there is compared with the pattern.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import cv2
import numpy as np

from garment_dataset.vision.depth.cloud import LEVEL_SPACING_PER_M

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, DepthImage, FloatArray

ShareReason = Literal["no_empty_scene", "image_size", "no_pattern", "few_pixels", "not_predictive"]
"""Why nothing of a pattern is taken off.

``no_empty_scene``: the recording's camera position has none. ``image_size``: its images are of another size.
``no_pattern``: it shows no smooth surface. ``few_pixels``: too little of the garment is smooth and lies where the
pattern is known. ``not_predictive``: what the garment shows does not follow it, within two standard uncertainties.
"""

_HALF_WINDOW_PX = 30
"""Of the surface that the empty scene is compared with: a pattern is what is finer than some 60 px, walls are not."""

_HALF_SIZES_PX = (2, 6, 12)

_NEAR_HALF_WINDOW_PX = 12
"""The same of the garment, which is bent more: over 25 px, 4.7 cm at 1.07 m."""

_FULL, _HALF_FULL = 0.8, 0.5
"""Share of a window that must be known: of cloth, which bends; of an empty scene, up to the border of a wall."""

_SEEN = 0.75
_OUTLIER = 4.0
"""More than so many times the usual deviation is no pattern, but the relief of what is seen."""

_TILE_PX = 32
"""Errors of pixels farther apart than that have little to do with each other."""

_LEAST_TILES = 8
_LEAST_PIXELS = 5000
_SIGNIFICANT = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class PixelPattern:
    """What a sensor adds to inverse depth, pixel by pixel.

    Parameters
    ----------
    per_m : (H, W) float64
        In 1/m; NaN where it was not seen.
    std_per_m : (H, W) float64
        Its standard uncertainty by the noise in time, before it is shrunk.
    """

    per_m: FloatArray
    std_per_m: FloatArray


@dataclass(frozen=True, slots=True)
class PatternShare:
    """How much of the pattern of the empty scene is seen at the garment.

    Parameters
    ----------
    value : float
        Regression of what the garment shows on the pattern, not shrunk.
    std : float
        Its standard uncertainty.
    used : float
        So much is taken off: the value, shrunk by its uncertainty, within 0 and 1.
    """

    value: float
    std: float
    used: float


def pixel_pattern(frames: Sequence[DepthImage], table: FloatArray, offset_per_m: FloatArray | None) -> PixelPattern:
    r"""Measure the pattern in images of a scene in which nothing moves.

    Parameters
    ----------
    frames : sequence of (H, W) uint16
        In millimetres.
    table : (65536,) float64
        Inverse depth by millimetres.
    offset_per_m : (W,) float64 or None
        What whole columns add, which recordings show themselves, and is left out.

    Returns
    -------
    PixelPattern

    Notes
    -----
    The mean over the frames, less the plane through the 61 x 61 pixels around, which is fitted twice, without outliers
    the second time. Pixels that are missing in a quarter of the frames, or around which half of the window is missing
    or an outlier, have none. What is left is split by size, at 5, 13 and 25 px, and each part is shrunk by how far the
    means over every other frame agree on it: noise is finer than many a pattern.
    """
    halves = [_Mean.of(frames[start::2], table) for start in (0, 1)]
    number = np.maximum(sum(half.number for half in halves), 2.0)
    sums = sum(half.number * half.mean for half in halves)
    mean, apart = sums / number, (halves[0].mean - halves[1].mean) / 2
    variance = np.maximum(sum(half.squares for half in halves) - number * mean**2, 0.0) / (number - 1)
    seen = number >= max(_SEEN * len(frames), 2)
    seen &= (halves[0].number > 0) & (halves[1].number > 0) & _smooth(mean, seen)
    level = mean if offset_per_m is None else mean - offset_per_m
    residual = residual_about_planes(np.where(seen, level, np.nan), _HALF_WINDOW_PX, _HALF_FULL)
    inside = _usual(residual)
    pattern, noise = (
        _by_size(residual_about_planes(np.where(inside, values, np.nan), _HALF_WINDOW_PX, _HALF_FULL))
        for values in (level, apart)
    )
    shrunk = np.zeros(mean.shape)
    for part, noise_part in zip(pattern, noise, strict=True):
        known = np.isfinite(part)
        power = float((part[known] ** 2).sum())
        shrunk += part * (max(1 - float((noise_part[known] ** 2).sum()) / power, 0.0) if power > 0 else 0.0)
    return PixelPattern(shrunk, np.where(np.isfinite(shrunk), np.sqrt(variance / number), np.nan))


@dataclass(frozen=True, slots=True, eq=False)
class _Mean:
    """Number of depths, their mean and sum of squares, pixel by pixel, in inverse depth."""

    number: FloatArray
    mean: FloatArray
    squares: FloatArray

    @classmethod
    def of(cls, frames: Sequence[DepthImage], table: FloatArray) -> _Mean:
        total, squares, number = np.zeros((3, *frames[0].shape))
        for frame in frames:
            inverse = table[frame]
            total += inverse
            squares += inverse**2
            number += inverse > 0
        return cls(number, total / np.maximum(number, 1), squares)


def _by_size(values: FloatArray) -> list[FloatArray]:
    """Return parts of values, the finest first, whose sum they are."""
    finer = [residual_about_planes(values, half_px, _HALF_FULL / 2) for half_px in _HALF_SIZES_PX]
    return [finer[0], *(finer[k] - finer[k - 1] for k in range(1, len(finer))), values - finer[-1]]


def pattern_share(
    frames: Sequence[DepthImage],
    table: FloatArray,
    offset_per_m: FloatArray | None,
    pattern_per_m: FloatArray,
    limits_mm: tuple[int, int],
) -> PatternShare | ShareReason:
    r"""Measure how much of a pattern is in what images show of a garment.

    Parameters
    ----------
    frames : sequence of (H, W) uint16
        Images of the recording, in millimetres.
    table : (65536,) float64
        Inverse depth by millimetres.
    offset_per_m : (W,) float64 or None
        What whole columns add.
    pattern_per_m : (H, W) float64
        From :func:`pixel_pattern`.
    limits_mm : (int, int)
        Depths between which the garment is.

    Returns
    -------
    PatternShare or str
        The reason when it cannot be measured, or is nothing.

    Notes
    -----
    With r and p what the garment and the pattern are beside their planes in 25 x 25 pixels, the share is
    :math:`b = \sum r p / \sum p^2`, which predicts best, whatever noise the pattern carries. Its variance is that of
    tiles of 32 x 32 pixels, :math:`\sum (A_i - b B_i)^2 / (\sum B_i)^2` with the sums A and B of a tile in all frames:
    what the cloth's own relief makes of it is in there. Used is :math:`b (1 - s^2 / b^2)`.
    """
    if not np.isfinite(pattern_per_m).any():
        return "no_pattern"
    fine = residual_about_planes(pattern_per_m, _NEAR_HALF_WINDOW_PX)
    known = np.isfinite(fine)
    shape = tuple(-(-size // _TILE_PX) for size in fine.shape)
    both, square, number = np.zeros(shape), np.zeros(shape), 0
    for frame in frames:
        near = (frame >= limits_mm[0]) & (frame <= limits_mm[1])
        inverse = np.where(near, table[frame], 0.0)
        seen = near & (inverse > 0) & _smooth(inverse, near)
        level = inverse if offset_per_m is None else inverse - offset_per_m
        residual = residual_about_planes(np.where(seen, level, np.nan), _NEAR_HALF_WINDOW_PX)
        good = known & _usual(residual)
        v, u = np.nonzero(good)
        np.add.at(both, (v // _TILE_PX, u // _TILE_PX), residual[good] * fine[good])
        np.add.at(square, (v // _TILE_PX, u // _TILE_PX), fine[good] ** 2)
        number += v.size
    if number < _LEAST_PIXELS or np.count_nonzero(square) < _LEAST_TILES:
        return "few_pixels"
    value = float(both.sum() / square.sum())
    std = float(np.sqrt(((both - value * square) ** 2).sum()) / square.sum())
    if value <= _SIGNIFICANT * std:
        return "not_predictive"
    return PatternShare(value, std, min(value * (1 - (std / value) ** 2), 1.0))


def _usual(residual: FloatArray) -> BoolArray:
    """Return which residuals are known and no outliers."""
    known = np.isfinite(residual)
    size = np.abs(np.where(known, residual, 0.0))
    limit = _OUTLIER * 1.4826 * float(np.median(size[known])) if known.any() else 0.0
    usual: BoolArray = known & (size <= max(limit, 1e-9))
    return usual


def _smooth(inverse: FloatArray, seen: BoolArray) -> BoolArray:
    """Return the pixels with a neighbourhood of 5 x 5 of one surface, whose medians are within some levels."""
    middle = cv2.medianBlur(inverse.astype(np.float32), 5)
    kernel = np.ones((5, 5), np.uint8)
    spread = cv2.dilate(middle, kernel) - cv2.erode(middle, kernel)
    return seen & (spread < 4 * LEVEL_SPACING_PER_M)


def residual_about_planes(values: FloatArray, half_px: int, least: float = _FULL) -> FloatArray:
    """Return what values are beside the plane through the window around each.

    Parameters
    ----------
    values : (H, W) float64
        NaN where there is none.
    half_px : int
        Half the width and height of the window.
    least : float
        Share of it that must be known.

    Returns
    -------
    (H, W) float64
        NaN where there is none, or less of the window is known.
    """
    known = np.isfinite(values)
    result = np.full(values.shape, np.nan)
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if rows.size == 0:
        return result
    part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    known, own = known[part], values[part]
    middle = float(own[known].mean())
    weight, level = known.astype(np.float64), np.where(known, own - middle, 0.0)
    step = np.arange(-half_px, half_px + 1, dtype=np.float64) / half_px
    ones = np.ones(step.size)
    n, nu, nuu = (_window(weight, step**power, ones) for power in range(3))
    nv, nuv, nvv = _window(weight, ones, step), _window(weight, step, step), _window(weight, ones, step**2)
    q, qu, qv = _window(level, ones, ones), _window(level, step, ones), _window(level, ones, step)
    # Cramer's rule for the level of the plane in the middle of the window
    minors = nuu * nvv - nuv**2, nu * nvv - nuv * nv, nu * nuv - nuu * nv
    whole = n * minors[0] - nu * minors[1] + nv * minors[2]
    plane = q * minors[0] - qu * minors[1] + qv * minors[2]
    good = known & (n >= least * step.size**2)
    result[part] = np.where(good, level - plane / np.where(good, whole, 1.0), np.nan)
    return result


def _window(values: FloatArray, across: FloatArray, down: FloatArray) -> FloatArray:
    """Return sums over windows, weighted by what they are across and down."""
    sums: FloatArray = cv2.sepFilter2D(values, -1, across, down, borderType=cv2.BORDER_CONSTANT).astype(np.float64)
    return sums
