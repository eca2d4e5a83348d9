"""Nuisances of the colour images: of the room, the light and the camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np


@dataclass(frozen=True, slots=True)
class ColorNuisance:
    """What is unusual about the colour images; None: as usual.

    Parameters
    ----------
    color_noise : float or None
        How many times as noisy the camera is.
    """

    color_noise: float | None = None


USUAL_COLOR = ColorNuisance()

COLOR_DRAWS: Mapping[str, Callable[[np.random.Generator], object]] = {
    "color_noise": lambda rng: float(rng.uniform(0.5, 2.0)),
}
"""How each is drawn."""
