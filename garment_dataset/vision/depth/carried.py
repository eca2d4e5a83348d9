"""What the points of one frame rest on: pixels, a bridge, or nothing."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.vision.depth.cloud import level_spacing_m

if TYPE_CHECKING:
    from garment_dataset.arrays import BoolArray, DepthImage, FloatArray
    from garment_dataset.vision.depth.chain import Chain, ChainPoints
    from garment_dataset.vision.depth.cloud import Intrinsics
    from garment_dataset.vision.depth.support import PointReason

_CONFIDENCE = 3.0
"""A point farther from every pixel than that many of its standard uncertainties, and a level, is on nothing. Neither is
one that is a jump away from them, unless it is on a bridge."""

_LARGEST_HALF_PX = 12
"""So far around a point pixels are looked for, at most: 22 mm at 1.07 m, half of the longest bridge and more."""


def judge_points(
    points: ChainPoints,
    chain: Chain,
    away_m: FloatArray,
    gripper_z_m: float,
    *,
    band_half_width_m: float,
    jump_m: float,
) -> ChainPoints:
    """Take away the points that nothing carries, and say on what the others rest.

    Parameters
    ----------
    points : ChainPoints
        Of one frame.
    chain : Chain
        On which they are.
    away_m : (r,) float64
        How far the points are from the nearest pixel of the frame.
    gripper_z_m : float
        Depth of the end point.
    band_half_width_m : float
        Depth from it that a garment can have, eq. (5.8).
    jump_m : float
        Neighbouring samples whose depths differ by more are on two layers.

    Returns
    -------
    ChainPoints
        NaN, with a reason, where there is none.
    """
    arc_m, (_, _, z_m) = points.arc_length_m, points.position_m
    link = np.searchsorted(chain.arc_length_m[1:-1], arc_m, side="right")
    ends = np.stack([link, link + 1])
    # a link has the worse of its ends, NaN included; a point before the first sample lies with it at the hold
    bridged_m = chain.support.bridged_m[ends].max(axis=0)
    start_z_m, end_z_m = chain.position_m[2, ends]
    layers = (np.abs(end_z_m - start_z_m) > jump_m) & (arc_m > chain.arc_length_m[0])
    layers |= chain.support.between_layers[ends].any(axis=0)
    # how far a point may slide along the cloth says nothing of how far it may be off it
    limit_m = np.where(bridged_m > 0, np.inf, jump_m)
    unsupported = (away_m > limit_m) | (away_m > _reach_m(points))
    beyond = np.abs(z_m - gripper_z_m) > band_half_width_m
    gap = np.isnan(bridged_m)
    none = layers | gap | beyond | unsupported
    pixels = points.pixels * (bridged_m == 0)
    if not none.any():
        return replace(points, pixels=pixels, bridged_m=bridged_m)
    verdicts: tuple[tuple[PointReason, BoolArray], ...] = (
        ("between_layers", layers),
        ("gap", gap),
        ("beyond_band", beyond),
        ("unsupported", unsupported),
    )
    return replace(
        points,
        position_m=np.where(none, np.nan, points.position_m),
        std_m=np.where(none, np.nan, points.std_m),
        fixed_std_m=np.where(none, np.nan, points.fixed_std_m),
        arc_length_m=np.where(none, np.nan, arc_m),
        pixels=pixels * ~none,
        bridged_m=np.where(none, np.nan, bridged_m),
        reasons=tuple(next((reason for reason, holds in verdicts if holds[i]), None) for i in range(arc_m.size)),
    )


def _reach_m(points: ChainPoints) -> FloatArray:
    """Return how far the nearest pixel of each point may be, (r,)."""
    std_m: FloatArray = np.sqrt((points.std_m**2).sum(axis=0))
    return _CONFIDENCE * std_m + level_spacing_m(points.position_m[2])


def distance_m(points: ChainPoints, measured_m: FloatArray) -> FloatArray:
    """Return how far points are from the nearest of some measured positions, (3, n): (r,)."""
    apart_m = points.position_m[:, :, None] - measured_m[:, None, :]
    squared = np.einsum("ijk,ijk->jk", apart_m, apart_m)
    away_m: FloatArray = np.sqrt(squared.min(axis=1))
    return away_m


def pixel_distance_m(points: ChainPoints, depth_mm: DepthImage, intrinsics: Intrinsics) -> FloatArray:
    """Return how far points are from the nearest pixel of an image, as far as they may be: (r,); inf beyond that."""
    x_m, y_m, z_m = points.position_m
    u, v = intrinsics.cx_px + intrinsics.fx_px * x_m / z_m, intrinsics.cy_px + intrinsics.fy_px * y_m / z_m
    half = math.ceil(float((_reach_m(points) / z_m).max()) * max(intrinsics.fx_px, intrinsics.fy_px))
    half = min(half, _LARGEST_HALF_PX)
    around = np.arange(-half, half + 1)
    rows, columns = np.rint(v).astype(np.intp)[:, None] + around, np.rint(u).astype(np.intp)[:, None] + around
    rows, columns = rows.clip(0, depth_mm.shape[0] - 1), columns.clip(0, depth_mm.shape[1] - 1)
    pixel_z_m = depth_mm[rows[:, :, None], columns[:, None, :]] / 1000
    away_x_m = pixel_z_m * ((columns - intrinsics.cx_px) / intrinsics.fx_px)[:, None, :] - x_m[:, None, None]
    away_y_m = pixel_z_m * ((rows - intrinsics.cy_px) / intrinsics.fy_px)[:, :, None] - y_m[:, None, None]
    # a pixel without return would be at the camera, farther than anything
    squared = away_x_m**2 + away_y_m**2 + (pixel_z_m - z_m[:, None, None]) ** 2
    away_m: FloatArray = np.sqrt(squared.min(axis=(1, 2)))
    return away_m
