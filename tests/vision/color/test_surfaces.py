"""The wall is told from other surfaces as by counting every pixel of every label."""

from __future__ import annotations

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_dataset.vision.color.surfaces import surfaces_of


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.5, 6), st.floats(0, 1), st.integers(1, 40), st.integers(1, 40))
def test_wall_and_others_are_those_of_the_counts(
    seed: int, blur_px: float, lit_share: float, least_lit_px: int, least_px: int
) -> None:
    rng = np.random.default_rng(seed)
    smooth = cv2.GaussianBlur(rng.normal(0, 1, (60, 70)), (0, 0), blur_px) > 0
    count, labels = cv2.connectedComponents(smooth.astype(np.uint8), connectivity=4)
    lit = smooth & (rng.random(smooth.shape) < lit_share)
    wall, surfaces = surfaces_of(labels, lit, least_lit_px, least_px)
    is_wall = [number > 0 and np.count_nonzero(lit & (labels == number)) >= least_lit_px for number in range(count)]
    np.testing.assert_array_equal(wall, np.array(is_wall)[labels])
    others = [
        number for number in range(1, count) if not is_wall[number] and np.count_nonzero(labels == number) >= least_px
    ]
    assert len(surfaces) == len(others)
    for surface, number in zip(surfaces, others, strict=True):
        here = np.zeros(labels.shape, np.bool_)
        here[surface.box] = surface.mask
        np.testing.assert_array_equal(here, labels == number)
        around = cv2.dilate(here.astype(np.uint8), np.ones((13, 13), np.uint8)).astype(np.bool_) & ~here
        ring = np.zeros(labels.shape, np.bool_)
        ring[surface.box] = surface.ring
        np.testing.assert_array_equal(ring, around)


def test_a_picture_without_a_surface_has_neither() -> None:
    nothing = np.zeros((20, 30), np.int32)
    wall, surfaces = surfaces_of(nothing, np.zeros((20, 30), np.bool_), 1, 1)
    assert not wall.any()
    assert surfaces == []
