"""Simulated frames against the figures measured on real frames of such sensors; the bounds are the measured ranges."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest

from garment_dataset.simulate.sensor import (
    DEAD_COLUMNS_PX,
    DepthSensor,
    fixed_pattern,
    openni_table,
    shadow,
    shift_of_depth,
)
from garment_dataset.simulate.sensor_color import ColorSensor

if TYPE_CHECKING:
    from numpy.typing import NDArray

SEED = 7
NEAR_M, FAR_M = 1.07, 1.80
LEFT_PX, RIGHT_PX = 220, 420


@pytest.fixture(scope="module")
def still() -> NDArray[np.float64]:
    """Return 15 frames of a wall at 1.07 m, in shift units; NaN where nothing was measured."""
    sensor = DepthSensor(np.random.default_rng(SEED))
    frames = np.array([sensor.frame(np.full((480, 640), NEAR_M)) for _ in range(15)])
    shifts = np.searchsorted(openni_table(), frames).astype(np.float64)
    shifts[frames == 0] = np.nan
    return shifts[..., : 640 - DEAD_COLUMNS_PX]


@pytest.fixture(scope="module")
def step_scene() -> NDArray[np.float64]:
    """Return a board at 1.07 m before a wall at 1.80 m."""
    depth = np.full((480, 640), FAR_M)
    depth[100:400, LEFT_PX:RIGHT_PX] = NEAR_M
    return depth


@pytest.fixture(scope="module")
def step_frames(step_scene: NDArray[np.float64]) -> NDArray[np.uint16]:
    sensor = DepthSensor(np.random.default_rng(SEED))
    return np.array([sensor.frame(step_scene) for _ in range(10)])


def test_table_is_openni_s() -> None:
    table = openni_table()
    assert (table[0], table[-1], len(table)) == (314, 9870, 1053)
    near = table[(table >= 1050) & (table <= 1090)]
    assert near.tolist() == [1050, 1054, 1057, 1060, 1063, 1067, 1070, 1073, 1077, 1080, 1084, 1087, 1090]
    assert ((table >= 700) & (table <= 5000)).sum() == 421


def test_every_reported_value_is_in_the_table(step_frames: NDArray[np.uint16]) -> None:
    assert set(np.unique(step_frames)) <= {0, *openni_table().tolist()}


def test_shift_is_the_table_s_inverse() -> None:
    index = np.arange(100, 1000)
    tan = ((index - 800) / 4 - 0.375) * 0.1052
    assert shift_of_depth((tan * 120 / (7.5 - tan) + 120) / 100) == pytest.approx(index, abs=1e-9)
    step_m = np.diff(shift_of_depth(np.array([1.07, 1.07 + 1e-6])))[0] / 1e-6
    assert 1 / step_m == pytest.approx(1.07**2 / 342.205, rel=1e-3)


def test_noise_in_time(still: NDArray[np.float64]) -> None:
    spread = np.nanmean(np.nanstd(still, axis=0, ddof=1))
    assert 0.33 <= spread <= 0.70
    mode = np.nanmedian(still, axis=0)
    off = np.abs(still - mode)
    measured = np.isfinite(off)
    assert 0.14 <= (off[measured] >= 1).mean() <= 0.42
    assert 0.002 <= (off[measured] >= 2).mean() <= 0.048
    assert (~measured).mean() <= 0.0017


@pytest.mark.parametrize(
    ("distance_px", "low", "high"), [(1, 0.44, 0.74), (2, 0.27, 0.62), (4, 0.11, 0.53), (8, 0.0, 0.47)]
)
def test_noise_comes_in_blobs(still: NDArray[np.float64], distance_px: int, low: float, high: float) -> None:
    noise = still - np.nanmean(still, axis=0)
    variance = np.nanmean(noise**2)
    along_x = np.nanmean(noise[:, :, distance_px:] * noise[:, :, :-distance_px]) / variance
    along_y = np.nanmean(noise[:, distance_px:] * noise[:, :-distance_px]) / variance
    assert low <= along_x <= high
    assert low <= along_y <= high
    assert along_x == pytest.approx(along_y, abs=0.05)


def test_noise_remembers_the_last_frame_a_little(still: NDArray[np.float64]) -> None:
    noise = still - np.nanmean(still, axis=0)
    correlation = np.nanmean(noise[1:] * noise[:-1]) / np.nanmean(noise**2)
    # the mean of 15 frames takes some 1/15 away from what is measured against it
    assert 0.11 - 1 / 15 <= correlation <= 0.18


def test_bands_are_vertical_fixed_and_of_the_measured_height(still: NDArray[np.float64]) -> None:
    columns = np.nanmean(still, axis=(0, 1))
    assert 0.35 <= columns.std() <= 0.5
    steps = np.abs(np.diff(columns))
    borders = np.flatnonzero(steps > 0.15)
    assert 4 <= len(borders) <= 11
    assert ((borders + 1 - 36) % 56.3 < 2).sum() + ((borders + 1 - 36) % 56.3 > 54.3).sum() == len(borders)
    assert (fixed_pattern() == fixed_pattern()).all()
    halves = [np.nanmean(still[part], axis=(0, 1)) for part in (slice(0, 7), slice(8, 15))]
    assert np.corrcoef(*halves)[0, 1] > 0.95


def test_residual_from_a_plane_exceeds_the_noise_in_time(still: NDArray[np.float64]) -> None:
    v, u = np.mgrid[:21, :21].reshape(2, -1)
    basis, _ = np.linalg.qr(np.stack([u, v, np.ones(441)], axis=1).astype(np.float64))
    residuals = []
    for top in range(0, 450, 40):
        for left in range(0, 600, 40):
            window = still[0, top : top + 21, left : left + 21].ravel()
            if np.isfinite(window).all():
                residuals.append(np.std(window - basis @ (basis.T @ window)))
    millimetres = np.median(residuals) * 3.35
    assert 1.65 <= millimetres <= 3.5


def test_shadow_lies_on_the_left_and_is_as_wide_as_the_baseline_says(step_scene: NDArray[np.float64]) -> None:
    shaded = shadow(step_scene)
    width = shaded[250].sum()
    expected = 570.3422 * 0.075 * (1 / NEAR_M - 1 / FAR_M)
    assert width == pytest.approx(expected - 2.5, abs=1)
    assert shaded[250, LEFT_PX - width : LEFT_PX].all()
    assert not shaded[:90].any()


def test_gaps_at_left_and_right_edges(step_frames: NDArray[np.uint16]) -> None:
    rows = step_frames[:, 110:390]
    left = np.cumprod((rows == 0)[..., LEFT_PX - 1 :: -1], axis=-1).sum(axis=-1)
    right = np.cumprod((rows == 0)[..., RIGHT_PX:], axis=-1).sum(axis=-1)
    assert 0.15 <= (left == 0).mean() <= 0.51
    assert 7 <= np.median(left[left > 0]) <= 14
    assert 0.73 <= (right == 0).mean() <= 0.93


def test_missing_pixels_by_distance_to_an_edge() -> None:
    scene = np.full((480, 640), 1.30)
    scene[100:400, 120:520] = NEAR_M
    sensor = DepthSensor(np.random.default_rng(SEED))
    missing = np.mean([sensor.frame(scene) == 0 for _ in range(10)], axis=0)
    border = np.zeros((480, 640), dtype=np.uint8)
    cv2.rectangle(border, (120, 100), (519, 399), 1, 1)
    distance = cv2.distanceTransform(1 - border, cv2.DIST_L2, 3)
    kept = np.ones_like(border, dtype=bool)
    kept[:, -DEAD_COLUMNS_PX:] = False
    shares = [
        missing[kept & (distance >= low) & (distance < high)].mean()
        for low, high in ((0, 1.5), (1.5, 3.5), (3.5, 6.5), (6.5, 12.5), (16, 400))
    ]
    measured = ((0.18, 0.47), (0.10, 0.27), (0.04, 0.12), (0.01, 0.04), (0.0, 0.03))
    for share, (low, high) in zip(shares, measured, strict=True):
        assert low <= share <= high
    assert shares == sorted(shares, reverse=True)


def test_right_columns_are_dead(step_frames: NDArray[np.uint16]) -> None:
    assert (step_frames[..., -DEAD_COLUMNS_PX:] == 0).all()
    assert (step_frames[..., -DEAD_COLUMNS_PX - 1] > 0).mean() > 0.9


@pytest.fixture(scope="module")
def gray() -> NDArray[np.float64]:
    """Return 12 colour frames of a gray wall."""
    sensor = ColorSensor(np.random.default_rng(SEED))
    return np.array([sensor.frame(np.full((480, 640, 3), 130.0, np.float32)) for _ in range(12)]).astype(np.float64)


def test_color_noise_is_a_bayer_sensor_s(gray: NDArray[np.float64]) -> None:
    middle = gray[:, 180:300, 260:380]
    noise = middle - middle.mean(axis=(1, 2), keepdims=True)
    noise -= noise.mean(axis=0)
    red, green, blue = noise.std(axis=(0, 1, 2)) * np.sqrt(12 / 11)
    assert 2.0 <= green <= 3.6
    assert 2.4 <= red <= 6.0
    assert 2.4 <= blue <= 6.0
    beside = (noise[:, :, 1:] * noise[:, :, :-1]).mean(axis=(0, 1, 2)) / (noise**2).mean(axis=(0, 1, 2))
    assert (beside >= 0.58).all()
    assert (beside <= 0.69).all()


def test_whole_frames_drift(gray: NDArray[np.float64]) -> None:
    level = gray.mean(axis=(1, 2))
    assert (level.std(axis=0) >= 0.5).all()
    assert (level.std(axis=0) <= 5.0).all()


def test_side_borders_are_darker(gray: NDArray[np.float64]) -> None:
    columns = gray.mean(axis=(0, 1, 3))
    assert columns[:10].mean() < 0.9 * columns[300:340].mean()
    assert columns[-10:].mean() < 0.9 * columns[300:340].mean()


def test_equal_seeds_give_equal_frames(step_scene: NDArray[np.float64]) -> None:
    first, again, other = (DepthSensor(np.random.default_rng(seed)).frame(step_scene) for seed in (1, 1, 2))
    assert (first == again).all()
    assert (first != other).any()
