"""What stands before the camera besides the garment: cameras, gripper, background."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.simulate.raster import Pinhole

if TYPE_CHECKING:
    from numpy.typing import NDArray

DEPTH_CAMERA = Pinhole(570.3422, 319.5, 239.5, (0.0, 0.0, 0.0), "xtion1_depth_optical_frame")
"""The driver's default calibration."""
COLOR_CAMERA = Pinhole(525.0, 319.5, 239.5, (0.025, 0.0, 0.0), "xtion1_rgb_optical_frame")
"""The driver's default calibration; the colour camera sits 25 mm to the right of the depth camera."""

WALL_M = 1.80
"""How far before the camera the monochrome panel stands."""
WALL_COLOR = (198, 200, 196)

TOWARDS_LIGHT = np.array([-0.35, -0.75, -0.56])
"""Unit vector towards the lamps: above, on the left and behind the camera."""
_AMBIENT, _DIFFUSE = 0.45, 0.6


@dataclass(frozen=True)
class Solid:
    """A mesh with one colour per triangle.

    Parameters
    ----------
    vertices_m : ndarray, shape (V, 3)
        Places.
    triangles : ndarray of int, shape (T, 3)
        Vertex indices.
    color : ndarray, shape (T, 3)
        Red, green, blue, 0 to 255, before shading.
    """

    vertices_m: NDArray[np.float64]
    triangles: NDArray[np.intp]
    color: NDArray[np.float64]

    def moved(self, rotation: NDArray[np.float64], translation_m: NDArray[np.float64]) -> Solid:
        """Return the solid turned about the origin and then shifted."""
        return Solid(self.vertices_m @ rotation.T + translation_m, self.triangles, self.color)

    def shaded(self) -> NDArray[np.float64]:
        """Return the colour of each triangle under the lamps, shape (T, 3)."""
        a, b, c = (self.vertices_m[self.triangles[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        return self.color * brightness(normal)[:, None]


def brightness(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the share of its colour that a surface shows; both sides of a sheet look alike."""
    facing = np.where(normal[..., 2:] > 0, -normal, normal)
    cosine = np.einsum("...k,k->...", facing, TOWARDS_LIGHT)
    lit: NDArray[np.float64] = _AMBIENT + _DIFFUSE * np.maximum(cosine, 0.0)
    return lit


def merge(*solids: Solid) -> Solid:
    """Return one solid of several."""
    offsets = np.cumsum([0, *(len(solid.vertices_m) for solid in solids)])
    return Solid(
        np.concatenate([solid.vertices_m for solid in solids]),
        np.concatenate([solid.triangles + offset for solid, offset in zip(solids, offsets, strict=False)]),
        np.concatenate([solid.color for solid in solids]),
    )


_BOX_FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def box(low_m: tuple[float, float, float], high_m: tuple[float, float, float], color: tuple[int, int, int]) -> Solid:
    """Return an axis-parallel box."""
    ends = np.array([low_m, high_m])
    corners = np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    triangles = np.array([t for a, b, c, d in _BOX_FACES for t in ((a, b, c), (a, c, d))])
    return Solid(corners, triangles, np.tile(np.array(color, dtype=np.float64), (12, 1)))


def cylinder(
    start_m: tuple[float, float, float], end_m: tuple[float, float, float], radius_m: float, color: tuple[int, int, int]
) -> Solid:
    """Return the wall of a cylinder of 24 sides."""
    start, end = np.array(start_m), np.array(end_m)
    along = (end - start) / np.linalg.norm(end - start)
    side = np.cross(along, [1.0, 0.0, 0.0] if abs(along[0]) < 0.9 else [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    turn = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)[:, None]
    ring = radius_m * (np.cos(turn) * side + np.sin(turn) * np.cross(along, side))
    near, far = np.arange(24), np.arange(24, 48)
    triangles = np.concatenate(
        [np.stack([near, np.roll(near, -1), far], 1), np.stack([np.roll(near, -1), np.roll(far, -1), far], 1)]
    )
    color_rows = np.tile(np.array(color, dtype=np.float64), (48, 1))
    return Solid(np.concatenate([start + ring, end + ring]), triangles, color_rows)


def gripper() -> Solid:
    """Return gripper, wrist and forearm at rest, the gripper's end point in the origin; two fingers pinch the cloth."""
    steel, dark, blue = (150, 152, 158), (58, 60, 66), (36, 70, 140)
    return merge(
        box((-0.012, -0.11, -0.014), (0.012, 0.0, -0.006), dark),
        box((-0.012, -0.11, 0.006), (0.012, 0.0, 0.014), dark),
        box((-0.035, -0.17, -0.03), (0.035, -0.10, 0.03), steel),
        cylinder((0.0, -0.16, 0.0), (0.0, -0.45, 0.0), 0.045, blue),
    )


def ruler(width_m: float) -> Solid:
    """Return a ruler of beech, at rest in the gripper, behind the upper edge of a garment of `width_m`."""
    half = width_m / 2 + 0.02
    return box((-half, -0.03, 0.001), (half, 0.0, 0.004), (206, 178, 128))


def background() -> Solid:
    """Return the monochrome panel, the room around it and what else stands still in the picture."""
    return merge(
        box((-4.0, -3.0, 2.95), (4.0, 3.0, 3.0), (172, 166, 150)),
        box((-0.78, -1.2, WALL_M), (0.80, 0.98, WALL_M + 0.02), WALL_COLOR),
        box((0.92, -0.45, 2.1), (1.5, 1.4, 2.6), (120, 92, 66)),
        box((-1.7, 0.25, 2.2), (-0.95, 1.4, 2.7), (78, 92, 84)),
        box((-1.6, -0.9, 2.6), (-1.25, -0.2, 2.7), (196, 60, 48)),
        cylinder((1.05, -1.4, 2.0), (1.05, -0.5, 2.05), 0.07, (36, 70, 140)),
        # the hand of the arm that carries the camera, at the lower edge
        box((-0.22, 0.165, 0.50), (-0.13, 0.30, 0.54), (150, 152, 158)),
        box((-0.20, 0.135, 0.51), (-0.185, 0.17, 0.53), (58, 60, 66)),
    )
