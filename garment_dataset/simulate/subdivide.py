"""Smooth the simulated mesh for looking at: Loop subdivision as one matrix.

The mesh that is simulated has cells of some 3 cm. What the cameras see, and what the truth is measured on, is its Loop
subdivision surface (C. Loop, Smooth Subdivision Surfaces Based on Triangles, 1987): every vertex of the fine mesh is a
fixed weighted mean of coarse ones, so positions and velocities alike are one matrix product.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_SHARP = np.cos(np.deg2rad(50.0))
"""An outline that turns by more than this at a vertex has a corner there; a round one turns by less, mesh by mesh."""


@dataclass(frozen=True)
class Blend:
    """A sparse matrix with few entries per row, applied without BLAS so that threads cannot change a bit of a result.

    Parameters
    ----------
    index : ndarray of int, shape (R, K)
        Columns of the entries.
    weight : ndarray, shape (R, K)
        The entries; 0 where a row has fewer than K.
    """

    index: NDArray[np.intp]
    weight: NDArray[np.float64]

    @classmethod
    def of(cls, matrix: NDArray[np.float64]) -> Blend:
        """Return the blend that a matrix of shape (R, C) stands for."""
        most = int((matrix != 0).sum(axis=1).max(initial=0))
        index = np.argsort(matrix == 0, axis=1, kind="stable")[:, :most]
        return cls(index, np.take_along_axis(matrix, index, axis=1))

    def apply(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the product with values of shape (C, D): shape (R, D)."""
        product: NDArray[np.float64] = np.einsum("rk,rkd->rd", self.weight, values[self.index])
        return product


def subdivide(
    material_m: NDArray[np.float64], triangles: NDArray[np.intp], levels: int, pinned: int | None = None
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return the matrix from coarse to fine vertices, and the fine triangles.

    Parameters
    ----------
    material_m : ndarray, shape (V, 2)
        Flat coordinates; where the outline turns, its corner stays sharp.
    triangles : ndarray of int, shape (T, 3)
        The coarse mesh.
    levels : int
        How often every triangle is divided into four.
    pinned : int, optional
        A vertex that stays where it is: the surface comes to a point there, as cloth does in a gripper.

    Returns
    -------
    matrix : ndarray, shape (V', V)
        Rows sum to 1.
    fine : ndarray of int, shape (4**levels * T, 3)
        The fine mesh.
    """
    matrix = np.eye(len(material_m))
    for _ in range(levels):
        step, triangles = _divide(material_m, triangles)
        if pinned is not None:
            step[pinned] = 0.0
            step[pinned, pinned] = 1.0
        blend = Blend.of(step)
        matrix, material_m = blend.apply(matrix), blend.apply(material_m)
    return matrix, triangles


def _divide(
    material_m: NDArray[np.float64], triangles: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    count = len(material_m)
    sides = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    opposite = np.concatenate([triangles[:, 2], triangles[:, 0], triangles[:, 1]])
    edges, edge_of_side, uses = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    edge_of_side = edge_of_side.ravel()
    outline = edges[uses == 1]
    step = np.zeros((count + len(edges), count))
    _place_vertices(step[:count], material_m, edges, outline)
    middle = step[count:]
    rows = np.arange(len(edges))
    inner = uses == 2
    for k in range(2):
        middle[rows, edges[:, k]] = np.where(inner, 3 / 8, 1 / 2)
    np.add.at(middle, (edge_of_side, opposite), np.where(inner[edge_of_side], 1 / 8, 0.0))
    ab, bc, ca = (count + edge_of_side).reshape(3, -1)
    a, b, c = triangles.T
    quarters = ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))
    return step, np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])


def _place_vertices(
    rows: NDArray[np.float64],
    material_m: NDArray[np.float64],
    edges: NDArray[np.intp],
    outline: NDArray[np.intp],
) -> None:
    """Fill in the rows of the old vertices: Loop's rule inside, cubic spline along the outline, sharp corners kept."""
    count = len(material_m)
    both = np.concatenate([edges, edges[:, ::-1]])
    valence = np.bincount(both[:, 0], minlength=count)
    share = np.where(valence == 3, 3 / 16, 3 / (8 * np.maximum(valence, 1)))
    rows[both[:, 0], both[:, 1]] = share[both[:, 0]]
    rows[np.arange(count), np.arange(count)] = 1 - valence * share
    around = np.concatenate([outline, outline[:, ::-1]])
    around = around[np.argsort(around[:, 0], kind="stable")].reshape(-1, 2, 2)
    for vertex, first, second in zip(around[:, 0, 0], around[:, 0, 1], around[:, 1, 1], strict=True):
        before, after = material_m[vertex] - material_m[first], material_m[second] - material_m[vertex]
        straight = before @ after > _SHARP * np.linalg.norm(before) * np.linalg.norm(after)
        rows[vertex] = 0.0
        rows[vertex, vertex] = 3 / 4 if straight else 1.0
        if straight:
            rows[vertex, [first, second]] = 1 / 8


def locate(
    points_m: NDArray[np.float64], material_m: NDArray[np.float64], triangles: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return the matrix that interpolates vertex values at material points.

    Parameters
    ----------
    points_m : ndarray, shape (P, 2)
        Material points inside the sheet.
    material_m : ndarray, shape (V, 2)
        Material coordinates of the vertices.
    triangles : ndarray of int, shape (T, 3)
        The mesh.

    Returns
    -------
    ndarray, shape (P, V)
        Barycentric weights; a point just outside takes the nearest triangle's continuation.
    """
    a, b, c = (material_m[triangles[:, k]] for k in range(3))
    area = _cross(b - a, c - a)
    matrix = np.zeros((len(points_m), len(material_m)))
    for row, point in enumerate(points_m):
        weights = np.stack([_cross(b - point, c - point), _cross(c - point, a - point), _cross(a - point, b - point)])
        weights /= area
        best = int(np.argmax(weights.min(axis=0)))
        matrix[row, triangles[best]] = weights[:, best]
    return matrix


def _cross(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    product: NDArray[np.float64] = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return product
