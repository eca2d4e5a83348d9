"""Which gaps of a chain are bridged, and how uncertain bridges are: known answers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset.vision.depth.support import HIDDEN_CURVATURE_PER_M, BridgeLimits, Support, bridge_gaps

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

LIMITS = BridgeLimits(jump_m=0.012, longest_m=0.06)
Y_M: FloatArray = 0.0025 * np.arange(100, dtype=np.float64)


def bridged(z_m: FloatArray, start: int, stop: int, hold_z_m: float | None = None) -> Support:
    """Judge a chain without the samples from start to stop, whose depth must not matter."""
    carried = (np.arange(100) < start) | (np.arange(100) >= stop)
    return bridge_gaps(Y_M, np.where(carried, z_m, np.nan), carried, hold_z_m, LIMITS)


def test_what_is_whole_needs_no_bridge() -> None:
    found = bridged(np.ones(100), 50, 50)
    assert not found.bridged_m.any()
    assert not found.std_m.any()
    assert not found.between_layers.any()


@pytest.mark.parametrize("slope", [0.0, 0.3, -1.0])
def test_a_hole_in_a_straight_sheet_is_bridged_by_its_length_along_the_sheet(slope: float) -> None:
    found = bridged(1 + slope * Y_M, 50, 59)
    length_m = 0.025 * np.hypot(1, slope)
    np.testing.assert_allclose(found.bridged_m[50:59], length_m)
    assert found.std_m[54] == pytest.approx(HIDDEN_CURVATURE_PER_M * length_m**2 / 8)  # the sagitta, in the middle
    assert found.std_m[50] < found.std_m[52] < found.std_m[54]
    outside = np.r_[0:50, 59:100]
    assert (found.bridged_m[outside] == 0).all()
    assert (found.std_m[outside] == 0).all()


def test_the_longer_the_bridge_the_less_certain_its_middle() -> None:
    middles_m = [bridged(np.ones(100), 50 - half, 51 + half).std_m[50] for half in range(1, 11)]
    assert (np.diff(middles_m) > 0).all()


def test_a_gap_too_long_is_not_bridged_and_is_not_between_layers() -> None:
    found = bridged(np.ones(100), 40, 65)
    assert np.isnan(found.bridged_m[40:65]).all()
    assert not found.between_layers.any()


@pytest.mark.parametrize("step_m", [0.03, -0.03, 0.1])
def test_two_layers_are_not_one_surface(step_m: float) -> None:
    found = bridged(np.where(np.arange(100) < 55, 1.0, 1.0 + step_m), 50, 60)
    assert np.isnan(found.bridged_m[50:60]).all()
    assert found.between_layers[50:60].all()


def test_equal_depth_is_not_enough_where_the_slopes_say_otherwise() -> None:
    """Both pieces lead steeply away from each other: across the gap of 5 cm each would be 7.5 cm off."""
    found = bridged(1 + 1.5 * np.abs(Y_M - Y_M[50]), 41, 60)
    assert found.between_layers[41:60].all()


def test_a_miss_within_the_noise_is_bridged_and_adds_to_the_uncertainty() -> None:
    straight, stepped = (bridged(np.where(np.arange(100) < 55, 1.0, 1.0 + step_m), 50, 60) for step_m in (0, 0.01))
    assert (stepped.bridged_m[50:60] > 0).all()
    # the arc over a gap whose ends miss each other by 1 cm is a quarter of that high, and the bridge is longer by 7 %
    added_m = np.sqrt(stepped.std_m[54] ** 2 - straight.std_m[54] ** 2)
    assert added_m == pytest.approx(0.01 / 4, rel=0.2)


def test_the_top_is_bridged_from_where_the_cloth_is_held_and_the_bottom_from_nowhere() -> None:
    assert bridged(np.ones(100), 0, 5, hold_z_m=1.0).bridged_m[0] == pytest.approx(0.0125)
    assert np.isnan(bridged(np.ones(100), 0, 5).bridged_m[:5]).all()
    assert np.isnan(bridged(np.ones(100), 0, 5, hold_z_m=1.2).bridged_m[:5]).all()
    assert np.isnan(bridged(np.ones(100), 95, 100).bridged_m[95:]).all()
