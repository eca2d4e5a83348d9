"""The garment as a sheet: its outline, its mesh, where it is held and how it hangs at first.

A garment is one sheet without thickness, of the size and the mass of table 4.1. Garments whose larger size is the span
of their sleeves get the outline of a shirt. Material coordinates are metres on the flat sheet: s to the right of the
middle, t down from the upper edge.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.errors import GarmentError
from garment_dataset.simulate.nuisance_cloth import USUAL_FOLDS, Folds

if TYPE_CHECKING:
    from numpy.typing import NDArray

_SLEEVED_SPAN_M = 1.0
_BODY_SHARE = 0.42
_SLEEVE_M = 0.17
_GRIP_WIDTH_M = 0.05
_BAND_WIDTH_M = 0.09

HOLDINGS = ("Ruler", "Corner", "Collar", "Belt", "Free")


@dataclass(frozen=True, slots=True)
class ClothSpec:
    """Size, mass and mechanical properties of a garment.

    Parameters
    ----------
    width_m, height_m : float
        Size of the flat garment. A size of a metre or more is the span of the sleeves.
    mass_kg : float
        Mass of the whole garment.
    stretch_n_m : float
        Membrane stiffness, Young's modulus times thickness.
    bending_n_m : float
        Bending rigidity per unit width, N·m (cotton: 1e-6 to 1e-4).
    """

    width_m: float
    height_m: float
    mass_kg: float
    stretch_n_m: float = 700.0
    bending_n_m: float = 6e-6

    @property
    def sleeved(self) -> bool:
        """Whether one size is the span of the sleeves."""
        return max(self.width_m, self.height_m) >= _SLEEVED_SPAN_M

    @property
    def extent_m(self) -> tuple[float, float]:
        """Extent along s and t: a sleeved garment lies with its sleeves along s."""
        size = (self.width_m, self.height_m)
        return (max(size), min(size)) if self.sleeved else size

    def area_m2(self) -> float:
        """Area of the sheet."""
        s_m, t_m = self.extent_m
        return s_m * _SLEEVE_M + _BODY_SHARE * s_m * (t_m - _SLEEVE_M) if self.sleeved else s_m * t_m


@dataclass(frozen=True)
class ClothMesh:
    """A triangle mesh of the flat sheet and the way it is held.

    Parameters
    ----------
    material_m : ndarray, shape (V, 2)
        Material coordinates s, t of every vertex, metres.
    triangles : ndarray of int, shape (T, 3)
        Vertex indices.
    mass_kg : ndarray, shape (V,)
        Lumped masses: a third of each adjacent triangle.
    held : ndarray of int
        Vertices that move with the gripper.
    hold_m, end_m : ndarray, shape (2,)
        Material points between which the material line runs: the gripper's, and the one that hangs farthest below it.
    """

    material_m: NDArray[np.float64]
    triangles: NDArray[np.intp]
    mass_kg: NDArray[np.float64]
    held: NDArray[np.intp]
    hold_m: NDArray[np.float64]
    end_m: NDArray[np.float64]


def _axis_nodes(extent_m: float, cell_m: float, start_m: float) -> NDArray[np.float64]:
    return start_m + np.linspace(0.0, extent_m, max(2, round(extent_m / cell_m)) + 1)


def _columns(spec: ClothSpec, cell_m: float) -> NDArray[np.float64]:
    """Return the nodes along s: an even number of cells, so that one column hangs in the middle."""
    s_m = spec.extent_m[0]
    if not spec.sleeved:
        half = _axis_nodes(s_m / 2, cell_m, 0.0)
    else:
        body_m = _BODY_SHARE * s_m / 2
        half = np.concatenate([_axis_nodes(body_m, cell_m, 0.0), _axis_nodes(s_m / 2 - body_m, cell_m, body_m)[1:]])
    return np.concatenate([-half[:0:-1], half])


def _rows(spec: ClothSpec, cell_m: float) -> NDArray[np.float64]:
    t_m = spec.extent_m[1]
    if not spec.sleeved:
        return _axis_nodes(t_m, cell_m, 0.0)
    sleeve = _axis_nodes(_SLEEVE_M, cell_m, 0.0)
    return np.concatenate([sleeve, _axis_nodes(t_m - _SLEEVE_M, cell_m, _SLEEVE_M)[1:]])


def _cells(spec: ClothSpec, s_m: NDArray[np.float64], t_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which cells of the grid are cloth, shape (rows - 1, columns - 1)."""
    middle_s, middle_t = (s_m[1:] + s_m[:-1]) / 2, (t_m[1:] + t_m[:-1]) / 2
    cells = np.ones((len(middle_t), len(middle_s)), dtype=np.bool_)
    if spec.sleeved:
        body = np.abs(middle_s) < _BODY_SHARE * spec.extent_m[0] / 2
        cells &= body[None, :] | (middle_t < _SLEEVE_M)[:, None]
    return cells


