"""The truth beside a recording: where the points are, how fast they move, whose the pixels are.

Two lines are followed down from the gripper. The *surface line* is what a depth camera can see: the garment's visible
surface in the vertical plane x = x_gripper, from the gripper's end point down, its points in the middles of equally
long segments (thesis 5.3.4). The *material line* is fixed to the cloth: a cloth model's centre line.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from garment_dataset.simulate.camera_pose import LEVEL, CameraPose
from garment_dataset.simulate.hem import HemShape
from garment_dataset.simulate.raster import HEIGHT_PX, WIDTH_PX
from garment_dataset.simulate.scene import COLOR_CAMERA, DEPTH_CAMERA
from garment_dataset.simulate.subdivide import Blend, locate, subdivide

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.simulate.cloth import ClothMesh
    from garment_dataset.simulate.hem import Hem
    from garment_dataset.simulate.motion import Swing
    from garment_dataset.simulate.physics import Trajectory
    from garment_dataset.simulate.render import ColorFrame

POINTS = 5
_LINE_NODES = 65
_RAY_STEP_PX = 0.25
_DIFFERENCE_S = 0.002


@dataclass(frozen=True)
class Polyline:
    """Points along a line from the gripper down.

    Parameters
    ----------
    nodes_m : ndarray, shape (N, 3)
        In the depth optical frame.
    """

    nodes_m: NDArray[np.float64]

    @property
    def arc_m(self) -> NDArray[np.float64]:
        """Arc length from the first node, shape (N,)."""
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.nodes_m, axis=0), axis=1))])

    def at(self, arc_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the points at given arc lengths, shape (P, 3)."""
        own = self.arc_m
        return np.stack([np.interp(arc_m, own, self.nodes_m[:, k]) for k in range(3)], axis=1)

    def middles(self, count: int) -> NDArray[np.float64]:
        """Return the points in the middles of `count` equally long segments, shape (count, 3)."""
        return self.at((np.arange(count) + 0.5) / count * self.arc_m[-1])


