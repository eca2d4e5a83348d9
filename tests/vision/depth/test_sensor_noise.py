"""What recordings say of their sensor: known noise, pattern and levels are found again."""

from __future__ import annotations

import numpy as np
import pytest

from garment_dataset.vision.depth.backdrop import backdrop, static_inverse
from garment_dataset.vision.depth.flat_field import plain_per_m
from garment_dataset.vision.depth.sensor_noise import level_step_per_m, time_noise, window_means
from tests.vision.depth.made_fields import SHAPE, blobs

EVERYWHERE = np.ones(SHAPE, np.bool_)


@pytest.mark.parametrize("correlation", [0.0, 0.4])
@pytest.mark.parametrize(("radius_px", "together"), [(0.0, 1.0), (1.5, 4 * np.pi * 1.5**2)])
def test_noise_and_its_correlations_are_found(correlation: float, radius_px: float, together: float) -> None:
    rng = np.random.default_rng(2)
    frames = [blobs(rng, radius_px)]
    for _ in range(20):
        frames.append(correlation * frames[-1] + np.sqrt(1 - correlation**2) * blobs(rng, radius_px))
    found = time_noise([1.0 + 0.002 * frame for frame in frames], EVERYWHERE)
    assert found is not None
    assert found.std_per_m == pytest.approx(0.002, rel=0.03)
    assert found.correlation == pytest.approx(correlation, abs=0.04)
    assert found.pixels_per_independent == pytest.approx(together, rel=0.25)


def test_two_frames_say_nothing_of_correlation() -> None:
    assert time_noise([np.ones(SHAPE)] * 2, EVERYWHERE) is None


@pytest.mark.parametrize("step_per_m", [0.0015, 0.003])
def test_the_step_of_the_levels_is_found(step_per_m: float) -> None:
    inverse = np.arange(0.9, 1.1, step_per_m)
    frame = np.tile(np.rint(1000 / inverse).astype(np.uint16), (10, 5))
    found = level_step_per_m([frame], plain_per_m(), 800, 1200)
    assert found == pytest.approx(step_per_m, rel=0.1)
    assert level_step_per_m([frame], plain_per_m(), 2000, 3000) is None


def test_a_leaning_plane_is_found_among_other_things() -> None:
    v, u = np.indices(SHAPE)
    inverse = 0.5 + 2e-4 * u + 1e-4 * v
    inverse[:, 200:] = 0.4 + 1e-3 * v[:, 200:]
    inverse[:40] = np.nan
    found = backdrop(inverse)
    assert found is not None
    assert found[40:, :200].all()
    assert found[:, 200:].mean() < 0.1


def test_what_is_missing_too_often_does_not_stand_still() -> None:
    frames = [np.full(SHAPE, 2000, np.uint16) for _ in range(4)]
    for frame in frames[:2]:
        frame[:100] = 0
    frames[0][100:120] = 900
    inverse = static_inverse(frames, plain_per_m(), 1.4)
    assert np.isnan(inverse[:100]).all()
    assert (inverse[100:] == 0.5).all()
    assert backdrop(np.full(SHAPE, np.nan)) is None


def test_noise_is_what_its_definition_says_wherever_the_region_is() -> None:
    """Differences of frames, their products and the means over windows that are nearly full, each taken one by one."""
    rng = np.random.default_rng(5)
    frames = 1.0 + 0.002 * rng.normal(size=(5, 90, 120))
    frames[rng.random(frames.shape) < 0.05] = np.nan
    frames[2, 40:44, 60:70] += 0.1
    region = np.zeros((90, 120), np.bool_)
    region[17:77, 41:109] = True
    change = np.diff(np.where(region, frames, np.nan), axis=0)
    change[np.abs(change) > 0.03] = np.nan
    variance = np.nanmean(change**2)
    correlation = 1 + 2 * np.nanmean(change[1:] * change[:-1]) / variance
    windows = [
        each[row : row + 25, column : column + 25]
        for each in change
        for row in range(0, 90 - 24, 12)
        for column in range(0, 120 - 24, 12)
    ]
    means = [np.nanmean(window) for window in windows if np.isfinite(window).sum() >= 500]
    found = time_noise(list(frames), region)
    assert found is not None
    assert found.correlation == pytest.approx(correlation, abs=1e-12)
    assert found.std_per_m == pytest.approx(np.sqrt(variance / (2 * (1 - correlation))), rel=1e-12)
    assert found.pixels_per_independent == pytest.approx(max(625 * np.mean(np.square(means)) / variance, 1.0))
    tall, size = window_means(change[0], 3, 5)
    assert size == 77
    expected = np.nanmean(change[0][20 : 20 + 11, 60 : 60 + 7])
    assert tall[4, 20] == pytest.approx(expected, rel=1e-12)
