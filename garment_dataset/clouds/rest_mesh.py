"""The garment at rest: a flat sheet of its size, where its outline is a rectangle."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import FloatArray, IntArray

RECTANGLES = frozenset({"cloth", "handkerchief", "napkin", "scarf", "sheet", "tablecloth", "towel"})
"""Kinds of garments that are one rectangular layer; of others, width and height are not their outline."""


class Mesh(NamedTuple):
    """A triangle mesh: vertices in metres, (n, 3) float64, and indices of three of them for each face, (m, 3) int64."""

    vertices_m: FloatArray
    faces: IntArray


def flat_mesh(width_m: float, height_m: float, pitch_m: float) -> Mesh:
    """Return a rectangle in the plane z = 0, x along its width, y along its height, a corner at the origin.

    Parameters
    ----------
    width_m, height_m : float
        Its size.
    pitch_m : float
        About how far vertices are apart; the sheet is divided evenly.

    Returns
    -------
    Mesh
        Vertices row by row; two triangles for each cell, all turned the same way, diagonals alternating so that the
        sheet bends alike along both.
    """
    columns, rows = (max(1, round(size_m / pitch_m)) + 1 for size_m in (width_m, height_m))
    x_m, y_m = np.meshgrid(np.linspace(0, width_m, columns), np.linspace(0, height_m, rows))
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (each.ravel() for each in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
    row, column = np.indices((rows - 1, columns - 1)).reshape(2, -1)
    odd = ((row + column) % 2 == 1)[:, None]
    first = np.where(odd, np.stack([a, b, d], 1), np.stack([a, b, c], 1))
    second = np.where(odd, np.stack([b, c, d], 1), np.stack([a, c, d], 1))
    faces = np.stack([first, second], axis=1).reshape(-1, 3)
    return Mesh(np.stack([x_m, y_m, np.zeros_like(x_m)], axis=2).reshape(-1, 3), faces)
