"""Hems: what is cut, folded over or curled stays one sheet and moves with the cloth."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.simulate.cloth import ClothMesh, ClothSpec, build_mesh
from garment_dataset.simulate.hem import Hem, HemShape, slopes
from garment_dataset.simulate.nuisance_cloth import CLOTH_DRAWS
from garment_dataset.simulate.subdivide import subdivide

PLAIN = Hem(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
TOWEL, SHIRT = ClothSpec(0.36, 0.64, 0.045), ClothSpec(0.69, 1.20, 0.137)
FINE_M = 0.002


def areas_m2(material_m: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (material_m[triangles[:, k]] for k in range(3))
    areas: np.ndarray = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    return areas


def strip(hem: Hem) -> tuple[HemShape, np.ndarray, np.ndarray]:
    """Return a fine flat strip that ends in a hem, seen from the front, and how far the hem is."""
    s, t = np.linspace(-0.02, 0.02, 5), np.arange(0.0, 0.06 + FINE_M / 2, FINE_M)
    material = np.stack(np.meshgrid(s, t), axis=-1).reshape(-1, 2)
    corner = (np.arange(len(t) - 1)[:, None] * len(s) + np.arange(len(s) - 1)).ravel()
    triangles = np.concatenate(
        [np.stack([corner, corner + 1, corner + 5], axis=1), np.stack([corner + 1, corner + 6, corner + 5], axis=1)]
    )
    to_hem = t[-1] - material[:, 1]
    flat = np.column_stack([material, np.ones(len(material))])
    return HemShape(material, triangles, to_hem, hem), flat, to_hem


def turned(points: np.ndarray, seed: int) -> np.ndarray:
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    placed: np.ndarray = points @ (turn * np.linalg.det(turn)) + np.array([0.1, -0.2, 0.3])
    return placed


def same_mesh(one: ClothMesh, other: ClothMesh) -> bool:
    return np.array_equal(one.material_m, other.material_m) and np.array_equal(one.mass_kg, other.mass_kg)


def test_a_plain_hem_is_no_hem() -> None:
    assert same_mesh(build_mesh(TOWEL, "Ruler", 0.03), build_mesh(TOWEL, "Ruler", 0.03, PLAIN))
    shape, flat, _ = strip(PLAIN)
    assert np.array_equal(shape.place(flat), flat)


@pytest.mark.parametrize("spec", [TOWEL, SHIRT], ids=["towel", "shirt"])
@pytest.mark.parametrize("holding", ["Ruler", "Corner", "Free"])
def test_round_and_slanting_cuts_turn_no_triangle_over_and_keep_what_is_held(spec: ClothSpec, holding: str) -> None:
    usual = build_mesh(spec, holding, 0.03)
    mesh = build_mesh(spec, holding, 0.03, replace(PLAIN, corner_radius_m=0.07, slope=-0.1))
    assert (areas_m2(mesh.material_m, mesh.triangles) > 0).all()
    assert np.array_equal(mesh.held, usual.held)
    assert mesh.material_m[mesh.held] == pytest.approx(usual.material_m[mesh.held], abs=0.02)
    assert mesh.mass_kg.sum() == pytest.approx(spec.mass_kg)
    upper = usual.material_m[:, 1] == 0
    assert np.array_equal(mesh.material_m[upper], usual.material_m[upper])


def test_round_corners_cost_what_a_quarter_of_a_disc_leaves_of_its_square() -> None:
    radius_m = 0.08
    mesh = build_mesh(TOWEL, "Ruler", 0.004, replace(PLAIN, corner_radius_m=radius_m))
    left = TOWEL.area_m2() - 2 * (1 - math.pi / 4) * radius_m**2
    assert areas_m2(mesh.material_m, mesh.triangles).sum() == pytest.approx(left, rel=1e-4)


def test_a_round_corner_stays_round_when_it_is_subdivided() -> None:
    mesh = build_mesh(TOWEL, "Ruler", 0.03, replace(PLAIN, corner_radius_m=0.08))
    matrix, _ = subdivide(mesh.material_m, mesh.triangles, 2)
    fine = matrix @ mesh.material_m
    middle = np.array([TOWEL.width_m / 2 - 0.08, TOWEL.height_m - 0.08])
    reach = np.linalg.norm(fine - middle, axis=1)[(fine > middle + 0.005).all(axis=1)]
    assert 0.07 < reach.max() < 0.084


def test_the_material_line_of_a_garment_held_by_its_corner_ends_on_the_cloth() -> None:
    mesh = build_mesh(TOWEL, "Corner", 0.03, replace(PLAIN, corner_radius_m=0.07))
    assert np.linalg.norm(mesh.material_m - mesh.end_m, axis=1).min() < 1e-12


def test_slopes_are_exact_for_what_is_linear() -> None:
    mesh = build_mesh(TOWEL, "Ruler", 0.05, replace(PLAIN, corner_radius_m=0.07, slope=0.05))
    rows = np.arange(len(mesh.material_m))
    across, down = slopes(mesh.material_m, mesh.triangles, rows)
    matrix = np.array([[1.0, -0.3, 0.2], [0.1, 0.9, 0.5]])
    values = mesh.material_m @ matrix + 4.0
    assert across.apply(values) == pytest.approx(np.tile(matrix[0], (len(rows), 1)))
    assert down.apply(values) == pytest.approx(np.tile(matrix[1], (len(rows), 1)))


@given(st.floats(0.01, 0.025), st.floats(-3.5, 3.5))
def test_a_curl_stretches_nothing_and_rolls_to_its_side(curl_m: float, curl_rad: float) -> None:
    shape, flat, to_hem = strip(replace(PLAIN, curl_m=curl_m, curl_rad=curl_rad))
    placed = shape.place(flat)
    assert np.array_equal(placed[to_hem >= curl_m], flat[to_hem >= curl_m])
    column = placed[np.abs(flat[:, 0]) < 1e-9]
    length = np.linalg.norm(np.diff(column, axis=0), axis=1).sum()
    # chords of an arc: shorter by the square of the angle of each over 24
    assert length == pytest.approx(0.06, rel=(FINE_M * 3.5 / 0.01) ** 2 / 24)
    tip = column[-1]
    radius_m = curl_m / max(abs(curl_rad), 1e-9)
    assert tip[2] - 1.0 == pytest.approx(-np.sign(curl_rad) * radius_m * (1 - math.cos(curl_rad)), abs=1e-6)


def test_a_fold_stands_out_to_its_side_and_nothing_else_moves() -> None:
    shape, flat, to_hem = strip(replace(PLAIN, fold_m=0.02, fold_thick_m=0.0015))
    moved = shape.place(flat) - flat
    folded = to_hem < 0.02
    assert moved[folded] == pytest.approx(np.tile([0.0, 0.0, -0.0015], (int(folded.sum()), 1)))
    assert not moved[~folded].any()


@pytest.mark.parametrize("seed", range(3))
def test_a_hem_turns_and_moves_with_the_cloth(seed: int) -> None:
    shape, flat, _ = strip(Hem(0.0, 0.0, 0.02, 0.001, 0.015, 2.5))
    rng = np.random.default_rng(seed)
    bent = flat + 0.003 * np.sin(flat[:, [1]] * 40 + rng.uniform(0, 6)) * np.array([0.0, 0.0, 1.0])
    assert turned(shape.place(bent), seed) == pytest.approx(shape.place(turned(bent, seed)))
    spin, drift = rng.normal(size=3), rng.normal(size=3)
    placed = shape.place(bent)
    assert shape.place_velocity(bent, np.cross(spin, bent) + drift) == pytest.approx(
        np.cross(spin, placed) + drift, abs=1e-6
    )


def test_draws_reach_every_trait_alone_and_together() -> None:
    hems = [CLOTH_DRAWS["hem"](np.random.default_rng(seed)) for seed in range(64)]
    traits = {
        (hem.corner_radius_m > 0, hem.slope != 0, hem.fold_m > 0, hem.curl_m > 0)
        for hem in hems
        if isinstance(hem, Hem)
    }
    assert len(traits) > 12
    assert (False, False, False, False) in traits
    assert (True, True, True, True) in traits
