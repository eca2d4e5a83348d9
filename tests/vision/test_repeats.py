"""Repeats are compared at common times; their spread is known, and its interval holds."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from garment_dataset.vision.repeats import Repeat, at_times, common_times_s, spread_of, summarise

Floats = NDArray[np.float64]
TIMES_S: Floats = np.arange(0, 4, 1 / 30)


def repeat(offset_s: float, level: float, *, std: float = 0.0, missing: slice | None = None) -> Repeat:
    """A straight line, sampled 30 times a second from somewhere within a frame."""
    time_s = np.arange(-0.5, 5, 1 / 30) + offset_s
    value = 2 * time_s + level
    if missing is not None:
        value[missing] = np.nan
    return Repeat(time_s, value, np.full(len(time_s), std))


@pytest.mark.parametrize("offset_s", [0.0, 0.011, 0.029])
def test_a_line_is_found_again_at_other_times(offset_s: float) -> None:
    value, std = at_times(repeat(offset_s, 3.0, std=0.25), TIMES_S)
    np.testing.assert_allclose(value, 2 * TIMES_S + 3, atol=1e-12)
    np.testing.assert_allclose(std, 0.25)


def test_nothing_is_told_beyond_the_ends_nor_over_a_long_gap() -> None:
    value, _ = at_times(repeat(0.0, 0.0, missing=slice(60, 75)), np.array([-1.0, 1.0, 1.7, 3.0, 9.0]))
    assert np.isfinite(value).tolist() == [False, True, False, True, False]


def test_a_lost_frame_is_bridged() -> None:
    value, _ = at_times(repeat(0.0, 0.0, missing=slice(60, 61)), np.array([1.5]))
    assert value == pytest.approx(3.0)


def test_what_two_repeats_have_in_common_is_compared() -> None:
    times_s = common_times_s([np.array([-0.31, 2.0]), np.array([-0.2, 3.0]), np.array([-0.1, 1.0])], 0.1)
    np.testing.assert_allclose(times_s, np.arange(-2, 21) * 0.1)
    assert common_times_s([np.array([0.0, 1.0]), np.array([np.nan])], 0.1).size == 0


def test_levels_apart_are_the_spread() -> None:
    spread, values = spread_of([repeat(0.01 * n, level, std=0.5) for n, level in enumerate((1.0, 2.0, 3.0))], TIMES_S)
    np.testing.assert_allclose(spread.mean, 2 * TIMES_S + 2, atol=1e-12)
    np.testing.assert_allclose(spread.std, 1.0)
    np.testing.assert_allclose(spread.stated, 0.5)
    found = summarise(spread, values, TIMES_S)
    assert found is not None
    assert (found.rms, found.largest, found.stated_rms) == pytest.approx((1.0, 1.0, 0.5))
    assert found.degrees == pytest.approx(2.0)  # all times say the same


def test_the_order_of_the_repeats_is_of_no_account() -> None:
    repeats = [repeat(0.01 * n, level) for n, level in enumerate((1.0, 2.5, 3.0))]
    forwards, backwards = (spread_of(each, TIMES_S)[0] for each in (repeats, repeats[::-1]))
    np.testing.assert_allclose(forwards.std, backwards.std, atol=1e-12)


def test_one_repeat_has_no_spread() -> None:
    spread, values = spread_of([repeat(0.0, 1.0)], TIMES_S)
    assert np.isnan(spread.std).all()
    assert summarise(spread, values, TIMES_S) is None


def test_a_value_without_an_uncertainty_is_compared_but_explains_nothing() -> None:
    spread, _ = spread_of([repeat(0.0, 1.0, std=np.nan), repeat(0.0, 2.0, std=0.1)], TIMES_S)
    assert np.isfinite(spread.std).all()
    assert np.isnan(spread.stated).all()


@pytest.mark.parametrize("count", [2, 3, 5])
@pytest.mark.parametrize("smooth_s", [0.0, 0.3, 100.0])
def test_the_interval_of_the_rms_holds(count: int, smooth_s: float) -> None:
    """Errors that are independent from frame to frame, that last for a while, or that all frames share."""
    rng = np.random.default_rng(count)
    covariance = np.exp(-(((TIMES_S[:, None] - TIMES_S) / smooth_s) ** 2)) if smooth_s else np.eye(len(TIMES_S))
    root = np.linalg.cholesky(covariance + 1e-9 * np.eye(len(TIMES_S)))
    held = []
    for _ in range(300):
        apart = rng.normal(size=(count, len(TIMES_S))) @ root.T
        repeats = [Repeat(TIMES_S, each, np.zeros(len(TIMES_S))) for each in apart]
        found = summarise(*spread_of(repeats, TIMES_S), TIMES_S)
        assert found is not None
        held.append(found.rms_low <= 1 <= found.rms_high)
    assert np.mean(held) > 0.91  # 0.95 less three standard deviations of 300 tries
