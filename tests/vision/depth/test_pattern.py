"""What a sensor always adds: known patterns are found again, in single pixels too; nothing else is taken for one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset.vision.depth.cloud import LEVEL_SPACING_PER_M
from garment_dataset.vision.depth.flat_field import column_offsets, ladder_per_m
from garment_dataset.vision.depth.pattern import fixed_pattern, less_known, measured_pattern
from garment_dataset.vision.depth.pixel_pattern import (
    PatternShare,
    pattern_share,
    pixel_pattern,
    residual_about_planes,
)
from garment_dataset.vision.depth.sensor_noise import window_means
from tests.vision.depth.made_fields import SHAPE, blobs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray, FloatArray

EVERYWHERE = np.ones(SHAPE, np.bool_)
LADDER = ladder_per_m()
LIMITS_MM = (800, 1300)
V, U = np.indices(SHAPE).astype(np.float64)
WALL = 1 / 1.8 + 2e-5 * V - 3e-5 * U
SHEET = 1 / 1.05 + 1e-4 * (V - 120) + 2e-5 * (U - 160) - 4e-7 * (V - 120) ** 2


def levels(inverse: FloatArray) -> NDArray[np.uint16]:
    """Return the millimetres of the level nearest to inverse depths."""
    mm = np.flatnonzero(LADDER)
    rising = LADDER[mm][::-1]
    nearest = np.clip(np.searchsorted((rising[1:] + rising[:-1]) / 2, inverse), 0, rising.size - 1)
    return mm[::-1][nearest].astype(np.uint16)


def seen(rng: np.random.Generator, exact: FloatArray, fixed: FloatArray, count: int) -> list[NDArray[np.uint16]]:
    """Return frames of a scene by a sensor with a fixed pattern, in levels, and noise in blobs."""
    return [levels(exact + LEVEL_SPACING_PER_M * (fixed + 0.55 * blobs(rng, 1.0))) for _ in range(count)]


@pytest.mark.parametrize("radius_px", [0.0, 4.0])
def test_the_pattern_is_told_from_noise(radius_px: float) -> None:
    rng = np.random.default_rng(4)
    fixed = 0.001 * blobs(rng, radius_px)
    v, u = np.indices(SHAPE)
    wall = 0.5 + 1e-4 * u - 2e-4 * v + 1e-8 * u * v
    first, second = (wall + fixed + 0.001 * blobs(rng, 1.0) for _ in range(2))
    found = fixed_pattern(first, second, EVERYWHERE)
    assert found is not None
    assert found.std_per_m[0] == pytest.approx(0.001, rel=0.1)
    assert (np.diff(found.std_per_m) <= 0).all()
    expected = np.nanstd(window_means(fixed, 12, 12)[0])
    assert found.at(np.array([625.0]))[0] == pytest.approx(expected, rel=0.2, abs=4e-5)


def test_without_a_pattern_there_is_next_to_none() -> None:
    rng = np.random.default_rng(6)
    found = fixed_pattern(0.5 + 0.001 * blobs(rng, 1.0), 0.5 + 0.001 * blobs(rng, 1.0), EVERYWHERE)
    assert found is not None
    assert found.std_per_m[0] < 5e-5


@pytest.mark.parametrize("strength", [0.0, 0.3])
def test_the_pattern_of_a_wall_is_found(strength: float) -> None:
    rng = np.random.default_rng(3)
    frames = seen(rng, WALL, strength * blobs(rng, 3.0), 12)
    found = measured_pattern(frames, LADDER, None, beyond_m=1.4)
    assert found is not None
    assert found.std_per_m[0] / LEVEL_SPACING_PER_M == pytest.approx(strength, abs=0.03)


def test_a_curtain_and_what_is_near_show_no_pattern() -> None:
    rng = np.random.default_rng(5)
    curtain = WALL + 1.2 * LEVEL_SPACING_PER_M * blobs(rng, 12.0)
    for frames in (seen(rng, curtain, np.zeros(SHAPE), 8), [np.full(SHAPE, 1000, np.uint16)] * 8):
        assert measured_pattern(frames, LADDER, None, beyond_m=1.4) is None


def test_what_is_taken_off_is_no_longer_there() -> None:
    rng = np.random.default_rng(7)
    fixed = 0.001 * blobs(rng, 3.0)
    found = fixed_pattern(0.5 + fixed, 0.5 + fixed, EVERYWHERE)
    assert found is not None
    assert less_known(found, fixed).std_per_m[0] < 1e-4
    np.testing.assert_allclose(less_known(found, 0 * fixed).std_per_m, found.std_per_m)
    assert less_known(found, 0.6 * fixed).std_per_m[0] == pytest.approx(0.8 * found.std_per_m[0], rel=0.02)


def test_planes_leave_nothing_whatever_their_border() -> None:
    plane = 0.7 + 3e-4 * U - 2e-4 * V
    plane[:, 200:] = np.nan
    plane[100:103, 50:60] = np.nan
    residual = residual_about_planes(plane, 10)
    np.testing.assert_allclose(residual[np.isfinite(residual)], 0, atol=1e-12)
    assert np.isfinite(residual[30:80, 30:180]).all()
    assert np.isnan(residual[:, 200:]).all()
    assert np.isnan(residual_about_planes(np.full(SHAPE, np.nan), 10)).all()


def test_an_empty_scene_shows_the_pattern_pixel_by_pixel() -> None:
    rng = np.random.default_rng(11)
    fixed = 0.3 * blobs(rng, 3.0)
    scene = WALL.copy()
    scene[150:, :100] = 1 / 1.2  # a table: an edge, and a smooth surface of its own
    found = pixel_pattern(seen(rng, scene, fixed, 60), LADDER, None)
    known = np.isfinite(found.per_m)
    assert known[60:140, 150:280].mean() > 0.99
    assert not known[140:160, 40:90].any()
    error = found.per_m[known] / LEVEL_SPACING_PER_M - fixed[known]
    assert np.std(error) < 0.12
    assert found.std_per_m[known].mean() / LEVEL_SPACING_PER_M == pytest.approx(0.62 / 60**0.5, rel=0.1)


def garment() -> BoolArray:
    return (np.abs(U - 160) < 110) & (V < 220)


def share_of(
    seen_by: FloatArray, known: FloatArray, seed: int = 13, pixels: BoolArray | None = None
) -> PatternShare | str:
    """Return how much of a pattern is seen on a sheet that a sensor with another sees."""
    rng = np.random.default_rng(seed)
    inside = garment() if pixels is None else pixels
    frames = [
        np.where(inside, near, far)
        for near, far in zip(seen(rng, SHEET, seen_by, 6), seen(rng, WALL, seen_by, 6), strict=True)
    ]
    return pattern_share(frames, LADDER, None, LEVEL_SPACING_PER_M * known, LIMITS_MM)


@pytest.mark.parametrize("part", [1.0, 0.5])
def test_the_share_is_that_of_the_pattern_that_the_garment_shows(part: float) -> None:
    """A part of the pattern is the same at the garment, the rest is another there."""
    rng = np.random.default_rng(17)
    own, other = (0.3 * blobs(rng, 3.0) for _ in range(2))
    found = share_of(part * own + np.sqrt(1 - part**2) * other, own)
    assert isinstance(found, PatternShare)
    assert found.value == pytest.approx(part, abs=4 * found.std)
    assert found.std < 0.1
    assert 0 < found.used <= min(found.value, 1)


def test_a_noisy_pattern_is_taken_off_only_in_part() -> None:
    rng = np.random.default_rng(19)
    own = 0.3 * blobs(rng, 3.0)
    found = share_of(own, own + 0.3 * blobs(rng, 3.0))
    assert isinstance(found, PatternShare)
    assert found.value == pytest.approx(0.5, abs=0.1)


def test_the_pattern_of_another_camera_is_not_used() -> None:
    """By chance it seems to be of use once in forty times, and then next to nothing is taken off."""
    rng = np.random.default_rng(23)
    used = [share_of(0.3 * blobs(rng, 3.0), 0.3 * blobs(rng, 3.0), seed) for seed in range(4)]
    assert all(share == "not_predictive" or (isinstance(share, PatternShare) and share.used < 0.1) for share in used)


def test_what_cannot_be_compared_has_a_reason() -> None:
    own = 0.3 * blobs(np.random.default_rng(29), 3.0)
    assert share_of(own, np.full(SHAPE, np.nan)) == "no_pattern"
    assert share_of(own, own, pixels=garment() & (V < 20)) == "few_pixels"


def test_columns_are_not_taken_off_twice() -> None:
    """What is known of pixels is beside the columns' own errors, which the wall behind the garment shows."""
    rng = np.random.default_rng(31)
    bands = 0.4 * np.repeat(rng.standard_normal(8), 40)[None, :] * np.ones(SHAPE)
    frames = seen(rng, WALL, bands, 40)
    columns = column_offsets(frames, LADDER, beyond_m=1.4)
    assert columns is not None
    found = pixel_pattern(frames, LADDER, columns)
    assert np.nanstd(found.per_m) < 0.15 * LEVEL_SPACING_PER_M
