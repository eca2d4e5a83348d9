"""Other sensors' faults: known answers on simple scenes."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from garment_dataset.simulate.nuisance_depth import USUAL_DEPTH, Pattern
from garment_dataset.simulate.raster import HEIGHT_PX, WIDTH_PX
from garment_dataset.simulate.scene import DEPTH_CAMERA
from garment_dataset.simulate.sensor import DepthSensor, depth_of_shift, openni_table, pattern_of, shift_of_depth
from garment_dataset.simulate.sensor_faults import fatten, grain, grazing, mix

SHAPE = (HEIGHT_PX, WIDTH_PX)
QUIET = replace(USUAL_DEPTH, depth_noise=0.0, depth_pattern=Pattern("none", 1.0, 0.0, 0))


def step() -> np.ndarray:
    """Return a near square before a wall."""
    depth_m = np.full(SHAPE, 2.0)
    depth_m[200:280, 300:380] = 1.0
    return depth_m


def plane(angle_rad: float) -> np.ndarray:
    """Return a plane through (0, 0, 1) whose normal is turned about the vertical."""
    u = np.arange(WIDTH_PX) - DEPTH_CAMERA.cx_px
    return np.broadcast_to(1 / np.maximum(1 - np.tan(angle_rad) * u / DEPTH_CAMERA.focal_px, 0.2), SHAPE)


def test_a_shift_is_a_depth_and_back() -> None:
    depth_m = np.linspace(0.5, 5.0, 50)
    np.testing.assert_allclose(depth_of_shift(shift_of_depth(depth_m)), depth_m)


@pytest.mark.parametrize("radius_px", [0.4, 1.0, 3.0])
def test_grain_has_unit_variance_whatever_its_radius(radius_px: float) -> None:
    assert grain(np.random.default_rng(1), SHAPE, radius_px).std() == pytest.approx(1.0, abs=0.05)


def test_what_is_near_grows_by_the_radius_on_all_sides() -> None:
    grown = fatten(step(), 2.0, np.zeros(SHAPE, np.float32))
    assert (grown[240] < 1.5).sum() == 84
    assert (grown[:, 340] < 1.5).sum() == 84
    assert set(np.unique(grown)) == {1.0, 2.0}


def test_only_edges_fly() -> None:
    mixed = mix(step(), 1.0, np.random.default_rng(0))
    changed = (mixed != step()).astype(np.uint8)
    edge = cv2.morphologyEx(step(), cv2.MORPH_GRADIENT, cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))) > 0
    assert changed.any()
    assert not changed[~edge].any()
    assert ((mixed >= 1.0) & (mixed <= 2.0)).all()


@pytest.mark.parametrize(("angle_deg", "gone"), [(60, False), (70, True)])
def test_flat_angles_return_nothing(angle_deg: float, gone: bool) -> None:
    missing = grazing(plane(np.deg2rad(angle_deg)), np.deg2rad(65), np.zeros(SHAPE, np.float32))
    assert missing[240, 318:322].all() == gone


def test_another_step_leaves_the_ladder() -> None:
    usual, fine = (DepthSensor(np.random.default_rng(0), own).frame(plane(0.5)) for own in (
        QUIET, replace(QUIET, depth_step=0.25)
    ))  # fmt: skip
    assert set(np.unique(usual)) <= {0, *openni_table().tolist()}
    assert np.unique(fine).size > 2 * np.unique(usual).size


@pytest.mark.parametrize("exponent", [0.5, 2.5])
def test_noise_grows_with_the_power_of_the_distance(exponent: float) -> None:
    sensor = DepthSensor(
        np.random.default_rng(0), replace(QUIET, depth_noise=2.0, depth_step=0.1, depth_exponent=exponent)
    )
    spread = []
    for depth_m in (1.0, 2.0):
        frames = np.stack([sensor.frame(np.full(SHAPE, depth_m)) for _ in range(3)]).astype(float)
        spread.append(frames[frames > 0].std())
    assert spread[1] / spread[0] == pytest.approx(2**exponent, rel=0.15)


def test_bias_and_drift_grow_with_the_square() -> None:
    sensor = DepthSensor(np.random.default_rng(0), replace(QUIET, depth_bias_m=0.02, depth_drift_m_s=0.01))
    for depth_m in (1.07, 2.14):
        wanted_m = depth_m + (0.02 + 0.01 * 2.0) * (depth_m / 1.07) ** 2
        found = sensor.frame(np.full(SHAPE, depth_m), 2.0)[240, 300] / 1000
        assert found == pytest.approx(wanted_m, rel=0.01)


def test_patterns_have_the_levels_they_say() -> None:
    assert not pattern_of(Pattern("none", 1.0, 0.3, 1)).any()
    bands = pattern_of(Pattern("bands", 50.0, 0.3, 1))
    assert np.ptp(bands, axis=0).max() == 0
    assert bands.std() == pytest.approx(0.3, abs=0.01)
    assert pattern_of(Pattern("blobs", 4.0, 0.3, 1)).std() == pytest.approx(0.3, abs=0.03)


@pytest.mark.parametrize("stays", [0.0, 0.5, 1.0])
def test_the_texture_of_the_dots_moves_with_the_disparity(stays: float) -> None:
    """What stays is alike at two distances, and the rest is alike after a way by the disparity."""
    nuisance = replace(QUIET, depth_step=0.1, depth_pattern=Pattern("blobs", 4.0, 0.5, 3), depth_pattern_stays=stays)
    seen = []
    for depth_m in (1.8, 1.07):
        image = DepthSensor(np.random.default_rng(0), nuisance).frame(np.full(SHAPE, depth_m))[:, 100:500]
        seen_m = np.where(image > 0, image / 1000, depth_m)
        seen.append(shift_of_depth(seen_m) - shift_of_depth(np.array(depth_m)))
    moved_px = round(42.78 / 1.07) - round(42.78 / 1.8)
    assert np.corrcoef(seen[0].ravel(), seen[1].ravel())[0, 1] == pytest.approx(stays, abs=0.12)
    far, near = seen[0][:, : 400 - moved_px], seen[1][:, moved_px:]
    assert np.corrcoef(far.ravel(), near.ravel())[0, 1] == pytest.approx(1 - stays, abs=0.12)
