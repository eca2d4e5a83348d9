"""A frame that stands level, so that what hangs is shown hanging down."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import FloatArray

LEVEL = "level"
"""Its name: at the camera, z up, x along the optical axis as far as that is level."""

_LEAST_LEVEL = 0.1  # an optical axis within 6 degrees of the vertical points nowhere that is level


def level_quaternion_xyzw(gravity: FloatArray) -> FloatArray:
    """Return the rotation from an optical frame to the level one at the same place.

    Parameters
    ----------
    gravity : (3,) float64
        Unit vector of gravity in the optical frame (x right, y down, z forward).

    Returns
    -------
    (4,) float64
        Quaternion x y z w. A camera that looks straight up or down has the x axis along the top of its image.
    """
    up = -gravity
    forward = np.array([0.0, 0.0, 1.0])
    ahead = forward - (forward @ up) * up
    if np.linalg.norm(ahead) < _LEAST_LEVEL:
        top = np.array([0.0, -1.0, 0.0])
        ahead = top - (top @ up) * up
    ahead /= np.linalg.norm(ahead)
    return _quaternion_xyzw(np.stack([ahead, np.cross(up, ahead), up]))


def _quaternion_xyzw(rotation: FloatArray) -> FloatArray:
    """Return the quaternion of a rotation matrix: the eigenvector of the largest eigenvalue (Bar-Itzhack, 2000)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation.tolist()
    matrix = np.array(
        [
            [xx - yy - zz, yx + xy, zx + xz, zy - yz],
            [yx + xy, yy - xx - zz, zy + yz, xz - zx],
            [zx + xz, zy + yz, zz - xx - yy, yx - xy],
            [zy - yz, xz - zx, yx - xy, xx + yy + zz],
        ]
    )
    quaternion = np.linalg.eigh(matrix)[1][:, -1]
    found: FloatArray = np.where(quaternion[3] < 0, -1.0, 1.0) * quaternion
    return found
