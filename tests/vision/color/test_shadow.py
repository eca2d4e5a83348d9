"""Shadows on the wall: painted soft and hard, beside and behind sheets of several colours, in an Xtion's noise."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest

from garment_dataset.vision.color.background import BackgroundAccumulator
from garment_dataset.vision.color.masks import disc_mask
from garment_dataset.vision.color.silhouette import BackgroundSubtractor, Silhouette

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray
    from garment_dataset.vision.color.background import Background

    Picture = NDArray[np.float64]

HEIGHT, WIDTH = 240, 320
GRIPPER = (150.0, 40.0)
COLORS = {"green": (60, 120, 70), "white": (232, 228, 220), "black": (38, 38, 44), "grey": (112, 112, 115)}
WIDE, EDGE_ON = 70, 8


def wall() -> Picture:
    """A white-grey wall that is darker on the right."""
    light = 1 - 0.15 * np.linspace(0, 1, WIDTH)[None, :, None] ** 2
    return np.asarray(np.array([182.0, 180.0, 172.0]) * light * np.ones((HEIGHT, 1, 1)), np.float64)


def noisy(picture: Picture, seed: int) -> NDArray[np.uint8]:
    """The noise of neighbouring pixels hangs together by 0.6, of 3 levels."""
    white = np.random.default_rng(seed).normal(0, 1, picture.shape)
    noise = cv2.GaussianBlur(white, (5, 5), 0.76)
    soft = cv2.GaussianBlur(picture, (5, 5), 0.6)
    return np.asarray(np.clip(np.rint(soft + 3 * noise / noise.std()), 0, 255), np.uint8)


@lru_cache
def background() -> Background:
    accumulator = BackgroundAccumulator()
    for frame in range(40):
        accumulator.add(noisy(wall(), 1000 + frame))
    return accumulator.finish()


def sheet(width_px: float) -> BoolArray:
    """A slightly slanted sheet that hangs from the gripper."""
    v, u = np.indices((HEIGHT, WIDTH))
    middle = GRIPPER[0] + 0.1 * (v - GRIPPER[1])
    return np.asarray((v >= GRIPPER[1]) & (v < 200) & (np.abs(u - middle) < width_px / 2))


def shadow(softness_px: float, depth: float, *, shift_px: int = -24, tint: float = 0.0) -> Picture:
    """The share of light that a sheet of 60 px leaves to the wall, of which a lamp sees more than the camera."""
    caster = np.roll(sheet(60).astype(np.float64), (14, shift_px), axis=(0, 1))
    dark = depth * cv2.GaussianBlur(caster, (0, 0), softness_px)
    return np.asarray(1 - dark[..., None] * np.array([1 + tint, 1.0, 1 - tint]), np.float64)


def find(picture: Picture, *, shadows: bool = True, seed: int = 0) -> Silhouette:
    subtractor = BackgroundSubtractor(background(), alpha=2.0, open_px=3, close_px=9, shadows=shadows)
    image = noisy(picture, seed)
    near = disc_mask(GRIPPER, 20, HEIGHT, WIDTH)
    return subtractor.find(image, drift=subtractor.drift(image), top_v_px=GRIPPER[1], near=near)


def painted(color: str, width_px: float, light: Picture | float = 1.0) -> Picture:
    texture = 1 + 0.04 * np.sin(np.indices((HEIGHT, WIDTH))[0] / 9)[..., None]
    return np.asarray(np.where(sheet(width_px)[..., None], np.array(COLORS[color]) * texture, wall() * light))


def iou(found: BoolArray, width_px: int) -> float:
    true = sheet(width_px)
    return float((found & true).sum() / (found | true).sum())


@pytest.mark.parametrize("color", COLORS)
@pytest.mark.parametrize("width_px", [WIDE, EDGE_ON])
def test_without_shadows_it_is_as_good_as_without_looking_for_them(color: str, width_px: int) -> None:
    picture = painted(color, width_px)
    found = iou(find(picture).mask, width_px)
    assert found > iou(find(picture, shadows=False).mask, width_px) - 0.005
    assert found > 0.99


@pytest.mark.parametrize("color", COLORS)
@pytest.mark.parametrize(("softness_px", "depth", "tint"), [(8, 0.08, 0.0), (12, 0.2, 0.0), (6, 0.1, 0.15)])
def test_a_soft_shadow_is_wall(color: str, softness_px: float, depth: float, tint: float) -> None:
    light = shadow(softness_px, depth, tint=tint)
    assert iou(find(painted(color, WIDE, light)).mask, WIDE) > 0.97
    assert iou(find(painted(color, EDGE_ON, light)).mask, EDGE_ON) > (0.8 if color == "grey" else 0.97)


def test_the_shadow_of_a_sheet_seen_edge_on_was_taken_for_it() -> None:
    picture = painted("green", EDGE_ON, shadow(8, 0.1))
    assert iou(find(picture, shadows=False).mask, EDGE_ON) < 0.3


@pytest.mark.parametrize("color", ["green", "black"])
@pytest.mark.parametrize("depth", [0.09, 0.2])
def test_a_hard_shadow_is_wall_where_cloth_of_another_colour_hangs(color: str, depth: float) -> None:
    assert iou(find(painted(color, WIDE, shadow(1.2, depth, shift_px=-60))).mask, WIDE) > 0.99


@pytest.mark.parametrize("depth", [0.05, 0.15, 0.25])
@pytest.mark.parametrize("softness_px", [0.3, 3, 10])
def test_less_light_at_the_same_hue_is_no_garment_beside_one(depth: float, softness_px: float) -> None:
    """Sharp or soft, up to what a lamp takes: next to a green sheet, all that a shadow explains is wall."""
    light = shadow(softness_px, depth, shift_px=-45)
    found = find(painted("green", WIDE, light)).mask
    dark = light.min(axis=2) < 1 - 0.9 * depth
    beyond = cv2.dilate(sheet(WIDE).view(np.uint8), np.ones((5, 5), np.uint8)) == 0
    assert not (found & dark & beyond).any()


def test_a_uniform_loss_of_light_is_exposure() -> None:
    found = find(painted("green", WIDE) * 0.75)
    assert iou(found.mask, WIDE) > 0.99


def test_fields_of_the_wall_s_hue_that_the_garment_surrounds_are_garment() -> None:
    picture = painted("green", WIDE)
    for v in (80, 120, 160):
        picture[v : v + 14, 145:165] = wall()[v : v + 14, 145:165] * 0.75
    assert iou(find(picture).mask, WIDE) > 0.99


def test_parts_of_a_pattern_belong_together_though_the_wall_shows_between() -> None:
    """White stripes that are just as the wall: what hangs below them is garment, and so are they."""
    picture = painted("green", EDGE_ON)
    for v in (80, 120, 160):
        picture[v : v + 14] = wall()[v : v + 14]
    assert iou(find(picture).mask, EDGE_ON) > 0.8


def test_grey_cloth_before_a_wall_is_no_shadow() -> None:
    """As flat and of the same hue as a hard shadow, but nothing else hangs from the gripper."""
    flat = np.where(sheet(WIDE)[..., None], wall() * 0.75, wall())
    found = find(flat)
    assert iou(found.mask, WIDE) > 0.97
    assert (found.confidence or 0) < 0.6
    assert found.doubt == "like_wall"


def test_coloured_and_black_cloth_is_sure() -> None:
    for color in ("green", "black"):
        found = find(painted(color, WIDE))
        assert (found.confidence or 0) > 0.95
        assert found.doubt is None
    assert find(painted("green", WIDE), shadows=False).confidence is None


def test_confidence_falls_as_more_of_the_cloth_could_be_the_wall_in_a_shallow_shadow() -> None:
    found = []
    for rows in (0, 40, 80, 120):
        picture = painted("green", WIDE)
        picture[60 : 60 + rows][sheet(WIDE)[60 : 60 + rows]] = np.array([155.0, 153.0, 146.0])
        found.append(find(picture))
    values = [each.confidence or 0 for each in found]
    assert values == sorted(values, reverse=True)
    assert values[-1] < 0.95 < values[0]
    assert found[-1].doubt == "like_wall"


@pytest.mark.parametrize("softness_px", [6, 12])
def test_a_soft_shadow_alone_is_no_garment(softness_px: float) -> None:
    assert not find(wall() * shadow(softness_px, 0.15, shift_px=0)).mask.any()


@pytest.mark.parametrize("color", ["green", "black"])
@pytest.mark.parametrize("width_px", [2.0, 3.0, 5.0])
def test_a_sheet_as_thin_as_its_thickness_is_one_line(color: str, width_px: float) -> None:
    """Its pixels are mixtures with the wall, which a shadow could explain one by one."""
    light = shadow(8, 0.1)
    found = find(painted(color, width_px, light)).mask
    rows = np.flatnonzero(found.any(axis=1))
    assert rows[0] <= GRIPPER[1] + 1
    assert rows[-1] >= 196
    assert len(rows) == np.ptp(rows) + 1
    middle = GRIPPER[0] + 0.1 * (rows - GRIPPER[1])
    assert np.abs([np.flatnonzero(found[row]).mean() for row in rows] - middle).max() < 3


def test_edges_of_grey_cloth_are_found_though_they_are_as_a_shadow() -> None:
    """Its inside has less light than any shadow leaves, its blurred edge has as much as one."""
    for share in (0.35, 0.45, 0.55):
        picture = cv2.GaussianBlur(np.where(sheet(WIDE)[..., None], wall() * share, wall()), (0, 0), 1.5)
        assert iou(find(np.asarray(picture, np.float64)).mask, WIDE) > 0.98


def test_what_does_not_come_near_the_gripper_is_no_garment() -> None:
    picture = wall()
    picture[120:200, 220:300] = COLORS["green"]
    found = find(picture)
    assert found.is_elsewhere
    assert not found.mask.any()
    picture[int(GRIPPER[1]) : 90, 146:158] = COLORS["green"]
    small = find(picture)
    assert not small.is_elsewhere
    assert small.mask[60, 150]
    assert not small.mask[150, 250]


def test_equal_frames_have_equal_masks() -> None:
    picture = painted("white", WIDE, shadow(8, 0.1))
    np.testing.assert_array_equal(find(picture).mask, find(picture).mask)
