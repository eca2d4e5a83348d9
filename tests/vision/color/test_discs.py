"""Discs made of rectangles equal OpenCV's, pixel by pixel."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from garment_dataset.vision.color.discs import closed_by_disc, dilated_by_disc

Mask = NDArray[np.uint8]

masks = hnp.arrays(
    np.uint8, hnp.array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=40), elements=st.integers(0, 1)
)
sides_px = st.integers(0, 16).map(lambda half: 2 * half + 1)


def ellipse(side_px: int) -> Mask:
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side_px, side_px)), np.uint8)


@pytest.mark.parametrize("side_px", range(1, 64, 2))
def test_a_point_grows_to_the_disc(side_px: int) -> None:
    point = np.zeros((2 * side_px + 1, 2 * side_px + 1), np.uint8)
    point[side_px, side_px] = 1
    np.testing.assert_array_equal(dilated_by_disc(point, side_px), cv2.dilate(point, ellipse(side_px)))


@given(masks, sides_px)
def test_dilation_is_that_by_the_whole_disc(mask: Mask, side_px: int) -> None:
    np.testing.assert_array_equal(dilated_by_disc(mask, side_px), cv2.dilate(mask, ellipse(side_px)))


@given(masks, sides_px)
def test_closing_is_that_by_the_whole_disc_in_an_endless_picture(mask: Mask, side_px: int) -> None:
    endless = np.pad(mask, 2 * side_px)
    closed = cv2.morphologyEx(endless, cv2.MORPH_CLOSE, ellipse(side_px))
    inner = slice(2 * side_px, -2 * side_px)
    np.testing.assert_array_equal(closed_by_disc(mask, side_px), closed[inner, inner])
