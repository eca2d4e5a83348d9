from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.vision.depth.cloud import (
    Cloud,
    Intrinsics,
    band_limits_mm,
    level_spacing_m,
    possible_region,
    select_pixels,
    z_std_m,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

GRIPPER_M = (0.01, -0.25, 1.065)
LIMITS = {"band_half_width_m": 0.27, "strip_half_width_m": 0.02}

# Powers of two make the conditions' bounds exact, so that pixels lie on them often.
dyadic_cameras = st.builds(
    Intrinsics, st.sampled_from([16.0, 32.0]), st.sampled_from([16.0, 64.0]), st.integers(-4, 28), st.integers(-4, 20)
)
dyadic_grippers = st.tuples(
    st.integers(-64, 64).map(lambda n: n / 64), st.integers(-64, 64).map(lambda n: n / 64), st.sampled_from([1.0, 1.25])
)
any_cameras = st.builds(Intrinsics, st.floats(10, 40), st.floats(10, 40), st.floats(-5.0, 30.0), st.floats(-5.0, 25.0))
any_grippers = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-0.5, 1.5))


@st.composite
def depth_images(draw: st.DrawFn) -> NDArray[np.uint16]:
    levels = draw(st.lists(st.sampled_from([0, 1, 500, 750, 875, 1000, 1125, 1250, 1500, 65535]), min_size=1))
    seed = draw(st.integers(0, 2**32 - 1))
    return np.random.default_rng(seed).choice(np.array(levels, np.uint16), (20, 24))


def assert_same(one: Cloud, other: Cloud) -> None:
    np.testing.assert_array_equal(one.x_m, other.x_m)
    np.testing.assert_array_equal(one.y_m, other.y_m)
    np.testing.assert_array_equal(one.z_mm, other.z_mm)


@given(
    depth_mm=depth_images(),
    scene=st.tuples(dyadic_cameras, dyadic_grippers) | st.tuples(any_cameras, any_grippers),
    band_half_width_m=st.sampled_from([0.0, 0.125, 0.25, 0.3]),
    strip_half_width_m=st.sampled_from([1 / 16, 0.25, 0.3]),
)
def test_it_is_the_full_cloud_cut_down(
    reference_cloud: Callable[..., Cloud],
    depth_mm: NDArray[np.uint16],
    scene: tuple[Intrinsics, tuple[float, float, float]],
    band_half_width_m: float,
    strip_half_width_m: float,
) -> None:
    limits = {"band_half_width_m": band_half_width_m, "strip_half_width_m": strip_half_width_m}
    intrinsics, gripper_m = scene
    selected = select_pixels(depth_mm, intrinsics, gripper_m, **limits)
    assert_same(selected, reference_cloud(depth_mm, intrinsics, gripper_m, **limits))


def test_one_pixel_by_hand() -> None:
    camera = Intrinsics(fx_px=500, fy_px=400, cx_px=3, cy_px=2)
    depth_mm = np.zeros((5, 7), np.uint16)
    depth_mm[4, 5] = 2000
    cloud = select_pixels(depth_mm, camera, (0, 0, 2), band_half_width_m=0.1, strip_half_width_m=0.1)
    assert (cloud.x_m.tolist(), cloud.y_m.tolist(), cloud.z_mm.tolist()) == ([0.008], [0.01], [2000])


def test_the_band_includes_its_bounds_and_the_strip_does_not() -> None:
    camera = Intrinsics(fx_px=1, fy_px=1, cx_px=1, cy_px=0)
    depth_mm = np.array([[0, 749, 0], [1000, 750, 1000], [0, 1250, 0], [0, 1251, 0], [0, 0, 0]], np.uint16)
    cloud = select_pixels(depth_mm, camera, (0, 0.75, 1), band_half_width_m=0.25, strip_half_width_m=1)
    assert cloud.z_mm.tolist() == [750, 1250]
    assert cloud.y_m.tolist() == [0.75, 2.5]


