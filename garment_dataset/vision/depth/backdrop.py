"""The largest plane that stands still behind the garment: what a sensor's own errors are seen on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.vision.depth.cloud import LEVEL_SPACING_PER_M

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, DepthImage, FloatArray

_HALF_THICKNESS_PER_M = 3 * LEVEL_SPACING_PER_M
"""Pixels nearer to a plane belong to it: six times the fixed error and the noise of means that were measured."""

_TRIALS = 256
_SEED = 20131118
_SAMPLE = 4096
_MIN_SHARE = 0.05


def static_inverse(frames: Sequence[DepthImage], table: FloatArray, beyond_m: float) -> FloatArray:
    """Return the mean inverse depth of what is far and seen in at least three quarters of the frames.

    Parameters
    ----------
    frames : sequence of (H, W) uint16
        Images in millimetres.
    table : (65536,) float64
        Inverse depth by millimetres.
    beyond_m : float
        Nothing nearer is looked at.

    Returns
    -------
    (H, W) float64
        In 1/m; NaN elsewhere.
    """
    total, count = np.zeros(frames[0].shape), np.zeros(frames[0].shape, np.int32)
    far = table.copy()
    far[: max(int(1000 * beyond_m), 0) + 1] = 0
    for frame in frames:
        inverse = far.take(frame)
        total += inverse
        count += inverse > 0
    often = count >= max(1.0, 0.75 * len(frames))
    return np.where(often, total / np.maximum(count, 1), np.nan)


def backdrop(inverse: FloatArray) -> BoolArray | None:
    """Find the plane that most pixels lie on, however it leans.

    Parameters
    ----------
    inverse : (H, W) float64
        Inverse depth in 1/m, NaN where there is none: planes are linear in it.

    Returns
    -------
    (H, W) bool or None
        The plane's pixels; None when it has fewer than 5 % of the image.

    Notes
    -----
    Random sample consensus (Fischler and Bolles, 1981) with a fixed seed, on some of the pixels; the best of the trials
    is refined by least squares on its own pixels, twice.
    """
    known = np.flatnonzero(np.isfinite(inverse))
    if known.size < _MIN_SHARE * inverse.size:
        return None
    random = np.random.default_rng(_SEED)
    chosen = known[random.integers(known.size, size=_SAMPLE)]
    x, y = _places(inverse.shape)
    points = np.stack([np.ones(_SAMPLE), x[chosen % x.size], y[chosen // x.size]], axis=1)
    values = inverse.ravel()[chosen]
    triples = random.integers(_SAMPLE, size=(_TRIALS, 3))
    systems = points[triples]
    solvable = np.abs(np.linalg.det(systems)) > 1e-3
    planes = np.linalg.solve(systems[solvable], values[triples[solvable]][:, :, None])[:, :, 0]
    if planes.size == 0:
        return None
    away = planes @ points.T
    away -= values
    near = np.abs(away, out=away) < _HALF_THICKNESS_PER_M
    plane = planes[int(np.count_nonzero(near, axis=1).argmax())]
    for _ in range(2):
        inside = np.abs(points @ plane - values) < _HALF_THICKNESS_PER_M
        plane = np.linalg.lstsq(points[inside], values[inside], rcond=None)[0]
    found = np.abs(plane[0] + plane[1] * x + (plane[2] * y)[:, None] - inverse) < _HALF_THICKNESS_PER_M
    return found if found.sum() >= _MIN_SHARE * found.size else None


def _places(shape: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """Return where columns and rows are in an image, from -0.5 to 0.5."""
    return np.arange(shape[1]) / shape[1] - 0.5, np.arange(shape[0]) / shape[0] - 0.5
