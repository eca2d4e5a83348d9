"""Which triangle each pixel sees, and at what depth: a z-buffer in numpy.

Exact at the pixel centres: the inverse depth of a plane is linear in the image, so it is evaluated, not approximated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

WIDTH_PX = 640
HEIGHT_PX = 480
_NEAR_M = 0.05
_BOX_SIZES = (4, 6, 8, 12, 16, 24, 32, 64, 128, 256, 640)
_BATCH = 400_000


@dataclass(frozen=True, slots=True)
class Pinhole:
    """A camera without distortion whose axes are those of the depth camera.

    Parameters
    ----------
    focal_px : float
        Focal length along u and v.
    cx_px, cy_px : float
        Principal point; pixel centres are at integers.
    origin_m : tuple of float
        Place of the camera in the depth optical frame.
    frame_id : str
        Its optical frame.
    """

    focal_px: float
    cx_px: float
    cy_px: float
    origin_m: tuple[float, float, float]
    frame_id: str

    def project(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return u, v in pixels and inverse depth in 1/m of points in the depth optical frame, shape (..., 3)."""
        local = points_m - np.array(self.origin_m)
        inverse = 1.0 / local[..., 2]
        return np.stack(
            [
                self.focal_px * local[..., 0] * inverse + self.cx_px,
                self.focal_px * local[..., 1] * inverse + self.cy_px,
                inverse,
            ],
            axis=-1,
        )


@dataclass
class Buffer:
    """What has been drawn so far.

    Parameters
    ----------
    inverse_depth : ndarray, shape (H, W)
        1/z in 1/m; 0 where nothing is.
    triangle : ndarray of int32, shape (H, W)
        Index of the visible triangle among the last mesh drawn; -1 elsewhere.
    """

    inverse_depth: NDArray[np.float64]
    triangle: NDArray[np.int32]

    @classmethod
    def empty(cls) -> Buffer:
        """Return a buffer with nothing in it."""
        shape = (HEIGHT_PX, WIDTH_PX)
        return cls(np.zeros(shape), np.full(shape, -1, dtype=np.int32))

    def under(self) -> Buffer:
        """Return a copy for drawing another mesh in front of this one."""
        return Buffer(self.inverse_depth.copy(), np.full(self.triangle.shape, -1, dtype=np.int32))


