"""Hems and lower corners of other shape: cut round or askew, folded over and sewn, or curled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.simulate.subdivide import Blend

if TYPE_CHECKING:
    from numpy.typing import NDArray

_STEP_S = 1e-4


@dataclass(frozen=True, slots=True)
class Hem:
    """How a garment ends below.

    Parameters
    ----------
    corner_radius_m : float
        About how round its lower corners are; 0 sharp.
    slope : float
        How much longer it is on the right than in the middle, over the distance: 0 is cut level.
    fold_m, fold_thick_m : float
        How broad a strip along the hem is folded over, and how far its surface stands out because of that: to the front
        where positive, as on the outside of a garment; 0 none.
    curl_m, curl_rad : float
        How broad a strip along the hem rolls, by which angle in all: to the front where positive; 0 lies flat.
    """

    corner_radius_m: float
    slope: float
    fold_m: float
    fold_thick_m: float
    curl_m: float
    curl_rad: float


def cut(
    material_m: NDArray[np.float64], half_width_m: float, height_m: float, upper_m: float, hem: Hem
) -> NDArray[np.float64]:
    """Return where the points of a sheet with a straight hem and sharp corners lie on one that is cut otherwise.

    Parameters
    ----------
    material_m : ndarray, shape (V, 2)
        s to the right of the middle, t down from the upper edge.
    half_width_m, height_m : float
        Of the part that ends in the hem: its lower corners are at s = +-half_width_m, t = height_m.
    upper_m : float
        Down to here everything stays.
    hem : Hem
        How it is cut.

    Notes
    -----
    The square in a corner becomes a quarter of a disc by ``(a, b) -> (a sqrt(1 - b^2 / 2), b sqrt(1 - a^2 / 2))``,
    which leaves its two inner sides where they are; the sheet stays whole and no triangle turns over.
    """
    s, t = material_m.T
    radius = min(hem.corner_radius_m, half_width_m, height_m - upper_m)
    if radius > 0:
        a = np.clip((np.abs(s) - half_width_m) / radius + 1.0, 0.0, 1.0)
        b = np.clip((t - height_m) / radius + 1.0, 0.0, 1.0)
        s = s + np.sign(s) * radius * a * (np.sqrt(1 - b * b / 2) - 1)
        t = t + radius * b * (np.sqrt(1 - a * a / 2) - 1)
    below = np.clip((t - upper_m) / (height_m - upper_m), 0.0, None)
    return np.column_stack([s, t + hem.slope * s * below])


class HemShape:
    """How a strip along the hem leaves the surface that was simulated.

    Parameters
    ----------
    material_m : ndarray, shape (V, 2)
        Of the visible mesh.
    triangles : ndarray of int, shape (T, 3)
        The visible mesh.
    to_hem_m : ndarray, shape (V,)
        How far the hem is.
    hem : Hem
        Its shape.
    """

    def __init__(
        self, material_m: NDArray[np.float64], triangles: NDArray[np.intp], to_hem_m: NDArray[np.float64], hem: Hem
    ) -> None:
        self._rows = np.flatnonzero(to_hem_m < max(hem.fold_m if hem.fold_thick_m else 0.0, hem.curl_m))
        self._across, self._down = slopes(material_m, triangles, self._rows)
        near_m = to_hem_m[self._rows]
        curled_m, bend = np.maximum(hem.curl_m - near_m, 0.0), abs(hem.curl_rad) / max(hem.curl_m, 1e-9)
        angle = bend * curled_m
        with np.errstate(divide="ignore", invalid="ignore"):
            rolled = np.where(angle > 0, np.stack([np.sin(angle), 1 - np.cos(angle)]) / bend, 0.0)
        self._down_m = np.where(angle > 0, rolled[0] - curled_m, 0.0)
        self._out_m = np.sign(hem.curl_rad) * rolled[1] + np.where(near_m < hem.fold_m, hem.fold_thick_m, 0.0)

    def place(self, surface_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the surface, shape (V, 3), with its hem in shape."""
        down = _unit(self._down.apply(surface_m))
        # to the front: the sheet's right, seen from before it, is its +s, and its -z looks at the camera
        front = _unit(np.cross(down, self._across.apply(surface_m)))
        placed = surface_m.copy()
        placed[self._rows] += self._down_m[:, None] * down + self._out_m[:, None] * front
        return placed

    def place_velocity(self, surface_m: NDArray[np.float64], velocity_m_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the velocities, shape (V, 3), of the surface with its hem in shape, by central differences."""
        step = _STEP_S * velocity_m_s
        moved: NDArray[np.float64] = (self.place(surface_m + step) - self.place(surface_m - step)) / (2 * _STEP_S)
        return moved


def slopes(material_m: NDArray[np.float64], triangles: NDArray[np.intp], rows: NDArray[np.intp]) -> tuple[Blend, Blend]:
    """Return the blends that give the derivative along s and along t at vertices: of what is linear, exactly.

    Parameters
    ----------
    material_m : ndarray, shape (V, 2)
        Material coordinates.
    triangles : ndarray of int, shape (T, 3)
        The mesh.
    rows : ndarray of int, shape (R,)
        At which vertices: the mean over the triangles around, by their areas.
    """
    a, b, c = (material_m[triangles[:, k]] for k in range(3))
    # gradients of the barycentric coordinates, times twice the signed area
    gradients = np.stack([b - c, c - a, a - b], axis=1)[..., ::-1] * np.array([1.0, -1.0])
    turn = np.sign((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    gradients *= turn[:, None, None]
    twice_area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    place = np.full(len(material_m), -1)
    place[rows] = np.arange(len(rows))
    matrices = np.zeros((2, len(rows), len(material_m)))
    around = np.zeros(len(rows))
    for corner in range(3):
        own = place[triangles[:, corner]]
        used = own >= 0
        np.add.at(around, own[used], twice_area[used])
        for other in range(3):
            for k in range(2):
                np.add.at(matrices[k], (own[used], triangles[used, other]), gradients[used, other, k])
    across, down = matrices / around[:, None]
    return Blend.of(across), Blend.of(down)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    unit: NDArray[np.float64] = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit
