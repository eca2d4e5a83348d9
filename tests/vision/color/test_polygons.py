from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.vision.color.masks import polygon_mask
from garment_dataset.vision.color.polygons import polygon_of

if TYPE_CHECKING:
    from numpy.typing import NDArray


def block(top: int, bottom: int, left: int, right: int) -> NDArray[np.bool_]:
    mask = np.zeros((60, 80), np.bool_)
    mask[top:bottom, left:right] = True
    return mask


def test_a_rectangle_has_four_corners() -> None:
    assert set(polygon_of(block(10, 30, 5, 50))) == {(5, 10), (49, 10), (49, 29), (5, 29)}


@given(st.integers(0, 20), st.integers(30, 60), st.integers(0, 30), st.integers(40, 80))
def test_a_rectangle_survives(top: int, bottom: int, left: int, right: int) -> None:
    mask = block(top, bottom, left, right)
    assert (polygon_mask(polygon_of(mask), 60, 80) == mask).all()


@pytest.mark.parametrize("tolerance_px", [1.0, 3.0])
def test_the_border_is_never_farther_than_the_tolerance(tolerance_px: float) -> None:
    v, u = np.indices((60, 80))
    distance = np.hypot(v - 30, u - 40)
    polygon = polygon_of(distance <= 25, tolerance_px=tolerance_px)
    filled = polygon_mask(polygon, 60, 80)
    assert filled[distance <= 25 - tolerance_px - 1].all()
    assert not filled[distance > 25 + 1].any()
    assert len(polygon) < 30


def test_the_largest_region_counts_and_its_holes_are_filled() -> None:
    mask = block(10, 50, 10, 60) | block(0, 5, 0, 5)
    mask[20:30, 20:30] = False
    assert (polygon_mask(polygon_of(mask), 60, 80) == block(10, 50, 10, 60)).all()
    assert polygon_of(np.zeros((60, 80), np.bool_)) == []