def planes(image: NDArray[np.float64], triangles: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return how barycentric coordinates vary over the image.

    Parameters
    ----------
    image : ndarray, shape (V, 3)
        Projected vertices: u, v, inverse depth.
    triangles : ndarray of int, shape (T, 3)
        The mesh.

    Returns
    -------
    ndarray, shape (T, 2, 3)
        For the first two vertices: the coordinate at the triangle's third vertex's place (0), and its slope along u
        and v; NaN for triangles seen edge-on.
    """
    a, b, c = (image[triangles[:, k], :2] for k in range(3))
    ac, bc = a - c, b - c
    area = ac[:, 0] * bc[:, 1] - ac[:, 1] * bc[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(np.abs(area) > 1e-9, 1.0 / area, np.nan)
    zero = np.zeros(len(triangles))
    first = np.stack([zero, bc[:, 1] * inverse, -bc[:, 0] * inverse], axis=1)
    second = np.stack([zero, -ac[:, 1] * inverse, ac[:, 0] * inverse], axis=1)
    return np.stack([first, second], axis=1)


def draw(buffer: Buffer, image: NDArray[np.float64], triangles: NDArray[np.intp]) -> None:
    """Draw a mesh into the buffer where it is nearer than what is there.

    Parameters
    ----------
    buffer : Buffer
        Changed in place.
    image : ndarray, shape (V, 3)
        Projected vertices: u, v, inverse depth. Triangles that reach behind the camera are left out.
    triangles : ndarray of int, shape (T, 3)
        The mesh.
    """
    corners = image[triangles]
    low = np.maximum(np.ceil(corners[..., :2].min(axis=1)), 0.0)
    high = np.minimum(np.floor(corners[..., :2].max(axis=1)), [WIDTH_PX - 1, HEIGHT_PX - 1])
    size = high - low + 1
    slopes = planes(image, triangles)
    before = (corners[..., 2] > 0).all(axis=1) & (corners[..., 2] < 1 / _NEAR_M).all(axis=1)
    drawn = np.flatnonzero((size > 0).all(axis=1) & before & np.isfinite(slopes[:, 0, 1]))
    box = np.searchsorted(_BOX_SIZES, size[drawn].max(axis=1))
    for kind in np.unique(box):
        members = drawn[box == kind]
        batch = max(1, _BATCH // _BOX_SIZES[kind] ** 2)
        for start in range(0, len(members), batch):
            chosen = members[start : start + batch]
            _draw_boxes(buffer, chosen, corners[chosen], slopes[chosen], low[chosen], size[chosen])


def _draw_boxes(
    buffer: Buffer,
    index: NDArray[np.intp],
    corners: NDArray[np.float64],
    slopes: NDArray[np.float64],
    low: NDArray[np.float64],
    size: NDArray[np.float64],
) -> None:
    """Draw triangles whose bounding boxes are of about one size."""
    columns = np.arange(size[:, 0].max())
    rows = np.arange(size[:, 1].max())
    du = (low[:, 0] - corners[:, 2, 0])[:, None] + columns
    dv = (low[:, 1] - corners[:, 2, 1])[:, None] + rows
    first = (slopes[:, 0, 1, None] * du)[:, None, :] + (slopes[:, 0, 2, None] * dv)[:, :, None]
    second = (slopes[:, 1, 1, None] * du)[:, None, :] + (slopes[:, 1, 2, None] * dv)[:, :, None]
    inside = (first >= -1e-9) & (second >= -1e-9) & (first + second <= 1 + 1e-9)
    inside &= (columns < size[:, 0, None])[:, None, :] & (rows < size[:, 1, None])[:, :, None]
    which, row, column = np.nonzero(inside)
    last = corners[which, 2, 2]
    first, second = first[inside], second[inside]
    inverse = last + first * (corners[which, 0, 2] - last) + second * (corners[which, 1, 2] - last)
    place = (low[which, 1].astype(np.intp) + row) * WIDTH_PX + low[which, 0].astype(np.intp) + column
    depths, owners = buffer.inverse_depth.reshape(-1), buffer.triangle.reshape(-1)
    nearer = inverse > depths[place]
    place, inverse, which = place[nearer], inverse[nearer], which[nearer]
    np.maximum.at(depths, place, inverse)
    seen = depths[place] == inverse
    owners[place[seen]] = index[which[seen]]


def interpolate(
    buffer: Buffer, image: NDArray[np.float64], triangles: NDArray[np.intp], values: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Return what the last mesh drawn shows, with values interpolated on its surface (perspective-correct).

    Parameters
    ----------
    buffer : Buffer
        As :func:`draw` left it.
    image, triangles
        What was drawn.
    values : ndarray, shape (V, C)
        Values at the vertices.

    Returns
    -------
    row, column : ndarray of int, shape (P,)
        The pixels that show the mesh.
    seen : ndarray, shape (P, C)
        Values there.
    """
    row, column = np.nonzero(buffer.triangle >= 0)
    owner = buffer.triangle[row, column]
    corner = triangles[owner]
    slopes = planes(image, triangles)[owner]
    du, dv = column - image[corner[:, 2], 0], row - image[corner[:, 2], 1]
    first = slopes[:, 0, 1] * du + slopes[:, 0, 2] * dv
    second = slopes[:, 1, 1] * du + slopes[:, 1, 2] * dv
    weights = np.stack([first, second, 1 - first - second], axis=1) * image[corner, 2]
    weights /= weights.sum(axis=1, keepdims=True)
    seen: NDArray[np.float64] = np.einsum("pk,pkc->pc", weights, values[corner])
    return row, column, seen
