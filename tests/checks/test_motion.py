"""What a gripper did, from its track, its joints and its orientation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.bags.joints import JointSample
from garment_dataset.checks.motion import swing_axis, turn_of_gripper, turn_of_joints

TIME_S = np.linspace(0, 4, 401)
STAMP_NS = (TIME_S * 1e9).astype(np.int64) + 1_391_700_000_000_000_000


def track(along_m: float, across_m: float) -> np.ndarray:
    swing = np.sin(TIME_S)
    return np.column_stack([0.1 + across_m * swing, -0.3 + 0.01 * swing, 1.0 + along_m * swing])


def samples(joint: str, angle_rad: np.ndarray) -> list[JointSample]:
    return [
        JointSample(int(stamp_ns), int(stamp_ns), joint, float(angle), None)
        for stamp_ns, angle in zip(STAMP_NS, angle_rad, strict=True)
    ]


@pytest.mark.parametrize(
    ("along_m", "across_m", "axis"),
    [(0.1, 0.01, "R"), (0.01, 0.1, "B"), (0.1, 0.08, None), (0.002, 0.001, None), (-0.1, 0.0, "R")],
)
def test_the_axis_is_that_of_the_longer_way(along_m: float, across_m: float, axis: str | None) -> None:
    assert swing_axis(track(along_m, across_m)) == axis
    assert swing_axis(track(along_m, across_m)[::-1]) == axis
    assert swing_axis(track(along_m, across_m) + 5.0) == axis


def test_no_point_has_no_axis() -> None:
    assert swing_axis(np.zeros((0, 3))) is None


@given(swing_rad=st.floats(0.02, 1.0), rate=st.floats(0.8, 4.0))
def test_the_joint_that_moves_most_tells_swing_and_peak(swing_rad: float, rate: float) -> None:
    moving = samples("r2_joint_b", 0.3 + swing_rad * np.sin(rate * TIME_S))
    still = samples("r1_joint_s", 0.1 * swing_rad * np.sin(rate * TIME_S))
    turn = turn_of_joints([*still, *moving])
    assert turn is not None
    assert turn.joint == "r2_joint_b"
    reached = np.ptp(np.sin(rate * TIME_S)) / 2
    assert turn.swing_rad == pytest.approx(swing_rad * reached, rel=0.01)
    assert turn.speed_rad_s == pytest.approx(swing_rad * rate, rel=0.03)


def test_joints_that_do_not_move_tell_nothing() -> None:
    assert turn_of_joints(samples("r2_joint_b", np.full(401, 0.3))) is None
    assert turn_of_joints([JointSample(0, 0, "r2_joint_b", None, None)]) is None
    assert turn_of_joints([]) is None


@given(swing_rad=st.floats(0.02, 1.0), axis=st.tuples(*[st.floats(-1, 1)] * 3), flips=st.integers(1, 50))
def test_the_orientation_tells_the_same_as_a_joint(
    swing_rad: float, axis: tuple[float, float, float], flips: int
) -> None:
    """Whatever the axis, the first orientation, and the signs of the quaternions."""
    direction = np.array(axis) + np.array([0.0, 0.0, 2.0])
    direction /= np.linalg.norm(direction)
    angle_rad = swing_rad * np.sin(2 * TIME_S)
    quaternions = np.column_stack([np.sin(angle_rad / 2)[:, None] * direction, np.cos(angle_rad / 2)])
    quaternions[::flips] *= -1
    quaternions[100:120] = np.nan
    found, by_joint = turn_of_gripper(STAMP_NS, quaternions), turn_of_joints(samples("j", angle_rad))
    assert found is not None
    assert by_joint is not None
    assert found.swing_rad == pytest.approx(by_joint.swing_rad, rel=1e-6)
    assert found.speed_rad_s == pytest.approx(by_joint.speed_rad_s, rel=0.01)
    assert turn_of_gripper(STAMP_NS, np.full((401, 4), np.nan)) is None
