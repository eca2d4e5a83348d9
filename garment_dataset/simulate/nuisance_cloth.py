"""Nuisances of the garment: its cloth, and how it was put into the gripper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np


@dataclass(frozen=True, slots=True)
class ClothNuisance:
    """What is unusual about the garment; None: as usual.

    Parameters
    ----------
    bending : float or None
        How many times as stiff against bending it is.
    """

    bending: float | None = None


USUAL_CLOTH = ClothNuisance()

CLOTH_DRAWS: Mapping[str, Callable[[np.random.Generator], object]] = {
    "bending": lambda rng: float(10 ** rng.uniform(-0.5, 1.0)),
}
"""How each is drawn."""
