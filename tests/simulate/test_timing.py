from __future__ import annotations

import numpy as np
import pytest

from garment_dataset.simulate.timing import frame_times, start_ns, ticks


@pytest.fixture(scope="module")
def long_recording() -> tuple[np.ndarray, np.ndarray]:
    depth, color = frame_times(np.random.default_rng(2), 10**18, 600.0, None)
    return depth.stamp_ns / 1e6, color.stamp_ns / 1e6


def test_period_and_its_spread(long_recording: tuple[np.ndarray, np.ndarray]) -> None:
    depth, _ = long_recording
    periods = np.diff(depth)
    kept = periods[periods < 50]
    assert kept.mean() == pytest.approx(33.47, abs=0.05)
    assert kept.std() == pytest.approx(2.5, abs=0.2)
    assert periods.min() > 0


def test_two_in_a_thousand_frames_are_dropped(long_recording: tuple[np.ndarray, np.ndarray]) -> None:
    for stamps in long_recording:
        expected = (stamps[-1] - stamps[0]) / 33.47 + 1
        assert 0.0005 <= 1 - len(stamps) / expected <= 0.004


def test_color_comes_after_depth(long_recording: tuple[np.ndarray, np.ndarray]) -> None:
    depth, color = long_recording
    lag = color - depth[np.searchsorted(depth, color) - 1]
    lag = lag[lag < 10]
    assert len(lag) > 0.99 * len(color)
    assert lag.mean() == pytest.approx(2.07, abs=0.05)
    assert lag.min() >= 1.65 - 1e-3
    assert lag.max() <= 3.61 + 1e-3


def test_record_times_lie_behind_and_never_run_back() -> None:
    for stream in frame_times(np.random.default_rng(3), 10**18, 60.0, None):
        assert (stream.record_ns > stream.stamp_ns).all()
        assert (np.diff(stream.record_ns) >= 0).all()
        assert stream.record_ns[-1] < 10**18 + 60 * 10**9
        assert stream.time_s == pytest.approx((stream.stamp_ns - 10**18) / 1e9)


def test_limit_cuts_the_end_off_and_changes_nothing_else() -> None:
    whole, _ = frame_times(np.random.default_rng(3), 10**18, 5.0, None)
    short, _ = frame_times(np.random.default_rng(3), 10**18, 5.0, 7)
    assert (short.stamp_ns == whole.stamp_ns[:7]).all()


def test_eight_seconds_hold_some_240_frames() -> None:
    depth, _ = frame_times(np.random.default_rng(3), start_ns(1), 8.0, None)
    assert 230 <= len(depth.stamp_ns) <= 240


def test_ticks_are_steady() -> None:
    stamps = ticks(5, 1.0, 50.0, 0.003)
    assert stamps[0] == 5 + 3_000_000
    assert set(np.diff(stamps).tolist()) == {20_000_000}
    assert len(stamps) == 50
