"""Noiseless frames: depth in millimetres, colour, and whose pixel each one is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.simulate import scene
from garment_dataset.simulate.camera_pose import LEVEL, CameraPose
from garment_dataset.simulate.nuisance_color import USUAL_COLOR, ColorNuisance
from garment_dataset.simulate.raster import Buffer, Pinhole, draw, interpolate
from garment_dataset.simulate.shadows import light_on_wall, uneven

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.simulate.motion import Swing

_FABRIC_PITCH_M = 0.0022


@dataclass(frozen=True)
class Fabric:
    """How a garment looks.

    Parameters
    ----------
    color : tuple of int
        Red, green, blue, 0 to 255.
    stripe_color : tuple of int, optional
        Of the stripes across the garment.
    stripe_m : float
        Width of a stripe.
    checked : bool
        Whether the stripes' colours alternate along them as well.
    weave : float
        Relative amplitude of the fabric's texture.
    """

    color: tuple[int, int, int]
    stripe_color: tuple[int, int, int] | None = None
    stripe_m: float = 0.03
    checked: bool = False
    weave: float = 0.05

    def at(self, material_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the colour at material points, shape (P, 2) to (P, 3)."""
        color = np.tile(np.array(self.color, dtype=np.float64), (len(material_m), 1))
        if self.stripe_color is not None:
            field = np.floor(material_m / self.stripe_m).astype(np.int64)
            odd = (field.sum(axis=1) if self.checked else field[:, 1]) % 2 == 1
            color[odd] = self.stripe_color
        wave = np.sin(2 * np.pi * material_m[:, 0] / (5 * _FABRIC_PITCH_M)) * np.sin(
            2 * np.pi * material_m[:, 1] / (7 * _FABRIC_PITCH_M)
        )
        return color * (1 + self.weave * wave)[:, None]


@dataclass(frozen=True)
class ColorFrame:
    """A noiseless colour image and its truth.

    Parameters
    ----------
    pixels : ndarray of float32, shape (H, W, 3)
        Red, green, blue, 0 to 255.
    garment, gripper : ndarray of bool, shape (H, W)
        Pixels that show the garment; the gripper, the arm or the ruler.
    """

    pixels: NDArray[np.float32]
    garment: NDArray[np.bool_]
    gripper: NDArray[np.bool_]


