from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from garment_dataset.errors import GarmentError
from garment_dataset.simulate.cloth import HOLDINGS, ClothSpec, build_mesh
from garment_dataset.simulate.hanging import Hanging, initial_shape
from garment_dataset.simulate.subdivide import Blend, locate, subdivide

SHIRT = ClothSpec(0.69, 1.20, 0.137)


@pytest.mark.parametrize("holding", HOLDINGS)
@pytest.mark.parametrize("spec", [ClothSpec(0.47, 0.58, 0.072), SHIRT], ids=["towel", "shirt"])
def test_mesh_has_the_garments_mass_size_and_area(spec: ClothSpec, holding: str) -> None:
    mesh = build_mesh(spec, holding, 0.04)
    assert mesh.mass_kg.sum() == pytest.approx(spec.mass_kg, rel=1e-12)
    assert np.ptp(mesh.material_m, axis=0) == pytest.approx(spec.extent_m, abs=1e-12)
    a, b, c = (mesh.material_m[mesh.triangles[:, k]] for k in range(3))
    area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert area.sum() == pytest.approx(spec.area_m2(), rel=1e-9)
    assert (area > 0).all()
    assert 0 < len(mesh.held) < len(mesh.material_m) / 4


def test_sleeves_make_a_shirt_of_the_larger_size() -> None:
    assert SHIRT.extent_m == (1.20, 0.69)
    mesh = build_mesh(SHIRT, "Collar", 0.04)
    low = mesh.material_m[mesh.material_m[:, 1] > 0.3]
    assert np.ptp(low[:, 0]) < 0.6


def test_ruler_holds_the_whole_upper_edge_and_nothing_else(towel: ClothSpec) -> None:
    mesh = build_mesh(towel, "Ruler", 0.03)
    assert (mesh.material_m[mesh.held, 1] == 0).all()
    assert np.ptp(mesh.material_m[mesh.held, 0]) == pytest.approx(towel.width_m)


@pytest.mark.parametrize("cell_m", [0.02, 0.03, 0.0415, 0.0497, 0.065])
@pytest.mark.parametrize("spec", [ClothSpec(0.47, 0.58, 0.072), SHIRT], ids=["towel", "shirt"])
def test_gripper_holds_more_than_a_point_however_coarse_the_mesh(spec: ClothSpec, cell_m: float) -> None:
    for holding in ("Collar", "Belt"):
        band = build_mesh(spec, holding, cell_m)
        assert 0.05 <= np.ptp(band.material_m[band.held, 0]) <= 0.14
    for holding in ("Corner", "Free"):
        pinch = build_mesh(spec, holding, cell_m)
        assert (np.ptp(pinch.material_m[pinch.held], axis=0) > 0.0).all()
        assert np.ptp(pinch.material_m[pinch.held], axis=0).max() <= 0.16


def test_unknown_holding_is_an_error_that_names_the_known_ones(towel: ClothSpec) -> None:
    with pytest.raises(GarmentError, match="Ruler, Corner, Collar, Belt, Free"):
        build_mesh(towel, "Sleeve", 0.03)


@pytest.mark.parametrize("holding", HOLDINGS)
def test_hangings_differ_and_never_start_torn(towel: ClothSpec, holding: str) -> None:
    mesh = build_mesh(towel, holding, 0.03)
    edges = np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]]])
    flat = np.linalg.norm(mesh.material_m[edges[:, 0]] - mesh.material_m[edges[:, 1]], axis=1)
    shapes = [initial_shape(mesh, holding, Hanging.draw(np.random.default_rng(seed))) for seed in (1, 2)]
    assert not np.allclose(shapes[0], shapes[1])
    for shape in shapes:
        assert (np.linalg.norm(shape[edges[:, 0]] - shape[edges[:, 1]], axis=1) < 3 * flat).all()
        held = shape[mesh.held]
        assert np.linalg.norm(held - held.mean(axis=0), axis=1).max() < 0.2


def test_hanging_turns_by_a_rotation(steady: Hanging) -> None:
    turn = Hanging.draw(np.random.default_rng(5)).turn
    assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    assert dataclasses.replace(steady, turn=turn).slip_m.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("spec", [ClothSpec(0.36, 0.64, 0.045), SHIRT], ids=["towel", "shirt"])
@pytest.mark.parametrize("levels", [1, 2])
def test_subdivision_keeps_outline_flatness_and_motions(spec: ClothSpec, levels: int) -> None:
    mesh = build_mesh(spec, "Ruler", 0.05)
    matrix, fine = subdivide(mesh.material_m, mesh.triangles, levels)
    blend = Blend.of(matrix)
    assert len(fine) == 4**levels * len(mesh.triangles)
    assert matrix.sum(axis=1) == pytest.approx(1.0)
    flat = blend.apply(mesh.material_m)
    assert flat.min(axis=0) == pytest.approx(mesh.material_m.min(axis=0))
    assert flat.max(axis=0) == pytest.approx(mesh.material_m.max(axis=0))
    a, b, c = (flat[fine[:, k]] for k in range(3))
    area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert area.sum() == pytest.approx(spec.area_m2(), rel=2e-3)
    # weights of sum 1 make the surface follow every rotation and shift of the vertices
    rng = np.random.default_rng(0)
    places = rng.normal(size=(len(mesh.material_m), 3))
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    assert blend.apply(places @ turn + 1.0) == pytest.approx(blend.apply(places) @ turn + 1.0)


def test_blend_equals_the_matrix_product() -> None:
    rng = np.random.default_rng(3)
    matrix = rng.normal(size=(40, 30)) * (rng.random((40, 30)) < 0.2)
    values = rng.normal(size=(30, 3))
    assert Blend.of(matrix).apply(values) == pytest.approx(matrix @ values)


def test_located_points_carry_their_own_coordinates(towel: ClothSpec) -> None:
    mesh = build_mesh(towel, "Corner", 0.05)
    share = np.linspace(0, 1, 33)[:, None]
    points = mesh.hold_m + share * (mesh.end_m - mesh.hold_m)
    weights = locate(points, mesh.material_m, mesh.triangles)
    assert weights @ mesh.material_m == pytest.approx(points, abs=1e-12)
    assert weights.min() >= -1e-9
