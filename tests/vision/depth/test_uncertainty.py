"""Uncertainties of points: what folds do to places along a chain."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset.vision.depth.chain import Chain, ChainPoints, Track
from garment_dataset.vision.depth.cloud import Intrinsics
from garment_dataset.vision.depth.pattern import FixedPattern
from garment_dataset.vision.depth.support import Support
from garment_dataset.vision.depth.tracking import divide_track
from garment_dataset.vision.depth.uncertainty import (
    BENT_STD_M,
    EDGE_STD_M,
    FOLD_SHARE,
    ErrorSources,
    fold_std_m,
    noise_factor,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

K = Intrinsics(fx_px=570.0, fy_px=570.0, cx_px=319.5, cy_px=239.5)
TOP_M = (0.0, -0.3, 1.0)
SAME = FixedPattern(np.array([1.0, 10000.0]), np.zeros(2))
EXACT = ErrorSources(np.zeros(640), SAME, (0.0, 0.0, 0.0), (70, 20))
SHARES = np.array([0.1, 0.3, 0.5, 0.7, 0.9])


def chain_of(z_m: FloatArray, pixels: int = 5781) -> Chain:
    """Return a chain with samples every 2.5 mm; a link too steep to be seen goes down, then across."""
    y_m = 0.0025 * np.arange(z_m.size)
    down_m, away_m = np.diff(y_m), np.abs(np.diff(z_m))
    arc_m = np.append(0.0, np.cumsum(np.where(away_m > 4 * down_m, down_m + away_m, np.hypot(down_m, away_m))))
    position_m = np.stack([np.zeros(z_m.size), TOP_M[1] + y_m, TOP_M[2] + z_m])
    return Chain(position_m, arc_m, np.full(z_m.size, pixels), np.full(z_m.size, np.nan), False, Support.full(z_m.size))


def points(z_m: FloatArray, sources: ErrorSources, pixels: int = 5781) -> ChainPoints:
    chain = chain_of(z_m, pixels)
    track = Track(chain, np.zeros(z_m.size), 0.0, 0.0, np.zeros(z_m.size))
    return divide_track(track, TOP_M, K, point_count=5, sources=sources)


def std_m(z_m: FloatArray, sources: ErrorSources = EXACT, pixels: int = 5781) -> FloatArray:
    return points(z_m, sources, pixels).std_m


FLAT = np.ones(241)


def test_smooth_flat_cloth_has_no_uncertain_folds() -> None:
    chain = chain_of(0.02 * np.sin(np.arange(241) / 40))
    folds_m, on_side = fold_std_m(chain, SHARES * chain.length_m, FLAT)
    assert (folds_m == 0).all()
    assert not on_side.any()


def test_a_jump_counts_by_the_share_above_it_and_by_the_rest_below() -> None:
    z_m = np.where(np.arange(241) < 100, 0.0, 0.05)
    chain = chain_of(z_m)
    folds_m, on_side = fold_std_m(chain, SHARES * chain.length_m, FLAT)
    np.testing.assert_allclose(folds_m, FOLD_SHARE * 0.05 * np.array([0.1, 0.3, 0.5, 0.3, 0.1]))
    assert not on_side.any()
    on_it_m = (chain.arc_length_m[99:101]).mean(keepdims=True)
    assert fold_std_m(chain, on_it_m, FLAT)[1].all()


def test_jumps_are_independent() -> None:
    step = np.arange(241)
    near, far = 0.03 * (step >= 60), 0.04 * (step >= 150)
    both = chain_of(near - far)
    place_m = SHARES * both.length_m
    above = SHARES - (place_m > 0.15), SHARES - (place_m > 0.43)
    expected_m = FOLD_SHARE * np.hypot(0.03 * above[0], 0.04 * above[1])
    np.testing.assert_allclose(fold_std_m(both, place_m, FLAT)[0], expected_m)


def test_in_bent_cloth_gentle_slopes_count_too() -> None:
    """Down and up again by 20 mm, gently: two sides of that extent."""
    chain = chain_of(np.interp(np.arange(241.0), [0, 90, 180, 240], [0, 0.02, 0, 0]))
    place_m = np.array([0.95]) * chain.length_m
    folds_m, on_side = fold_std_m(chain, place_m, np.zeros(241))
    np.testing.assert_allclose(folds_m, FOLD_SHARE * 0.02 * np.sqrt(2) * 0.05)
    assert not on_side.any()


def test_sliding_over_a_sheet_moves_points_along_it() -> None:
    """Half a row of pixels at the hem lets a point slide by its share of it, down and away by the tilt."""
    z_m: FloatArray = np.linspace(0, 0.3, 241)
    moved_along_m = SHARES * (TOP_M[2] + z_m[-1]) / K.fy_px
    found_m = std_m(z_m)
    np.testing.assert_allclose(found_m[1], moved_along_m / np.hypot(1, 0.5))
    np.testing.assert_allclose(found_m[2], moved_along_m * 0.5 / np.hypot(1, 0.5))
    assert (found_m[0] == 0).all()


def test_points_on_the_side_of_a_fold_are_as_uncertain_as_its_edge() -> None:
    z_m = np.where(np.arange(241) < 120, 0.0, 0.05)
    found_m = std_m(z_m)
    assert (found_m[1, 2] >= EDGE_STD_M).all()
    assert (found_m[1, [0, 1, 3, 4]] < EDGE_STD_M).all()


@pytest.mark.parametrize("pixels", [0, 135, 625])
def test_small_windows_mean_bent_cloth(pixels: int) -> None:
    flat = 2 * pixels / 5781
    np.testing.assert_allclose(std_m(np.zeros(241), pixels=pixels)[2], BENT_STD_M * (1 - flat))


def test_the_grippers_uncertainty_is_all_of_that_of_x() -> None:
    sources = replace(EXACT, gripper_std_m=(0.0005, 0.0, 0.0))
    np.testing.assert_allclose(std_m(np.zeros(241), sources)[0], 0.0005)


def test_an_error_of_the_grippers_height_moves_points_by_the_rest_of_the_length() -> None:
    """On a sheet that hangs straight down; the row of pixels at the hem comes on top, and both stay as they are."""
    sources = replace(EXACT, gripper_std_m=(0.0, 0.004, 0.0))
    row_m = TOP_M[2] / K.fy_px
    found = points(np.zeros(241), sources)
    np.testing.assert_allclose(found.std_m[1], np.hypot(0.004 * (1 - SHARES), row_m * SHARES))
    np.testing.assert_allclose(found.fixed_std_m, found.std_m)


def test_the_fixed_pattern_counts_by_the_size_of_the_window() -> None:
    pattern = FixedPattern(np.array([1.0, 625.0, 5781.0]), np.array([1e-3, 4e-4, 1e-4]))
    for pixels, per_m in ((5781, 1e-4), (10000, 1e-4)):
        found = points(np.zeros(241), replace(EXACT, pattern=pattern), pixels)
        np.testing.assert_allclose(found.fixed_std_m[2], TOP_M[2] ** 2 * per_m)
    assert pattern.at(np.array([625.0, 25.0])) == pytest.approx([4e-4, 7e-4])


def test_noise_that_hangs_together_in_time_is_averaged_less() -> None:
    assert noise_factor(0.0) == pytest.approx(np.sqrt(2))
    assert noise_factor(0.5) == pytest.approx(np.sqrt(2 * 1.5) / 0.5)
