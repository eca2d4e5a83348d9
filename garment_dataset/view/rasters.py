"""Frames as small arrays of pixels with what was extracted: many of them, where a figure each would take too long."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from garment_dataset.view.depth import POINT_COLORS, depth_colors, project

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import FloatArray
    from garment_dataset.view.color import ColorFrame
    from garment_dataset.view.depth import DepthFrame

    Rgb = NDArray[np.uint8]

_NOTHING = (217, 217, 217)
_WHITE, _BLACK, _RED, _YELLOW = (255, 255, 255), (0, 0, 0), (214, 39, 40), (240, 228, 66)
_FINE = 4
"""Lines are drawn to the fourth part of a pixel: bits of a fixed-point number are 2."""


def depth_raster(frame: DepthFrame, limits_m: tuple[float, float], width_px: int) -> Rgb:
    """Return a depth image in colours, with chain, points and gripper.

    Parameters
    ----------
    frame : DepthFrame
        What is drawn.
    limits_m : (float, float)
        Depths between which colour changes; see :func:`garment_dataset.view.depth.color_limits_m`.
    width_px : int
        Of the picture.

    Returns
    -------
    (H, W, 3) uint8
        RGB, of the image's proportions.
    """
    picture, scale = _resized(_depth_scale(*limits_m, int(frame.depth_mm.max(initial=0)))[frame.depth_mm], width_px)
    _draw_line(picture, _pixels_of(frame.chain, frame), scale, _WHITE, 1)
    for point, at in zip(frame.points["point"], _pixels_of(frame.points, frame), strict=True):
        _draw_dot(picture, at, scale, _hex_rgb(POINT_COLORS[(int(point) - 1) % len(POINT_COLORS)]))
    if frame.gripper is not None:
        (at,) = _pixels_of(frame.gripper.to_frame().T, frame)
        _draw_cross(picture, at, scale)
    return picture


def color_raster(frame: ColorFrame, width_px: int) -> Rgb:
    """Return a colour image with outline, central curve and gripper.

    Parameters
    ----------
    frame : ColorFrame
        What is drawn.
    width_px : int
        Of the picture.

    Returns
    -------
    (H, W, 3) uint8
        RGB, of the image's proportions.
    """
    picture, scale = _resized(frame.pixels, width_px)
    silhouette = frame.silhouette
    if silhouette.get("mask") is not None:
        outline = np.stack([silhouette["outline_u_px"], silhouette["outline_v_px"]], axis=1).astype(np.float64)
        closed = np.concatenate([outline, outline[:1]])
        _draw_line(picture, closed, scale, _BLACK, 3)
        _draw_line(picture, closed, scale, _YELLOW, 1)
        curve = frame.curve[["u_px", "v_px"]].to_numpy(np.float64)
        _draw_line(picture, curve, scale, _BLACK, 3)
        _draw_line(picture, curve, scale, _WHITE, 1)
    at = np.array([silhouette.get("gripper_u_px", np.nan), silhouette.get("gripper_v_px", np.nan)], np.float64)
    _draw_cross(picture, at, scale)
    return picture


def _depth_scale(near_m: float, far_m: float, most_mm: int) -> Rgb:
    """Return the colour of every depth in mm up to the greatest, (most_mm + 1, 3): 0 is no return."""
    colors = (depth_colors()(np.arange(258) - 1)[:, :3] * 255).astype(np.uint8)  # nearer, the scale, farther
    levels = (np.arange(most_mm + 1) * 1e-3 - near_m) / max(far_m - near_m, 1e-9)
    scale: Rgb = colors[np.clip(np.floor(levels * 256), -1, 256).astype(np.int64) + 1]
    scale[0] = _NOTHING
    return scale


def _resized(pixels: Rgb, width_px: int) -> tuple[Rgb, float]:
    """Return a picture of a width, and by how much it is larger; what grows keeps its pixels."""
    height, width = pixels.shape[:2]
    scale = width_px / width
    way = cv2.INTER_NEAREST if scale >= 1 else cv2.INTER_AREA
    resized: Any = cv2.resize(pixels, (width_px, max(1, round(height * scale))), interpolation=way)
    return np.ascontiguousarray(resized), scale


def _pixels_of(rows: Any, frame: DepthFrame) -> FloatArray:  # noqa: ANN401 - a DataFrame
    return np.stack(project(rows, frame.camera), axis=1)


def _fixed(at: FloatArray, scale: float) -> NDArray[np.int32]:
    """Return places of the image in the picture, in fourths of its pixels; the centre of the first pixel is 0."""
    return np.round(((at + 0.5) * scale - 0.5) * _FINE).astype(np.int32)


def _draw_line(picture: Rgb, at: FloatArray, scale: float, color: tuple[int, int, int], width: int) -> None:
    known = at[np.isfinite(at).all(axis=1)]
    if len(known) > 1:
        cv2.polylines(picture, [_fixed(known, scale)], False, color, width, cv2.LINE_AA, 2)


def _draw_dot(picture: Rgb, at: FloatArray, scale: float, color: tuple[int, int, int]) -> None:
    if np.isfinite(at).all():
        u, v = (int(value) for value in _fixed(at, scale))
        for radius, shade in ((5, _WHITE), (4, color)):
            cv2.circle(picture, (u, v), radius * _FINE, shade, -1, cv2.LINE_AA, 2)


def _draw_cross(picture: Rgb, at: FloatArray, scale: float) -> None:
    if np.isfinite(at).all():
        u, v = (round(value / _FINE) for value in _fixed(at, scale))
        for width, shade in ((4, _WHITE), (2, _RED)):
            cv2.drawMarker(picture, (u, v), shade, cv2.MARKER_TILTED_CROSS, 11, width)


def _hex_rgb(text: str) -> tuple[int, int, int]:
    red, green, blue = bytes.fromhex(text.removeprefix("#"))
    return red, green, blue
