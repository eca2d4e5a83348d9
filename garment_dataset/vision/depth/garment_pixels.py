"""Which pixels of a depth image show the garment, all of it and not only its profile; and where they are in space.

Thesis 5.3.1 to 5.3.3 without the strip of eq. (5.9): what lies in the band, below the gripper, and hangs from it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from garment_dataset.vision.depth.cloud import band_limits_mm

if TYPE_CHECKING:
    from garment_dataset.arrays import BoolArray, DepthImage, FloatArray, IntArray
    from garment_dataset.vision.depth.cloud import Intrinsics, Point

_BRIDGE_M = 0.03
"""Pieces of the garment are no farther from each other in the image: what shadows of the sensor and seams cut out."""


def garment_mask(
    depth_mm: DepthImage,
    intrinsics: Intrinsics,
    gripper_m: Point,
    *,
    band_half_width_m: float,
    hold_reach_m: float,
) -> BoolArray:
    """Return the pixels that show what hangs from the gripper.

    Parameters
    ----------
    depth_mm : (H, W) uint16
        Distance along the optical axis in millimetres; 0 means no return.
    intrinsics : Intrinsics
        Of this image.
    gripper_m : (x, y, z)
        End point of the gripper.
    band_half_width_m : float
        Depth from the gripper's that is kept, eq. (5.8), bounds included.
    hold_reach_m : float
        A piece of the image belongs to the garment if it comes so near to the end point, in space, or is within 3 cm
        of one that does.

    Returns
    -------
    (H, W) bool
        All false where nothing hangs there.
    """
    near_mm, far_mm = band_limits_mm(gripper_m[2], band_half_width_m)
    inside = (depth_mm >= near_mm) & (depth_mm <= far_mm)
    rows, columns = np.nonzero(inside)
    position_m = _back_projected(depth_mm, rows, columns, intrinsics)
    below = position_m[:, 1] >= gripper_m[1]
    inside[rows[~below], columns[~below]] = False
    held = below & (np.linalg.norm(position_m - np.asarray(gripper_m), axis=1) <= hold_reach_m)
    if not held.any():
        return np.zeros(depth_mm.shape, np.bool_)
    size = 2 * max(1, round(_BRIDGE_M / 2 * intrinsics.fx_px / gripper_m[2])) + 1
    grown = cv2.dilate(inside.astype(np.uint8), np.ones((size, size), np.uint8))
    _, label = cv2.connectedComponents(grown, connectivity=8)
    mask: BoolArray = inside & np.isin(label, np.unique(label[rows[held], columns[held]]))
    return mask


def back_project(depth_mm: DepthImage, mask: BoolArray, intrinsics: Intrinsics) -> FloatArray:
    """Return the points of some pixels in the optical frame, thesis eq. (5.6), row by row.

    Parameters
    ----------
    depth_mm : (H, W) uint16
        Distance along the optical axis in millimetres.
    mask : (H, W) bool
        Which pixels.
    intrinsics : Intrinsics
        Of this image; lens distortion is left alone, as everywhere.

    Returns
    -------
    (n, 3) float64
        x right, y down, z forward, in metres.
    """
    rows, columns = np.nonzero(mask)
    return _back_projected(depth_mm, rows, columns, intrinsics)


def _back_projected(depth_mm: DepthImage, rows: IntArray, columns: IntArray, intrinsics: Intrinsics) -> FloatArray:
    z_m = depth_mm[rows, columns].astype(np.float64) / 1000
    x_m = (columns - intrinsics.cx_px) / intrinsics.fx_px * z_m
    y_m = (rows - intrinsics.cy_px) / intrinsics.fy_px * z_m
    return np.stack([x_m, y_m, z_m], axis=1)
