"""A coarse lattice of controls whose values bend a patch: bilinear in between, smooth where nothing is seen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import FloatArray, IntArray

_MOST = (6, 16)
"""Controls across and down: time and memory go with the square of their number and more."""


@dataclass(frozen=True, eq=False)
class Blend:
    """Rows of a sparse matrix from controls to places.

    Parameters
    ----------
    index : (m, k) int64
        Controls.
    weight : (m, k) float64
        What each adds.
    """

    index: IntArray
    weight: FloatArray

    @cached_property
    def groups(self) -> tuple[IntArray, IntArray, IntArray]:
        """Rows in the order of the controls that they share, the groups' bounds (g + 1), and their controls (g, k)."""
        heads, inverse = np.unique(self.index, axis=0, return_inverse=True)
        group = inverse.ravel()  # numpy 2.0 alone gives it another axis
        order = np.argsort(group, kind="stable")
        return order, np.searchsorted(group[order], np.arange(len(heads) + 1)), heads

    def apply(self, values: FloatArray) -> FloatArray:
        """Return (m, 3) of values (C, 3)."""
        placed: FloatArray = np.einsum("mk,mkd->md", self.weight, values[self.index])
        return placed

    def less(self, other: Blend) -> Blend:
        """Return the rows of this less those of another."""
        return Blend(np.hstack([self.index, other.index]), np.hstack([self.weight, -other.weight]))

    def take(self, rows: IntArray) -> Blend:
        """Return some rows."""
        return Blend(self.index[rows], self.weight[rows])


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """Controls at equal steps across and down.

    Parameters
    ----------
    x_m, y_m : (nx,), (ny,) float64
        Where they are, relative to the gripper at rest. Control ``j * nx + i`` is at x i, y j.
    """

    x_m: FloatArray
    y_m: FloatArray

    @classmethod
    def over(cls, low_m: FloatArray, high_m: FloatArray, step_m: tuple[float, float]) -> Lattice:
        """Return one that covers a box (x, y) with steps of about the given size, larger ones where it is large."""
        counts = [int(np.clip(round((high_m[k] - low_m[k]) / step_m[k]) + 1, 2, _MOST[k])) for k in range(2)]
        return cls(*(np.linspace(low_m[k], high_m[k], counts[k]) for k in range(2)))

    @property
    def size(self) -> int:
        """Number of controls."""
        return self.x_m.size * self.y_m.size

    def blend(self, places_m: FloatArray) -> Blend:
        """Return how places (m, 2+) depend on the controls, bilinearly; beyond the border its cells are drawn out."""
        cells, shares = [], []
        for axis_m, place_m in ((self.x_m, places_m[:, 0]), (self.y_m, places_m[:, 1])):
            at = (place_m - axis_m[0]) / (axis_m[1] - axis_m[0])
            cell = np.clip(np.floor(at).astype(np.int64), 0, axis_m.size - 2)
            cells.append(cell)
            shares.append(at - cell)
        (i, j), (s, t) = cells, shares
        first = j * self.x_m.size + i
        index = np.stack([first, first + 1, first + self.x_m.size, first + self.x_m.size + 1], axis=1)
        return Blend(index, np.stack([(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t], axis=1))

    def bending(self) -> FloatArray:
        r"""Return the matrix (C, C) of the bending of one coordinate.

        The sum of squares of second differences along both axes and, twice, of the mixed one: what a thin plate
        costs, per cell; 0 for values that are linear in x and y.
        """
        across, down = np.eye(self.x_m.size), np.eye(self.y_m.size)
        second_x, second_y = np.diff(across, 2, axis=0), np.diff(down, 2, axis=0)
        mixed = np.kron(np.diff(down, axis=0), np.diff(across, axis=0))
        rows = np.vstack([np.kron(down, second_x), np.kron(second_y, across), np.sqrt(2.0) * mixed])
        matrix: FloatArray = rows.T @ rows
        return matrix


def normal_matrix(blend: Blend, weight: FloatArray, direction: FloatArray, controls: int) -> FloatArray:
    r"""Return :math:`\sum_m w_m (g_m \otimes b_m)(g_m \otimes b_m)^T`, (3 C, 3 C); unknown ``axis * C + control``.

    Parameters
    ----------
    blend : Blend
        b, (m, C).
    weight : (m,) float64
        w.
    direction : (m, 3) float64
        g.
    controls : int
        C.
    """
    order, bounds, heads = blend.groups
    scaled = np.sqrt(weight[order])[:, None] * direction[order]
    rows = (scaled[:, :, None] * blend.weight[order][:, None, :]).reshape(order.size, 3 * blend.weight.shape[1])
    # rows of one cell are multiplied before they are spread: there are far fewer cells than rows
    sums = np.empty((len(heads), rows.shape[1], rows.shape[1]))
    for total, (start, end) in zip(sums, pairwise(bounds), strict=True):
        np.matmul(rows[start:end].T, rows[start:end], out=total)
    places = (np.arange(3)[:, None] * controls + heads[:, None, :]).reshape(len(heads), rows.shape[1])
    pairs = places[:, :, None] * (3 * controls) + places[:, None, :]
    matrix = np.asarray(np.bincount(pairs.ravel(), sums.ravel(), (3 * controls) ** 2), np.float64)
    return matrix.reshape(3 * controls, 3 * controls)


def normal_vector(blend: Blend, weight: FloatArray, direction: FloatArray, controls: int) -> FloatArray:
    r"""Return :math:`\sum_m w_m (g_m \otimes b_m)`, (3 C,)."""
    values = weight[:, None] * blend.weight
    sums = [np.bincount(blend.index.ravel(), (values * direction[:, [a]]).ravel(), controls) for a in range(3)]
    return np.concatenate(sums)
