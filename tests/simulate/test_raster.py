from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_dataset.simulate.raster import HEIGHT_PX, WIDTH_PX, Buffer, Pinhole, draw, interpolate
from garment_dataset.simulate.scene import DEPTH_CAMERA, box

QUAD = np.array([[0, 1, 2], [1, 3, 2]])


def plane(z_m: float, slope_x: float, slope_y: float, half_m: float = 0.3) -> np.ndarray:
    """Return the corners of a square of the plane z = z_m + slope_x x + slope_y y."""
    ends = [(x, y) for y in (-half_m, half_m) for x in (-half_m, half_m)]
    return np.array([[x, y, z_m + slope_x * x + slope_y * y] for x, y in ends])


@settings(max_examples=15, deadline=None)
@given(st.floats(0.7, 2.0), st.floats(-0.8, 0.8), st.floats(-0.8, 0.8))
def test_depth_is_that_of_the_ray_through_the_pixel_centre(z_m: float, slope_x: float, slope_y: float) -> None:
    buffer = Buffer.empty()
    draw(buffer, DEPTH_CAMERA.project(plane(z_m, slope_x, slope_y)), QUAD)
    v, u = np.nonzero(buffer.triangle >= 0)
    assert len(u) > 10_000
    ray_x, ray_y = (u - 319.5) / DEPTH_CAMERA.focal_px, (v - 239.5) / DEPTH_CAMERA.focal_px
    exact = z_m / (1 - slope_x * ray_x - slope_y * ray_y)
    assert np.abs(1 / buffer.inverse_depth[v, u] - exact).max() < 1e-9


def test_nearer_surface_hides_the_farther_whatever_the_order() -> None:
    near, far = plane(0.9, 0.5, 0.0, 0.2), plane(0.9, -0.5, 0.0, 0.2)
    seen = []
    for order in ((near, far), (far, near)):
        buffer = Buffer.empty()
        for corners in order:
            draw(buffer, DEPTH_CAMERA.project(corners), QUAD)
        seen.append(buffer.inverse_depth)
    assert (seen[0] == seen[1]).all()
    # they cross in the middle: the left half shows the one that is nearer there
    middle = seen[0][240]
    assert middle[300] > 1 / 0.9
    assert middle[340] > 1 / 0.9


def test_neighbouring_triangles_leave_no_gap_and_cover_each_pixel_once() -> None:
    rng = np.random.default_rng(1)
    grid = np.stack(np.meshgrid(np.linspace(-0.2, 0.2, 15), np.linspace(-0.2, 0.2, 15)), -1).reshape(-1, 2)
    inner = (np.abs(grid) < 0.19).all(axis=1)
    grid[inner] += rng.uniform(-0.008, 0.008, (inner.sum(), 2))
    vertices = np.column_stack([grid, np.full(len(grid), 1.0)])
    a = (np.arange(14)[:, None] * 15 + np.arange(14)).ravel()
    triangles = np.concatenate([np.stack([a, a + 1, a + 15], 1), np.stack([a + 1, a + 16, a + 15], 1)])
    buffer = Buffer.empty()
    draw(buffer, DEPTH_CAMERA.project(vertices), triangles)
    v, u = np.nonzero(buffer.triangle >= 0)
    assert (np.ptp(u) + 1) * (np.ptp(v) + 1) == len(u)
    assert np.ptp(u) == pytest.approx(0.4 * DEPTH_CAMERA.focal_px - 0.5, abs=1)


def test_values_are_interpolated_on_the_surface_not_in_the_image() -> None:
    corners = plane(1.2, 0.7, -0.3)
    image = DEPTH_CAMERA.project(corners)
    buffer = Buffer.empty()
    draw(buffer, image, QUAD)
    v, u, seen = interpolate(buffer, image, QUAD, corners)
    again = DEPTH_CAMERA.project(seen)
    assert again[:, 0] == pytest.approx(u, abs=1e-6)
    assert again[:, 1] == pytest.approx(v, abs=1e-6)


def test_what_reaches_behind_the_camera_or_out_of_the_image_is_left_out() -> None:
    buffer = Buffer.empty()
    behind = np.array([[0.0, 0.0, -1.0], [0.5, 0.0, 1.0], [0.0, 0.5, 1.0]])
    with np.errstate(divide="raise"):
        draw(buffer, DEPTH_CAMERA.project(behind), np.array([[0, 1, 2]]))
    draw(buffer, DEPTH_CAMERA.project(plane(1.0, 0, 0) + np.array([5.0, 0.0, 0.0])), QUAD)
    assert (buffer.triangle == -1).all()
    draw(buffer, DEPTH_CAMERA.project(plane(1.0, 0, 0, half_m=9.0)), QUAD)
    assert (buffer.triangle >= 0).all()
    assert buffer.inverse_depth.shape == (HEIGHT_PX, WIDTH_PX)


def test_shifted_camera_sees_a_shifted_scene() -> None:
    moved = Pinhole(500.0, 319.5, 239.5, (0.1, 0.0, 0.0), "other")
    straight = Pinhole(500.0, 319.5, 239.5, (0.0, 0.0, 0.0), "one")
    points = np.array([[0.2, 0.1, 1.5]])
    assert moved.project(points + np.array([0.1, 0.0, 0.0])) == pytest.approx(straight.project(points))


def test_box_is_closed() -> None:
    solid = box((-0.1, -0.1, 1.0), (0.1, 0.1, 1.2), (1, 2, 3))
    sides = np.sort(np.concatenate([solid.triangles[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))]), axis=1)
    _, uses = np.unique(sides, axis=0, return_counts=True)
    assert (uses == 2).all()
