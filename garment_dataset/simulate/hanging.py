"""How a garment hangs at first: how a person puts the sheet into the gripper, each time a little otherwise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.simulate.cloth import BAND_WIDTH_M
from garment_dataset.simulate.nuisance_cloth import USUAL_FOLDS, Folds

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.simulate.cloth import ClothMesh


@dataclass(frozen=True)
class Hanging:
    """What differs from one hanging of a garment to the next.

    Parameters
    ----------
    turn : ndarray, shape (3, 3)
        Rotation of the held part against the gripper: a little yaw and roll.
    slip_m : ndarray, shape (3,)
        Its offset from the gripper's end point, sideways and forwards.
    phase_rad, pleats, sway_m : float
        Where the first folds begin, how narrow they are, and how the sheet sways before it settles.
    folds : Folds
        How it is folded into the gripper.
    """

    turn: NDArray[np.float64]
    slip_m: NDArray[np.float64]
    phase_rad: float
    pleats: float
    sway_m: float
    folds: Folds = USUAL_FOLDS

    @classmethod
    def draw(cls, rng: np.random.Generator, folds: Folds | None = None) -> Hanging:
        """Return one hanging, as a person's hand differs from one to the next."""
        yaw, roll = rng.normal(0.0, 0.03), rng.normal(0.0, 0.01)
        slip = np.array([rng.normal(0.0, 0.001), 0.0, rng.normal(0.0, 0.001)])
        about_z = np.array([[np.cos(roll), -np.sin(roll), 0.0], [np.sin(roll), np.cos(roll), 0.0], [0.0, 0.0, 1.0]])
        about_y = np.array([[np.cos(yaw), 0.0, np.sin(yaw)], [0.0, 1.0, 0.0], [-np.sin(yaw), 0.0, np.cos(yaw)]])
        phase, pleats, sway = rng.uniform(0.0, 2 * np.pi), rng.uniform(0.92, 1.08), rng.normal(0.0, 0.01)
        return cls(about_y @ about_z, slip, float(phase), float(pleats), float(sway), folds or USUAL_FOLDS)

    def yawed(self, yaw_rad: float) -> Hanging:
        """Return this hanging, turned about the vertical."""
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        about_y = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
        return replace(self, turn=about_y @ self.turn, slip_m=about_y @ self.slip_m)


def initial_shape(mesh: ClothMesh, holding: str, hanging: Hanging) -> NDArray[np.float64]:
    """Return how a person hangs the sheet into the gripper, before it settles.

    Parameters
    ----------
    mesh : ClothMesh
        The sheet.
    holding : str
        One of :data:`HOLDINGS`.
    hanging : Hanging
        This time's hanging.

    Returns
    -------
    ndarray, shape (V, 3)
        Positions relative to the gripper's end point, optical axes, metres.
    """
    offset = mesh.material_m - mesh.hold_m
    down = float(np.arctan2(*(mesh.end_m - mesh.hold_m)))
    if holding == "Ruler":
        shape = _straight(offset, hanging.phase_rad, hanging.sway_m, hanging.folds)
    elif holding == "Free":
        shape = _umbrella(offset, down, hanging.phase_rad, hanging.pleats * hanging.folds.waves)
    else:
        strip_m, narrow = (0.0, 0.98) if holding == "Corner" else (BAND_WIDTH_M / 2, 0.35)
        shape = _pleated(offset, down, strip_m, narrow, hanging.phase_rad, hanging.pleats * hanging.folds.waves)
        shape[:, 2] *= hanging.folds.forward
    placed: NDArray[np.float64] = shape @ hanging.turn.T + hanging.slip_m
    return placed


def _straight(offset_m: NDArray[np.float64], phase_rad: float, sway_m: float, folds: Folds) -> NDArray[np.float64]:
    """Return an outstretched sheet with shallow waves."""
    x, y = offset_m.T
    wave = folds.depth * 0.004 * np.sin(folds.waves * 2 * np.pi * x / 0.17 + phase_rad) * np.minimum(1.0, y / 0.1)
    return np.column_stack([x, y, wave + sway_m * np.sin(np.pi * y / np.ptp(y))])


def _pleated(
    offset_m: NDArray[np.float64], down_rad: float, strip_m: float, narrow: float, phase_rad: float, pleats: float
) -> NDArray[np.float64]:
    """Return a sheet whose middle strip hangs straight and whose sides fall down beside it in pleats.

    `down_rad` is the angle, from t to s, of the direction that points down.
    """
    cos, sin = np.cos(down_rad), np.sin(down_rad)
    x, y = (offset_m @ np.array([[cos, sin], [-sin, cos]])).T
    beside = np.sign(x) * np.maximum(np.abs(x) - strip_m, 0.0)
    radius, angle = np.hypot(beside, y), np.arctan2(beside, y)
    # left and right do not fold alike, and both fold backwards: the middle is what the camera sees
    waves = 6.0 * pleats * (1.0 + 0.15 * np.sin(phase_rad + 2.0 * np.sign(angle)))
    deep = np.sqrt(2 * (1 - narrow**2)) / waves
    fold = deep * radius * (1.0 - np.cos(waves * angle))
    return np.column_stack([x - beside + radius * np.sin(narrow * angle), radius * np.cos(narrow * angle), fold])


def _umbrella(offset_m: NDArray[np.float64], front_rad: float, phase_rad: float, pleats: float) -> NDArray[np.float64]:
    """Return a narrow ruffled cone about the held point, with the material line on the side of the camera."""
    radius, angle = np.hypot(*offset_m.T), np.arctan2(*offset_m.T) - front_rad
    opening = np.deg2rad(18.0) + np.deg2rad(16.0) * pleats * np.cos(5 * angle + phase_rad)
    out = radius * np.sin(opening)
    return np.column_stack([out * np.sin(angle), radius * np.cos(opening), -out * np.cos(angle)])
