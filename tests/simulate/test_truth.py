from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.simulate.render import Stage, as_millimetres
from garment_dataset.simulate.scene import DEPTH_CAMERA
from garment_dataset.simulate.truth import Polyline, as_png, in_image, mask_axes, visible_profile

GRIPPER = np.array([0.01, -0.35, 1.065])
QUAD = np.array([[0, 1, 2], [1, 3, 2]])


def sheet(top: tuple[float, float], bottom: tuple[float, float], half_m: float = 0.1) -> np.ndarray:
    """Return a strip from top to bottom, each given as y and z."""
    return np.array([[x, y, z] for y, z in (top, bottom) for x in (-half_m, half_m)])


@given(st.floats(0.3, 0.65), st.floats(-0.2, 0.2))
def test_profile_of_a_plane_has_its_length_and_its_points(height_m: float, lean_m: float) -> None:
    top, bottom = (GRIPPER[1], GRIPPER[2]), (GRIPPER[1] + height_m, GRIPPER[2] + lean_m)
    line = visible_profile(sheet(top, bottom), QUAD, GRIPPER)
    assert line is not None
    assert line.arc_m[-1] == pytest.approx(np.hypot(height_m, lean_m), abs=1e-6)
    middles = line.middles(5)
    share = (np.arange(5) + 0.5) / 5
    assert middles[:, 1] == pytest.approx(top[0] + share * height_m, abs=1e-5)
    assert middles[:, 2] == pytest.approx(top[1] + share * lean_m, abs=1e-5)
    assert (middles[:, 0] == GRIPPER[0]).all()


def test_cloth_above_the_gripper_is_left_out() -> None:
    line = visible_profile(sheet((-0.5, 1.065), (0.2, 1.065)), QUAD, GRIPPER)
    assert line is not None
    assert line.arc_m[-1] == pytest.approx(0.55, abs=1e-6)
    assert line.nodes_m[:, 1].min() == pytest.approx(GRIPPER[1])


def test_fold_in_front_hides_what_is_behind() -> None:
    behind, front = sheet((-0.35, 1.065), (0.3, 1.065)), sheet((-0.1, 1.0), (0.1, 1.0))
    line = visible_profile(np.vstack([behind, front]), np.vstack([QUAD, QUAD + 4]), GRIPPER)
    assert line is not None
    y, z = line.nodes_m[:, 1], line.nodes_m[:, 2]
    hidden = (y > -0.09) & (y < 0.09)
    assert z[hidden] == pytest.approx(1.0, abs=1e-9)
    assert z[(y < -0.12) | (y > 0.12)] == pytest.approx(1.065, abs=1e-9)


def test_no_cloth_below_the_gripper_is_no_line() -> None:
    assert visible_profile(sheet((-0.35, 1.0), (0.3, 1.0)) + np.array([1.0, 0.0, 0.0]), QUAD, GRIPPER) is None
    assert visible_profile(sheet((-0.6, 1.0), (-0.4, 1.0)), QUAD, GRIPPER) is None


def test_length_does_not_shake_as_the_sheet_moves() -> None:
    lengths = []
    for shift in np.linspace(0, 0.002, 23):
        step = np.array([0.0, shift, -shift])
        moved, corners = GRIPPER + step, sheet((-0.36, 1.0655), (0.28, 1.0655)) + step
        line = visible_profile(corners, QUAD, moved)
        assert line is not None
        lengths.append(line.arc_m[-1])
    assert np.ptp(lengths) < 1e-7


def test_rendered_depth_lies_on_the_profile() -> None:
    corners = sheet((-0.35, 1.065), (0.29, 0.95))
    stage = Stage(triangles=QUAD, material_m=np.zeros((4, 2)))
    depth = as_millimetres(stage.depth_m(0.0, corners))
    line = visible_profile(corners, QUAD, GRIPPER)
    assert line is not None
    u, v, inverse = DEPTH_CAMERA.project(line.middles(7)).T
    for column, row, expected in zip(u, v, 1000 / inverse, strict=True):
        left, top = int(column), int(row)
        patch = depth[top : top + 2, left : left + 2].astype(float)
        across, down = column - left, row - top
        found = np.array([1 - down, down]) @ patch @ np.array([1 - across, across])
        assert found == pytest.approx(expected, abs=0.51)


def test_polyline_measures_along_itself() -> None:
    corner = Polyline(np.array([[0.0, 0.0, 1.0], [0.0, 0.3, 1.0], [0.0, 0.3, 1.4]]))
    assert corner.arc_m.tolist() == pytest.approx([0.0, 0.3, 0.7])
    assert corner.at(np.array([0.5]))[0] == pytest.approx([0.0, 0.3, 1.2])


def test_axes_of_a_rectangle_are_regionprops() -> None:
    mask = np.zeros((480, 640), dtype=np.bool_)
    mask[100:140, 200:300] = True
    axes = mask_axes(mask)
    # variance of a uniform square of w pixels, areas not points: w^2 / 12
    assert axes["major_px"] == pytest.approx(4 * 100 / np.sqrt(12))
    assert axes["minor_px"] == pytest.approx(4 * 40 / np.sqrt(12))
    assert (axes["centroid_u_px"], axes["centroid_v_px"]) == (249.5, 119.5)
    assert axes["orientation_rad"] == pytest.approx(0.0)


@given(st.floats(-80, 89))
def test_orientation_is_counter_clockwise(degrees: float) -> None:
    mask = np.zeros((480, 640), dtype=np.uint8)
    cv2.ellipse(mask, (320, 240), (120, 40), -degrees, 0, 360, 1, -1)
    found = np.rad2deg(mask_axes(mask.astype(np.bool_))["orientation_rad"])
    assert found == pytest.approx(degrees, abs=0.6)


def test_axes_of_nothing_are_nan() -> None:
    assert np.isnan(list(mask_axes(np.zeros((4, 4), dtype=np.bool_)).values())).all()


def test_masks_survive_png_and_stay_small() -> None:
    mask = np.random.default_rng(0).random((480, 640)) < 0.5
    data = as_png(mask)
    again = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    assert again is not None
    assert np.array_equal(again > 0, mask)
    assert len(data) < 480 * 640 / 8 * 1.1


def test_in_image() -> None:
    points = np.array([[0.0, 0.0, 1.0], [0.0, 0.43, 1.0], [-0.6, 0.0, 1.0]])
    assert in_image(points).tolist() == [True, False, False]
