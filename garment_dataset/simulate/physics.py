"""The cloth in motion: MuJoCo's flexible sheet on a gripper whose path is given.

Everything is in the depth camera's optical frame (x right, y down, z forward), so gravity points along +y. The gripper
is a body on one hinge, the wrist, whose angle is set before every step; the held vertices are fixed to it, every other
vertex is a point mass. The sheet is elastic in its plane and in bending, integrated implicitly. Air resists motion
across the sheet with the square of the speed, and a little in every direction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from garment_dataset.errors import GarmentError, MissingExtraError
from garment_dataset.simulate.hanging import initial_shape

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.simulate.cloth import ClothMesh, ClothSpec
    from garment_dataset.simulate.hanging import Hanging
    from garment_dataset.simulate.motion import Swing

GRAVITY_M_S2 = 9.81
_POISSON = 0.3
_RAYLEIGH_S = 5e-4
_AIR_KG_M3 = 1.2
_DRAG_COEFFICIENT = 1.3
_LINEAR_RATE_1_S = 0.4
_SETTLING_STEPS = 4
_SETTLING = ((3.0, 6.0), (6.0, 1.0), (2.0, 4.0))
"""Seconds and linear resistance, 1/s: fall into place, find the way out of every unstable fold, come to rest."""
_SAMPLE_S = 0.004


def import_mujoco() -> Any:  # noqa: ANN401 - a module without stubs
    """Import MuJoCo.

    Raises
    ------
    MissingExtraError
        If the extra is not installed.
    """
    try:
        import mujoco
    except ImportError as error:
        raise MissingExtraError("simulating needs MuJoCo", hint="pip install 'garment-dataset[simulate]'") from error
    return mujoco


@dataclass(frozen=True)
class Trajectory:
    """Vertex positions over time, to be asked at any time.

    Parameters
    ----------
    start_s, step_s : float
        Time of the first sample, and the time between samples.
    position_m, velocity_m_s : ndarray of float32, shape (N, V, 3)
        Of every vertex at every sample.
    """

    start_s: float
    step_s: float
    position_m: NDArray[np.float32]
    velocity_m_s: NDArray[np.float32]

    def at(self, time_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return positions and velocities, each of shape (V, 3), by cubic Hermite interpolation."""
        place = (time_s - self.start_s) / self.step_s
        index = int(np.clip(np.floor(place), 0, len(self.position_m) - 2))
        t = float(np.clip(place - index, 0.0, 1.0))
        p0, p1 = (self.position_m[index + k].astype(np.float64) for k in (0, 1))
        m0, m1 = (self.velocity_m_s[index + k].astype(np.float64) * self.step_s for k in (0, 1))
        rise = 3 * t**2 - 2 * t**3
        position = (1 - rise) * p0 + (t**3 - 2 * t**2 + t) * m0 + rise * p1 + (t**3 - t**2) * m1
        slope = (6 * t**2 - 6 * t) * (p0 - p1) + (3 * t**2 - 4 * t + 1) * m0 + (3 * t**2 - 2 * t) * m1
        return position, slope / self.step_s


def model_xml(spec: ClothSpec, mesh: ClothMesh, swing: Swing, step_s: float) -> str:
    """Return the MuJoCo model: the gripper on its wrist, the point masses and the sheet between them.

    The origin is the gripper's end point at rest; the sheet lies flat, as cut, which is its shape without stress.
    """
    thickness = np.sqrt(12 * (1 - _POISSON**2) * spec.bending_n_m / spec.stretch_n_m)
    flat = np.column_stack([mesh.material_m, np.zeros(len(mesh.material_m))])
    held = set(mesh.held.tolist())
    bodies = "".join(_vertex_body(k, flat[k], mesh.mass_kg[k]) for k in range(len(flat)) if k not in held)
    names = " ".join("gripper" if k in held else f"v{k}" for k in range(len(flat)))
    local = np.where(np.isin(np.arange(len(flat)), mesh.held)[:, None], flat, 0.0)
    return f"""<mujoco>
  <option timestep="{step_s}" integrator="discrete" solver="Newton" gravity="0 {GRAVITY_M_S2} 0">
    <flag contact="disable"/>
  </option>
  <worldbody>
    <body name="gripper">
      <inertial pos="0 0 0" mass="1000" diaginertia="1000 1000 1000"/>
      <joint type="hinge" axis="{_numbers(swing.axis_vector)}" pos="{_numbers(swing.wrist_m - swing.rest_m)}"/>
    </body>
    {bodies}
  </worldbody>
  <deformable>
    <flex name="cloth" dim="2" radius="0.001" body="{names}" vertex="{_numbers(local.ravel())}"
          element="{" ".join(map(str, mesh.triangles.ravel()))}">
      <elasticity young="{spec.stretch_n_m / thickness}" thickness="{thickness}" poisson="{_POISSON}"
                  damping="{_RAYLEIGH_S}" elastic2d="both"/>
      <contact selfcollide="none" contype="0" conaffinity="0"/>
    </flex>
  </deformable>
</mujoco>"""


def _numbers(values: NDArray[np.float64]) -> str:
    return " ".join(f"{value:.10g}" for value in values)


def _vertex_body(index: int, place_m: NDArray[np.float64], mass_kg: float) -> str:
    slides = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    inertia = f'<inertial pos="0 0 0" mass="{mass_kg:.10g}" diaginertia="1e-9 1e-9 1e-9"/>'
    return f'<body name="v{index}" pos="{_numbers(place_m)}">{inertia}{slides}</body>'


