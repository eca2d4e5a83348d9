"""The pixels of the garment hang from the gripper, whatever else is in the band, and lie where eq. (5.6) says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.vision.depth.cloud import Intrinsics, select_pixels
from garment_dataset.vision.depth.garment_pixels import back_project, garment_mask

if TYPE_CHECKING:
    from garment_dataset.arrays import BoolArray, DepthImage

K = Intrinsics(142.5, 142.5, 80.0, 60.0)
GRIPPER_M = (0.0, -0.3, 1.0)
WALL_MM, SHEET_MM = 2000, 1000


def scene() -> DepthImage:
    """A sheet of 30 x 60 pixels below the gripper, before a wall."""
    depth_mm = np.full((120, 160), WALL_MM, np.uint16)
    depth_mm[20:80, 65:95] = SHEET_MM
    return depth_mm


def mask_of(
    depth_mm: DepthImage,
) -> BoolArray:
    return garment_mask(depth_mm, K, GRIPPER_M, band_half_width_m=0.27, hold_reach_m=0.1)


def test_what_hangs_from_the_gripper_is_taken_whole() -> None:
    np.testing.assert_array_equal(mask_of(scene()), scene() == SHEET_MM)


def test_what_hangs_elsewhere_in_the_band_is_not() -> None:
    depth_mm = scene()
    depth_mm[20:80, 120:140] = 1100  # 17 cm beside it
    np.testing.assert_array_equal(mask_of(depth_mm), scene() == SHEET_MM)


def test_shadows_and_folds_do_not_cut_it_in_two() -> None:
    depth_mm = scene()
    depth_mm[48:51, :] = 0
    depth_mm[60:80, 65:95] = 1150  # a layer behind
    np.testing.assert_array_equal(mask_of(depth_mm), (depth_mm == SHEET_MM) | (depth_mm == 1150))


def test_nothing_above_the_gripper_or_without_a_return() -> None:
    depth_mm = scene()
    depth_mm[0:20, 78:82] = SHEET_MM  # the arm
    depth_mm[30:33, 70:73] = 0
    mask = mask_of(depth_mm)
    rows = np.flatnonzero(mask.any(axis=1))
    assert (rows[0] - K.cy_px) / K.fy_px * SHEET_MM / 1000 >= GRIPPER_M[1]
    assert rows[0] >= 17
    assert not mask[depth_mm == 0].any()


@pytest.mark.parametrize("depth_mm", [np.zeros((120, 160), np.uint16), np.full((120, 160), WALL_MM, np.uint16)])
def test_nothing_hangs_where_nothing_is(depth_mm: DepthImage) -> None:
    assert not mask_of(depth_mm).any()


@given(st.integers(740, 1260), st.integers(0, 2**32 - 1))
def test_points_project_onto_their_own_pixels(z_mm: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    depth_mm = random.integers(z_mm - 5, z_mm + 5, (30, 40)).astype(np.uint16)
    mask = random.random((30, 40)) < 0.5
    points_m = back_project(depth_mm, mask, K)
    v, u = np.nonzero(mask)
    np.testing.assert_allclose(K.fx_px * points_m[:, 0] / points_m[:, 2] + K.cx_px, u, atol=1e-9)
    np.testing.assert_allclose(K.fy_px * points_m[:, 1] / points_m[:, 2] + K.cy_px, v, atol=1e-9)
    np.testing.assert_array_equal(points_m[:, 2], depth_mm[mask] / 1000)


def test_they_are_the_points_that_the_strip_is_cut_from() -> None:
    cut = select_pixels(scene(), K, GRIPPER_M, band_half_width_m=0.27, strip_half_width_m=0.05)
    points_m = back_project(scene(), mask_of(scene()), K)
    inside = points_m[np.abs(points_m[:, 0]) < 0.05]
    expected = np.stack([cut.x_m, cut.y_m, cut.z_mm / 1000], axis=1)
    assert len(inside) > 500
    np.testing.assert_allclose(inside[np.lexsort(inside.T)], expected[np.lexsort(expected.T)], atol=1e-12)
