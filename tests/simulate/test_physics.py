from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from garment_dataset.simulate.cloth import ClothMesh, ClothSpec, build_mesh
from garment_dataset.simulate.hanging import Hanging
from garment_dataset.simulate.motion import Swing
from garment_dataset.simulate.physics import GRAVITY_M_S2, Trajectory, model_xml, simulate_cloth
from garment_dataset.simulate.truth import GarmentView

pytest.importorskip("mujoco")

SWING = Swing("R", np.pi / 16, 0.5)


@dataclass(frozen=True)
class Ride:
    mesh: ClothMesh
    trajectory: Trajectory

    def energy_j(self, sample: int) -> float:
        """Return kinetic and potential energy; y points down."""
        speed, place = self.trajectory.velocity_m_s[sample], self.trajectory.position_m[sample]
        kinetic = 0.5 * self.mesh.mass_kg @ (speed.astype(np.float64) ** 2).sum(axis=1)
        return float(kinetic - GRAVITY_M_S2 * self.mesh.mass_kg @ place[:, 1].astype(np.float64))


@pytest.fixture(scope="module")
def ride(towel: ClothSpec, steady: Hanging) -> Ride:
    """Return the towel on the ruler through rest, swing and ring-out."""
    mesh = build_mesh(towel, "Ruler", 0.06)
    return Ride(mesh, simulate_cloth(towel, mesh, "Ruler", SWING, duration_s=8.0, step_s=0.002, hanging=steady))


def test_towel_on_the_ruler_hangs_64_cm(ride: Ride) -> None:
    view = GarmentView(ride.mesh, ride.trajectory, SWING, 1)
    line = view.surface_line(0.5)
    assert line is not None
    assert line.arc_m[-1] == pytest.approx(0.64, rel=0.01)
    points, _, length = view.surface_points(0.5)
    below = (points[:, 1] - SWING.rest_m[1]) * 0.64 / length
    assert below == pytest.approx([0.064, 0.192, 0.320, 0.448, 0.576], abs=0.002)


def test_rest_is_rest(ride: Ride) -> None:
    samples = range(0, int(1.5 / ride.trajectory.step_s), 25)
    assert np.abs(ride.trajectory.velocity_m_s[: samples[-1]]).max() < 0.005
    energies = [ride.energy_j(sample) for sample in samples]
    assert max(energies) - energies[0] < 1e-6


def test_energy_only_falls_once_the_gripper_is_back(ride: Ride) -> None:
    first = int((SWING.end_s + 0.1) / ride.trajectory.step_s)
    rest = ride.energy_j(100)
    energies = np.array([ride.energy_j(sample) for sample in range(first, len(ride.trajectory.position_m), 125)]) - rest
    assert (np.diff(energies) < 1e-5).all()
    assert energies[-1] < 0.2 * energies[0]


def test_garment_stays_in_the_thesis_range_of_z(ride: Ride) -> None:
    z = ride.trajectory.position_m[..., 2]
    assert 0.80 <= z.min() <= 0.85
    assert 1.10 <= z.max() <= 1.16


def test_held_edge_follows_the_gripper(ride: Ride) -> None:
    for time_s in (0.0, 2.0, 2.8, 3.6, 7.0):
        held, speed = (values[ride.mesh.held] for values in ride.trajectory.at(time_s))
        middle = np.argmin(np.abs(ride.mesh.material_m[ride.mesh.held, 0]))
        assert held[middle] == pytest.approx(SWING.gripper_m(time_s), abs=1e-4)
        assert speed[middle] == pytest.approx(SWING.gripper_velocity_m_s(time_s), abs=2e-3)


def test_velocity_is_the_derivative_of_the_position(ride: Ride) -> None:
    for time_s in (1.9, 2.7, 3.3):
        step = 1e-3
        before, after = ride.trajectory.at(time_s - step)[0], ride.trajectory.at(time_s + step)[0]
        assert ride.trajectory.at(time_s)[1] == pytest.approx((after - before) / (2 * step), abs=5e-3)


def test_the_cloth_hardly_stretches(ride: Ride) -> None:
    edges = ride.mesh.triangles[:, [0, 1]]
    flat = np.linalg.norm(np.diff(ride.mesh.material_m[edges], axis=1)[:, 0], axis=1)
    places = ride.trajectory.position_m[::50].astype(np.float64)
    now = np.linalg.norm(places[:, edges[:, 0]] - places[:, edges[:, 1]], axis=2)
    assert np.abs(now / flat - 1).max() < 0.03


def test_hem_lags_and_overshoots(ride: Ride) -> None:
    hem = int(np.argmin(np.linalg.norm(ride.mesh.material_m - ride.mesh.end_m, axis=1)))
    gripper = SWING.gripper_m(SWING.start_s + 0.45)[2]
    assert ride.trajectory.at(SWING.start_s + 0.45)[0][hem, 2] > gripper + 0.02
    assert ride.trajectory.position_m[:, hem, 2].min() < SWING.gripper_m(SWING.start_s + 1.5)[2] - 0.03


def test_model_holds_the_garments_mass(towel: ClothSpec) -> None:
    mujoco = pytest.importorskip("mujoco")
    mesh = build_mesh(towel, "Corner", 0.06)
    model = mujoco.MjModel.from_xml_string(model_xml(towel, mesh, SWING, 0.002))
    moving = model.body_mass[2:].sum()
    assert moving == pytest.approx(towel.mass_kg - mesh.mass_kg[mesh.held].sum(), rel=1e-6)


def test_equal_hangings_give_equal_bits(towel: ClothSpec) -> None:
    mesh = build_mesh(towel, "Corner", 0.08)
    runs = [
        simulate_cloth(
            towel,
            mesh,
            "Corner",
            SWING,
            duration_s=0.1,
            step_s=0.004,
            hanging=Hanging.draw(np.random.default_rng(seed)),
        ).position_m
        for seed in (1, 1, 2)
    ]
    assert (runs[0] == runs[1]).all()
    assert np.abs(runs[0] - runs[2]).max() > 1e-3
