"""The garment as a sheet: its outline, its mesh, and where it is held.

A garment is one sheet without thickness, of the size and the mass of table 4.1. Garments whose larger size is the span
of their sleeves get the outline of a shirt. Material coordinates are metres on the flat sheet: s to the right of the
middle, t down from the upper edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.errors import GarmentError
from garment_dataset.simulate.hem import cut

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.simulate.hem import Hem

_SLEEVED_SPAN_M = 1.0
_BODY_SHARE = 0.42
_SLEEVE_M = 0.17
_GRIP_WIDTH_M = 0.05

BAND_WIDTH_M = 0.09
"""How much of a collar or belt is held."""

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

    @property
    def body_m(self) -> float:
        """Width of what ends in the hem: all of it, or what is between the sleeves."""
        s_m = self.extent_m[0]
        return _BODY_SHARE * s_m if self.sleeved else s_m

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
    to_hem_m : ndarray, shape (V,)
        How far every vertex is from the hem, along t.
    """

    material_m: NDArray[np.float64]
    triangles: NDArray[np.intp]
    mass_kg: NDArray[np.float64]
    held: NDArray[np.intp]
    hold_m: NDArray[np.float64]
    end_m: NDArray[np.float64]
    to_hem_m: NDArray[np.float64]


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


def build_mesh(spec: ClothSpec, holding: str, cell_m: float, hem: Hem | None = None) -> ClothMesh:
    """Mesh the sheet and find the vertices that the gripper holds.

    Parameters
    ----------
    spec : ClothSpec
        The garment.
    holding : str
        One of :data:`HOLDINGS` (figure C.1).
    cell_m : float
        Size of a cell of the grid.
    hem : Hem, optional
        How it is cut below; by default level, with sharp corners.

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
    flat = grid[used]
    hold, end = _material_line(spec, holding, flat)
    held = _held(spec, holding, flat, hold)
    to_hem = spec.extent_m[1] - flat[:, 1]
    material = flat
    if hem is not None:
        upper = _SLEEVE_M if spec.sleeved else 0.0
        material, ends = (
            cut(points, spec.body_m / 2, spec.extent_m[1], upper, hem) for points in (flat, np.stack([hold, end]))
        )
        hold, end = ends
    p, q, r = (material[triangles[:, k]] for k in range(3))
    area = 0.5 * np.abs((q - p)[:, 0] * (r - p)[:, 1] - (q - p)[:, 1] * (r - p)[:, 0])
    mass = np.zeros(len(material))
    for k in range(3):
        np.add.at(mass, triangles[:, k], area / 3)
    return ClothMesh(material, triangles, mass * spec.mass_kg / mass.sum(), held, hold, end, to_hem)


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
        return hold, np.array([spec.body_m / 2, t_m])
    return np.array([0.0, 0.0]), np.array([0.0, t_m])


def _held(
    spec: ClothSpec, holding: str, material_m: NDArray[np.float64], hold_m: NDArray[np.float64]
) -> NDArray[np.intp]:
    offset = np.abs(material_m - hold_m)
    upper = material_m[:, 1] < 1e-9
    if holding == "Ruler":
        return np.flatnonzero(upper & (offset[:, 0] <= spec.body_m / 2 + 1e-9))
    # however coarse the mesh, the next vertices are held too: a single one would let the sheet turn about it
    beside, below = (1.001 * offset[offset[:, k] > 1e-9, k].min() for k in (0, 1))
    if holding in {"Collar", "Belt"}:
        return np.flatnonzero(upper & (offset[:, 0] <= max(BAND_WIDTH_M / 2, beside)))
    reach = max(_GRIP_WIDTH_M if holding == "Corner" else _GRIP_WIDTH_M / 2, beside, below)
    return np.flatnonzero(np.linalg.norm(offset, axis=1) <= reach)
