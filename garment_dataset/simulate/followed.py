"""The truth of tracks: material points that are followed from where they are seen at first.

The points in the middles of equally long segments of the visible profile, in the first depth frame, are points of the
cloth. From then on they stay on it, seen or not, whatever the visible profile does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.simulate.subdivide import Blend

if TYPE_CHECKING:
    from numpy.typing import NDArray


def seen_on(points_m: NDArray[np.float64], surface_m: NDArray[np.float64], triangles: NDArray[np.intp]) -> Blend:
    """Return the weights of the vertices whose mean lies on the line of sight of each point, nearest to it.

    Parameters
    ----------
    points_m : ndarray, shape (P, 3)
        On the surface, or between two of its layers, before the camera in the origin.
    surface_m : ndarray, shape (V, 3)
        Vertices.
    triangles : ndarray of int, shape (T, 3)
        The mesh.

    Notes
    -----
    A point p is a mean of the corners a, b, c of a triangle, up to a factor along its line of sight, with the weights
    p x b . c, p x c . a and p x a . b over their sum, all of one sign. Where a ray meets several triangles, the one
    whose depth is nearest to the point's counts; where it meets none, the triangle that it misses by least.
    """
    a, b, c = (surface_m[triangles[:, k]] for k in range(3))
    index = np.zeros((len(points_m), 3), dtype=np.intp)
    weight = np.zeros((len(points_m), 3))
    normals = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    for row, point in enumerate(points_m):
        shares = normals @ point
        total = shares.sum(axis=1, keepdims=True)
        shares /= np.where(np.abs(total) < 1e-15, 1e-15, total)
        away_m = np.abs(np.einsum("tk,tk->t", shares, np.stack([a[:, 2], b[:, 2], c[:, 2]], axis=1)) - point[2])
        missed = np.maximum(-shares.min(axis=1), 0.0)
        hit = missed < 1e-9
        best = int(np.flatnonzero(hit)[np.argmin(away_m[hit])]) if hit.any() else int(np.argmin(missed + away_m))
        index[row], weight[row] = triangles[best], shares[best]
    return Blend(index, weight)
