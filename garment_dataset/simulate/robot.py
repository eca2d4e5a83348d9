"""The robot's transforms: a chain of links whose one moving joint carries the gripper along its arc.

Two arms stand on a turntable; arm r1 carries the camera, arm r2 the gripper. The angles are those of the recorder's
measuring position; the links before and behind the moving joint are placed so that the gripper's end point lies where
the scene has it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.simulate.camera_pose import LEVEL, CameraPose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.simulate.motion import Swing

JOINTS = (
    "ext_axis",
    *(f"r1_joint_{letter}" for letter in "slurbt"),
    *(f"r2_joint_{letter}" for letter in "slurbt"),
)
_CAMERA_ARM_RAD = (0.21, -0.7854, 0.0, -1.4235, 1.7672, 2.9452, 0.7854)
_MEASURING_RAD = (*_CAMERA_ARM_RAD, -0.1817, 0.7407, 1.1124, -0.2807, -0.4054, 0.2945)
_AWAY_RAD = (*_CAMERA_ARM_RAD, -1.5, 0.2, 0.3, 0.0, -0.2, 0.0)
_MOVING = {"R": "r2_joint_r", "B": "r2_joint_b"}

# axis of rotation and offset from the link before, metres
_ARM = (
    ("s", "z", (0.0, 0.9, 0.3)),
    ("l", "y", (0.15, 0.0, 0.45)),
    ("u", "y", (0.0, 0.0, 0.614)),
    ("r", "x", (0.2, 0.0, 0.2)),
    ("b", "y", (0.44, 0.0, 0.0)),
    ("t", "x", (0.17, 0.0, 0.0)),
)
_CAMERA_FROM_FLANGE_M = (0.0, -0.12, 0.05)
_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Optical axes (x right, y down, z forward) in the camera body's (x forward, y left, z up)."""


@dataclass(frozen=True, slots=True)
class Link:
    """One transform of the tree.

    Parameters
    ----------
    parent, child : str
        Frame ids.
    matrix : ndarray, shape (4, 4)
        Pose of the child in the parent.
    """

    parent: str
    child: str
    matrix: NDArray[np.float64]

    @property
    def translation_m(self) -> tuple[float, float, float]:
        """Place of the child."""
        x, y, z = self.matrix[:3, 3].tolist()
        return x, y, z

    @property
    def quaternion_xyzw(self) -> tuple[float, float, float, float]:
        """Orientation of the child, unit quaternion."""
        return quaternion_xyzw(self.matrix[:3, :3])


