"""Nuisances: drawn one by one from a seed, and each of them changes what is recorded."""

from __future__ import annotations

import dataclasses
import hashlib
from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset.errors import GarmentError
from garment_dataset.simulate.cloth import ClothSpec, build_mesh
from garment_dataset.simulate.garments import unusual
from garment_dataset.simulate.hanging import Hanging, initial_shape
from garment_dataset.simulate.nuisance import Nuisance, draw_nuisance, nuisance_names, wanted_names
from garment_dataset.simulate.nuisance_cloth import CLOTH_DRAWS, ClothNuisance
from garment_dataset.simulate.nuisance_color import COLOR_DRAWS, ColorNuisance
from garment_dataset.simulate.nuisance_depth import DEPTH_DRAWS, DepthNuisance
from garment_dataset.simulate.recording import simulate_recording

if TYPE_CHECKING:
    from pathlib import Path

NAME, OTHER = "GreenTowel_Ruler_01_pi16_0.5_R1", "camera_default_0"


def drawn(nuisance: Nuisance) -> dict[str, object]:
    groups = (nuisance.color, nuisance.depth, nuisance.cloth)
    values = {name: value for group in groups for name, value in dataclasses.asdict(group).items()}
    return {name: value for name, value in values.items() if value is not None}


def test_every_field_has_a_draw_and_every_draw_a_field() -> None:
    for group, draws in ((ColorNuisance, COLOR_DRAWS), (DepthNuisance, DEPTH_DRAWS), (ClothNuisance, CLOTH_DRAWS)):
        assert [field.name for field in dataclasses.fields(group)] == list(draws)
    assert len(set(nuisance_names())) == len(nuisance_names())


def test_none_draws_nothing_and_wide_draws_all() -> None:
    assert draw_nuisance("none", NAME, 0) == Nuisance()
    assert set(drawn(draw_nuisance("wide", NAME, 0))) == set(nuisance_names())


@pytest.mark.parametrize("name", nuisance_names())
def test_one_alone_is_drawn_as_among_all(name: str) -> None:
    wide, alone = drawn(draw_nuisance("wide", NAME, 3)), drawn(draw_nuisance(name, NAME, 3))
    assert alone == {name: wide[name]}
    assert drawn(draw_nuisance(name, NAME, 4)) != alone


def test_recordings_of_a_seed_share_camera_and_room_but_not_the_garment() -> None:
    one, other = draw_nuisance("wide", NAME, 5), draw_nuisance("wide", OTHER, 5)
    assert (one.color, one.depth) == (other.color, other.depth)
    assert one.cloth != other.cloth


@pytest.mark.parametrize(("text", "hint"), [("wid", "Did you mean wide?"), ("bendin", "bending"), ("", "")])
def test_what_is_no_nuisance_is_refused(text: str, hint: str) -> None:
    with pytest.raises(GarmentError) as caught:
        wanted_names(text)
    assert "no such nuisance" in str(caught.value)
    assert hint in str(caught.value)


@pytest.mark.parametrize("name", CLOTH_DRAWS)
def test_each_of_the_cloth_changes_it_or_how_it_is_held(name: str) -> None:
    own = draw_nuisance(name, NAME, 3).cloth
    if own.hem is not None:  # not every hem is cut askew
        own = dataclasses.replace(own, hem=dataclasses.replace(own.hem, slope=0.05))
    usual = ClothSpec(0.36, 0.64, 0.1)
    shapes = [
        initial_shape(
            build_mesh(usual, holding, 0.05, nuisance.hem),
            holding,
            Hanging.draw(np.random.default_rng(0), nuisance.folds),
        )
        for nuisance in (own, ClothNuisance())
        for holding in ("Ruler", "Corner")
    ]
    shaped = all(not np.allclose(shapes[i], shapes[i + 2]) for i in range(2))
    assert shaped == (name in {"folds", "hem"})
    assert (unusual(usual, own) != usual) == (name not in {"folds", "hem", "yaw_rad", "wall_hue", "pattern"})


@pytest.mark.parametrize("name", [*(name for name in COLOR_DRAWS if name != "lamps"), *DEPTH_DRAWS])
def test_each_changes_the_recording(name: str, tmp_path: Path) -> None:
    """The empty scene, in which nothing casts shadows, is enough for room and camera; equal seeds give equal bytes."""
    digests = {
        folder: hashlib.sha256(
            simulate_recording(OTHER, tmp_path / folder, frames=2, nuisance=nuisance).read_bytes()
        ).digest()
        for folder, nuisance in (("usual", "none"), ("unusual", name), ("again", name))
    }
    assert digests["again"] == digests["unusual"] != digests["usual"]
