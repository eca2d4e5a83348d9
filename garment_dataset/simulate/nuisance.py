"""What differs from one room, camera and garment to the next: each nuisance by name, drawn from a range.

A nuisance is a field of one of three groups, and None where it is as the simulation usually has it. A preset draws all,
a list of names those alone, so that what one of them costs can be measured.
"""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from garment_dataset.errors import GarmentError, did_you_mean
from garment_dataset.simulate.nuisance_cloth import CLOTH_DRAWS, USUAL_CLOTH, ClothNuisance
from garment_dataset.simulate.nuisance_color import COLOR_DRAWS, USUAL_COLOR, ColorNuisance
from garment_dataset.simulate.nuisance_depth import DEPTH_DRAWS, USUAL_DEPTH, DepthNuisance

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    Draws = Mapping[str, Callable[[np.random.Generator], object]]

Group = TypeVar("Group", ColorNuisance, DepthNuisance, ClothNuisance)

NONE, WIDE = "none", "wide"
"""The presets: as usual; every nuisance drawn."""


@dataclass(frozen=True, slots=True)
class Nuisance:
    """All nuisances of one recording.

    Parameters
    ----------
    color, depth, cloth
        Of the colour images, the depth images, and the garment.
    """

    color: ColorNuisance = USUAL_COLOR
    depth: DepthNuisance = USUAL_DEPTH
    cloth: ClothNuisance = USUAL_CLOTH


def nuisance_names() -> tuple[str, ...]:
    """Return the names of all nuisances, those of colour first."""
    return (*COLOR_DRAWS, *DEPTH_DRAWS, *CLOTH_DRAWS)


def wanted_names(text: str) -> frozenset[str]:
    """Return which nuisances are meant by ``none``, ``wide``, or names with commas between.

    Raises
    ------
    GarmentError
        If one of them is no nuisance.
    """
    if text in {NONE, WIDE}:
        return frozenset(nuisance_names() if text == WIDE else ())
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in nuisance_names():
            expected = f"{NONE}, {WIDE}, or some of {', '.join(nuisance_names())}"
            hint = did_you_mean(name, (NONE, WIDE, *nuisance_names()))
            raise GarmentError("no such nuisance", expected=expected, found=repr(name), hint=hint)
    return frozenset(names)


def draw_nuisance(text: str, name: str, seed: int) -> Nuisance:
    """Draw the nuisances of a recording.

    Parameters
    ----------
    text : str
        See :func:`wanted_names`.
    name : str
        Of the recording; an empty scene and the recordings of its camera position share camera and room.
    seed : int
        Equal seeds give equal draws, whichever nuisances are drawn beside.

    Returns
    -------
    Nuisance
        Those of the camera and the room are drawn from the seed alone, those of the garment from the name as well.
    """
    wanted = wanted_names(text)
    place, own = f"{seed}/nuisance", f"{seed}/nuisance/{name}"
    return Nuisance(
        _draw(USUAL_COLOR, COLOR_DRAWS, wanted, place),
        _draw(USUAL_DEPTH, DEPTH_DRAWS, wanted, place),
        _draw(USUAL_CLOTH, CLOTH_DRAWS, wanted, own),
    )


def _draw(group: Group, draws: Draws, wanted: frozenset[str], key: str) -> Group:
    drawn: dict[str, Any] = {name: draw(_random(f"{key}/{name}")) for name, draw in draws.items() if name in wanted}
    return dataclasses.replace(group, **drawn)


def _random(key: str) -> np.random.Generator:
    return np.random.default_rng(int.from_bytes(hashlib.sha256(key.encode()).digest()[:16], "little"))
