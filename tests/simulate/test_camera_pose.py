"""A tilted camera: transforms, topics and truth agree on what it sees."""

from __future__ import annotations

import numpy as np
import pytest

from garment_dataset.simulate.camera_pose import LEVEL, CameraPose
from garment_dataset.simulate.motion import REST_GRIPPER_M, Swing
from garment_dataset.simulate.robot import Robot

TILTED = CameraPose((0.05, -0.03))
SWING = Swing("R", np.pi / 16, 0.5, 0.5)


def chain(robot: Robot, frame: str, time_s: float) -> np.ndarray:
    """Return the pose of a frame in the base, by the transforms."""
    above = {link.child: link for link in (*robot.links(time_s), *robot.fixed)}
    matrices = []
    while frame != "base_link":
        matrices.append(above[frame].matrix)
        frame = above[frame].parent
    whole: np.ndarray = np.linalg.multi_dot([*reversed(matrices)])
    return whole


def by_transforms(robot: Robot, time_s: float) -> np.ndarray:
    """Return the gripper in the depth camera's frame."""
    camera = chain(robot, "xtion1_depth_optical_frame", time_s)
    seen: np.ndarray = np.linalg.inv(camera) @ chain(robot, "r2_ee", time_s)
    return seen[:3, 3]


@pytest.mark.parametrize("time_s", [0.0, 1.0])
def test_transforms_follow_the_tilt(time_s: float) -> None:
    np.testing.assert_allclose(
        by_transforms(Robot(SWING, TILTED), time_s), TILTED.see(SWING.gripper_m(time_s)), atol=1e-12
    )


def test_an_error_of_the_transforms_is_one_in_the_cameras_frame() -> None:
    error_m = (0.003, -0.001, 0.002)
    apart_m = by_transforms(Robot(SWING, TILTED, error_m), 1.0) - TILTED.see(SWING.gripper_m(1.0))
    np.testing.assert_allclose(apart_m, error_m, atol=1e-12)


def test_the_gripper_rests_where_it_does_and_down_turns() -> None:
    rest_m = np.array(REST_GRIPPER_M)
    np.testing.assert_allclose(TILTED.see(rest_m), rest_m)
    x, _, z = TILTED.turn(np.array([0.0, 1.0, 0.0]))
    assert x == pytest.approx(np.sin(-0.03), abs=1e-4)  # leaning to its right, down is on its right
    assert z == pytest.approx(-np.sin(0.05), abs=1e-4)  # looking up, down lies behind
    assert LEVEL.see(rest_m) is rest_m
