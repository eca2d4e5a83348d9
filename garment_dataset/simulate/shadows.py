"""Shadows that lamps cast on the wall, and what makes a wall uneven."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from garment_dataset.simulate import scene
from garment_dataset.simulate.camera_pose import LEVEL, CameraPose
from garment_dataset.simulate.raster import HEIGHT_PX, WIDTH_PX

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from garment_dataset.simulate.nuisance_color import Lamp, Wall

_GARMENT_M = 1.065  # how far before the camera what casts shadows is
_SUBPIXEL_BITS = 4
_FAR_PX = 4000.0


def light_on_wall(
    lamps: Sequence[Lamp],
    casting: Sequence[tuple[NDArray[np.float64], NDArray[np.intp]]],
    pose: CameraPose = LEVEL,
) -> NDArray[np.float32]:
    """Return which share of its light each pixel of the wall has, as the colour camera sees it, shape (H, W, 3).

    Parameters
    ----------
    lamps : sequence of Lamp
        Where the light comes from.
    casting : sequence of (ndarray, ndarray)
        Meshes that stand before the wall: vertices (V, 3) in the frame of a level camera, metres, and triangles (T, 3).
    pose : CameraPose
        How the camera looks at the wall.

    Notes
    -----
    Each mesh is projected from the lamp onto the plane of the wall, and drawn as the camera sees it there. The umbra of
    a lamp of diameter D is blurred by D/4, the standard deviation of a disc, times the ratio of the distances from
    garment to wall and from lamp to garment. It is drawn in half size, for it is blurred.
    """
    light = np.ones((HEIGHT_PX, WIDTH_PX, 3), dtype=np.float32)
    for lamp in lamps:
        umbra = np.zeros((HEIGHT_PX // 2, WIDTH_PX // 2), dtype=np.float32)
        for vertices_m, triangles in casting:
            _draw_umbra(umbra, lamp, vertices_m, triangles, pose)
        behind = (scene.WALL_M - _GARMENT_M) / (_GARMENT_M - lamp.place_m[2])
        radius_px = lamp.size_m / 4 * behind * scene.COLOR_CAMERA.focal_px / scene.WALL_M
        full = cv2.resize(umbra, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_LINEAR)
        soft = cv2.GaussianBlur(full, (0, 0), max(radius_px, 0.5), borderType=cv2.BORDER_REPLICATE)
        light -= soft[..., None] * np.array(lamp.tint, dtype=np.float32) * np.float32(lamp.share)
    return light


def _draw_umbra(
    umbra: NDArray[np.float32],
    lamp: Lamp,
    vertices_m: NDArray[np.float64],
    triangles: NDArray[np.intp],
    pose: CameraPose,
) -> None:
    """Draw the full shadow of a mesh, in half size."""
    place_m = np.array(lamp.place_m)
    stretch = (scene.WALL_M - place_m[2]) / np.maximum(vertices_m[:, 2] - place_m[2], 1e-3)
    on_wall_m = place_m + stretch[:, None] * (vertices_m - place_m)
    image_px = (scene.COLOR_CAMERA.project(pose.see(on_wall_m))[:, :2] - 0.5) / 2
    fixed = np.rint(np.clip(image_px, -_FAR_PX, _FAR_PX) * 2**_SUBPIXEL_BITS).astype(np.int32)
    for corners in fixed[triangles]:
        cv2.fillConvexPoly(umbra, corners, 1.0, shift=_SUBPIXEL_BITS)


def uneven(wall: Wall) -> NDArray[np.float32]:
    """Return which share of the light each pixel of an uneven wall reflects, shape (H, W, 1)."""
    rng = np.random.default_rng(wall.number)
    u_px, v_px = np.arange(WIDTH_PX), np.arange(HEIGHT_PX)[:, None]
    pitch_px = wall.fold_m * scene.COLOR_CAMERA.focal_px / scene.WALL_M
    folds = np.zeros((HEIGHT_PX, WIDTH_PX))
    for _ in range(3):  # hardly two folds are alike, and none is quite upright
        slant, phase = rng.normal(0.0, 0.15), rng.uniform(0.0, 2 * np.pi)
        folds += np.sin(2 * np.pi * (u_px + slant * v_px) / (pitch_px * rng.uniform(0.6, 1.6)) + phase) / 3
    texture = cv2.GaussianBlur(rng.standard_normal((HEIGHT_PX, WIDTH_PX)), (0, 0), wall.texture_px)
    texture *= wall.texture_share / texture.std()
    share = 1 + wall.fold_share * folds + texture
    return share.astype(np.float32)[..., None]
