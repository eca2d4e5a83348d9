"""Cloth in colour images: a sheet is as wide as it is thick when seen edge-on, and covers what it covers."""

from __future__ import annotations

import numpy as np
import pytest

from garment_dataset.simulate import scene
from garment_dataset.simulate.cloth import ClothSpec
from garment_dataset.simulate.motion import Swing
from garment_dataset.simulate.render import SAMPLES, ColorFrame, Fabric, Stage
from garment_dataset.simulate.sheet import facing, shell_m, shell_triangles, thickness_m

FLAT = np.array([[0, 1, 2], [1, 3, 2]])
RED = Fabric((200, 20, 20), weave=0.0)
THICK_M = 0.003
DISTANCE_M, FOCAL_PX = 1.0, scene.COLOR_CAMERA.focal_px
SWING = Swing("B", np.pi / 16, 0.5)


def sheet_m(wide_m: float, high_m: float, yaw_rad: float = 0.0, roll_rad: float = 0.0) -> np.ndarray:
    """Corners of a sheet before the colour camera, turned about the vertical and then in the image."""
    ends = np.array([[x, y, 0.0] for y in (-high_m / 2, high_m / 2) for x in (-wide_m / 2, wide_m / 2)])
    about_y = [[np.cos(yaw_rad), 0, np.sin(yaw_rad)], [0, 1, 0], [-np.sin(yaw_rad), 0, np.cos(yaw_rad)]]
    about_z = [[np.cos(roll_rad), -np.sin(roll_rad), 0], [np.sin(roll_rad), np.cos(roll_rad), 0], [0, 0, 1]]
    turned = ends @ np.array(about_y).T @ np.array(about_z).T
    return np.asarray(turned + np.array([scene.COLOR_CAMERA.origin_m[0], 0.0, DISTANCE_M]))


def seen(corners_m: np.ndarray) -> ColorFrame:
    stage = Stage(SWING, RED, FLAT, corners_m[:, :2], thick_m=THICK_M)
    return stage.color(0.0, corners_m)


def test_shell_is_closed_and_turned_outwards() -> None:
    corners = sheet_m(0.2, 0.3)
    triangles = shell_triangles(FLAT, 4)
    body = shell_m(corners, np.tile([0.0, 0.0, 1.0], (4, 1)), THICK_M)
    sides = np.concatenate([triangles[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))])
    assert len({(a, b) for a, b in sides.tolist()} & {(b, a) for a, b in sides.tolist()}) == len(sides)
    a, b, c = (body[triangles[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    assert volume == pytest.approx(0.2 * 0.3 * THICK_M)


def test_only_what_faces_the_camera_is_drawn() -> None:
    body = shell_m(sheet_m(0.2, 0.3), np.tile([0.0, 0.0, 1.0], (4, 1)), THICK_M)
    triangles = shell_triangles(FLAT, 4)
    kept = triangles[facing(scene.COLOR_CAMERA.project(body), triangles)]
    assert set(kept[:2].ravel().tolist()) == {4, 5, 6, 7}, "the side before the sheet, whose normals point away"


@pytest.mark.parametrize("roll_deg", [0.0, 3.0, 21.0])
def test_a_sheet_edge_on_is_a_line_as_wide_as_it_is_thick(roll_deg: float) -> None:
    corners = sheet_m(0.2, 0.3, np.pi / 2, np.radians(roll_deg))
    frame = seen(corners)
    # its near edge is 0.9 m away, and in front of its far one
    expected = THICK_M * 0.3 * (FOCAL_PX / 0.9) ** 2
    red = frame.pixels[..., 0] - frame.pixels[..., 1]
    empty = Stage(SWING).color(0.0, None).pixels
    covered = (red - (empty[..., 0] - empty[..., 1])) / red.max()
    assert covered[150:330, 250:390].sum() == pytest.approx(expected, rel=0.05)
    rows = np.flatnonzero(frame.garment.any(axis=1))
    assert len(rows) == np.ptp(rows) + 1, "no dashes"
    assert frame.garment.sum() == pytest.approx(expected, rel=0.25)


@pytest.mark.parametrize("roll_deg", [0.0, 10.0, 45.0])
def test_coverage_conserves_the_area(roll_deg: float) -> None:
    frame = seen(sheet_m(0.11, 0.13, 0.0, np.radians(roll_deg)))
    side_m = np.array([0.11, 0.13])
    assert frame.garment.sum() == pytest.approx((side_m * FOCAL_PX / (DISTANCE_M - THICK_M / 2)).prod(), rel=0.01)


def test_edge_pixels_are_mixtures() -> None:
    frame, empty = seen(sheet_m(0.11, 0.13, 0.0, 0.3)), Stage(SWING).color(0.0, None)
    inner = frame.pixels[240, 320]
    share = (frame.pixels[240] - empty.pixels[240])[:, 1] / (inner - empty.pixels[240, 320])[1]
    parts = share[(share > 0.02) & (share < 0.98)] * len(SAMPLES)
    assert len(parts)
    np.testing.assert_allclose(parts, np.rint(parts), atol=0.05)


def test_thickness_follows_from_the_mass_within_what_is_worn() -> None:
    thin, usual, thick = (thickness_m(ClothSpec(0.4, 0.6, mass_kg)) for mass_kg in (0.001, 0.045, 5.0))
    assert (thin, thick) == (0.001, 0.004)
    assert thin < usual < thick