def build_mesh(spec: ClothSpec, holding: str, cell_m: float) -> ClothMesh:
    """Mesh the sheet and find the vertices that the gripper holds.

    Parameters
    ----------
    spec : ClothSpec
        The garment.
    holding : str
        One of :data:`HOLDINGS` (figure C.1).
    cell_m : float
        Size of a cell of the grid.

    Raises
    ------
    GarmentError
        If the holding is unknown.
    """
    if holding not in HOLDINGS:
        raise GarmentError("no such holding", where=holding, expected=", ".join(HOLDINGS))
    s_m, t_m = _columns(spec, cell_m), _rows(spec, cell_m)
    cells = _cells(spec, s_m, t_m)
    row, column = np.nonzero(cells)
    corner = row * len(s_m) + column
    corners = np.stack([corner, corner + 1, corner + len(s_m), corner + len(s_m) + 1])
    # alternating diagonals keep the sheet from being softer along one of them
    even = ((row + column) % 2 == 0)[:, None]
    a, b, c, d = corners
    first = np.where(even, np.stack([a, c, b], axis=1), np.stack([a, c, d], axis=1))
    second = np.where(even, np.stack([b, c, d], axis=1), np.stack([a, d, b], axis=1))
    used, triangles = np.unique(np.concatenate([first, second]), return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    grid = np.stack(np.meshgrid(s_m, t_m), axis=-1).reshape(-1, 2)
    material = grid[used]
    p, q, r = (material[triangles[:, k]] for k in range(3))
    area = 0.5 * np.abs((q - p)[:, 0] * (r - p)[:, 1] - (q - p)[:, 1] * (r - p)[:, 0])
    mass = np.zeros(len(material))
    for k in range(3):
        np.add.at(mass, triangles[:, k], area / 3)
    hold, end = _material_line(spec, holding, material)
    held = _held(spec, holding, material, hold)
    return ClothMesh(material, triangles, mass * spec.mass_kg / mass.sum(), held, hold, end)


def _material_line(
    spec: ClothSpec, holding: str, material_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the ends of the material line."""
    s_m, t_m = spec.extent_m
    if holding == "Corner" and not spec.sleeved:
        return np.array([-s_m / 2, 0.0]), np.array([s_m / 2, t_m])
    if holding == "Free":
        # a third of the way into the body: neither an edge nor the middle
        wish = np.array([-0.12 * s_m, 0.3 * t_m])
        hold = material_m[np.argmin(np.linalg.norm(material_m - wish, axis=1))]
        body = _BODY_SHARE * s_m if spec.sleeved else s_m
        return hold, np.array([body / 2, t_m])
    return np.array([0.0, 0.0]), np.array([0.0, t_m])


def _held(
    spec: ClothSpec, holding: str, material_m: NDArray[np.float64], hold_m: NDArray[np.float64]
) -> NDArray[np.intp]:
    offset = np.abs(material_m - hold_m)
    upper = material_m[:, 1] < 1e-9
    if holding == "Ruler":
        width_m = _BODY_SHARE * spec.extent_m[0] if spec.sleeved else spec.extent_m[0]
        return np.flatnonzero(upper & (offset[:, 0] <= width_m / 2 + 1e-9))
    # however coarse the mesh, the next vertices are held too: a single one would let the sheet turn about it
    beside, below = (1.001 * offset[offset[:, k] > 1e-9, k].min() for k in (0, 1))
    if holding in {"Collar", "Belt"}:
        return np.flatnonzero(upper & (offset[:, 0] <= max(_BAND_WIDTH_M / 2, beside)))
    reach = max(_GRIP_WIDTH_M if holding == "Corner" else _GRIP_WIDTH_M / 2, beside, below)
    return np.flatnonzero(np.linalg.norm(offset, axis=1) <= reach)


@dataclass(frozen=True)
class Hanging:
    """What differs from one hanging of a garment to the next.

    Parameters
    ----------
    turn : ndarray, shape (3, 3)
        Rotation of the held part against the gripper: a little yaw and roll.
    slip_m : ndarray, shape (3,)
        Its offset from the gripper's end point, sideways and forwards.
    phase_rad, pleats, sway_m : float
        Where the first folds begin, how narrow they are, and how the sheet sways before it settles.
    folds : Folds
        How it is folded into the gripper.
    """

    turn: NDArray[np.float64]
    slip_m: NDArray[np.float64]
    phase_rad: float
    pleats: float
    sway_m: float
    folds: Folds = USUAL_FOLDS

    @classmethod
    def draw(cls, rng: np.random.Generator, folds: Folds | None = None) -> Hanging:
        """Return one hanging, as a person's hand differs from one to the next."""
        yaw, roll = rng.normal(0.0, 0.03), rng.normal(0.0, 0.01)
        slip = np.array([rng.normal(0.0, 0.001), 0.0, rng.normal(0.0, 0.001)])
        about_z = np.array([[np.cos(roll), -np.sin(roll), 0.0], [np.sin(roll), np.cos(roll), 0.0], [0.0, 0.0, 1.0]])
        about_y = np.array([[np.cos(yaw), 0.0, np.sin(yaw)], [0.0, 1.0, 0.0], [-np.sin(yaw), 0.0, np.cos(yaw)]])
        phase, pleats, sway = rng.uniform(0.0, 2 * np.pi), rng.uniform(0.92, 1.08), rng.normal(0.0, 0.01)
        return cls(about_y @ about_z, slip, float(phase), float(pleats), float(sway), folds or USUAL_FOLDS)

    def yawed(self, yaw_rad: float) -> Hanging:
        """Return this hanging, turned about the vertical."""
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        about_y = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
        return replace(self, turn=about_y @ self.turn, slip_m=about_y @ self.slip_m)


def initial_shape(mesh: ClothMesh, holding: str, hanging: Hanging) -> NDArray[np.float64]:
    """Return how a person hangs the sheet into the gripper, before it settles.

    Parameters
    ----------
    mesh : ClothMesh
        The sheet.
    holding : str
        One of :data:`HOLDINGS`.
    hanging : Hanging
        This time's hanging.

    Returns
    -------
    ndarray, shape (V, 3)
        Positions relative to the gripper's end point, optical axes, metres.
    """
    offset = mesh.material_m - mesh.hold_m
    down = float(np.arctan2(*(mesh.end_m - mesh.hold_m)))
    if holding == "Ruler":
        shape = _straight(offset, hanging.phase_rad, hanging.sway_m, hanging.folds)
    elif holding == "Free":
        shape = _umbrella(offset, down, hanging.phase_rad, hanging.pleats * hanging.folds.waves)
    else:
        strip_m, narrow = (0.0, 0.98) if holding == "Corner" else (_BAND_WIDTH_M / 2, 0.35)
        shape = _pleated(offset, down, strip_m, narrow, hanging.phase_rad, hanging.pleats * hanging.folds.waves)
        shape[:, 2] *= hanging.folds.forward
    placed: NDArray[np.float64] = shape @ hanging.turn.T + hanging.slip_m
    return placed


def _straight(offset_m: NDArray[np.float64], phase_rad: float, sway_m: float, folds: Folds) -> NDArray[np.float64]:
    """Return an outstretched sheet with shallow waves."""
    x, y = offset_m.T
    wave = folds.depth * 0.004 * np.sin(folds.waves * 2 * np.pi * x / 0.17 + phase_rad) * np.minimum(1.0, y / 0.1)
    return np.column_stack([x, y, wave + sway_m * np.sin(np.pi * y / np.ptp(y))])


def _pleated(
    offset_m: NDArray[np.float64], down_rad: float, strip_m: float, narrow: float, phase_rad: float, pleats: float
) -> NDArray[np.float64]:
    """Return a sheet whose middle strip hangs straight and whose sides fall down beside it in pleats.

    `down_rad` is the angle, from t to s, of the direction that points down.
    """
    cos, sin = np.cos(down_rad), np.sin(down_rad)
    x, y = (offset_m @ np.array([[cos, sin], [-sin, cos]])).T
    beside = np.sign(x) * np.maximum(np.abs(x) - strip_m, 0.0)
    radius, angle = np.hypot(beside, y), np.arctan2(beside, y)
    # left and right do not fold alike, and both fold backwards: the middle is what the camera sees
    waves = 6.0 * pleats * (1.0 + 0.15 * np.sin(phase_rad + 2.0 * np.sign(angle)))
    deep = np.sqrt(2 * (1 - narrow**2)) / waves
    fold = deep * radius * (1.0 - np.cos(waves * angle))
    return np.column_stack([x - beside + radius * np.sin(narrow * angle), radius * np.cos(narrow * angle), fold])


def _umbrella(offset_m: NDArray[np.float64], front_rad: float, phase_rad: float, pleats: float) -> NDArray[np.float64]:
    """Return a narrow ruffled cone about the held point, with the material line on the side of the camera."""
    radius, angle = np.hypot(*offset_m.T), np.arctan2(*offset_m.T) - front_rad
    opening = np.deg2rad(18.0) + np.deg2rad(16.0) * pleats * np.cos(5 * angle + phase_rad)
    out = radius * np.sin(opening)
    return np.column_stack([out * np.sin(angle), radius * np.cos(opening), -out * np.cos(angle)])
