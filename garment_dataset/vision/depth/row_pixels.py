"""The pixels around a profile, row by row: those that its surface connects with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from garment_dataset.vision.depth.pieces import breaks
from garment_dataset.vision.depth.surfaces import ProfileRows

if TYPE_CHECKING:
    from garment_dataset.arrays import BoolArray, DepthImage, FloatArray, IntArray
    from garment_dataset.vision.depth.cloud import Intrinsics, Point

_MIN_ROW_PIXELS = 3
_CENTRE_PX = 2

MEDIAN_PX = 3
"""Side of the windows over whose median pixels are followed."""


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """The part of an image in which the garment can be, (h, w): 0 outside of the band.

    What is added to inverse depth is (h, w), or (1, w) where it is the same in all rows.
    """

    masked_mm: DepthImage
    first_row: int
    first_column: int
    table_per_m: FloatArray
    offset_per_m: FloatArray


def gather_rows(block: Block, intrinsics: Intrinsics, gripper_m: Point, jump_m: float, half: int) -> ProfileRows:
    """Collect the pixels of every row that are connected to the profile's column.

    Parameters
    ----------
    block : Block
        Of h rows.
    intrinsics : Intrinsics
        Of the image.
    gripper_m : (x, y, z)
        End point of the gripper.
    jump_m : float
        Neighbouring depths that differ by more are not the same surface.
    half : int
        So many columns to each side are looked at.

    Returns
    -------
    ProfileRows
        Of h rows.
    """
    smooth_mm = np.asarray(cv2.medianBlur(np.ascontiguousarray(block.masked_mm), MEDIAN_PX), np.uint16)
    column_px = _profile_column(smooth_mm, intrinsics.cx_px - block.first_column, intrinsics.fx_px, gripper_m)
    middle = np.rint(column_px)
    own_mm, around_mm, offset_per_m = _around(block, smooth_mm, middle.astype(np.int64), half)
    inverse = block.table_per_m.take(own_mm)
    used = _connected(around_mm, 1000 * jump_m)
    used &= own_mm - around_mm + np.uint16(2000 * jump_m) <= np.uint16(4000 * jump_m)
    used &= inverse > 0
    weight = used.astype(np.float64)
    inverse -= offset_per_m
    inverse *= weight
    near = weight[:, half - _CENTRE_PX : half + _CENTRE_PX + 1] @ np.ones(2 * _CENTRE_PX + 1) > 0
    return ProfileRows(
        v=np.arange(block.first_row, block.first_row + middle.size, dtype=np.float64),
        weight=weight,
        inverse=inverse,
        shift_px=middle - column_px,
        column_px=column_px,
        middle_m=np.where(around_mm[:, half] > 0, around_mm[:, half] / 1000, np.nan),
        filled=near & (weight @ np.ones(weight.shape[1]) >= _MIN_ROW_PIXELS),
    )


def _around(
    block: Block, smooth_mm: DepthImage, middle: IntArray, half: int
) -> tuple[DepthImage, DepthImage, FloatArray]:
    """Return depth, smoothed depth and offset of the columns around the middle one of every row, (h, 2 half + 1) each.

    Beyond the block there is no depth, and what is smoothed goes on as it is at its edge.
    """
    width = smooth_mm.shape[1]
    lack = int(min(max(half - middle.min(), middle.max() + half + 1 - width, 0), 2 * half + 1))
    first, rows = np.clip(middle + (lack - half), 0, width + 2 * lack - 2 * half - 1), np.arange(middle.size)
    sides = ((0, 0), (lack, lack))
    masked_mm, offset_per_m = block.masked_mm, block.offset_per_m
    if lack > 0:
        masked_mm, smooth_mm = np.pad(masked_mm, sides), np.pad(smooth_mm, sides, mode="edge")
        offset_per_m = np.pad(offset_per_m, sides)
    # copies runs of memory, where indices of single pixels would copy them one by one
    own_mm, around_mm = (
        sliding_window_view(image_mm, 2 * half + 1, axis=1)[rows, first] for image_mm in (masked_mm, smooth_mm)
    )
    line = rows if len(offset_per_m) > 1 else 0
    return own_mm, around_mm, sliding_window_view(offset_per_m, 2 * half + 1, axis=1)[line, first]


def _connected(around_mm: DepthImage, jump_mm: float) -> BoolArray:
    """Return which pixels no break parts from the middle one of their row; none where there is nothing."""
    half = around_mm.shape[1] // 2
    left, right = around_mm[:, :-1], around_mm[:, 1:]
    broken = breaks(np.maximum(left, right) - np.minimum(left, right), jump_mm)
    # one column more, so that every row has a break
    ends = np.ones((2, around_mm.shape[0], half + 1), dtype=np.bool_)
    ends[0, :, :-1], ends[1, :, :-1] = broken[:, half - 1 :: -1], broken[:, half:]
    # short integers: a comparison takes a fraction of the time
    to_left, to_right = ends.argmax(axis=2)[:, :, None].astype(np.int16)
    away = np.arange(-half, half + 1, dtype=np.int16)
    connected: BoolArray = (away >= -to_left) & (away <= to_right) & (around_mm > 0)
    connected &= around_mm[:, half : half + 1] > 0
    return connected


def _profile_column(smooth_mm: DepthImage, centre_px: float, fx_px: float, gripper_m: Point) -> FloatArray:
    """Return where the plane x = x_gripper meets the surface in every row of a block, in columns of the block."""
    row, last_column = np.arange(smooth_mm.shape[0]), smooth_mm.shape[1] - 1
    middle_m = np.full(row.size, gripper_m[2])
    for _ in range(2):
        column = np.clip(np.rint(centre_px + fx_px * gripper_m[0] / middle_m).astype(np.int64), 0, last_column)
        found_mm = smooth_mm[row, column]
        middle_m = np.where(found_mm > 0, found_mm / 1000, middle_m)
    column_px: FloatArray = centre_px + fx_px * gripper_m[0] / middle_m
    return column_px
