"""The pixels that a surface connects with the profile: as found one by one, wherever the block ends."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from garment_dataset.vision.depth.cloud import Intrinsics
from garment_dataset.vision.depth.pieces import breaks
from garment_dataset.vision.depth.row_pixels import Block, gather_rows

JUMP_M = 0.012
TABLE_PER_M = np.append(0.0, 1000 / np.arange(1, 1 << 16))


def folded_cloth(rng: np.random.Generator) -> np.ndarray:
    """Return a block of slopes, jumps and holes, (40, 46) uint16 in millimetres."""
    step_mm = rng.choice([0, 3, -3, 7, -7, 40, -40], size=(40, 46), p=[0.5, 0.2, 0.2, 0.03, 0.03, 0.02, 0.02])
    depth_mm = 1000 + np.cumsum(step_mm, axis=1)
    depth_mm[rng.random(depth_mm.shape) < 0.08] = 0
    return depth_mm.astype(np.uint16)


@pytest.mark.parametrize("half", [1, 9])
@pytest.mark.parametrize("offset_rows", [1, 40])
@pytest.mark.parametrize("gripper_x_m", [0.0, -0.03, 0.035, -0.06, 0.2])
def test_pixels_count_as_far_as_no_break_parts_them_from_the_profile(
    gripper_x_m: float, offset_rows: int, half: int
) -> None:
    rng = np.random.default_rng(3)
    offset_per_m = rng.normal(0, 1e-3, (offset_rows, 46))
    masked_mm = folded_cloth(rng)
    smooth_mm = cv2.medianBlur(masked_mm, 3).astype(np.int64)
    k = Intrinsics(570.0, 570.0, 300.0, 200.0)
    found = gather_rows(Block(masked_mm, 100, 277, TABLE_PER_M, offset_per_m), k, (gripper_x_m, 0, 1.0), JUMP_M, half)
    offset_per_m = np.broadcast_to(offset_per_m, masked_mm.shape)
    for row in range(40):
        middle = round(float(found.column_px[row]))
        columns = np.clip(np.arange(middle - half, middle + half + 1), 0, 45)
        around_mm = smooth_mm[row, columns]
        broken = breaks(np.abs(np.diff(around_mm)).astype(np.float64), 1000 * JUMP_M)
        for place, column in enumerate(range(middle - half, middle + half + 1)):
            own_mm = int(masked_mm[row, columns[place]])
            between = broken[min(place, half) : max(place, half)]
            used = (
                column in range(46) and middle in range(46)
                and around_mm[place] > 0 and around_mm[half] > 0
                and not between.any() and own_mm > 0 and abs(own_mm - around_mm[place]) <= 24
            )  # fmt: skip
            assert found.weight[row, place] == used
            inverse = TABLE_PER_M[own_mm] - offset_per_m[row, columns[place]] if used else 0.0
            assert found.inverse[row, place] == inverse
