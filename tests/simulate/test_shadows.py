"""Shadows on the simulated wall: where geometry puts them, as dark and as soft as the lamp makes them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from garment_dataset.catalog import Catalog
from garment_dataset.simulate import scene
from garment_dataset.simulate.camera_pose import LEVEL, CameraPose
from garment_dataset.simulate.garments import fabric_of, unusual_fabric
from garment_dataset.simulate.hanging import Hanging
from garment_dataset.simulate.motion import Swing
from garment_dataset.simulate.nuisance_cloth import CLOTH_DRAWS, ClothNuisance, Pattern
from garment_dataset.simulate.nuisance_color import AutoExposure, ColorNuisance, Lamp, Wall
from garment_dataset.simulate.render import Stage
from garment_dataset.simulate.sensor_color import ColorSensor
from garment_dataset.simulate.shadows import light_on_wall, uneven

SMALL = Lamp((0.025, -0.5, 0.0), 0.005, 0.2, (1.1, 1.0, 0.9))


def square_m(side_m: float = 0.2) -> tuple[np.ndarray, np.ndarray]:
    """A square one metre before the camera, as high as it."""
    half = side_m / 2
    corners = [[-half, -half, 1.0], [half, -half, 1.0], [half, half, 1.0], [-half, half, 1.0]]
    return np.array(corners), np.array([[0, 1, 2], [0, 2, 3]])


def test_without_anything_before_it_the_wall_is_lit() -> None:
    np.testing.assert_array_equal(light_on_wall([SMALL], []), 1)


def test_a_shadow_lies_where_the_lamp_throws_it() -> None:
    """From y = -0.5 m at z = 0 through y = 0 at z = 1 m, it meets the wall at z = 1.8 m at y = 0.4 m."""
    light = light_on_wall([SMALL], [square_m()])
    dark_v, dark_u = np.nonzero(light[..., 1] < 0.9)
    middle_v = 239.5 + 525 * 0.4 / scene.WALL_M
    left_u = 319.5 + 525 * ((0.025 + 1.8 * -0.125) - 0.025) / scene.WALL_M
    assert dark_v.mean() == pytest.approx(middle_v, abs=1)
    assert dark_u.min() == pytest.approx(left_u, abs=1.5)
    middle_u = round(dark_u.mean())
    np.testing.assert_allclose(light[round(middle_v), middle_u], 1 - 0.2 * np.array(SMALL.tint), atol=1e-5)


def test_a_large_lamp_makes_a_soft_edge() -> None:
    large = Lamp(SMALL.place_m, 0.3, SMALL.share, SMALL.tint)
    steps = [np.abs(np.diff(light_on_wall([lamp], [square_m()])[..., 1], axis=1)).max() for lamp in (SMALL, large)]
    assert steps[1] < 0.3 * steps[0]


def test_arm_and_gripper_cast_shadows_on_the_wall_alone() -> None:
    swing = Swing("B", np.pi / 16, 0.5)
    usual, lit = Stage(swing), Stage(swing, nuisance=ColorNuisance(lamps=(SMALL,)))
    before, after = usual.color(0.0, None), lit.color(0.0, None)
    darker = np.asarray((after.pixels < before.pixels - 1).any(axis=2))
    assert darker.any()
    within = cv2.erode(before.gripper.astype(np.uint8), np.ones((3, 3)))  # at its edges the wall mixes in
    assert not darker[within > 0].any()


def test_an_uneven_wall_is_as_bright_as_an_even_one_on_average() -> None:
    share = uneven(Wall(0.1, 0.2, 0.02, 2.0, 3))
    assert share.mean() == pytest.approx(1, abs=0.03)
    assert 0.01 < share.std() < 0.12
    np.testing.assert_array_equal(share, uneven(Wall(0.1, 0.2, 0.02, 2.0, 3)))


def test_exposure_follows_the_picture() -> None:
    """A grey picture comes to middle grey when the camera goes all the way."""
    nuisance = ColorNuisance(auto_exposure=AutoExposure(1.0, 0.0, 0.5), flicker=0.0)
    sensor = ColorSensor(np.random.default_rng(0), nuisance)
    dark = np.full((480, 640, 3), 80, np.float32)
    assert sensor.frame(dark).mean() == pytest.approx(128, abs=1)
    bright = [float(sensor.frame(dark * 1.5).mean()) for _ in range(12)]
    assert bright[0] > 150
    assert bright[-1] == pytest.approx(128, abs=1)


def test_a_garment_takes_the_hue_of_the_wall_and_keeps_its_brightness() -> None:
    fabric = fabric_of("GreenTowel", Catalog.load())
    grey = unusual_fabric(fabric, ClothNuisance(wall_hue=1.0))
    np.testing.assert_allclose(np.array(grey.color) / scene.WALL_COLOR, grey.color[0] / scene.WALL_COLOR[0], atol=0.01)
    assert sum(grey.color) == pytest.approx(sum(fabric.color), abs=2)
    checked = unusual_fabric(fabric, ClothNuisance(pattern=Pattern((1, 2, 3), 0.02, True)))
    seen = checked.at(np.array([[0.01, 0.01], [0.03, 0.01], [0.01, 0.03], [0.03, 0.03]])).round()
    assert (seen[1] == seen[2]).all()
    assert abs(seen[0] - seen[3]).max() < abs(seen[0] - seen[1]).max()


def test_a_yaw_turns_the_garment_about_the_vertical() -> None:
    hanging = Hanging(np.eye(3), np.zeros(3), 0.0, 1.0, 0.0)
    across = np.array([0.1, 0.2, 0.0]) @ hanging.yawed(np.pi / 2).turn.T
    np.testing.assert_allclose(np.abs(across), [0, 0.2, 0.1], atol=1e-12)


def test_yaws_are_open_at_an_angle_or_edge_on() -> None:
    rng = np.random.default_rng(1)
    drawn = np.abs(np.degrees(np.array([CLOTH_DRAWS["yaw_rad"](rng) for _ in range(300)], np.float64)))
    for low, high in ((0, 30), (30, 75), (75, 105)):
        assert 0.2 < np.mean((drawn >= low) & (drawn < high)) < 0.5


def test_a_tilted_camera_sees_the_same_shadow_elsewhere() -> None:
    """The middle of a shadow lies where the pose says that point of the wall is."""
    middle_m = np.array([[0.025 - 1.8 * 0.025, 0.4, scene.WALL_M]])
    for pose in (LEVEL, CameraPose((0.05, 0.08))):
        dark = light_on_wall([SMALL], [square_m()], pose)[..., 1] < 0.9
        v_px, u_px = np.argwhere(dark).mean(axis=0)
        expected_px = scene.COLOR_CAMERA.project(pose.see(middle_m))[0, :2] - 0.5
        np.testing.assert_allclose([u_px, v_px], expected_px, atol=2)
    np.testing.assert_allclose(pose.level(pose.see(middle_m)), middle_m)
