"""Nuisances of the depth images: of the sensor, and of what is known of the gripper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np


@dataclass(frozen=True, slots=True)
class DepthNuisance:
    """What is unusual about the depth images; None: as usual.

    Parameters
    ----------
    depth_noise : float or None
        How many times as noisy the sensor is.
    """

    depth_noise: float | None = None


USUAL_DEPTH = DepthNuisance()

DEPTH_DRAWS: Mapping[str, Callable[[np.random.Generator], object]] = {
    "depth_noise": lambda rng: float(rng.uniform(0.6, 1.5)),
}
"""How each is drawn."""