@pytest.mark.parametrize("openni", [False, True])
def test_pixels_outside_band_and_strip_and_above_the_gripper_do_not_matter(
    sheet_depth_m: Callable[..., NDArray[np.float64]],
    image: Callable[..., NDArray[np.uint16]],
    intrinsics: Intrinsics,
    openni: bool,
) -> None:
    depth_mm = image(sheet_depth_m(lambda y: 1.05 + 0.03 * np.sin(20 * y), -0.25, 0.39), openni=openni)
    alone = select_pixels(depth_mm, intrinsics, GRIPPER_M, **LIMITS)
    assert alone.z_mm.size > 5000
    crowded = depth_mm.copy()
    crowded[depth_mm == 0] = 2500
    crowded[::7, ::3][depth_mm[::7, ::3] == 0] = 700
    crowded[:60] = 1065
    crowded[:, :200] = 1065
    crowded[:, 400:] = 1065
    assert_same(select_pixels(crowded, intrinsics, GRIPPER_M, **LIMITS), alone)


def test_only_the_columns_of_the_strip_and_the_rows_below_the_gripper_are_touched(intrinsics: Intrinsics) -> None:
    band_mm = band_limits_mm(1.065, 0.27)
    assert band_mm == (795, 1335)
    rows, columns = possible_region((480, 640), intrinsics, GRIPPER_M, band_mm, 0.02)
    width_px = 570 * (0.03 + 0.01) / 0.795  # both sides of the strip where it looks widest
    assert width_px <= columns.stop - columns.start <= width_px + 3  # rounding is outwards
    assert rows == slice(int(239.5 - 569 * 0.25 / 0.795), 480)


@pytest.mark.parametrize("gripper_m", [(0, 0, -2), (5, 0, 1), (-5, 0, 1), (0, 5, 1), (0, 0, 70)])
def test_a_gripper_out_of_sight_sees_nothing(intrinsics: Intrinsics, gripper_m: tuple[float, float, float]) -> None:
    depth_mm = np.full((480, 640), 1000, np.uint16)
    assert select_pixels(depth_mm, intrinsics, gripper_m, **LIMITS).z_mm.size == 0


def test_no_return_is_never_in_the_band() -> None:
    assert band_limits_mm(0.1, 0.27) == (1, 370)
    assert band_limits_mm(65.5, 1)[1] == 65535


def test_level_spacing_is_that_of_the_sensor(levels_mm: NDArray[np.int64]) -> None:
    near_mm = np.arange(700, 5000, 100)
    beyond = np.searchsorted(levels_mm, near_mm)
    found_mm = (levels_mm[beyond + 5] - levels_mm[beyond - 5]) / 10
    np.testing.assert_allclose(level_spacing_m(levels_mm[beyond] / 1000) * 1000, found_mm, rtol=0.05)
    assert level_spacing_m(1.07) == pytest.approx(3.35e-3, abs=1e-5)


def test_depth_uncertainty_of_known_windows() -> None:
    spacing_m = 1.07**2 * 1000 / 342205
    assert z_std_m(1.07, 1) == pytest.approx(spacing_m * np.hypot(0.64, 0.43))
    assert z_std_m(1.07, 100) == pytest.approx(spacing_m * np.hypot(0.32, 0.43))
    assert z_std_m(1.07, 10**9) == pytest.approx(spacing_m * 0.43, rel=1e-3)
    assert z_std_m(1.07, 0) == z_std_m(1.07, 1)
    assert np.isnan(z_std_m(np.nan, 5))


@given(z_m=st.floats(0.4, 5), pixels=st.integers(0, 500), more=st.integers(0, 500))
def test_more_pixels_are_never_worse_and_never_free_of_error(z_m: float, pixels: int, more: int) -> None:
    assert 0.43 * level_spacing_m(z_m) <= z_std_m(z_m, pixels + more) <= z_std_m(z_m, pixels)
