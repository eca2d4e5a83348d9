"""Parts of a picture within which brightness makes no step, and what lies around them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from garment_dataset.vision.color.masks import square

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray
    from garment_dataset.vision.color.seen import Seen

    Place = tuple[NDArray[np.intp], NDArray[np.intp]]

_RING_PX = 6  # how far around a surface to look, blurred edges included
_LATTICE_PX = 8


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A part of the picture without a step: where it is, its pixels and those around it."""

    box: tuple[slice, slice]
    mask: BoolArray
    ring: BoolArray

    @classmethod
    def of(cls, labels: NDArray[Any], label: int, place: Place) -> Surface:
        """Return the surface of a number, the rows and columns of whose pixels are given."""
        (top, bottom), (left, right) = ((int(each.min()), int(each.max()) + 1) for each in place)
        box = slice(max(top - _RING_PX, 0), bottom + _RING_PX), slice(max(left - _RING_PX, 0), right + _RING_PX)
        mask = np.asarray(labels[box] == label)
        ring = cv2.dilate(mask.view(np.uint8), square(2 * _RING_PX + 1)).astype(np.bool_) & ~mask
        return cls(box, mask, ring)

    def contrast(self, seen: Seen, beside: BoolArray) -> float:
        """Return the difference of the channel that differs most, in grey levels; infinite without a neighbour."""
        if np.count_nonzero(beside) < 5:
            return np.inf
        close = self.mask & cv2.dilate(beside.view(np.uint8), square(2 * _RING_PX + 1)).astype(np.bool_)
        if not close.any():
            return np.inf
        there, here = (seen.typical_change(self.box, pixels) for pixels in (beside, close))
        return float(np.abs(there - here).max())


def surfaces_of(
    labels: NDArray[Any], lit: BoolArray, least_lit_px: int, least_px: int
) -> tuple[BoolArray, list[Surface]]:
    """Tell the wall from other surfaces.

    Nearly all of a picture is one lit surface: it is found by a lattice of pixels, and taken out before the
    others are counted.

    Parameters
    ----------
    labels : (h, w) int
        Number of each pixel's surface; 0 is none.
    lit : (h, w) bool
        Which of their pixels are as in the empty scene.
    least_lit_px : int
        How many of these make a surface wall.
    least_px : int
        Smaller surfaces are none.

    Returns
    -------
    wall : (h, w) bool
        Surfaces that are wall.
    surfaces : list of Surface
        The others, by their numbers.
    """
    coarse = (slice(None, None, _LATTICE_PX),) * 2
    counts = np.bincount(labels[coarse][lit[coarse]], minlength=1)
    wall = np.asarray(labels == (np.argmax(counts) if counts.max() >= least_lit_px else -1))
    others = cv2.findNonZero(((labels > 0) & ~wall).view(np.uint8))
    if others is None:
        return wall, []
    u, v = others.reshape(-1, 2).T
    rest = labels[v, u]
    is_wall = np.bincount(rest, lit[v, u], minlength=1) >= least_lit_px
    of_wall = is_wall[rest]
    wall[v[of_wall], u[of_wall]] = True
    large = np.flatnonzero((np.bincount(rest, minlength=1) >= least_px) & ~is_wall)
    return wall, [Surface.of(labels, label, (v[rest == label], u[rest == label])) for label in large.tolist()]
