"""The pixels around a profile, row by row: those that its surface connects with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import cv2
import numpy as np

from garment_dataset.vision.depth.pieces import breaks
from garment_dataset.vision.depth.surfaces import ProfileRows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray, DepthImage, FloatArray, IntArray
    from garment_dataset.vision.depth.cloud import Intrinsics, Point

_Pixel = TypeVar("_Pixel", bound=np.generic)

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
    smooth_mm = np.asarray(cv2.medianBlur(block.masked_mm, MEDIAN_PX), np.uint16)
    column_px = _profile_column(smooth_mm, intrinsics.cx_px - block.first_column, intrinsics.fx_px, gripper_m)
    middle = np.rint(column_px)
    # unsigned subtraction wraps: one comparison for two
    alike = block.masked_mm - smooth_mm + np.uint16(2000 * jump_m) <= np.uint16(4000 * jump_m)
    alike &= smooth_mm > 0
    sure = Block(block.masked_mm * alike, block.first_row, block.first_column, block.table_per_m, block.offset_per_m)
    own_mm, around_mm, offset_per_m = _around(sure, smooth_mm, middle.astype(np.int64), half)
    inverse = block.table_per_m.take(own_mm)
    used = _connected(around_mm, 1000 * jump_m)
    used &= inverse > 0
    weight = used.astype(np.float64)
    inverse -= offset_per_m
    inverse *= weight
    centre = weight[:, max(half - _CENTRE_PX, 0) : half + _CENTRE_PX + 1]
    return ProfileRows(
        v=np.arange(block.first_row, block.first_row + middle.size, dtype=np.float64),
        weight=weight,
        inverse=inverse,
        shift_px=middle - column_px,
        column_px=column_px,
        middle_m=np.where(around_mm[:, half] > 0, around_mm[:, half] / 1000, np.nan),
        filled=centre.any(axis=1) & (weight @ np.ones(weight.shape[1]) >= _MIN_ROW_PIXELS),
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
    own_mm, around_mm = (_runs(image_mm, 2 * half + 1)[rows, first] for image_mm in (masked_mm, smooth_mm))
    line = rows if len(offset_per_m) > 1 else 0
    return own_mm, around_mm, _runs(offset_per_m, 2 * half + 1)[line, first]


def _runs(image: NDArray[_Pixel], size: int) -> NDArray[_Pixel]:
    """Return a view of all runs of ``size`` pixels, by row and first column, (h, w - size + 1, size).

    They are copied as they lie in memory, where indices of single pixels would copy these one by one.
    """
    shape = (image.shape[0], image.shape[1] - size + 1, size)
    return np.ndarray(shape, image.dtype, image, strides=(*image.strides, image.strides[1]))


def _connected(around_mm: DepthImage, jump_mm: float) -> BoolArray:
    """Return which pixels no break parts from the middle one of their row; none where there is nothing."""
    half, flat_mm = around_mm.shape[1] // 2, around_mm.ravel()
    # rows are joined end to end, which is fast: no step from one to the next, and a break there
    step_mm = np.zeros(around_mm.shape, np.uint16)
    np.maximum(flat_mm[1:], flat_mm[:-1], out=step_mm.ravel()[:-1])
    step_mm.ravel()[:-1] -= np.minimum(flat_mm[1:], flat_mm[:-1])
    step_mm[:, -1] = 0
    broken = breaks(step_mm.ravel(), jump_mm).reshape(step_mm.shape)
    broken[:, -1] = True
    column = np.arange(2 * half + 1, dtype=np.int16)  # short integers are compared in a fraction of the time
    first = (broken[:, :half] * column[1 : half + 1]).max(axis=1)
    last = np.where(around_mm[:, half] > 0, half + broken[:, half:].argmax(axis=1), -1).astype(np.int16)
    connected: BoolArray = column >= first[:, None]
    connected &= column <= last[:, None]
    return connected


def _profile_column(smooth_mm: DepthImage, centre_px: float, fx_px: float, gripper_m: Point) -> FloatArray:
    """Return where the plane x = x_gripper meets the surface in every row of a block, in columns of the block."""
    last_column = smooth_mm.shape[1] - 1
    row = np.arange(smooth_mm.shape[0]) * smooth_mm.shape[1]
    middle_m = np.full(row.size, gripper_m[2])
    for _ in range(2):
        column = np.clip(np.rint(centre_px + fx_px * gripper_m[0] / middle_m).astype(np.int64), 0, last_column)
        found_mm = smooth_mm.ravel().take(row + column)
        middle_m = np.where(found_mm > 0, found_mm / 1000, middle_m)
    column_px: FloatArray = centre_px + fx_px * gripper_m[0] / middle_m
    return column_px