class GarmentView:
    """The garment's smooth surface over time, and the lines on it.

    Parameters
    ----------
    mesh : ClothMesh
        What was simulated.
    trajectory : Trajectory
        How it moved.
    swing : Swing
        How the gripper moved.
    levels : int
        Subdivisions from the simulated to the visible mesh.
    pose : CameraPose
        How the cameras look at it: everything is in the frame of the depth camera.
    hem : Hem, optional
        How its hem leaves the sheet that was simulated; by default not at all.
    """

    def __init__(
        self,
        mesh: ClothMesh,
        trajectory: Trajectory,
        swing: Swing,
        levels: int,
        pose: CameraPose = LEVEL,
        hem: Hem | None = None,
    ) -> None:
        self._trajectory, self._swing, self._pose = trajectory, swing, pose
        gripped = int(np.argmin(np.linalg.norm(mesh.material_m - mesh.hold_m, axis=1)))
        matrix, self.triangles = subdivide(mesh.material_m, mesh.triangles, levels, gripped)
        self._surface = Blend.of(matrix)
        self.material_m = self._surface.apply(mesh.material_m)
        share = np.linspace(0.0, 1.0, _LINE_NODES)[:, None]
        on_line = mesh.hold_m + share * (mesh.end_m - mesh.hold_m)
        self._line = Blend.of(locate(on_line, self.material_m, self.triangles))
        to_hem = self._surface.apply(mesh.to_hem_m[:, None])[:, 0]
        self._hem = None if hem is None else HemShape(self.material_m, self.triangles, to_hem, hem)

    def surface_m(self, time_s: float) -> NDArray[np.float64]:
        """Return the vertices of the visible mesh, shape (V, 3)."""
        surface = self._surface.apply(self._trajectory.at(time_s)[0])
        return self._pose.see(surface if self._hem is None else self._hem.place(surface))

    def gripper_m(self, time_s: float) -> NDArray[np.float64]:
        """Return the gripper's end point, shape (3,)."""
        return self._pose.see(self._swing.gripper_m(time_s))

    def gripper_velocity_m_s(self, time_s: float) -> NDArray[np.float64]:
        """Return its velocity, shape (3,)."""
        return self._pose.turn(self._swing.gripper_velocity_m_s(time_s))

    def surface_state(self, time_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the vertices of the visible mesh and their velocities, each (V, 3)."""
        surface, velocity = (self._surface.apply(values) for values in self._trajectory.at(time_s))
        if self._hem is None:
            return surface, velocity
        return self._hem.place(surface), self._hem.place_velocity(surface, velocity)

    def material_line(self, time_s: float) -> tuple[Polyline, NDArray[np.float64]]:
        """Return the material line and the velocities of its nodes, shape (65, 3)."""
        surface, velocity = self.surface_state(time_s)
        return Polyline(self._pose.see(self._line.apply(surface))), self._pose.turn(self._line.apply(velocity))

    def surface_line(self, time_s: float) -> Polyline | None:
        """Return the visible profile below the gripper; None when no cloth is there."""
        return visible_profile(self.surface_m(time_s), self.triangles, self.gripper_m(time_s))

    def surface_points(self, time_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Return the points of the surface line, their velocities, each (r, 3), and the line's length; NaN without one.

        The velocity is that of the point of constant share of the length, by central differences over +-2 ms.
        """
        lines = [self.surface_line(time_s + shift) for shift in (-_DIFFERENCE_S, 0.0, _DIFFERENCE_S)]
        if any(line is None for line in lines):
            nothing = np.full((POINTS, 3), np.nan)
            return nothing, nothing, float("nan")
        before, now, after = (line for line in lines if line is not None)
        velocity = (after.middles(POINTS) - before.middles(POINTS)) / (2 * _DIFFERENCE_S)
        return now.middles(POINTS), velocity, float(now.arc_m[-1])

    def material_points(self, time_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Return the points at fixed shares of the material line, their velocities, each (r, 3), and its length now."""
        line, velocity = self.material_line(time_s)
        share = np.linspace(0.0, 1.0, _LINE_NODES)
        wanted = (np.arange(POINTS) + 0.5) / POINTS
        points, speeds = (
            np.stack([np.interp(wanted, share, values[:, k]) for k in range(3)], axis=1)
            for values in (line.nodes_m, velocity)
        )
        return points, speeds, float(line.arc_m[-1])


def visible_profile(
    surface_m: NDArray[np.float64], triangles: NDArray[np.intp], gripper_m: NDArray[np.float64]
) -> Polyline | None:
    """Return what a depth camera sees of a surface in the plane x = x_gripper, from the gripper down.

    Parameters
    ----------
    surface_m : ndarray, shape (V, 3)
        Vertices.
    triangles : ndarray of int, shape (T, 3)
        The mesh.
    gripper_m : ndarray, shape (3,)
        The gripper's end point, where the line begins.

    Returns
    -------
    Polyline or None
        None when the plane meets no cloth below the gripper.

    Notes
    -----
    The mesh cuts the plane in segments. Projected to v and inverse depth they stay straight, so the nearest one along
    each ray (every quarter of a pixel) is found exactly. Where a fold hides what is behind it, the line jumps as the
    depth image does, and the jump counts as length.
    """
    segments = _cut(surface_m, triangles, float(gripper_m[0]))
    if len(segments) == 0:
        return None
    inverse = 1.0 / segments[..., 1]
    height = segments[..., 0] * inverse * DEPTH_CAMERA.focal_px
    low, high = float(height.min()), float(height.max())
    between = np.arange(np.ceil(low / _RAY_STEP_PX), np.floor(high / _RAY_STEP_PX) + 1) * _RAY_STEP_PX
    rays = np.concatenate([[low], between[(between > low) & (between < high)], [high]])
    nearest = _nearest(rays, height, inverse)
    z = 1.0 / nearest[nearest > 0]
    y = rays[nearest > 0] / DEPTH_CAMERA.focal_px * z
    below = np.flatnonzero(y > gripper_m[1])
    if len(below) == 0:
        return None
    # both ends are where they are, not at the nearest ray: a quarter of a pixel would shake the line's length
    start = below[0] - 1 if below[0] > 0 else below[0]
    y, z = y[start:], z[start:]
    if y[0] < gripper_m[1]:
        z[0] += (gripper_m[1] - y[0]) / (y[1] - y[0]) * (z[1] - z[0])
        y[0] = gripper_m[1]
    nodes = np.column_stack([np.full(len(y), gripper_m[0]), y, z])
    return Polyline(np.vstack([gripper_m, nodes]))


def _cut(surface_m: NDArray[np.float64], triangles: NDArray[np.intp], x_m: float) -> NDArray[np.float64]:
    """Return the segments in which triangles cut the plane x = `x_m`, shape (S, 2, 2): their ends' y and z."""
    # a vertex exactly in the plane would be cut twice or not at all
    offset = surface_m[:, 0] - x_m
    offset = np.where(offset == 0.0, 1e-12, offset)
    side = offset[triangles] > 0
    crossed = triangles[side.any(axis=1) & ~side.all(axis=1)]
    side = offset[crossed] > 0
    alone = np.where(side.sum(axis=1) == 1, np.argmax(side, axis=1), np.argmin(side, axis=1))
    rows = np.arange(len(crossed))
    apex = crossed[rows, alone]
    ends = []
    for step in (1, 2):
        other = crossed[rows, (alone + step) % 3]
        share = offset[apex] / (offset[apex] - offset[other])
        ends.append(surface_m[apex, 1:] + share[:, None] * (surface_m[other, 1:] - surface_m[apex, 1:]))
    return np.stack(ends, axis=1)


def _nearest(
    rays: NDArray[np.float64], height: NDArray[np.float64], inverse: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the largest inverse depth of any segment along each ray; 0 where there is none."""
    nearest = np.zeros(len(rays))
    order = np.argsort(height, axis=1)
    low, high = np.take_along_axis(height, order, axis=1).T
    low_inverse, high_inverse = np.take_along_axis(inverse, order, axis=1).T
    start = np.searchsorted(rays, low, side="left")
    count = np.searchsorted(rays, high, side="right") - start
    segment = np.repeat(np.arange(len(height)), count)
    place = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count) + start[segment]
    span = np.maximum(high - low, 1e-12)[segment]
    share = (rays[place] - low[segment]) / span
    np.maximum.at(nearest, place, low_inverse[segment] + share * (high_inverse - low_inverse)[segment])
    return nearest


def in_image(points_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points the depth image holds, shape (P,)."""
    u, v, _ = np.moveaxis(DEPTH_CAMERA.project(points_m), -1, 0)
    inside: NDArray[np.bool_] = (u >= 0) & (u <= WIDTH_PX - 1) & (v >= 0) & (v <= HEIGHT_PX - 1)
    return inside


def mask_axes(mask: NDArray[np.bool_]) -> dict[str, float]:
    """Return centroid, axes and orientation of a region, as MATLAB's ``regionprops`` defines them.

    Eigenvalues of the covariance of pixel areas (each a unit square, hence 1/12 more variance); full axes are four
    times their square roots; the orientation is counter-clockwise, in radians. NaN for an empty region.
    """
    v, u = np.nonzero(mask)
    names = ("centroid_u_px", "centroid_v_px", "major_px", "minor_px", "orientation_rad")
    if len(u) == 0:
        return dict.fromkeys(names, float("nan"))
    covariance = np.cov(np.stack([u, v]), bias=True) + np.eye(2) / 12
    values, vectors = np.linalg.eigh(covariance)
    along_u, along_v = vectors[:, 1]
    orientation = float(np.arctan2(-along_v, along_u))
    orientation -= np.pi * np.ceil(orientation / np.pi - 0.5)
    found = (u.mean(), v.mean(), 4 * np.sqrt(values[1]), 4 * np.sqrt(values[0]), orientation)
    return {name: float(value) for name, value in zip(names, found, strict=True)}


def below_gripper(frame: ColorFrame, gripper_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the garment's mask below the gripper's end point, shape (H, W)."""
    mask = frame.garment.copy()
    mask[: int(np.ceil(COLOR_CAMERA.project(gripper_m)[1]))] = False
    return mask


def as_png(mask: NDArray[np.bool_]) -> bytes:
    """Return a mask as a PNG of one bit per pixel."""
    done, data = cv2.imencode(".png", mask.view(np.uint8) * np.uint8(255), [cv2.IMWRITE_PNG_BILEVEL, 1])
    assert done
    return data.tobytes()
