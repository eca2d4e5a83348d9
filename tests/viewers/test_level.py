"""In the level frame gravity points down, and the camera looks along x."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.bags.poses import Transform
from garment_dataset.viewers.level import level_quaternion_xyzw

if TYPE_CHECKING:
    from garment_dataset.arrays import FloatArray

UNIT = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)


def turned(gravity: FloatArray, vector: list[float]) -> FloatArray:
    return Transform(np.zeros(3), level_quaternion_xyzw(gravity), 0, 0).apply(vector)


@given(UNIT)
def test_gravity_points_down_whatever_the_camera_looks_at(direction: tuple[float, float, float]) -> None:
    gravity = np.array(direction) / np.linalg.norm(direction)
    quaternion = level_quaternion_xyzw(gravity)
    assert np.linalg.norm(quaternion) == pytest.approx(1)
    np.testing.assert_allclose(turned(gravity, gravity.tolist()), [0, 0, -1], atol=1e-9)


def test_a_level_camera_looks_along_x_and_has_the_left_of_its_image_on_y() -> None:
    gravity = np.array([0.0, 1.0, 0.0])
    np.testing.assert_allclose(turned(gravity, [0, 0, 1]), [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(turned(gravity, [-1, 0, 0]), [0, 1, 0], atol=1e-12)


def test_a_tilted_camera_stays_tilted() -> None:
    gravity = np.array([0.0, np.cos(0.3), np.sin(0.3)])  # it looks down by 0.3 rad
    np.testing.assert_allclose(turned(gravity, [0, 0, 1]), [np.cos(0.3), 0, -np.sin(0.3)], atol=1e-12)


def test_a_camera_that_looks_straight_down_has_the_top_of_its_image_on_x() -> None:
    gravity = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(turned(gravity, [0, -1, 0]), [1, 0, 0], atol=1e-12)
