"""Masks as polygons that a person can read and edit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import BoolArray


def polygon_of(mask: BoolArray, *, tolerance_px: float = 2.0) -> list[tuple[int, int]]:
    """Draw a polygon around the largest region of a mask; its holes are filled.

    Parameters
    ----------
    mask : (H, W) bool
    tolerance_px : float
        Farthest that the border may be from the polygon.

    Returns
    -------
    list of (u, v)
        Corners in whole pixels, which belong to the region; fewer than three for a region that is a line or a point,
        none for an empty mask. What :func:`~garment_dataset.vision.color.masks.polygon_mask` fills.

    Notes
    -----
    Lines are simplified as D. Douglas and T. Peucker, *Cartographica* 10 (1973), describe.
    """
    contours, _ = cv2.findContours(mask.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if len(contours) == 0:
        return []
    corners = cv2.approxPolyDP(max(contours, key=cv2.contourArea), tolerance_px, closed=True)
    return [(int(u), int(v)) for u, v in corners[:, 0, :]]
