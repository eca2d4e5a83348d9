"""How the cameras look at the scene: level, or tilted about the place where the gripper rests.

The scene is computed as a level camera sees it. A tilted one sees it turned about that place: cloth and gripper stay in
the image, and which way is down changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.simulate.motion import REST_GRIPPER_M

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.simulate.scene import Solid

_PIVOT_M = np.array(REST_GRIPPER_M)


@dataclass(frozen=True, slots=True)
class CameraPose:
    """How far the cameras are tilted.

    Parameters
    ----------
    tilt_rad : (float, float) or None
        How far they look up, and then lean to their right; None: level.
    """

    tilt_rad: tuple[float, float] | None = None

    @property
    def rotation(self) -> NDArray[np.float64]:
        """What takes directions in the level camera's frame to the tilted one's, shape (3, 3)."""
        up, right = (0.0, 0.0) if self.tilt_rad is None else self.tilt_rad
        about_x = np.array([[1, 0, 0], [0, np.cos(up), np.sin(up)], [0, -np.sin(up), np.cos(up)]])
        about_z = np.array([[np.cos(right), np.sin(right), 0], [-np.sin(right), np.cos(right), 0], [0, 0, 1]])
        turn: NDArray[np.float64] = about_z @ about_x
        return turn

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The same for points, shape (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = _PIVOT_M - self.rotation @ _PIVOT_M
        return matrix

    def see(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points, shape (..., 3), as these cameras see them."""
        if self.tilt_rad is None:
            return points_m
        seen: NDArray[np.float64] = (points_m - _PIVOT_M) @ self.rotation.T + _PIVOT_M
        return seen

    def level(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points, shape (..., 3), that these cameras see as given, as a level camera sees them."""
        if self.tilt_rad is None:
            return points_m
        seen: NDArray[np.float64] = (points_m - _PIVOT_M) @ self.rotation + _PIVOT_M
        return seen

    def turn(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return directions or velocities, shape (..., 3), as these cameras see them."""
        if self.tilt_rad is None:
            return vectors
        turned: NDArray[np.float64] = vectors @ self.rotation.T
        return turned

    def see_solid(self, solid: Solid) -> Solid:
        """Return a solid as these cameras see it."""
        return solid if self.tilt_rad is None else solid.moved(self.matrix[:3, :3], self.matrix[:3, 3])


LEVEL = CameraPose()
