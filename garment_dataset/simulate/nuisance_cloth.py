"""Nuisances of the garment: its cloth, and how it was put into the gripper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np


@dataclass(frozen=True, slots=True)
class Folds:
    """How a garment's folds differ from the usual when it is put into the gripper.

    Parameters
    ----------
    forward : float
        Where its sides fold: 1 backwards, as usual, -1 to the front, 0 neither.
    waves : float
        How many times as many folds there are.
    depth : float
        How many times as deep the shallow waves of a garment on the ruler are.
    """

    forward: float
    waves: float
    depth: float


USUAL_FOLDS = Folds(1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class ClothNuisance:
    """What is unusual about the garment; None: as usual.

    Parameters
    ----------
    bending : float or None
        How many times as stiff against bending it is.
    stretch : float or None
        How many times as stiff in its plane.
    mass : float or None
        How many times as heavy.
    size : (float, float) or None
        How many times as wide and as high.
    folds : Folds or None
        How it is put into the gripper.
    """

    bending: float | None = None
    stretch: float | None = None
    mass: float | None = None
    size: tuple[float, float] | None = None
    folds: Folds | None = None


USUAL_CLOTH = ClothNuisance()

CLOTH_DRAWS: Mapping[str, Callable[[np.random.Generator], object]] = {
    # cotton: 1e-6 to 1e-4 N m (Kawabata's bending rigidity), about the usual 6e-6
    "bending": lambda rng: float(10 ** rng.uniform(-0.5, 1.0)),
    # knitted to woven
    "stretch": lambda rng: float(10 ** rng.uniform(-0.5, 0.5)),
    # 0.1 to 0.4 kg/m2 are worn
    "mass": lambda rng: float(10 ** rng.uniform(-0.3, 0.3)),
    # so that the hem of the towel stays in the image
    "size": lambda rng: (float(rng.uniform(0.7, 1.2)), float(rng.uniform(0.75, 1.05))),
    "folds": lambda rng: Folds(
        float(rng.uniform(-1.0, 1.0)), float(rng.uniform(0.6, 1.5)), float(10 ** rng.uniform(-0.5, 0.5))
    ),
}
"""How each is drawn."""
