"""What an OpenNI depth sensor really measured, and what its columns always add to it.

The sensor measures disparity in steps of an eighth of a pixel and hands out whole millimetres. Both are undone here:
every millimetre that it can report belongs to one step, whose exact inverse depth is known, and the fixed error that
whole columns share is seen on any plane behind the garment. All that follows is in inverse depth, 1/m, where the
levels are equally far apart, planes are linear in the pixel, and the noise is the same at every distance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.vision.depth.backdrop import backdrop, static_inverse
from garment_dataset.vision.depth.cloud import COLUMN_BAND_LEVELS, LEVEL_SPACING_PER_M

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, DepthImage, FloatArray

BAND_WIDTH_PX = 56.0
"""Width of the vertical bands that share an error (measured: 56 px on most cameras, 96 px on some)."""

_LEVELS = 1053
_MIN_ON_LADDER = 0.99
_MIN_COLUMNS = 150
_MIN_ROWS = 20


def ladder_per_m() -> FloatArray:
    """Return the inverse depth of every millimetre value that an OpenNI driver can report, (65536,); 0 for others.

    Notes
    -----
    ``mm = floor(10 (120 m / (7.5 - m) + 120))`` with ``m = 0.1052 ((i - 800) / 4 - 0.375)``, i = 0..1052: the table of
    OpenNI's driver, which holds every value of real Xtion frames. What is returned is that depth before the ``floor``,
    which is half a millimetre on average.
    """
    tangent = ((np.arange(_LEVELS) - 800) / 4 - 0.375) * 0.1052
    exact_mm = 10 * (tangent * 120 / (7.5 - tangent) + 120)
    table = np.zeros(1 << 16)
    table[np.floor(exact_mm).astype(np.int64)] = 1000 / exact_mm
    return table


def plain_per_m() -> FloatArray:
    """Return the inverse depth of every millimetre value taken as it is, (65536,); 0 for 0, which means no return."""
    table = np.zeros(1 << 16)
    table[1:] = 1000 / np.arange(1, 1 << 16)
    return table


def inverse_depth_table(frames: Sequence[DepthImage]) -> tuple[FloatArray, bool]:
    """Return how millimetres are to be read, and whether they come from an OpenNI driver.

    Parameters
    ----------
    frames : sequence of (H, W) uint16
        Some images of the recording, in millimetres.

    Returns
    -------
    table : (65536,) float64
        Inverse depth in 1/m by millimetres; 0 where there is none.
    on_ladder : bool
        Whether 99 % of the values are ones that the driver can report. Of arbitrary millimetres near 1 m only a third
        are.
    """
    ladder = ladder_per_m()
    counts = np.zeros(1 << 16, np.int64)
    for frame in frames:
        counts += np.bincount(frame.ravel(), minlength=1 << 16)
    counts[0] = 0
    on_ladder = bool(counts.sum() > 0 and counts[ladder > 0].sum() >= _MIN_ON_LADDER * counts.sum())
    return (ladder if on_ladder else plain_per_m()), on_ladder


def column_offsets(frames: Sequence[DepthImage], table: FloatArray, *, beyond_m: float) -> FloatArray | None:
    """Measure what columns add to inverse depth, on the largest plane that stands still behind the garment.

    Parameters
    ----------
    frames : sequence of (H, W) uint16
        Images spread over the recording, in millimetres.
    table : (65536,) float64
        From :func:`inverse_depth_table`.
    beyond_m : float
        Nothing nearer than this is looked at: garment and gripper.

    Returns
    -------
    (W,) float64 or None
        To be subtracted from measured inverse depths, in 1/m; 0 for columns that do not see the plane. None when
        there is no plane that stands upright, still and large enough.

    Notes
    -----
    The mean over the columns and a linear trend cannot be told from the plane's own place and lean and are left out:
    an error common to all columns remains, as large as one band's over the square root of the number of bands.
    """
    inverse = static_inverse(frames, table, beyond_m)
    plane = backdrop(inverse)
    if plane is None:
        return None
    used = plane.sum(axis=0) >= _MIN_ROWS
    if used.sum() < _MIN_COLUMNS:
        return None
    return _offsets_from_plane(np.where(plane & used, inverse, np.nan), used)


def _offsets_from_plane(inverse: FloatArray, used: BoolArray) -> FloatArray | None:
    """Return the column means about a plane; its slope down the rows is found within columns, robustly."""
    rows = np.arange(inverse.shape[0], dtype=np.float64)[:, None]
    powers = rows.T ** np.arange(3)[:, None]
    known = inside = np.isfinite(inverse)
    plain = np.where(known, inverse, 0.0)
    offset = np.zeros(inverse.shape[1])
    slope = 0.0
    for _ in range(6):
        number, sum_row, sum_square = powers @ inside.astype(np.float64)
        total, moment = powers[:2] @ (plain * inside)
        count = np.maximum(number, 1)
        mean, mean_row = total / count, sum_row / count
        slope = float((moment - mean_row * total).sum() / max(float((sum_square - mean_row * sum_row).sum()), 1e-12))
        offset = mean - slope * mean_row
        residual = plain - slope * rows - offset
        spread = 1.4826 * float(np.median(np.abs(residual[inside])))
        before, inside = inside, known & (np.abs(residual) <= 3 * max(spread, 1e-6))
        if np.array_equal(before, inside):  # what is found from the same pixels is the same
            break
    used = used & (inside.sum(axis=0) >= _MIN_ROWS)
    if used.sum() < _MIN_COLUMNS or spread > LEVEL_SPACING_PER_M:
        return None
    column = np.flatnonzero(used).astype(np.float64)
    trend = np.polynomial.Polynomial.fit(column, offset[used], 1)
    result = np.zeros(offset.size)
    flat = np.where(inside, inverse - slope * rows, np.nan)
    result[used] = _shared(flat[:, used], column) * (offset[used] - trend(column))
    return result


def _shared(flat: FloatArray, column: FloatArray) -> float:
    """Return how much of the columns' means is the columns' own: the regression of one half of the rows on the other.

    1 where the upper and the lower half of the plane agree on them, 0 where what they show is noise, or blobs.
    """
    order = np.cumsum(np.isfinite(flat), axis=0)
    upper = order <= order[-1] / 2
    halves = []
    for half in (upper, ~upper):
        count = np.maximum((np.isfinite(flat) & half).sum(axis=0), 1)
        mean = np.where(np.isfinite(flat) & half, flat, 0.0).sum(axis=0) / count
        halves.append(mean - np.polynomial.Polynomial.fit(column, mean, 1)(column))
    both = float(np.mean(halves[0] * halves[1]))
    whole = float(np.mean((halves[0] + halves[1]) ** 2)) / 4
    return float(np.clip(both / whole, 0.0, 1.0)) if whole > 0 else 0.0


def column_std_per_m(
    offset_per_m: FloatArray | None, window_px: float, image_width_px: int, *, measured: bool
) -> FloatArray:
    r"""Return the standard deviation of the depth error that whole columns share, in inverse depth.

    Parameters
    ----------
    offset_per_m : (W,) float64 or None
        From :func:`column_offsets`.
    window_px : float
        Width over which depth is averaged, where the columns are not corrected.
    image_width_px : int
        W.
    measured : bool
        Whether the offsets also tell how large the errors of columns are; otherwise they are taken to be as on real
        cameras, 0.43 level spacings.

    Returns
    -------
    (W,) float64
        By column.

    Notes
    -----
    Bands of :math:`\sigma` level spacings were measured about the mean over the image, so their mean over n of N
    bands has the variance :math:`\sigma^2 (1/n - 1/N)`, none when all are seen. It is left in columns that were
    corrected on n bands, and in those that were not, by the n bands in the window. The trend that was taken for the
    plane's adds :math:`\sigma^2 (u - \bar u)^2 / (n \operatorname{var} u)`. An error that all columns of the image
    share is part of the camera's calibration and not in here.
    """

    def of_mean(columns: float) -> float:
        return max(BAND_WIDTH_PX / max(columns, BAND_WIDTH_PX) - BAND_WIDTH_PX / image_width_px, 0.0)

    variance = np.full(image_width_px, of_mean(window_px))
    usual_per_m = COLUMN_BAND_LEVELS * LEVEL_SPACING_PER_M
    if offset_per_m is not None and (seen := np.flatnonzero(offset_per_m)).size:
        of_trend = BAND_WIDTH_PX / seen.size * (seen - seen.mean()) ** 2 / seen.var()
        variance[seen] = of_mean(seen.size) + of_trend
        if measured:
            usual_per_m = float(np.sqrt((offset_per_m[seen] ** 2).mean()))
    elif offset_per_m is not None and measured:
        usual_per_m = 0.0
    std_per_m: FloatArray = usual_per_m * np.sqrt(variance)
    return std_per_m
