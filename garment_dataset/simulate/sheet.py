"""A sheet of cloth as a body: its two sides, as far apart as it is thick, and the rim between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.simulate.cloth import ClothSpec

_BULK_KG_M3 = 150.0
"""Fabrics hold five to ten times as much air as fibre: woven ones 200 to 400, knits and terry 80 to 200 kg/m3."""

_LAYERS = 2.0
"""At its edges, which are what is seen of a sheet edge-on, a fabric is hemmed."""

_THINNEST_M, _THICKEST_M = 0.001, 0.004


def thickness_m(spec: ClothSpec) -> float:
    """Return how thick a garment is at its hems: 1 to 4 mm, by its mass per area."""
    return min(max(_LAYERS * spec.mass_kg / spec.area_m2() / _BULK_KG_M3, _THINNEST_M), _THICKEST_M)


def shell_triangles(triangles: NDArray[np.intp], vertices: int) -> NDArray[np.intp]:
    """Return the closed surface around a sheet.

    Parameters
    ----------
    triangles : ndarray of int, shape (T, 3)
        Of the sheet, all turned the same way.
    vertices : int
        V, how many vertices the sheet has.

    Returns
    -------
    ndarray of int, shape (2 T + 2 E, 3)
        Triangles of one side, of the other, whose vertices are V further on, and of the rim along the E edges of the
        sheet. All are turned outwards.
    """
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    ordered = np.sort(sides, axis=1)
    _, index, uses = np.unique(ordered[:, 0] * vertices + ordered[:, 1], return_index=True, return_counts=True)
    start, end = sides[index[uses == 1]].T
    rim = [np.stack([end, start, start + vertices], 1), np.stack([end, start + vertices, end + vertices], 1)]
    return np.concatenate([triangles, triangles[:, ::-1] + vertices, *rim])


def shell_m(vertices_m: NDArray[np.float64], normals: NDArray[np.float64], thick_m: float) -> NDArray[np.float64]:
    """Return the vertices of both sides of a sheet.

    Parameters
    ----------
    vertices_m, normals : ndarray, shape (V, 3)
        Places, and unit normals.
    thick_m : float
        Distance of the sides.

    Returns
    -------
    ndarray, shape (2 V, 3)
        First those on the side that the normals point to.
    """
    half = thick_m / 2 * normals
    return np.concatenate([vertices_m + half, vertices_m - half])


def facing(image: NDArray[np.float64], triangles: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return which triangles of a closed surface turn their outside to the camera, shape (T,).

    Parameters
    ----------
    image : ndarray, shape (V, 3)
        Projected vertices: u right, v down.
    triangles : ndarray of int, shape (T, 3)
        Turned outwards: seen from outside, their corners run counter-clockwise in a right-handed frame.
    """
    a, b, c = (image[triangles[:, k], :2] for k in range(3))
    ab, ac = b - a, c - a
    return np.asarray(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0] < 0)