def quaternion_xyzw(rotation: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Return the unit quaternion x, y, z, w of a rotation matrix (Shepperd's method)."""
    trace = np.trace(rotation)
    squares = np.array([*(2 * np.diag(rotation) - trace), trace])
    largest = int(np.argmax(squares))
    q = np.empty(4)
    if largest == 3:
        q[3] = 1 + trace
        q[:3] = rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        q[i] = 1 + rotation[i, i] - rotation[j, j] - rotation[k, k]
        q[j], q[k] = rotation[j, i] + rotation[i, j], rotation[k, i] + rotation[i, k]
        q[3] = rotation[k, j] - rotation[j, k]
    x, y, z, w = (q / np.linalg.norm(q)).tolist()
    return x, y, z, w


def _turn(axis: str, angle_rad: float) -> NDArray[np.float64]:
    first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(4)
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    matrix[first, first] = matrix[second, second] = cos
    matrix[second, first], matrix[first, second] = sin, -sin
    return matrix


def _pose(rotation: NDArray[np.float64], translation_m: NDArray[np.float64]) -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation_m
    return matrix


class Robot:
    """The robot of one recording.

    Parameters
    ----------
    swing : Swing, optional
        The gripper's motion; without one, arm r2 stands aside.
    pose : CameraPose
        How the cameras look at it.
    error_m : (x, y, z)
        By how much the transforms misplace the camera against the gripper: what they say of the gripper in the depth
        camera's frame is off by that.
    """

    def __init__(
        self, swing: Swing | None, pose: CameraPose = LEVEL, error_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> None:
        self._swing = swing
        self._rest_rad = np.array(_MEASURING_RAD if swing is not None else _AWAY_RAD)
        flange = self._chain_to("r1_link_t", [link for link in self._arms(0.0) if link.child.startswith(("ext", "r1"))])
        # looks along the turntable's -y, towards arm r2, and stands upright
        body = _turn("z", -np.pi / 2)
        body[:3, 3] = flange[:3, 3] + _CAMERA_FROM_FLANGE_M
        body_to_depth = _pose(np.eye(3), np.array([0.0, -0.02, 0.0]))
        self._base_optical = body @ body_to_depth @ _pose(_OPTICAL, np.zeros(3))
        if pose.tilt_rad is not None or any(error_m):
            optical = self._base_optical @ np.linalg.inv(pose.matrix) @ _pose(np.eye(3), -np.array(error_m))
            body = optical @ np.linalg.inv(body_to_depth @ _pose(_OPTICAL, np.zeros(3)))
        self.fixed = (
            Link("r1_link_t", "xtion1_link", np.linalg.inv(flange) @ body),
            Link("xtion1_link", "xtion1_depth_frame", body_to_depth),
            Link("xtion1_depth_frame", "xtion1_depth_optical_frame", _pose(_OPTICAL, np.zeros(3))),
            Link("xtion1_link", "xtion1_rgb_frame", _pose(np.eye(3), np.array([0.0, -0.045, 0.0]))),
            Link("xtion1_rgb_frame", "xtion1_rgb_optical_frame", _pose(_OPTICAL, np.zeros(3))),
        )
        """Transforms that never change."""
        self._placed = self._place_arm()

    def joints_rad(self, time_s: float) -> NDArray[np.float64]:
        """Return the angles of :data:`JOINTS`, shape (13,), radians."""
        angles = self._rest_rad.copy()
        if self._swing is not None:
            angles[JOINTS.index(_MOVING[self._swing.axis])] += float(self._swing.angle_rad(np.asarray(time_s)))
        return angles

    def links(self, time_s: float) -> list[Link]:
        """Return the transforms of both arms, from the base to the gripper, as they stand at `time_s`."""
        links = self._arms(time_s)
        if self._swing is None:
            return [*links, Link("r2_link_t", "r2_ee", _pose(np.eye(3), np.array([0.229, 0.0, 0.011])))]
        moving = f"r2_link_{self._swing.axis.lower()}"
        turned = _turn("x" if self._swing.axis == "R" else "y", float(self._swing.angle_rad(np.asarray(time_s))))
        placed = [
            Link(link.parent, link.child, self._placed[link.child] @ turned) if link.child == moving else link
            for link in links
        ]
        return [*placed, Link("r2_link_t", "r2_ee", self._placed["r2_ee"])]

    def _arms(self, time_s: float) -> list[Link]:
        """Return the transforms of table and arms by their joint angles alone."""
        angles = dict(zip(JOINTS, self.joints_rad(time_s), strict=True))
        table = _turn("z", angles["ext_axis"])
        table[:3, 3] = 0.0, 0.0, 0.7
        links = [Link("base_link", "ext_axis_link", table)]
        for arm, side in (("r1", 1.0), ("r2", -1.0)):
            parent = "ext_axis_link"
            for letter, axis, (x, y, z) in _ARM:
                matrix = _turn(axis, angles[f"{arm}_joint_{letter}"])
                matrix[:3, 3] = x, side * y, z
                links.append(Link(parent, f"{arm}_link_{letter}", matrix))
                parent = f"{arm}_link_{letter}"
        return links

    def _place_arm(self) -> dict[str, NDArray[np.float64]]:
        """Return the poses at rest of the moving link and of the gripper, each in its parent."""
        if self._swing is None:
            return {}
        axis = self._swing.axis_vector
        other = np.array([0.0, -1.0, 0.0])
        third = np.cross(axis, other)
        columns = (axis, other, third) if self._swing.axis == "R" else (other, axis, -third)
        wrist = self._base_optical @ _pose(np.stack(columns, axis=1), self._swing.wrist_m)
        gripper = self._base_optical @ _pose(np.eye(3), self._swing.rest_m)
        links = self._arms(0.0)
        moving = f"r2_link_{self._swing.axis.lower()}"
        parent = next(link.parent for link in links if link.child == moving)
        held = np.linalg.inv(self._chain_to(parent, links)) @ wrist
        at_rest = [Link(link.parent, link.child, held) if link.child == moving else link for link in links]
        return {moving: held, "r2_ee": np.linalg.inv(self._chain_to("r2_link_t", at_rest)) @ gripper}

    @staticmethod
    def _chain_to(frame: str, links: list[Link]) -> NDArray[np.float64]:
        """Return the pose of a frame in the base."""
        above = {link.child: link for link in links}
        matrix = np.eye(4)
        while frame != "base_link":
            matrix = above[frame].matrix @ matrix
            frame = above[frame].parent
        return matrix