class Stage:
    """The scene of one recording, to be seen at any time.

    Parameters
    ----------
    swing : Swing, optional
        The gripper's motion; without one, the arm is out of view.
    fabric : Fabric, optional
        The garment's looks; None without a garment.
    triangles : ndarray of int, shape (T, 3), optional
        The garment's fine mesh.
    material_m : ndarray, shape (V, 2), optional
        Material coordinates of its vertices.
    ruler : Solid, optional
        The ruler that the garment hangs on, as it lies in the gripper.
    pose : CameraPose
        How the cameras look at it.
    nuisance : ColorNuisance
        What is unusual about room and light.
    """

    def __init__(
        self,
        swing: Swing | None = None,
        fabric: Fabric | None = None,
        triangles: NDArray[np.intp] | None = None,
        material_m: NDArray[np.float64] | None = None,
        ruler: scene.Solid | None = None,
        pose: CameraPose = LEVEL,
        nuisance: ColorNuisance = USUAL_COLOR,
    ) -> None:
        self._lamps = nuisance.lamps
        self._swing, self._fabric, self._pose = swing, fabric, pose
        self._triangles, self._material_m = triangles, material_m
        self._gripper = scene.gripper() if ruler is None else scene.merge(scene.gripper(), ruler)
        level = scene.background()
        room = pose.see_solid(level)
        self._room_depth = _draw_solid(Buffer.empty(), room, scene.DEPTH_CAMERA)
        self._room_color = _draw_solid(Buffer.empty(), room, scene.COLOR_CAMERA)
        self._room_pixels = room.shaded().astype(np.float32)[self._room_color.triangle]
        middle_m = level.vertices_m[level.triangles].mean(axis=1)[:, 2]
        self._on_wall = np.isclose(middle_m, scene.WALL_M)[self._room_color.triangle]
        if nuisance.wall is not None:
            self._room_pixels[self._on_wall] *= uneven(nuisance.wall)[self._on_wall]

    def gripper_at(self, time_s: float) -> scene.Solid | None:
        """Return gripper and arm as the cameras see them at `time_s`."""
        if self._swing is None:
            return None
        return self._pose.see_solid(self._gripper.moved(self._swing.rotation(time_s), self._swing.gripper_m(time_s)))

    def depth_m(self, time_s: float, cloth_m: NDArray[np.float64] | None) -> NDArray[np.float64]:
        """Return the depth image, shape (H, W), metres along the optical axis.

        Parameters
        ----------
        time_s : float
            When.
        cloth_m : ndarray, shape (V, 3), optional
            Vertices of the garment's fine mesh at that time, as the cameras see them.
        """
        buffer = self._room_depth
        solid = self.gripper_at(time_s)
        if solid is not None:
            buffer = _draw_solid(buffer.under(), solid, scene.DEPTH_CAMERA)
        if cloth_m is not None and self._triangles is not None:
            buffer = buffer.under()
            draw(buffer, scene.DEPTH_CAMERA.project(cloth_m), self._triangles)
        depth: NDArray[np.float64] = 1.0 / buffer.inverse_depth
        return depth

    def color(self, time_s: float, cloth_m: NDArray[np.float64] | None) -> ColorFrame:
        """Return the colour image with its masks; arguments as for :meth:`depth_m`."""
        pixels = self._room_pixels.copy()
        garment = np.zeros(pixels.shape[:2], dtype=np.bool_)
        gripper = np.zeros_like(garment)
        buffer = self._room_color
        solid = self.gripper_at(time_s)
        if self._lamps is not None and solid is not None:
            casting = [(self._pose.level(solid.vertices_m), solid.triangles)]
            if cloth_m is not None and self._triangles is not None:
                casting.append((self._pose.level(cloth_m), self._triangles))
            pixels[self._on_wall] *= light_on_wall(self._lamps, casting, self._pose)[self._on_wall]
        if solid is not None:
            buffer = _draw_solid(buffer.under(), solid, scene.COLOR_CAMERA)
            gripper = buffer.triangle >= 0
            pixels[gripper] = solid.shaded()[buffer.triangle[gripper]]
        if cloth_m is not None and self._triangles is not None:
            buffer = buffer.under()
            self._paint(buffer, cloth_m, pixels)
            garment = buffer.triangle >= 0
            gripper &= ~garment
        return ColorFrame(pixels, garment, gripper)

    def _paint(self, buffer: Buffer, cloth_m: NDArray[np.float64], pixels: NDArray[np.float32]) -> None:
        assert self._triangles is not None
        assert self._material_m is not None
        assert self._fabric is not None
        image = scene.COLOR_CAMERA.project(cloth_m)
        draw(buffer, image, self._triangles)
        normal = vertex_normals(cloth_m, self._triangles)
        values = np.column_stack([self._material_m, normal])
        row, column, seen = interpolate(buffer, image, self._triangles, values)
        across = seen[:, 2:] / np.maximum(np.linalg.norm(seen[:, 2:], axis=1, keepdims=True), 1e-9)
        pixels[row, column] = self._fabric.at(seen[:, :2]) * scene.brightness(across)[:, None]


def vertex_normals(vertices_m: NDArray[np.float64], triangles: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return area-weighted unit normals, shape (V, 3)."""
    a, b, c = (vertices_m[triangles[:, k]] for k in range(3))
    face = np.cross(b - a, c - a)
    normal = np.empty_like(vertices_m)
    corners = triangles.ravel()
    for k in range(3):
        normal[:, k] = np.bincount(corners, np.repeat(face[:, k], 3), minlength=len(vertices_m))
    unit: NDArray[np.float64] = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return unit


def _draw_solid(buffer: Buffer, solid: scene.Solid, camera: Pinhole) -> Buffer:
    draw(buffer, camera.project(solid.vertices_m), solid.triangles)
    return buffer


def as_millimetres(depth_m: NDArray[np.float64]) -> NDArray[np.uint16]:
    """Return depth as 16UC1 demands: whole millimetres."""
    return np.rint(depth_m * 1000.0).astype(np.uint16)
