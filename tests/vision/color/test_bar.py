"""The ruler that a garment hangs on is cut off; the cloth clamped to it, and coloured tops without one, stay."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from garment_dataset.vision.color.bar import Held, bar_above

HEIGHT, WIDTH = 300, 300
WALL, WOOD, CLOTH = (182.0, 180.0, 172.0), (196.0, 160.0, 104.0), (60.0, 120.0, 70.0)
HELD = Held(150.0, 60.0, 500.0)


def turned(degrees: float) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates along a bar through the gripper, and across it, downwards."""
    v, u = np.indices((HEIGHT, WIDTH))
    angle = np.radians(degrees)
    along = (u - HELD.u_px) * np.cos(angle) + (v - HELD.v_px) * np.sin(angle)
    return along, (v - HELD.v_px) * np.cos(angle) - (u - HELD.u_px) * np.sin(angle)


def scene(
    degrees: float, *, wood: tuple[float, ...] = WOOD, half_px: float = 70.0, checked: bool = False, low_px: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Frame, the wall alone, what is seen of bar and cloth below the gripper's row, and the cloth of it."""
    along, across = turned(degrees)
    cloth = (np.abs(along) < half_px - 8) & (across >= low_px) & (across < 180)
    bar = (np.abs(along) < half_px) & (across < low_px) & (across >= low_px - 15)
    expected = np.full((HEIGHT, WIDTH, 3), WALL)
    picture = expected.copy()
    picture[bar], picture[cloth] = wood, CLOTH
    if checked:
        odd = ((along // 25 + across // 25) % 2 == 1) & cloth
        picture[odd] = (220.0, 210.0, 60.0)
    picture[:60, 140:160] = (60.0, 60.0, 66.0)
    white = np.random.default_rng(2).normal(0, 3.0, picture.shape)
    frame = np.clip(np.rint(cv2.GaussianBlur(picture, (5, 5), 0.8) + white), 0, 255).astype(np.uint8)
    below = np.indices((HEIGHT, WIDTH))[0] >= HELD.v_px
    return frame, expected, ((bar | cloth) & below).astype(np.uint8), cloth & below


@pytest.mark.parametrize("degrees", [-20.0, -8.0, 8.0, 20.0, 40.0])
@pytest.mark.parametrize("checked", [False, True])
def test_the_bar_is_removed_and_the_cloth_kept(degrees: float, checked: bool) -> None:
    frame, expected, mask, cloth = scene(degrees, checked=checked)
    bar = bar_above(frame, expected, mask, HELD)
    assert bar is not None
    kept = (mask > 0) & ~bar
    hung = (mask > 0) & ~cloth
    assert (kept & hung).sum() < 0.1 * hung.sum()
    assert (bar & cloth).sum() < 0.01 * cloth.sum()


@pytest.mark.parametrize("low_px", [-6.0, 4.0, 8.0])
@pytest.mark.parametrize("degrees", [-15.0, 3.0])
def test_a_bar_may_be_held_anywhere_across_it(low_px: float, degrees: float) -> None:
    frame, expected, mask, cloth = scene(degrees, low_px=low_px)
    bar = bar_above(frame, expected, mask, HELD)
    hung = (mask > 0) & ~cloth
    if hung.sum() > 100:
        assert bar is not None
        assert (hung & ~bar).sum() < 0.1 * hung.sum()
    if bar is not None:
        assert (bar & cloth).sum() < 0.01 * cloth.sum()


def test_a_bar_seen_along_it_is_removed() -> None:
    frame, expected, mask, cloth = scene(70.0, half_px=38.0)
    cloth = (mask > 0) & cloth
    bar = bar_above(frame, expected, mask, HELD)
    assert bar is not None
    assert (bar & cloth).sum() < 0.02 * cloth.sum()


def test_a_level_bar_hangs_nowhere_below_the_gripper() -> None:
    frame, expected, mask, _ = scene(0.0)
    assert bar_above(frame, expected, mask, HELD) is None


def test_a_bar_of_the_cloth_s_colour_cannot_be_told_from_it() -> None:
    frame, expected, mask, _ = scene(15.0, wood=CLOTH)
    assert bar_above(frame, expected, mask, HELD) is None


def test_the_collar_of_a_shirt_is_no_bar() -> None:
    """Of another colour, and straight, but it ends at the gripper."""
    frame, expected, mask, _ = scene(15.0)
    along, across = turned(15.0)
    collar = (along > 0) & (across < 12) & (mask > 0)
    frame[(along < -5) & (across < 0)] = np.array(WALL, np.uint8)
    frame[collar] = np.array(WOOD, np.uint8)
    assert bar_above(frame, expected, mask, HELD) is None


def test_cloth_that_all_lies_near_the_gripper_is_left_alone() -> None:
    frame, expected, mask, _ = scene(15.0)
    mask[90:] = 0
    assert bar_above(frame, expected, mask, HELD) is None
