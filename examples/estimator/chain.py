"""A chain of r rigid links that hangs from a gripper and swings in one plane: gravity, bending, damping, air."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from examples.estimator.recording import Recording

    FloatArray = NDArray[np.float64]

PARAMETERS = ("bending, 1/s²", "damping, 1/s", "drag, 1/s", "drag, 1/m")
"""All per mass: stiffness and damping of the joints, drag with the speed across the links and with its square."""

STEPS = 3
"""Steps of the integration between two frames."""


def simulate(recording: Recording, logarithms: FloatArray) -> FloatArray:
    """Return the displacements of the points for several sets of parameters.

    Parameters
    ----------
    recording : Recording
        Whose gripper drives the chain, and whose gravity pulls it.
    logarithms : (B, 4) float64
        Natural logarithms of :data:`PARAMETERS`.

    Returns
    -------
    (B, T, r, 2) float64
        Along y and z, in metres.
    """
    stiffness, damping, linear, square = np.exp(logarithms).T[:, :, None]
    driven = np.column_stack([recording.gripper_m_s2, recording.gripper_m_s, recording.gripper_pitch_rad])
    links = Links(recording.count, recording.segment_m, stiffness, damping, linear, square)
    return recording.gripper_m[:, None] + swing(links, np.diff(recording.time_s), driven, recording.gravity_m_s2, STEPS)


@dataclass(frozen=True, eq=False)
class Links:
    """r links, and B sets of what they are like, each (B, 1) or, of the drag with the speed itself, (B, r).

    Parameters
    ----------
    count : int
        r.
    length_m : float
        Of each.
    stiffness, damping : (B, 1) float64
        Of the joints, per mass, 1/s² and 1/s.
    linear, square : (B, 1) or (B, r) float64
        Drag across the links with the speed, 1/s, and with its square, 1/m.
    """

    count: int
    length_m: float
    stiffness: FloatArray
    damping: FloatArray
    linear: FloatArray
    square: FloatArray


def swing(links: Links, frames_s: FloatArray, driven: FloatArray, gravity_m_s2: FloatArray, steps: int) -> FloatArray:
    r"""Return how far the points go below the gripper from where they hang, (B, T, r, 2), along y and z.

    Parameters
    ----------
    links : Links
        The chain.
    frames_s : (T - 1,) float64
        Between frames.
    driven : (T, 5) float64
        Acceleration and velocity of the gripper, each along y and z, and its pitch.
    gravity_m_s2 : (2,) float64
        Gravity.
    steps : int
        Of the integration between two frames.

    Notes
    -----
    With the angles :math:`\varphi` of the links from the vertical and :math:`I_{ij}` the products of their levers,
    :math:`\sum_j I_{ij} (\cos(\varphi_i - \varphi_j) \ddot\varphi_j + \sin(\varphi_i - \varphi_j) \dot\varphi_j^2)`
    is the moment of gravity, of the gripper's acceleration, of air and of the joints, all per mass. The first joint is
    between gripper and first link: it bends as the gripper turns.
    """
    count, length_m = links.count, links.length_m
    lever_m = length_m * (np.tri(count, k=-1) + np.eye(count) / 2)  # of each point, by link
    inertia = lever_m.T @ lever_m + np.eye(count) * length_m**2 / 12
    turn = np.eye(count) - np.eye(count, k=-1)  # of the joints, the gripper's first
    bend = length_m**2 * links.stiffness[:, :, None] * (turn.T @ turn)
    joints = length_m**2 * links.damping[:, :, None] * (turn.T @ turn)

    def change(state: FloatArray, base: FloatArray) -> FloatArray:
        angle, rate = state
        sin, cos = np.sin(angle), np.cos(angle)
        apart = angle[:, :, None] - angle[:, None, :]
        mass = inertia * np.cos(apart)
        down_m_s = base[2] - (sin * rate) @ lever_m.T  # of the points
        forward_m_s = base[3] + (cos * rate) @ lever_m.T
        across = cos * forward_m_s - sin * down_m_s
        air = (links.linear + links.square * np.abs(across)) * across
        down = gravity_m_s2[0] - base[0] + air * sin
        forward = gravity_m_s2[1] - base[1] - air * cos
        moment = (forward @ lever_m) * cos - (down @ lever_m) * sin
        turning = (inertia * np.sin(apart)) @ rate[:, :, None] ** 2
        moment = moment[:, :, None] - turning - bend @ (angle - base[4])[:, :, None]
        return np.stack([rate, np.linalg.solve(mass, moment)[:, :, 0]])

    def creep(state: FloatArray, step_s: float) -> FloatArray:
        """Damp the joints, by the implicit trapezoidal rule: it stays stable however stiff they are."""
        angle, rate = state
        mass = inertia * np.cos(angle[:, :, None] - angle[:, None, :])
        half = step_s / 2 * joints
        return np.stack([angle, np.linalg.solve(mass + half, (mass - half) @ rate[:, :, None])[:, :, 0]])

    state = np.zeros((2, len(links.stiffness), count))
    angles = [state[0]]
    for frame_s, now, after in zip(frames_s, driven[:-1], driven[1:], strict=True):
        step_s = frame_s / steps
        for i in range(steps):  # Runge and Kutta
            begin, middle, end = (now + (i + share) / steps * (after - now) for share in (0, 0.5, 1))
            state = creep(state, step_s / 2)
            first = change(state, begin)
            second = change(state + step_s / 2 * first, middle)
            third = change(state + step_s / 2 * second, middle)
            fourth = change(state + step_s * third, end)
            state = creep(state + step_s / 6 * (first + 2 * second + 2 * third + fourth), step_s / 2)
        angles.append(state[0])
    angle = np.stack(angles, axis=1)
    below_m: FloatArray = np.stack([(np.cos(angle) - 1) @ lever_m.T, np.sin(angle) @ lever_m.T], axis=-1)
    return below_m
