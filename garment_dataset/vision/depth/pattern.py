"""How strong the sensor's fixed pattern is, and how large its blobs, measured on a plane behind the garment."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from garment_dataset.vision.depth.cloud import LEVEL_SPACING_PER_M
from garment_dataset.vision.depth.flat_field import FINE_PATTERN_BLOB_PX, FINE_PATTERN_LEVELS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, DepthImage, FloatArray

ASSUMED_PATTERN: FloatArray = np.array([FINE_PATTERN_LEVELS * LEVEL_SPACING_PER_M, FINE_PATTERN_BLOB_PX])
"""Where nothing can be measured."""

_WINDOW_PX = 49
_LEAST_FRAMES = 4
_LEAST_PIXELS = 20_000
_LARGEST_LEVELS = 0.6
"""More than that is no sensor: a wall of bricks, a curtain."""

_PLANE_HALF_THICKNESS = 10 * LEVEL_SPACING_PER_M
"""Room for a wall that leans."""

_FILLED = 0.8


def fixed_pattern(frames: Sequence[DepthImage], table: FloatArray, *, beyond_m: float) -> FloatArray:
    r"""Measure the fixed pattern on what stands still far behind, as what the halves of some frames have in common.

    Parameters
    ----------
    frames : sequence of (H, W) uint16
        Images spread over the recording, in millimetres.
    table : (65536,) float64
        Inverse depth in 1/m by millimetres.
    beyond_m : float
        Nothing nearer is looked at.

    Returns
    -------
    (2,) float64
        Standard deviation of the pattern in a pixel, 1/m; number of pixels of a window that tell as much about it as
        one independent pixel would. As assumed where no smooth surface is seen far behind.

    Notes
    -----
    Noise differs between the halves, so the covariance of their means is that of the pattern alone. What columns share
    is taken off, as it is from the garment. The mean over a window of n pixels has the variance :math:`\sigma^2 B / n`,
    which is measured in windows of 49 x 49 pixels and gives B.
    """
    if len(frames) < _LEAST_FRAMES:
        return ASSUMED_PATTERN
    halves = [_mean_inverse(frames[start::2], table, beyond_m) for start in (0, 1)]
    seen = np.isfinite(halves[0]) & np.isfinite(halves[1])
    if not seen.any():
        return ASSUMED_PATTERN
    middle = float(np.median(halves[0][seen]))
    seen &= np.abs(halves[0] - middle) < _PLANE_HALF_THICKNESS
    if seen.sum() < _LEAST_PIXELS:
        return ASSUMED_PATTERN
    first, second = (_without_columns(half, seen) for half in halves)
    pixel = float((first * second).sum() / seen.sum())
    share = cv2.boxFilter(seen.astype(np.float64), -1, (_WINDOW_PX, _WINDOW_PX), normalize=True)
    whole = share > _FILLED
    if pixel <= 0:
        return np.array([0.0, 1.0])
    if np.sqrt(pixel) > _LARGEST_LEVELS * LEVEL_SPACING_PER_M or not whole.any():
        return ASSUMED_PATTERN
    means = [cv2.boxFilter(half, -1, (_WINDOW_PX, _WINDOW_PX), normalize=True)[whole] for half in (first, second)]
    window = float((means[0] * means[1] / share[whole] ** 2).mean())
    return np.array([np.sqrt(pixel), np.clip(_WINDOW_PX**2 * window / pixel, 1, _WINDOW_PX**2)])


def _mean_inverse(frames: Sequence[DepthImage], table: FloatArray, beyond_m: float) -> FloatArray:
    """Return the mean inverse depth of the pixels that see something far in all frames, NaN elsewhere."""
    far = min(max(int(1000 * beyond_m), 0), (1 << 16) - 1)
    total = np.zeros(frames[0].shape)
    for frame in frames:
        total += np.where(frame > far, table[frame], np.nan)
    return total / len(frames)


def _without_columns(inverse: FloatArray, seen: BoolArray) -> FloatArray:
    """Return the residuals about a slope down the rows and the mean of each column, 0 where nothing is seen."""
    rows = np.arange(inverse.shape[0], dtype=np.float64)[:, None]
    count = np.maximum(seen.sum(axis=0), 1)
    values = np.where(seen, inverse, 0)
    away = np.where(seen, rows - (rows * seen).sum(axis=0) / count, 0)
    centred = np.where(seen, values - values.sum(axis=0) / count, 0)
    slope = float((away * centred).sum() / max(float((away**2).sum()), 1e-12))
    residual: FloatArray = centred - slope * away
    return residual
