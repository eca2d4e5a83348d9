"""How long a garment hangs, and of which colour it is: painted images, known answers."""

from __future__ import annotations

import numpy as np
import pytest

from garment_dataset.bags import Camera
from garment_dataset.checks.appearance import Color, color_of, contradicts, hanging_region

CAMERA = Camera("optical", 640, 480, 570.0, 570.0, 319.5, 239.5, "", ())
GRIPPER_M = np.array([0.0, -0.35, 1.0])


def sheet(length_m: float, half_width_m: float = 0.15, z_m: float = 1.0) -> np.ndarray:
    """Paint a sheet that hangs from the gripper, before a wall 2.5 m away."""
    depth_mm = np.full((480, 640), 2500, np.uint16)
    v_px, u_px = np.indices(depth_mm.shape)
    x_m, y_m = (u_px - 319.5) / 570 * z_m, (v_px - 239.5) / 570 * z_m
    covered = (np.abs(x_m) < half_width_m) & (y_m >= -0.35) & (y_m <= -0.35 + length_m)
    depth_mm[covered] = round(z_m * 1000)
    return depth_mm


@pytest.mark.parametrize("length_m", [0.2, 0.45, 0.7])
def test_the_length_is_that_of_the_sheet(length_m: float) -> None:
    region = hanging_region(sheet(length_m), CAMERA, GRIPPER_M)
    assert region is not None
    assert region.length_m == pytest.approx(length_m, abs=0.003)
    assert not region.is_cut


def test_a_sheet_that_hangs_out_of_the_image_is_cut() -> None:
    region = hanging_region(sheet(1.2), CAMERA, GRIPPER_M)
    assert region is not None
    assert region.is_cut


def test_what_does_not_hang_from_the_gripper_is_not_the_garment() -> None:
    depth_mm = sheet(0.4)
    depth_mm[400:470, 500:600] = 1000  # something else at the same distance
    region = hanging_region(depth_mm, CAMERA, GRIPPER_M)
    assert region is not None
    assert region.length_m == pytest.approx(0.4, abs=0.003)
    assert hanging_region(np.full((480, 640), 2500, np.uint16), CAMERA, GRIPPER_M) is None
    assert hanging_region(np.zeros((480, 640), np.uint16), CAMERA, GRIPPER_M) is None
    assert hanging_region(sheet(0.4), CAMERA, GRIPPER_M + np.array([0.5, 0, 0])) is None


def test_holes_do_not_cut_a_garment_in_two() -> None:
    depth_mm = sheet(0.6)
    depth_mm[250:253] = 0
    region = hanging_region(depth_mm, CAMERA, GRIPPER_M)
    assert region is not None
    assert region.length_m == pytest.approx(0.6, abs=0.003)


def painted(*rgb: tuple[int, int, int]) -> Color:
    image = np.zeros((480, 640, 3), np.uint8)
    for row in range(0, 480, 40):
        image[row : row + 40] = rgb[row // 40 % len(rgb)]
    region = hanging_region(sheet(0.6), CAMERA, GRIPPER_M)
    assert region is not None
    color = color_of(image, CAMERA, region.points_m)
    assert color is not None
    return color


PAINTS = {
    "red": [(176, 40, 44)],
    "green": [(64, 142, 78)],
    "blue": [(52, 84, 158)],
    "black": [(30, 30, 34)],
    "gray": [(122, 122, 126)],
    "white": [(232, 228, 214)],
    "black&white": [(226, 224, 220), (38, 38, 42)],
}
ALIKE = {("gray", "black"), ("black", "gray"), ("gray", "white"), ("white", "gray")}
"""Which is which is a question of light."""


@pytest.mark.parametrize("word", PAINTS)
@pytest.mark.parametrize("shown", PAINTS)
@pytest.mark.parametrize("light", [1.0, 0.6])
def test_a_colour_contradicts_those_that_it_cannot_be(word: str, shown: str, light: float) -> None:
    color = painted(*[(round(light * r), round(light * g), round(light * b)) for r, g, b in PAINTS[shown]])
    found = contradicts(color, word)
    achromatic = {"black", "white", "gray", "black&white"}
    if word == shown or (light == 1 and (word, shown) in ALIKE):
        assert found is False
    elif not {word, shown} <= achromatic:
        assert found is True


def test_black_is_not_white() -> None:
    assert contradicts(painted((20, 20, 20)), "white")
    assert contradicts(painted((240, 240, 240)), "black")
    assert not contradicts(painted((240, 240, 240)), "black&white")


def test_words_that_are_no_colours_contradict_nothing() -> None:
    assert contradicts(painted((20, 20, 20)), "tartan") is None
    assert contradicts(painted((20, 20, 20)), "") is None


def test_points_beside_the_image_have_no_colour() -> None:
    points_m = np.tile([5.0, 0.0, 1.0], (1000, 1))
    assert color_of(np.zeros((480, 640, 3), np.uint8), CAMERA, points_m) is None