class _Sheet:
    """The sheet on the gripper, stepped through time; positions relative to the gripper's end point at rest."""

    def __init__(
        self, spec: ClothSpec, mesh: ClothMesh, shape_m: NDArray[np.float64], swing: Swing, step_s: float
    ) -> None:
        self._mujoco = import_mujoco()
        self._model = self._mujoco.MjModel.from_xml_string(model_xml(spec, mesh, swing, step_s))
        self._data = self._mujoco.MjData(self._model)
        self._mesh, self._swing = mesh, swing
        self._free = np.setdiff1d(np.arange(len(mesh.material_m)), mesh.held)
        flat = np.column_stack([mesh.material_m, np.zeros(len(mesh.material_m))])
        self._model.flex_vert[mesh.held] = shape_m[mesh.held]
        self._data.qpos[1:] = (shape_m - flat)[self._free].ravel()
        self._mass = np.repeat(mesh.mass_kg[self._free], 3)
        self._mujoco.mj_forward(self._model, self._data)

    def step(self, time_s: float, rate_1_s: float) -> None:
        """Advance one step from `time_s`, with a linear resistance of `rate_1_s`."""
        data = self._data
        data.qpos[0] = self._swing.angle_rad(np.asarray(time_s))
        data.qvel[0] = self._swing.rate_rad_s(np.asarray(time_s))
        position, velocity = self.state()
        data.qfrc_applied[1:] = -rate_1_s * self._mass * data.qvel[1:] + self._drag(position, velocity)
        self._mujoco.mj_step(self._model, data)

    def state(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return positions and velocities of all vertices, each of shape (V, 3)."""
        data, held = self._data, self._mesh.held
        # as of the start of the step in MuJoCo's own arrays: the generalised coordinates are newer
        position = np.empty((len(self._mesh.material_m), 3))
        velocity = np.empty_like(position)
        flat = np.column_stack([self._mesh.material_m, np.zeros(len(position))])
        position[self._free] = flat[self._free] + data.qpos[1:].reshape(-1, 3)
        velocity[self._free] = data.qvel[1:].reshape(-1, 3)
        lever = self._swing.wrist_m - self._swing.rest_m
        arm = self._model.flex_vert[held] - lever
        axis = self._swing.axis_vector
        angle, rate = float(data.qpos[0]), float(data.qvel[0])
        turned = (
            np.cos(angle) * arm
            + np.sin(angle) * np.cross(axis, arm)
            + (1 - np.cos(angle)) * (arm @ axis)[:, None] * axis
        )
        position[held] = lever + turned
        velocity[held] = rate * np.cross(axis, turned)
        return position, velocity

    def _drag(self, position: NDArray[np.float64], velocity: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the resistance of the air, shape (3 * free vertices,): square of the speed across each triangle."""
        a, b, c = self._mesh.triangles.T
        normal = np.cross(position[b] - position[a], position[c] - position[a])
        double_area = np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        normal /= double_area
        speed = np.sum((velocity[a] + velocity[b] + velocity[c]) / 3 * normal, axis=1, keepdims=True)
        push = -0.25 * _AIR_KG_M3 * _DRAG_COEFFICIENT * double_area * np.abs(speed) * speed * normal / 3
        force = np.empty_like(position)
        corners = self._mesh.triangles.ravel()
        for k in range(3):
            force[:, k] = np.bincount(corners, np.repeat(push[:, k], 3), minlength=len(position))
        return force[self._free].ravel()


def simulate_cloth(
    spec: ClothSpec,
    mesh: ClothMesh,
    holding: str,
    swing: Swing,
    *,
    duration_s: float,
    step_s: float,
    hanging: Hanging,
) -> Trajectory:
    """Hang the garment up, let it settle, then swing the gripper.

    Parameters
    ----------
    spec, mesh, holding
        The garment, its mesh and how it is held.
    swing : Swing
        The wrist's motion.
    duration_s : float
        How long to simulate after the cloth has settled.
    step_s : float
        Step of the integration; the settling takes steps of four times the length.
    hanging : Hanging
        How the garment was hung up this time.

    Returns
    -------
    Trajectory
        In the depth camera's optical frame, from time 0.

    Raises
    ------
    GarmentError
        If the simulation leaves the finite numbers.
    MissingExtraError
        If MuJoCo is not installed.
    """
    shape = initial_shape(mesh, holding, hanging)
    settling = _Sheet(spec, mesh, shape, swing, _SETTLING_STEPS * step_s)
    for settle_s, rate_1_s in _SETTLING:
        for _ in range(round(settle_s / (_SETTLING_STEPS * step_s))):
            settling.step(0.0, rate_1_s)
    position, _ = settling.state()
    moving = _Sheet(spec, mesh, position, swing, step_s)
    every = max(1, round(_SAMPLE_S / step_s))
    samples = round(duration_s / (every * step_s)) + 2
    positions = np.empty((samples, len(position), 3), dtype=np.float32)
    velocities = np.empty_like(positions)
    for sample in range(samples):
        position, velocity = moving.state()
        positions[sample] = position + swing.rest_m
        velocities[sample] = velocity
        for k in range(every):
            moving.step((sample * every + k) * step_s, _LINEAR_RATE_1_S)
    if not np.isfinite(positions).all():
        raise GarmentError("the simulated cloth went out of bounds", hint="Use a smaller step or a coarser mesh")
    return Trajectory(0.0, every * step_s, positions, velocities)
