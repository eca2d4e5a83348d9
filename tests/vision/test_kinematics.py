from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.vision.kinematics import (
    FIXED_REACH_M,
    differences,
    displacement,
    increasing,
    local_polynomial,
    with_fixed_errors,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    IntArray = NDArray[np.int64]

START_NS = 1391700000033711302
"""A stamp that float64 cannot hold: its neighbours there are 256 ns away."""


def uneven_stamps_ns(count: int, seed: int = 0) -> IntArray:
    """Return stamps about 33 ms apart, some frames dropped, none where an even clock would have it."""
    periods_ns = np.random.default_rng(seed).integers(20_000_000, 60_000_000, count)
    return START_NS + np.cumsum(periods_ns)


def path(stamp_ns: IntArray, *coefficients: list[float]) -> FloatArray:
    """Return positions (T, 1, 3) of a polynomial in the seconds since the first stamp, lowest order first."""
    elapsed_s = (stamp_ns - stamp_ns[0]) / 1e9
    powers = elapsed_s[:, None] ** np.arange(len(coefficients))
    position_m: FloatArray = (powers @ np.array(coefficients))[:, None, :]
    return position_m


REST_M, SPEED_M_S, ACCELERATION_M_S2 = [0.1, -0.2, 1.06], [0.3, -0.1, 0.5], [2.0, 0.5, -1.0]


@given(seed=st.integers(0, 1000), count=st.integers(3, 20), frames=st.sampled_from([3, 5, 7, 9]))
def test_constant_speed_and_constant_acceleration_are_exact_on_uneven_stamps(
    seed: int, count: int, frames: int
) -> None:
    stamp_ns = uneven_stamps_ns(count, seed)
    elapsed_s = ((stamp_ns - stamp_ns[0]) / 1e9)[:, None]
    for quadratic, degree in ((np.zeros(3), 1), (np.array(ACCELERATION_M_S2) / 2, 2)):
        position_m = path(stamp_ns, REST_M, SPEED_M_S, quadratic.tolist())
        found = local_polynomial(stamp_ns, position_m, np.ones_like(position_m), frames=frames, degree=degree)
        expected = SPEED_M_S + 2 * quadratic * elapsed_s
        np.testing.assert_allclose(found.velocity_m_s[:, 0], expected, rtol=0, atol=1e-9)
        acceleration = np.full((count, 3), np.nan) if degree == 1 else np.tile(2 * quadratic, (count, 1))
        np.testing.assert_allclose(found.acceleration_m_s2[:, 0], acceleration, rtol=0, atol=1e-6)


@given(
    degree=st.integers(1, 4),
    coefficients=st.lists(st.floats(-2, 2), min_size=5, max_size=5),
    missing=st.sets(st.integers(0, 29), max_size=8),
)
def test_a_polynomial_of_the_same_degree_is_exact_with_frames_missing(
    degree: int, coefficients: list[float], missing: set[int]
) -> None:
    stamp_ns = uneven_stamps_ns(30)
    position_m = path(stamp_ns, *([value] * 3 for value in coefficients[: degree + 1]))
    position_m[list(missing)] = np.nan
    velocity_m_s, std_m_s, acceleration_m_s2, _ = local_polynomial(
        stamp_ns, position_m, np.ones_like(position_m), frames=2 * degree + 3, degree=degree
    )
    elapsed_s = (stamp_ns - stamp_ns[0]) / 1e9
    expected = sum(k * coefficients[k] * elapsed_s ** (k - 1) for k in range(1, degree + 1))
    found = np.isfinite(velocity_m_s[:, 0, 0])
    assert not found[list(missing)].any()
    np.testing.assert_array_equal(np.isfinite(std_m_s[:, 0, 0]), found)
    np.testing.assert_allclose(velocity_m_s[found, 0, 0], np.asarray(expected)[found], rtol=1e-6, atol=1e-6)
    if degree > 1:
        second = sum(k * (k - 1) * coefficients[k] * elapsed_s ** (k - 2) for k in range(2, degree + 1))
        np.testing.assert_allclose(acceleration_m_s2[found, 0, 0], np.asarray(second)[found], rtol=1e-4, atol=1e-4)


def test_a_fit_needs_enough_positions_around_it() -> None:
    stamp_ns = uneven_stamps_ns(9)
    position_m = path(stamp_ns, REST_M, SPEED_M_S)
    position_m[[1, 3, 7, 8]] = np.nan
    velocity_m_s, *_ = local_polynomial(stamp_ns, position_m, position_m, frames=5, degree=2)
    # Frames left: 0 2 4 5 6. In 0 to 4, for 0 and 2: 0 2 4. In 2 to 6: 2 4 5 6. In 4 to 8, for 6: 4 5 6.
    assert np.flatnonzero(np.isfinite(velocity_m_s[:, 0, 0])).tolist() == [0, 2, 4, 5, 6]
    velocity_m_s, *_ = local_polynomial(stamp_ns, position_m, position_m, frames=3, degree=2)
    assert np.flatnonzero(np.isfinite(velocity_m_s[:, 0, 0])).tolist() == [5]


def test_points_do_not_touch_each_other() -> None:
    stamp_ns = uneven_stamps_ns(12)
    both_m = np.concatenate([path(stamp_ns, REST_M, SPEED_M_S), path(stamp_ns, SPEED_M_S, REST_M)], axis=1)
    both_m[4, 1] = np.nan
    both = local_polynomial(stamp_ns, both_m, np.abs(both_m), frames=5, degree=2)
    for point in range(2):
        one_m = both_m[:, [point]]
        one = local_polynomial(stamp_ns, one_m, np.abs(one_m), frames=5, degree=2)
        for together, alone in zip(both, one, strict=True):
            np.testing.assert_array_equal(together[:, [point]], alone)


def test_uncertainty_of_a_slope_is_the_textbook_one() -> None:
    """Of five positions 1/30 s apart a line or parabola has slope (-2 -1 0 1 2)/10: its variance is 1/10."""
    stamp_ns = START_NS + 33_333_333 * np.arange(9)
    position_m = np.zeros((9, 1, 3))
    _, std_m_s, *_ = local_polynomial(stamp_ns, position_m, np.full_like(position_m, 0.001), frames=5, degree=2)
    np.testing.assert_allclose(std_m_s[2:-2], 0.001 / np.sqrt(10) / 0.033333333)
    assert (std_m_s[[0, -1]] > std_m_s[2]).all()


def test_uncertainty_of_an_acceleration_is_the_textbook_one() -> None:
    """Of five positions a step apart the parabola has acceleration (2 -1 -2 -1 2)/7 per step²: its variance is 2/7."""
    stamp_ns = START_NS + 33_333_333 * np.arange(9)
    position_m = np.zeros((9, 1, 3))
    found = local_polynomial(stamp_ns, position_m, np.full_like(position_m, 0.001), frames=5, degree=2)
    np.testing.assert_allclose(found.acceleration_std_m_s2[2:-2], 0.001 * np.sqrt(2 / 7) / 0.033333333**2)


def test_positions_that_scatter_more_than_they_say_make_a_slope_uncertain() -> None:
    """A step of 10 mm where 1 mm is stated: the line through its five frames has a scatter of its own."""
    stamp_ns = START_NS + 33_333_333 * np.arange(9)
    position_m = np.zeros((9, 1, 3))
    position_m[5:] = 0.01
    _, std_m_s, *_ = local_polynomial(stamp_ns, position_m, np.full_like(position_m, 0.001), frames=5, degree=1)
    away_m = position_m[2:7, 0, 0]
    line = np.polynomial.Polynomial.fit(np.arange(5), away_m, 1)
    scatter_m = np.sqrt(((away_m - line(np.arange(5))) ** 2).sum() / 3)
    assert (std_m_s[4] >= scatter_m / np.sqrt(10) / 0.033333333).all()
    np.testing.assert_allclose(std_m_s[0], 0.001 / np.sqrt(10) / 0.033333333)


def test_what_a_shorter_fit_says_otherwise_is_uncertain() -> None:
    """A cubic through motion that is one has nothing to hide; on a fast oscillation it misses part of it."""
    stamp_ns = START_NS + 33_333_333 * np.arange(31)
    since_s = ((stamp_ns - stamp_ns[0]) / 1e9)[:, None, None]
    nothing = np.zeros((31, 1, 3))
    smooth_m, swung_m = (
        np.broadcast_to(0.3 * since_s**3, (31, 1, 3)),
        np.broadcast_to(0.01 * np.sin(15 * since_s), (31, 1, 3)),
    )
    _, std_m_s, *_ = local_polynomial(stamp_ns, smooth_m, nothing, frames=11, degree=3)
    assert std_m_s.max() < 1e-9
    velocity_m_s, std_m_s, *_ = local_polynomial(stamp_ns, swung_m, nothing, frames=11, degree=3)
    error_m_s = (velocity_m_s - 0.15 * np.cos(15 * since_s))[8:-8]
    assert 0.5 < np.mean(error_m_s**2) / np.mean(std_m_s[8:-8] ** 2) < 2


def test_an_unknown_uncertainty_stays_unknown_and_spoils_no_velocity() -> None:
    stamp_ns = uneven_stamps_ns(9)
    position_m = path(stamp_ns, REST_M, SPEED_M_S)
    unknown_m = np.full_like(position_m, np.nan)
    for velocity_m_s, std_m_s in (
        local_polynomial(stamp_ns, position_m, unknown_m, frames=5, degree=2)[:2],
        local_polynomial(stamp_ns, position_m, unknown_m, frames=5, degree=2)[2:],
        differences(stamp_ns, position_m, unknown_m)[1:],
    ):
        assert np.isfinite(velocity_m_s[:-1]).all()
        assert np.isnan(std_m_s).all()


@given(wrong=st.dictionaries(st.integers(0, 29), st.integers(-5, 5), max_size=4))
def test_wrong_stamps_take_no_others_with_them(wrong: dict[int, int]) -> None:
    """Stamps of frames 100 ns apart, some replaced by multiples of 1000: these alone are left out, or they fit in."""
    stamp_ns = 100 * np.arange(30) + START_NS
    for index, thousands in wrong.items():
        stamp_ns[index] = START_NS + 1000 * thousands + 1
    kept = increasing(stamp_ns)
    assert (np.diff(stamp_ns[kept]) > 0).all()
    assert kept.sum() >= 30 - len(wrong)


def test_of_stamps_that_exclude_each_other_the_first_is_kept() -> None:
    assert increasing(np.array([0, 33, 33, 66])).tolist() == [True, True, False, True]
    assert increasing(np.array([0, 33, 20, 66])).tolist() == [True, True, False, True]
    assert increasing(np.array([0, 33, 500, 100, 133])).tolist() == [True, True, False, True, True]
    assert increasing(np.array([], np.int64)).tolist() == []


def test_differences_hold_at_the_middle_of_their_stamps() -> None:
    stamp_ns = uneven_stamps_ns(10)
    position_m = path(stamp_ns, REST_M, SPEED_M_S, [value / 2 for value in ACCELERATION_M_S2])
    middle_ns, velocity_m_s, std_m_s = differences(stamp_ns, position_m, np.full_like(position_m, 0.001))
    np.testing.assert_array_equal(middle_ns[:-1], stamp_ns[:-1] + (stamp_ns[1:] - stamp_ns[:-1]) // 2)
    elapsed_s = ((middle_ns - stamp_ns[0]) / 1e9)[:-1, None]
    expected = np.array(SPEED_M_S) + np.array(ACCELERATION_M_S2) * elapsed_s
    np.testing.assert_allclose(velocity_m_s[:-1, 0], expected, rtol=0, atol=1e-7)  # a middle is off by half a ns
    assert np.isnan(velocity_m_s[-1]).all()
    np.testing.assert_allclose(std_m_s[:-1, 0, 0], np.sqrt(2) * 0.001 / (np.diff(stamp_ns) / 1e9))


def test_a_missing_point_has_no_difference_on_either_side() -> None:
    stamp_ns = uneven_stamps_ns(6)
    position_m = path(stamp_ns, REST_M, SPEED_M_S)
    position_m[3] = np.nan
    _, velocity_m_s, _ = differences(stamp_ns, position_m, position_m)
    assert np.isnan(velocity_m_s[:, 0, 0]).tolist() == [False, False, True, True, False, True]


@given(shift_ns=st.integers(-(10**18), 10**18), offset_m=st.floats(-5, 5))
def test_velocity_and_displacement_know_no_epoch_and_no_origin(shift_ns: int, offset_m: float) -> None:
    stamp_ns = uneven_stamps_ns(15)
    position_m = path(stamp_ns, REST_M, SPEED_M_S, ACCELERATION_M_S2, [9.0, -8.0, 7.0])
    std_m = np.full_like(position_m, 0.001)
    here, *_ = local_polynomial(stamp_ns, position_m, std_m, frames=5, degree=2)
    later, *_ = local_polynomial(stamp_ns + shift_ns, position_m, std_m, frames=5, degree=2)
    np.testing.assert_array_equal(here, later)
    there, *_ = local_polynomial(stamp_ns, position_m + offset_m, std_m, frames=5, degree=2)
    np.testing.assert_allclose(there, here, atol=1e-10)
    at_rest = np.arange(15) < 5
    np.testing.assert_allclose(
        displacement(position_m + offset_m, std_m, at_rest)[0], displacement(position_m, std_m, at_rest)[0], atol=1e-12
    )


@pytest.mark.parametrize("velocity", [differences, lambda *args: local_polynomial(*args, frames=5, degree=2)])
def test_no_frames_no_velocities(velocity: Callable[..., tuple[FloatArray, ...]]) -> None:
    nothing = np.empty((0, 2, 3))
    assert velocity(np.empty(0, np.int64), nothing, nothing)[-1].shape == (0, 2, 3)


def test_displacement_is_from_the_median_at_rest() -> None:
    position_m = np.tile([[0.1, 0.2, 0.3]], (8, 1, 1))
    position_m[1] += 0.5  # an outlier
    position_m[2] = np.nan
    position_m[5:] += [[0.01, 0.02, 0.03]]
    moved_m, std_m = displacement(position_m, np.full_like(position_m, 0.002), np.arange(8) < 5)
    np.testing.assert_allclose(moved_m[[0, 3, 4], 0], np.zeros((3, 3)), atol=1e-15)
    np.testing.assert_allclose(moved_m[5:, 0], np.tile([0.01, 0.02, 0.03], (3, 1)))
    assert np.isnan(moved_m[2]).all()
    np.testing.assert_allclose(std_m[5:], 0.002 * np.sqrt(1 + 1.2533**2 / 4))


def test_fixed_errors_cancel_until_the_point_has_moved() -> None:
    position_m = np.zeros((7, 1, 3))
    position_m[5, 0, 2], position_m[6, 0, 2] = 0.01 * FIXED_REACH_M, 10 * FIXED_REACH_M
    fixed_m = np.full_like(position_m, 0.002)
    _, std_m = displacement(position_m, fixed_m, np.arange(7) < 5, fixed_m)
    assert (std_m[:6] < 0.0001).all()
    np.testing.assert_allclose(std_m[6], 0.002 * np.sqrt(2))


def test_fixed_errors_make_velocities_uncertain_as_fast_as_points_move() -> None:
    stamp_ns = np.arange(9) * 33_000_000
    position_m = np.zeros((9, 1, 3))
    position_m[:, 0, 2] = 0.5 * stamp_ns / 1e9
    found = local_polynomial(stamp_ns, position_m, np.zeros_like(position_m), frames=5, degree=2)
    std_m_s = with_fixed_errors(found, np.full_like(position_m, 0.001)).velocity_std_m_s
    np.testing.assert_allclose(std_m_s, 0.001 * 0.5 / FIXED_REACH_M, rtol=1e-6)


def test_a_point_never_seen_at_rest_has_no_displacement() -> None:
    position_m = np.ones((6, 2, 3))
    position_m[:3, 1] = np.nan
    moved_m, std_m = displacement(position_m, np.ones_like(position_m), np.arange(6) < 3)
    assert np.isfinite(moved_m[:, 0]).all()
    assert np.isnan(moved_m[:, 1]).all()
    assert np.isnan(std_m[:, 1]).all()
