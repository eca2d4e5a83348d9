"""How the robot's wrist swings: rest, over, a short stop, back, rest.

The recorder's trajectory starts at one end of the swing, -pi/16, goes to +pi/16, stops for a moment and returns the
same way, so that the whole way of the gripper is twice the swing of the file name. A single joint turns (thesis 3.2),
hence the gripper's end point moves on an arc about the wrist.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

WRIST_RADIUS_M = 0.47
REST_GRIPPER_M = (0.0, -0.35, 1.065)
"""Where the gripper rests in the depth optical frame for axis R: thesis 5.3.3 says 1.06 to 1.07 m before the camera."""

_RAMP_S = 0.6
_STOP_S = 0.15


@dataclass(frozen=True, slots=True)
class Swing:
    """The wrist's motion, in the depth camera's optical frame (x right, y down, z forward).

    Parameters
    ----------
    axis : {"R", "B"}
        R: along the optical axis, towards the camera and back. B: across it, to the left and back.
    swing_rad : float
        Amplitude: the wrist turns from -swing to +swing and back.
    speed_rad_s : float
        Angular speed of the wrist between its ramps.
    start_s : float
        When the motion begins.
    """

    axis: Literal["R", "B"]
    swing_rad: float
    speed_rad_s: float
    start_s: float = 1.5

    @property
    def rest_m(self) -> NDArray[np.float64]:
        """The gripper's end point before the motion, shape (3,), metres."""
        x_m, y_m, z_m = REST_GRIPPER_M
        across_m = WRIST_RADIUS_M * np.sin(self.swing_rad) if self.axis == "B" else 0.0
        return np.array([x_m + across_m, y_m, z_m])

    @property
    def wrist_m(self) -> NDArray[np.float64]:
        """The point about which the gripper turns, shape (3,), metres: above it."""
        lever = WRIST_RADIUS_M * np.array([np.sin(self.swing_rad), np.cos(self.swing_rad)])
        side = 2 if self.axis == "R" else 0
        wrist = self.rest_m
        wrist[side] -= lever[0]
        wrist[1] -= lever[1]
        return wrist

    @property
    def axis_vector(self) -> NDArray[np.float64]:
        """Unit vector about which positive angles turn, shape (3,): towards the camera, or to the left."""
        return np.array([-1.0, 0.0, 0.0]) if self.axis == "R" else np.array([0.0, 0.0, 1.0])

    @property
    def stroke_s(self) -> float:
        """Duration of one way."""
        return self._shape()[1]

    @property
    def end_s(self) -> float:
        """When the gripper is back at rest."""
        return self.start_s + 2 * self.stroke_s + _STOP_S

    def _shape(self) -> tuple[float, float]:
        """Return the cruising speed and the duration of one way; a short way never reaches the named speed."""
        way = 2 * self.swing_rad
        speed = min(self.speed_rad_s, way / _RAMP_S)
        return speed, way / speed + _RAMP_S

    def angle_rad(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the wrist's angle since rest, 0 to twice the swing, same shape as `time_s`."""
        elapsed = np.asarray(time_s, dtype=np.float64) - self.start_s
        back = elapsed - self.stroke_s - _STOP_S
        return self._stroke(elapsed)[0] - self._stroke(back)[0]

    def rate_rad_s(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the time derivative of :meth:`angle_rad`."""
        elapsed = np.asarray(time_s, dtype=np.float64) - self.start_s
        back = elapsed - self.stroke_s - _STOP_S
        return self._stroke(elapsed)[1] - self._stroke(back)[1]

    def _stroke(self, elapsed_s: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return angle and rate of one way whose speed ramps up and down as a raised cosine."""
        speed, duration = self._shape()

        def ramp(since_s: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            inside = np.clip(since_s, 0.0, _RAMP_S)
            phase = np.pi * inside / _RAMP_S
            angle = 0.5 * (inside - _RAMP_S / np.pi * np.sin(phase)) + np.maximum(since_s - _RAMP_S, 0.0)
            return speed * angle, speed * 0.5 * (1 - np.cos(phase))

        up, down = ramp(elapsed_s), ramp(elapsed_s - (duration - _RAMP_S))
        return up[0] - down[0], up[1] - down[1]

    def rotation(self, time_s: float) -> NDArray[np.float64]:
        """Return the rotation of the gripper since rest at `time_s`, shape (3, 3) (Rodrigues)."""
        angle = float(self.angle_rad(np.asarray(time_s)))
        x, y, z = self.axis_vector
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        rotation: NDArray[np.float64] = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
        return rotation

    def gripper_m(self, time_s: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Return the gripper's end point at each time, shape (..., 3), metres."""
        angle = np.asarray(self.angle_rad(np.asarray(time_s, dtype=np.float64)))[..., None]
        lever, axis = self.rest_m - self.wrist_m, self.axis_vector
        turned = np.cos(angle) * lever + np.sin(angle) * np.cross(axis, lever)  # the lever is perpendicular to the axis
        point: NDArray[np.float64] = self.wrist_m + turned
        return point

    def gripper_velocity_m_s(self, time_s: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Return the velocity of the gripper's end point at each time, shape (..., 3), m/s."""
        rate = np.asarray(self.rate_rad_s(np.asarray(time_s, dtype=np.float64)))[..., None]
        velocity: NDArray[np.float64] = np.cross(rate * self.axis_vector, self.gripper_m(time_s) - self.wrist_m)
        return velocity
