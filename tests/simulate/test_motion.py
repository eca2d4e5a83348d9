from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.simulate.motion import WRIST_RADIUS_M, Swing
from garment_dataset.simulate.robot import JOINTS, Robot, quaternion_xyzw

swings = st.builds(
    Swing,
    axis=st.sampled_from(["R", "B"]),
    swing_rad=st.floats(np.pi / 64, np.pi / 8),
    speed_rad_s=st.floats(0.1, 2.0),
    start_s=st.floats(0.2, 2.0),
)


@given(swings, st.floats(0.0, 10.0))
def test_gripper_stays_on_an_arc_about_the_wrist(swing: Swing, time_s: float) -> None:
    lever = swing.gripper_m(time_s) - swing.wrist_m
    assert np.linalg.norm(lever) == pytest.approx(WRIST_RADIUS_M, abs=1e-12)
    assert lever @ swing.axis_vector == pytest.approx(0.0, abs=1e-12)


@given(swings)
def test_swing_goes_twice_its_angle_and_comes_back(swing: Swing) -> None:
    times = np.linspace(swing.start_s, swing.end_s, 4001)
    angle = swing.angle_rad(times)
    assert angle[0] == 0.0
    assert angle.max() == pytest.approx(2 * swing.swing_rad, rel=1e-9)
    assert angle[-1] == pytest.approx(0.0, abs=1e-9)
    assert swing.rate_rad_s(times).max() <= swing.speed_rad_s * (1 + 1e-9)


@given(swings, st.floats(0.0, 6.0))
def test_velocity_is_the_derivative_of_the_path(swing: Swing, time_s: float) -> None:
    step = 1e-5
    difference = (swing.gripper_m(time_s + step) - swing.gripper_m(time_s - step)) / (2 * step)
    assert swing.gripper_velocity_m_s(time_s) == pytest.approx(difference, abs=1e-6)


def test_axis_r_moves_towards_the_camera_and_axis_b_across_it() -> None:
    turn = 2.0
    along = Swing("R", np.pi / 16, 0.5).gripper_m(turn + 1.0) - Swing("R", np.pi / 16, 0.5).rest_m
    across = Swing("B", np.pi / 16, 0.5).gripper_m(turn + 1.0) - Swing("B", np.pi / 16, 0.5).rest_m
    assert along[2] < -0.15
    assert along[0] == pytest.approx(0.0, abs=1e-12)
    assert across[0] < -0.15
    assert across[2] == pytest.approx(0.0, abs=1e-12)


def test_rest_lies_where_the_thesis_has_it(swing: Swing) -> None:
    assert 1.06 <= swing.rest_m[2] <= 1.07


@pytest.mark.parametrize("time_s", [0.0, 2.0, 2.9, 4.0, 7.0])
def test_transforms_lead_from_the_camera_to_the_gripper(swing: Swing, time_s: float) -> None:
    robot = Robot(swing)
    pose = {"base_link": np.eye(4)}
    for link in (*robot.links(time_s), *robot.fixed):
        pose[link.child] = pose[link.parent] @ link.matrix
    seen = np.linalg.inv(pose["xtion1_depth_optical_frame"]) @ pose["r2_ee"]
    assert seen[:3, 3] == pytest.approx(swing.gripper_m(time_s), abs=1e-9)
    assert seen[:3, :3] == pytest.approx(swing.rotation(time_s), abs=1e-9)
    to_color = np.linalg.inv(pose["xtion1_depth_optical_frame"]) @ pose["xtion1_rgb_optical_frame"]
    assert to_color[:3, 3] == pytest.approx([0.025, 0.0, 0.0], abs=1e-12)


def test_only_the_named_joint_moves(swing: Swing) -> None:
    robot = Robot(swing)
    moved = robot.joints_rad(3.0) - robot.joints_rad(0.0)
    assert [name for name, turn in zip(JOINTS, moved, strict=True) if turn != 0] == [f"r2_joint_{swing.axis.lower()}"]


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_quaternions_mean_their_rotation(parts: list[float]) -> None:
    x, y, z, w = np.array(parts) / np.linalg.norm(parts)
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    assert abs(np.dot(quaternion_xyzw(rotation), [x, y, z, w])) == pytest.approx(1.0, abs=1e-9)
