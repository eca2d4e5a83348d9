"""Nuisances of the garment: its cloth and its looks, and how it was put into the gripper."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from garment_dataset.simulate.hem import Hem

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
class Pattern:
    """Stripes or checks, as shirts and towels have.

    Parameters
    ----------
    color : tuple of int
        Of every second field, red, green, blue, 0 to 255.
    width_m : float
        Of a field: pinstripes of a centimetre to broad blocks.
    checked : bool
        Whether fields alternate across as well.
    """

    color: tuple[int, int, int]
    width_m: float
    checked: bool


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
    hem : Hem or None
        How it ends below.
    yaw_rad : float or None
        How far it is turned about the vertical when it swings across the view: the operator shows it open, at an angle
        or edge-on, which alone shows its deformation. Along the view it always faces the camera.
    wall_hue : float or None
        How much of the wall's hue its colour has, from 0 to all of it: its brightness stays.
    pattern : Pattern or None
        What is printed on it.
    """

    bending: float | None = None
    stretch: float | None = None
    mass: float | None = None
    size: tuple[float, float] | None = None
    folds: Folds | None = None
    hem: Hem | None = None
    yaw_rad: float | None = None
    wall_hue: float | None = None
    pattern: Pattern | None = None


USUAL_CLOTH = ClothNuisance()

_YAWS_DEG = ((0.0, 8.0), (35.0, 10.0), (90.0, 3.0))
"""Open, at an angle, edge-on; each with how well a hand does it."""


def _yaw_rad(rng: np.random.Generator) -> float:
    middle_deg, spread_deg = _YAWS_DEG[int(rng.integers(len(_YAWS_DEG)))]
    side = 1 if rng.random() < 0.5 else -1
    return float(rng.normal(middle_deg, spread_deg) * side * math.pi / 180)


def _hem(rng: np.random.Generator) -> Hem:
    """Draw a hem; each of its four traits in half of the garments, so that they occur alone and together."""
    front, curl_front = (1 if rng.random() < 0.5 else -1 for _ in range(2))
    drawn = Hem(
        corner_radius_m=float(rng.uniform(0.01, 0.08)),
        slope=float(rng.uniform(-0.1, 0.1)),
        # turned over twice and sewn: a strip of one to three centimetres, two layers of half to one millimetre thicker
        fold_m=float(rng.uniform(0.01, 0.03)),
        fold_thick_m=float(rng.uniform(0.0005, 0.002)) * front,
        # the cut edge of a knitted fabric rolls up, by half a turn and more
        curl_m=float(rng.uniform(0.008, 0.025)),
        curl_rad=float(rng.uniform(0.5, 3.5)) * curl_front,
    )
    traits = (("corner_radius_m",), ("slope",), ("fold_m", "fold_thick_m"), ("curl_m", "curl_rad"))
    left_out = [name for names in traits if rng.random() < 0.5 for name in names]
    return replace(drawn, **dict.fromkeys(left_out, 0.0))


def _pattern(rng: np.random.Generator) -> Pattern:
    red, green, blue = (int(level) for level in rng.integers(20, 240, 3))
    return Pattern((red, green, blue), float(rng.uniform(0.01, 0.08)), bool(rng.random() < 0.5))


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
    "hem": _hem,
    "yaw_rad": _yaw_rad,
    "wall_hue": lambda rng: float(rng.uniform(0.0, 1.0)),
    "pattern": _pattern,
}
"""How each is drawn."""
