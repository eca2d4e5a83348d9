"""Points that stay on the material: from images and where the points are at rest to tracks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from garment_dataset.vision.cloth.patch import patch_at_rest
from garment_dataset.vision.cloth.relief import fold_std_m, relief_m
from garment_dataset.vision.cloth.sight import look, sample, trimmed
from garment_dataset.vision.cloth.solve import carry
from garment_dataset.vision.cloth.warp import Warp

if TYPE_CHECKING:
    from collections.abc import Iterable

    from garment_dataset.arrays import BoolArray, DepthImage, FloatArray, IntArray
    from garment_dataset.vision.cloth.sight import Reading, Sight
    from garment_dataset.vision.cloth.warp import WarpSettings
    from garment_dataset.vision.depth.cloud import Intrinsics

TrackReason = Literal["no_gripper", "image_size", "no_rest", "no_start", "no_garment", "stamp"]
"""Why there is no track.

``no_gripper``: the end point is not known at this frame. ``image_size``: the image is not of the size that K is for.
``no_rest``: fewer frames than ``least_rest_frames`` show the gripper before it moves. ``no_start``: at rest there is no
such point. ``no_garment``: no layer of cloth is seen below the gripper at rest. ``stamp``: it is not later than those
of images before it.
"""

_VISIBLE_M = 0.012
"""A surface so near to a point along the line of sight is the point's own layer."""


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Points in every frame.

    Parameters
    ----------
    position_m, std_m : (T, r, 3) float64
        In the optical frame, and the standard uncertainty; NaN for points without a start.
    visible : (T, r) bool
        Whether the image shows the cloth there.
    """

    position_m: FloatArray
    std_m: FloatArray
    visible: BoolArray


def frames_at_rest(gripper_m: FloatArray, *, threshold_m: float, margin: int, most: int, least: int) -> IntArray | None:
    """Return the last frames before the gripper moves.

    Parameters
    ----------
    gripper_m : (T, 3) float64
        End point, by time.
    threshold_m : float
        Distance from where it is at first that counts as motion.
    margin : int
        Frames right before that are left out.
    most, least : int
        How many are taken; None with fewer.
    """
    if gripper_m.shape[0] == 0:
        return None
    away_m = np.linalg.norm(gripper_m - gripper_m[:1], axis=1)
    moving = away_m > threshold_m
    stop = max(int(moving.argmax()) - margin, 0) if moving.any() else gripper_m.shape[0]
    rest = np.arange(max(stop - most, 0), stop)
    return rest if rest.size >= least else None


def follow(
    images: Iterable[DepthImage],
    time_s: FloatArray,
    grippers_m: FloatArray,
    rest: IntArray,
    start_m: FloatArray,
    start_std_m: FloatArray,
    intrinsics: Intrinsics,
    reading: Reading,
    settings: WarpSettings,
) -> Tracks | None:
    """Carry the patch that is seen at rest through the images, and the points on it.

    Parameters
    ----------
    images : iterable of (H, W) uint16, length T
        In millimetres, by time. Taken once; no more than those at rest are kept.
    time_s : (T,) float64
        Ascending, all different.
    grippers_m : (T, 3) float64
        End point of the gripper.
    rest : (n,) int64
        Frames that show the rest.
    start_m, start_std_m : (r, 3) float64
        The points at rest, relative to the gripper; NaN where there is none.
    intrinsics : Intrinsics
        Of the images.
    reading : Reading
        How they are read.
    settings : WarpSettings
        See there.

    Returns
    -------
    Tracks or None
        None when no garment is seen at rest.
    """
    at_rest_m, resting = grippers_m[rest].mean(axis=0), set(rest.tolist())
    sights, still = [], []
    for frame, (image, gripper_m) in enumerate(zip(images, grippers_m, strict=True)):
        sights.append(trimmed(look(image, intrinsics, gripper_m, reading)))
        if frame in resting:
            # the gripper rests, so that all crops are the first one's but for its noise
            still.append(look(image, intrinsics, at_rest_m, reading))
    patch = patch_at_rest(still, at_rest_m, intrinsics, reach_m=reading.reach_m)
    if patch is None:
        return None
    warp = Warp(patch, sights, grippers_m, intrinsics, settings)
    controls_m = carry(warp, time_s, rest, settings)
    known = np.isfinite(start_m.sum(axis=1))
    blend = warp.lattice.blend(np.where(known[:, None], start_m, 0.0))
    moved_m = np.stack([blend.apply(own) for own in controls_m])
    position_m = start_m + moved_m + grippers_m[:, None]
    own_std_m = np.stack([warp.std_m(frame, controls_m[frame], blend) for frame in range(time_s.size)])
    misfit_m = np.array([warp.misfit_m(frame, own) for frame, own in enumerate(controls_m)])
    worse_m = np.sqrt(np.maximum(misfit_m**2 - np.nanmean(misfit_m[rest] ** 2), 0.0))
    folds_m = fold_std_m(*relief_m(patch.places_m, start_m), moved_m, worse_m, settings.fold_share)
    std_m = np.sqrt((settings.caution * own_std_m) ** 2 + start_std_m**2 + folds_m**2)
    seen = [_seen(position_m[frame], sight, intrinsics) for frame, sight in enumerate(sights)]
    return Tracks(position_m, np.where(known[:, None], std_m, np.nan), np.stack(seen))


def _seen(point_m: FloatArray, sight: Sight, intrinsics: Intrinsics) -> BoolArray:
    """Return which points (r, 3) the image shows: the surface there is neither before nor behind them."""
    x_m, y_m, z_m = np.where(np.isfinite(point_m), point_m, 1.0).T
    u = intrinsics.cx_px + intrinsics.fx_px * x_m / z_m - sight.corner_px[0]
    v = intrinsics.cy_px + intrinsics.fy_px * y_m / z_m - sight.corner_px[1]
    near: BoolArray = np.abs(sample(sight.z_m, u, v) - z_m) <= _VISIBLE_M
    return near & np.isfinite(point_m).all(axis=1)
