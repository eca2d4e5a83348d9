"""Noiseless frames: depth in millimetres, colour, and whose pixel each one is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.simulate import scene
from garment_dataset.simulate.camera_pose import LEVEL, CameraPose
from garment_dataset.simulate.nuisance_color import USUAL_COLOR, ColorNuisance
from garment_dataset.simulate.raster import HEIGHT_PX, WIDTH_PX, Buffer, Pinhole, draw, interpolate
from garment_dataset.simulate.shadows import light_on_wall, uneven
from garment_dataset.simulate.sheet import facing, shell_m, shell_triangles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from garment_dataset.simulate.motion import Swing

    _Body = tuple[NDArray[np.float64], NDArray[np.float64]]

_FABRIC_PITCH_M = 0.0022

SAMPLES = ((0.0, 0.0), (-0.4, -0.2), (-0.2, 0.4), (0.2, -0.4), (0.4, 0.2))
"""Where a pixel is looked at, u and v from its centre: five columns and five rows, so that thin upright or level parts
count by their width. As they are odd in number, more than half of them is half of the pixel without a bias."""

_SAMPLE_CAMERAS = tuple(
    replace(scene.COLOR_CAMERA, cx_px=scene.COLOR_CAMERA.cx_px - u, cy_px=scene.COLOR_CAMERA.cy_px - v)
    for u, v in SAMPLES
)


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
        Pixels of which at least half show the garment; the gripper, the arm or the ruler.
    """

    pixels: NDArray[np.float32]
    garment: NDArray[np.bool_]
    gripper: NDArray[np.bool_]


class Stage:
    """The scene of one recording, to be seen at any time.

    A pixel of a colour image is the mean over :data:`SAMPLES` within it; the garment's colour is taken at one of them.

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
    thick_m : float
        How thick the garment is in colour images; depth images show a sheet without thickness.
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
        thick_m: float = 0.002,
    ) -> None:
        self._lamps = nuisance.lamps
        self._swing, self._fabric, self._pose = swing, fabric, pose
        self._triangles, self._thick_m = triangles, thick_m
        if triangles is not None and material_m is not None:
            self._shell, self._material_m = shell_triangles(triangles, len(material_m)), material_m
        self._gripper = scene.gripper() if ruler is None else scene.merge(scene.gripper(), ruler)
        level = scene.background()
        room = pose.see_solid(level)
        self._room_depth = _draw_solid(Buffer.empty(), room, scene.DEPTH_CAMERA)
        self._rooms = [_draw_solid(Buffer.empty(), room, camera) for camera in _SAMPLE_CAMERAS]
        middle_m = level.vertices_m[level.triangles].mean(axis=1)[:, 2]
        on_wall = np.isclose(middle_m, scene.WALL_M)
        shaded = room.shaded()
        self._wall_pixels = _room_share(self._rooms, shaded * on_wall[:, None])
        self._other_pixels = _room_share(self._rooms, shaded * ~on_wall[:, None])
        if nuisance.wall is not None:
            self._wall_pixels *= uneven(nuisance.wall)

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
        solid = self.gripper_at(time_s)
        pixels = self._wall_pixels.copy()
        if self._lamps is not None and solid is not None:
            casting = [(self._pose.level(solid.vertices_m), solid.triangles)]
            if cloth_m is not None and self._triangles is not None:
                casting.append((self._pose.level(cloth_m), self._triangles))
            pixels *= light_on_wall(self._lamps, casting, self._pose)
        pixels += self._other_pixels
        before = _Foreground()
        body = None if cloth_m is None or self._triangles is None else self._body(cloth_m, self._triangles)
        for room, camera in zip(self._rooms, _SAMPLE_CAMERAS, strict=True):
            buffer = room
            if solid is not None:
                buffer = _draw_solid(buffer.under(), solid, camera)
            front = None if body is None else self._draw_garment(buffer.under(), body, camera, before)
            if solid is not None:
                before.add_gripper(buffer, front, solid)
        return before.over(pixels)

    def _body(self, cloth_m: NDArray[np.float64], triangles: NDArray[np.intp]) -> _Body:
        """Return the garment as a body, and what its colours follow from: material coordinates and normals."""
        normal = vertex_normals(cloth_m, triangles)
        values = np.tile(np.column_stack([self._material_m, normal]), (2, 1))
        return shell_m(cloth_m, normal, self._thick_m), values

    def _draw_garment(self, buffer: Buffer, body: _Body, camera: Pinhole, before: _Foreground) -> Buffer:
        """Draw the garment as one sample sees it; its colour where no sample before showed it."""
        assert self._fabric is not None
        image = camera.project(body[0])
        triangles = self._shell[facing(image, self._shell)]
        draw(buffer, image, triangles)
        fresh = Buffer(buffer.inverse_depth, np.where(before.garment_count > 0, -1, buffer.triangle))
        row, column, seen = interpolate(fresh, image, triangles, body[1])
        across = seen[:, 2:] / np.maximum(np.linalg.norm(seen[:, 2:], axis=1, keepdims=True), 1e-9)
        before.garment[row, column] = self._fabric.at(seen[:, :2]) * scene.brightness(across)[:, None]
        before.garment_count += buffer.triangle >= 0
        return buffer


class _Foreground:
    """What is before the room, by sample."""

    def __init__(self) -> None:
        shape = (HEIGHT_PX, WIDTH_PX)
        self.garment, self._gripper = (np.zeros((*shape, 3), np.float32) for _ in range(2))
        self.garment_count, self._gripper_count = (np.zeros(shape, np.uint8) for _ in range(2))

    def add_gripper(self, buffer: Buffer, front: Buffer | None, solid: scene.Solid) -> None:
        """Add what one sample shows of the gripper, where no garment is in front of it."""
        seen = buffer.triangle >= 0
        if front is not None:
            seen &= front.triangle < 0
        self._gripper[seen] += solid.shaded()[buffer.triangle[seen]]
        self._gripper_count += seen

    def over(self, pixels: NDArray[np.float32]) -> ColorFrame:
        """Return the image of it all before a room's `pixels`."""
        samples = len(SAMPLES)
        free = samples - self._gripper_count - self.garment_count
        mixed = pixels * free[..., None] + self._gripper + self.garment * self.garment_count[..., None]
        mixed /= samples
        return ColorFrame(mixed, self.garment_count * 2 > samples, self._gripper_count * 2 > samples)


def _room_share(rooms: Sequence[Buffer], colors: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the mean over the samples of the triangles' colours, (H, W, 3)."""
    table = colors.astype(np.float32)
    return np.asarray(sum(table[room.triangle] for room in rooms) / np.float32(len(rooms)), np.float32)


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
