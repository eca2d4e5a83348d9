"""Frames as arrays of pixels: colours of depth, and what was extracted where the camera sees it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgb

from garment_dataset.view.color import ColorFrame
from garment_dataset.view.curves import point_color
from garment_dataset.view.depth import POINT_COLORS, DepthFrame
from garment_dataset.view.rasters import color_raster, depth_raster
from tests.view.test_pictures import CAMERA, depth_frame

LIMITS_M = (0.9, 1.1)


def without_rows(depth_mm: Any) -> DepthFrame:
    nothing = pd.DataFrame({"x_m": [], "y_m": [], "z_m": [], "point": []})
    return DepthFrame(depth_mm, CAMERA, None, nothing, nothing)


def test_nearer_is_black_farther_white_and_no_return_grey() -> None:
    picture = depth_raster(without_rows(np.array([[500, 3000, 0, 1000]], np.uint16)), LIMITS_M, 4)
    assert picture.shape == (1, 4, 3)
    assert [tuple(pixel) for pixel in picture[0, :3].tolist()] == [(0, 0, 0), (255, 255, 255), (217, 217, 217)]
    assert len(set(picture[0, 3].tolist())) > 1


def test_colours_change_with_every_millimetre_of_a_garment() -> None:
    depth_mm = np.arange(901, 1100, dtype=np.uint16)[None]
    picture = depth_raster(without_rows(depth_mm), LIMITS_M, depth_mm.shape[1]).astype(int)
    assert (np.abs(np.diff(picture[0], axis=0)).sum(axis=1) > 0).mean() > 0.95


@pytest.mark.parametrize("width_px", [40, 400, 800])
def test_points_lie_where_the_camera_sees_them(width_px: int) -> None:
    frame = depth_frame("gap")  # the third point is missing
    picture = depth_raster(frame, LIMITS_M, width_px)
    assert picture.shape == (width_px * 3 // 4, width_px, 3)
    if width_px == 40:
        return
    scale = width_px / 40
    v = [round((100 * y / z + 15 + 0.5) * scale - 0.5) for y, z in ((-0.08, 1.0), (0.0, 1.02))]
    u = round(20.5 * scale - 0.5)
    for row, color in zip(v, POINT_COLORS, strict=False):
        assert picture[row, u].tolist() == [round(255 * part) for part in to_rgb(color)]


def test_an_outline_is_drawn_only_where_there_is_a_mask() -> None:
    pixels = np.full((30, 40, 3), 100, np.uint8)
    curve = pd.DataFrame({"u_px": [20.0, 20.0], "v_px": [10.0, 20.0]})
    nothing = color_raster(ColorFrame(pixels, {"mask": None}, curve), 40)
    assert (nothing == 100).all()
    box = {"mask": b"", "outline_u_px": [10, 30, 30, 10], "outline_v_px": [5, 5, 25, 25]}
    found = color_raster(ColorFrame(pixels, box, curve), 40)
    red, green, blue = found[15, 10].tolist()  # the edges of lines are smoothed
    assert min(red, green) > 190
    assert blue < 100
    assert found[15, 20].min() > 220
    assert (found[15, 14:17] == 100).all()
    assert (pixels == 100).all()


def test_curves_of_points_are_told_apart_on_both_grounds() -> None:
    for ends, ground in (((0.0, 0.85), (1, 1, 1)), ((0.35, 1.0), (0, 0, 0))):
        colors = [np.array(to_rgb(point_color(point, 5, ends))) for point in range(1, 6)]
        grey = [float(color @ (0.299, 0.587, 0.114)) for color in colors]
        assert grey == sorted(grey)
        assert all(np.abs(color - ground).max() > 0.4 for color in colors)
