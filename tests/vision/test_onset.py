from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset.simulate.motion import Swing
from garment_dataset.simulate.timing import frame_times
from garment_dataset.vision.onset import Onset, OnsetSettings, find_onset, motion_frame

if TYPE_CHECKING:
    from typing import Literal

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

BEGIN_NS = 1391700000033711302
FRAME_S = 0.0335
SETTINGS = OnsetSettings(threshold_m=0.002, rest_frames=5, lasting_frames=3, rise_frames=6, noise_m=2e-5)


def error_s(swing: Swing, noise_m: float, seed: int) -> tuple[float, float]:
    """Return the error of the onset of a simulated swing seen with noise, and its stated standard uncertainty."""
    rng = np.random.default_rng(seed)
    times, _ = frame_times(rng, BEGIN_NS, 4.0, None)
    path_m = swing.gripper_m(times.time_s) + rng.normal(0, noise_m, (times.time_s.size, 3))
    onset = find_onset(times.stamp_ns, path_m, SETTINGS)
    assert isinstance(onset, Onset)
    return (onset.stamp_ns - BEGIN_NS) / 1e9 - swing.start_s, onset.std_s


@pytest.mark.parametrize("axis", ["R", "B"])
@pytest.mark.parametrize("noise_m", [0.0, 2e-5])
def test_onset_of_simulated_swings_is_true_within_a_frame(axis: Literal["R", "B"], noise_m: float) -> None:
    """The threshold alone is passed some 0.2 s late, and later the slower the swing."""
    swings = [
        Swing(axis, np.pi / divisor, speed, start_s)
        for divisor in (8, 16, 32)
        for speed, start_s in ((0.1, 1.5), (0.25, 0.5), (0.5, 0.5), (1.0, 1.0))
    ]
    found = np.array([error_s(swing, noise_m, seed) for swing in swings for seed in range(2)])
    errors_s, stds_s = found.T
    assert np.abs(errors_s).max() < FRAME_S
    assert np.sqrt((errors_s**2).mean()) < 0.01
    assert (np.abs(errors_s) < 2 * stds_s).mean() > 0.9
    assert stds_s.max() < FRAME_S


def test_noise_makes_the_onset_uncertain_and_is_stated() -> None:
    found = [error_s(Swing("R", np.pi / 16, 0.5, 0.5), 0.0002, seed) for seed in range(20)]
    errors_s, stds_s = np.array(found).T
    assert stds_s.mean() > 1.5 * error_s(Swing("R", np.pi / 16, 0.5, 0.5), 0.0, 0)[1]
    assert (np.abs(errors_s) < 2 * stds_s).mean() >= 0.9


@pytest.mark.parametrize("power", [1, 1.5, 2, 3])
def test_onset_of_a_power_of_time_lies_between_frames(power: float) -> None:
    stamp_ns = BEGIN_NS + 33_000_000 * np.arange(30)
    start_ns = int(stamp_ns[12]) + 20_000_000
    rise_m = 0.5 * np.maximum((stamp_ns - start_ns) / 1e9, 0) ** power
    onset = find_onset(stamp_ns, rise_m[:, None] * np.array([2, -1, 2]) / 3, SETTINGS)
    assert isinstance(onset, Onset)
    assert abs(onset.stamp_ns - start_ns) / 1e9 < max(2 * onset.std_s, 0.012)


def frame_of(distance_m: list[float], *, rest_frames: int = 3, lasting_frames: int = 2) -> int | str:
    """Return the first frame surely in motion along a path at these distances from its start."""
    path_m = np.array([0.1, -0.2, 1.06]) + np.array(distance_m)[:, None] * np.array([2, -1, 2]) / 3
    return motion_frame(path_m, threshold_m=0.002, rest_frames=rest_frames, lasting_frames=lasting_frames)


def test_motion_is_sure_in_the_first_frame_beyond_the_threshold() -> None:
    assert frame_of([0, 0, 0, 0, 0.0019, 0.0021, 0.01, 0.02]) == 5
    assert frame_of([0, 0, 0, 0.01, 0.02, 0.01, 0, -0.01, -0.02]) == 3


def test_noise_and_one_wrong_position_are_no_motion() -> None:
    noise_m = np.random.default_rng(0).normal(0, 0.0003, 200)
    assert frame_of(noise_m.tolist(), rest_frames=5, lasting_frames=3) == "no_motion"
    noise_m[100] = 0.5
    assert frame_of(noise_m.tolist(), rest_frames=5, lasting_frames=3) == "no_motion"
    noise_m[150:] += 0.01 * np.arange(1, 51)
    assert frame_of(noise_m.tolist(), rest_frames=5, lasting_frames=3) == 150


def test_motion_from_the_first_frame_has_no_rest() -> None:
    assert frame_of([0.01 * i for i in range(30)], rest_frames=5) == "no_rest"
    assert frame_of([0, 0.01, 0.02, 0.03], rest_frames=3) == "no_gripper"
    assert frame_of([0, 0]) == "no_gripper"


def test_unknown_positions_are_passed_over() -> None:
    times, _ = frame_times(np.random.default_rng(0), BEGIN_NS, 3.0, None)
    path_m = Swing("R", np.pi / 16, 0.5, 0.5).gripper_m(times.time_s)
    known = np.random.default_rng(1).random(times.time_s.size) > 0.2
    path_m[~known] = np.nan
    assert find_onset(times.stamp_ns, path_m, SETTINGS) == find_onset(times.stamp_ns[known], path_m[known], SETTINGS)
    assert find_onset(times.stamp_ns, np.full_like(path_m, np.nan), SETTINGS) == "no_gripper"
    assert find_onset(np.empty(0, np.int64), np.empty((0, 3)), SETTINGS) == "no_gripper"


def test_a_rest_that_may_have_ended_before_the_first_frames_was_not_seen() -> None:
    """Frame 7 is beyond the threshold, but the rise began with the first."""
    stamp_ns = BEGIN_NS + 33_000_000 * np.arange(30)
    path_m = np.zeros((30, 3))
    path_m[:, 2] = 0.00001 * np.arange(30) ** 3
    assert find_onset(stamp_ns, path_m, SETTINGS) == "no_rest"
