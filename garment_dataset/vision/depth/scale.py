"""How the depth images of one recording are to be read: inverse depth by millimetres, and what columns add to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.vision.depth.flat_field import column_offsets, column_std_per_m, inverse_depth_table
from garment_dataset.vision.depth.profile import DepthScale

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import DepthImage, FloatArray
    from garment_dataset.vision.depth.settings import TrackSettings


def spread_over(frames: Sequence[int], count: int) -> frozenset[int]:
    """Return about so many of a recording's frames, spread over it: those on which what stays is measured."""
    return frozenset(frames[:: max(len(frames) // count, 1)])


def measure_scale(
    some: Sequence[DepthImage], settings: TrackSettings, pixels_per_m: FloatArray | None, *, measured: bool
) -> tuple[DepthScale, FloatArray]:
    """Measure what the columns add to inverse depth.

    Parameters
    ----------
    some : sequence of (H, W) uint16
        Images spread over the recording, in millimetres.
    settings : TrackSettings
        See there.
    pixels_per_m : (H, W) float64 or None
        What is known beforehand to be added to pixels.
    measured : bool
        Whether the recording shows its fixed pattern, see
        :func:`~garment_dataset.vision.depth.flat_field.column_std_per_m`.

    Returns
    -------
    scale : DepthScale
    left_per_m : (W,) float64
        Standard deviation of what columns still add; (1,) without images.
    """
    table, _ = inverse_depth_table(some)
    if not some:
        return DepthScale(table), np.zeros(1)
    offset = column_offsets(some, table, beyond_m=settings.flat_field_beyond_m)
    window_px = 2.0 * settings.profile.windows_px[-1][0]
    left_per_m = column_std_per_m(offset, window_px, some[0].shape[1], measured=measured)
    if pixels_per_m is None:
        return DepthScale(table, offset), left_per_m
    return DepthScale(table, pixels_per_m + (0.0 if offset is None else offset)), left_per_m
