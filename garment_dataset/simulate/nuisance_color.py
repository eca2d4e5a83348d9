"""Nuisances of the colour images: of the room, the light and the camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np


@dataclass(frozen=True, slots=True)
class Lamp:
    """A lamp that casts shadows on the wall.

    Parameters
    ----------
    place_m : tuple of float
        x, y, z in the depth optical frame: above the camera, beside it, and behind it or a little before.
    size_m : float
        Its diameter, which makes the shadow's edge soft: a bulb to a panel of the ceiling.
    share : float
        Of the wall's light that comes from it: a lamp among others in a lit room takes 10 to 50 grey levels with it.
    tint : tuple of float
        How many times as much of red, green, blue it takes as of all: lamps and daylight differ by some hundred kelvin.
    """

    place_m: tuple[float, float, float]
    size_m: float
    share: float
    tint: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class AutoExposure:
    """A camera that keeps its pictures at one brightness and grey, which every such camera does unless told otherwise.

    Parameters
    ----------
    exposure, balance : float
        Which share of the way it goes: for the brightness, for each channel's part in it.
    rate : float
        Which share of what is left it goes within a frame: a camera takes some tenths of a second.
    """

    exposure: float
    balance: float
    rate: float


@dataclass(frozen=True, slots=True)
class Wall:
    """A wall that is not smooth: a sheet that was hung up, a plastered wall.

    Parameters
    ----------
    fold_share, fold_m : float
        How much of the light folds take, and their mean distance.
    texture_share, texture_px : float
        How much the texture does (standard deviation), and how fine it is.
    number : int
        Which of all such walls.
    """

    fold_share: float
    fold_m: float
    texture_share: float
    texture_px: float
    number: int


@dataclass(frozen=True, slots=True)
class ColorNuisance:
    """What is unusual about the colour images; None: as usual.

    Parameters
    ----------
    color_noise : float or None
        How many times as noisy the camera is: 0.6 to 2, as real cameras' 2.0 to 6 levels are to the usual 2.5 to 3.8.
    lamps : tuple of Lamp or None
        What casts shadows of garment, gripper and arm: one lamp or two.
    auto_exposure : AutoExposure or None
        Brightness and white balance follow what is seen.
    flicker : float or None
        How many times as much brightness drifts from frame to frame: 0.5 to 2.5, as real cameras' 1 to 5 levels are
        to the usual 2.
    wall : Wall or None
        Folds and texture of the wall.
    blur_px : float or None
        Radius (standard deviation) of the lens' blur: well focused at 0.4, a fixed focus at a metre up to 1.5.
    """

    color_noise: float | None = None
    lamps: tuple[Lamp, ...] | None = None
    auto_exposure: AutoExposure | None = None
    flicker: float | None = None
    wall: Wall | None = None
    blur_px: float | None = None


USUAL_COLOR = ColorNuisance()


def _lamps(rng: np.random.Generator) -> tuple[Lamp, ...]:
    return tuple(
        Lamp(
            (float(rng.uniform(-1.2, 1.2)), float(rng.uniform(-1.8, -0.3)), float(rng.uniform(-1.5, 0.2))),
            float(10 ** rng.uniform(-1.3, -0.2)),
            float(rng.uniform(0.05, 0.25)),
            (float(rng.uniform(0.85, 1.15)), 1.0, float(rng.uniform(0.85, 1.15))),
        )
        for _ in range(int(rng.integers(1, 3)))
    )


def _auto_exposure(rng: np.random.Generator) -> AutoExposure:
    return AutoExposure(float(rng.uniform(0.2, 1.0)), float(rng.uniform(0.0, 0.6)), float(rng.uniform(0.05, 0.4)))


def _wall(rng: np.random.Generator) -> Wall:
    return Wall(
        float(rng.uniform(0.0, 0.12)),
        float(rng.uniform(0.08, 0.5)),
        float(rng.uniform(0.0, 0.025)),
        float(rng.uniform(0.7, 4.0)),
        int(rng.integers(2**31)),
    )


COLOR_DRAWS: Mapping[str, Callable[[np.random.Generator], object]] = {
    "color_noise": lambda rng: float(rng.uniform(0.6, 2.0)),
    "lamps": _lamps,
    "auto_exposure": _auto_exposure,
    "flicker": lambda rng: float(rng.uniform(0.5, 2.5)),
    "wall": _wall,
    "blur_px": lambda rng: float(rng.uniform(0.4, 1.5)),
}
"""How each is drawn."""
