"""How far a silhouette can be trusted, from what the picture itself shows, and why not further."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

import cv2
import numpy as np

from garment_dataset.vision.color.masks import square
from garment_dataset.vision.color.seen import middle

if TYPE_CHECKING:
    from garment_dataset.arrays import BoolArray, ByteMask, FloatArray

Doubt = Literal["like_wall", "edges", "torn"]
"""What speaks most against a silhouette.

``like_wall``: parts of it are as grey as the wall, and as bright as a shadow or the wall itself, so that others of the
kind may be missing, or a shadow be among them. ``edges``: it has many pixels at its edges, or little contrast there for
the noise. ``torn``: parts that hang together with it nowhere were left out.
"""

# Weights by least squares on wide draws of `garment simulate`, so that it is about the IoU to expect
_LIKE_WALL = 0.25
_BY_EDGES_ALONE = 0.5  # not fitted: it may as well be none
_DOUBTFUL = 0.15  # more than fits: shadows with sharp edges are rare among the draws, pale parts of cloth too
_EDGES_PX = 13.0  # by which an edge is off, by noise over contrast
_TORN = 1.0
_SURE = 0.95


class Confidence(NamedTuple):
    """How far a silhouette can be trusted.

    Parameters
    ----------
    value : float
        About the intersection over union with the truth to expect, 0 to 1.
    doubt : str or None
        What lowers it most; None where it is at least 0.95.
    """

    value: float
    doubt: Doubt | None


def confidence(
    mask: ByteMask,
    distance: FloatArray,
    pale: BoolArray,
    *,
    by_edges_alone: bool,
    doubtful_px: int,
    lost_px: int,
    noise: float,
) -> Confidence:
    """Judge a silhouette.

    Parameters
    ----------
    mask : (H, W) uint8
        Of the garment, 0 or 1; not empty.
    distance : (n,) float
        Distances of the colours of its :func:`inner_part` from those expected without a garment, in grey levels.
    pale : (H, W) bool
        Which pixels could as well be the wall, in a shallow shadow.
    by_edges_alone : bool
        Whether all of it could be a shadow.
    doubtful_px : int
        Pixels beside it that were taken for a shadow, but could be cloth.
    lost_px : int
        Pixels that look like garment, but hang together with it nowhere.
    noise : float
        Standard deviation of brightness, in grey levels.
    """
    area_px = int(np.count_nonzero(mask))
    inner_px = len(distance) if len(distance) < area_px else 0  # all of it where nothing is inner
    contrast = max(middle(distance, len(distance)), noise)
    edge_share = 1 - inner_px / area_px
    pale_px = int(np.count_nonzero(pale & mask.view(np.bool_)))
    could_be_wall = _LIKE_WALL * (pale_px / area_px) + _BY_EDGES_ALONE * by_edges_alone
    could_be_cloth = _DOUBTFUL * doubtful_px / (area_px + doubtful_px)
    losses: dict[Doubt, float] = {
        "like_wall": could_be_wall + could_be_cloth,
        "edges": _EDGES_PX * edge_share * noise / contrast,
        "torn": _TORN * lost_px / (area_px + lost_px),
    }
    value = max(0.0, 1 - sum(losses.values()))
    most: Doubt = max(losses, key=lambda name: losses[name])
    return Confidence(value, None if value >= _SURE else most)


def inner_part(mask: ByteMask) -> ByteMask:
    """Return the pixels of a mask that lie at no edge; all where there are none.

    Parameters
    ----------
    mask : (H, W) uint8
        0 or 1.
    """
    inner = np.asarray(cv2.erode(mask, square(3), borderType=cv2.BORDER_CONSTANT, borderValue=0), np.uint8)
    return inner if inner.any() else mask
