"""Rigid motions as plain numbers, with what they rest on in time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from garment_dataset.bags.quaternions import Quaternion, Vector, conjugate, multiply, rotate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray


class Pose(NamedTuple):
    """A rigid motion from one frame to another.

    Parameters
    ----------
    translation : Vector
        In metres.
    quaternion : Quaternion
        Of unit length.
    gap_ns, bracket_ns : int
        Distance in time to the nearest sample, and length of the span that was interpolated across.
    """

    translation: Vector
    quaternion: Quaternion
    gap_ns: int = 0
    bracket_ns: int = 0


class Poses(NamedTuple):
    """Rigid motions at N times: as :class:`Pose`, each number an array of shape (N,), or one that holds for all."""

    translation: tuple[Any, Any, Any]
    quaternion: tuple[Any, Any, Any, Any]
    gap_ns: Any
    bracket_ns: Any


IDENTITY = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


@dataclass(frozen=True, eq=False, slots=True)
class Transform:
    """A rigid motion that takes coordinates in ``source`` to coordinates in ``target``.

    Parameters
    ----------
    translation : (3,) float64
        Origin of ``source`` in ``target``, in metres.
    quaternion_xyzw : (4,) float64
        Rotation, of unit norm.
    nearest_sample_gap_ns : int
        Distance in time from the stamp asked for to the nearest sample, of the link where it is largest; links of
        ``/tf_static`` hold at all times and count 0.
    bracket_ns : int
        Longest time between two unequal samples that were interpolated between; 0 when there were none. The two
        samples of a fixed link are equal, however rarely it is published.
    """

    translation: NDArray[np.float64]
    quaternion_xyzw: NDArray[np.float64]
    nearest_sample_gap_ns: int
    bracket_ns: int

    def apply(self, points_m: ArrayLike) -> NDArray[np.float64]:
        """Take points of ``source`` into ``target``.

        Parameters
        ----------
        points_m : array-like, shape (..., 3)
            In metres.

        Returns
        -------
        (..., 3) float64
        """
        x, y, z = np.asarray(points_m, dtype=np.float64).T
        (ax, ay, az, w), (ox, oy, oz) = self.quaternion_xyzw.tolist(), self.translation.tolist()
        tx, ty, tz = 2.0 * (ay * z - az * y), 2.0 * (az * x - ax * z), 2.0 * (ax * y - ay * x)
        moved = (
            x + w * tx + (ay * tz - az * ty) + ox,
            y + w * ty + (az * tx - ax * tz) + oy,
            z + w * tz + (ax * ty - ay * tx) + oz,
        )
        return np.array(moved).T


def compose(outer: Pose, inner: Pose) -> Pose:
    """Apply ``inner`` first, then ``outer``."""
    gap_ns, bracket_ns = max(outer.gap_ns, inner.gap_ns), max(outer.bracket_ns, inner.bracket_ns)
    return Pose(*_composed(outer, inner), gap_ns, bracket_ns)


def compose_all(outer: Poses, inner: Poses) -> Poses:
    """Do as :func:`compose` at every time, with the same results to the last bit."""
    gap_ns, bracket_ns = np.maximum(outer.gap_ns, inner.gap_ns), np.maximum(outer.bracket_ns, inner.bracket_ns)
    return Poses(*_composed(outer, inner), gap_ns, bracket_ns)


def inverse(pose: Pose) -> Pose:
    """Return the motion back."""
    return Pose(*_inverted(pose), pose.gap_ns, pose.bracket_ns)


def inverse_all(poses: Poses) -> Poses:
    """Do as :func:`inverse` at every time, with the same results to the last bit."""
    return Poses(*_inverted(poses), poses.gap_ns, poses.bracket_ns)


def arranged(poses: Sequence[Pose]) -> Poses:
    """Return single poses as arrays."""
    numbers = np.array([(*each.translation, *each.quaternion) for each in poses], np.float64).reshape(-1, 7).T
    times_ns = np.array([(each.gap_ns, each.bracket_ns) for each in poses], np.int64).reshape(-1, 2).T
    x, y, z, qx, qy, qz, qw = numbers
    return Poses((x, y, z), (qx, qy, qz, qw), *times_ns)


def columns(numbers: Sequence[Any], count: int) -> NDArray[Any]:
    """Return numbers of :class:`Poses` as rows, one per time: shape (``count``, number of numbers)."""
    return np.stack([np.broadcast_to(each, count) for each in numbers], axis=1)


def _composed(outer: Pose | Poses, inner: Pose | Poses) -> tuple[Vector, Quaternion]:
    moved, origin = rotate(outer.quaternion, inner.translation), outer.translation
    translation = (moved[0] + origin[0], moved[1] + origin[1], moved[2] + origin[2])
    return translation, multiply(outer.quaternion, inner.quaternion)


def _inverted(pose: Pose | Poses) -> tuple[Vector, Quaternion]:
    back = conjugate(pose.quaternion)
    moved = rotate(back, pose.translation)
    return (-moved[0], -moved[1], -moved[2]), back
