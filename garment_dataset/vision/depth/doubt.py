"""What a frame's own profile cannot tell of its points' uncertainty, and its neighbours in time can.

Layers that are seen in one frame and not in the next, and a hem that is not seen, make the way along the cloth longer
or shorter than it seems.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.vision.depth.smoothing import local_fit, seconds_apart, unrest
from garment_dataset.vision.depth.uncertainty import slid_m2

if TYPE_CHECKING:
    from garment_dataset.arrays import BoolArray, FloatArray, IntArray
    from garment_dataset.vision.depth.chain import ChainPoints, Track
    from garment_dataset.vision.depth.cloud import Point

UNREST_FRAMES = 17
"""Length of the parabolas about which points jump: half a second, some frames before and after a fold passes."""

ISLAND_SHARE = 0.5
"""Standard deviation of what is there or not, one as likely as the other."""


def unrest_m(stamp_ns: IntArray, points_m: FloatArray) -> FloatArray:
    """Return by how much points jump about in time more than they usually do, (T, 3, r).

    Where folds pass, one frame sees a layer that the next does not, and points change their places by more than their
    own frames can tell.

    Parameters
    ----------
    stamp_ns : (T,) int64
        When, in any order.
    points_m : (T, 3, r) float64
        Points relative to the gripper's end point.
    """
    order = np.argsort(stamp_ns, kind="stable")
    time_s = seconds_apart(stamp_ns[order])
    series = points_m[order].reshape(order.size, -1)
    restless = unrest(series - local_fit(time_s, series, UNREST_FRAMES, 2)[0])
    result_m = np.empty_like(points_m)
    result_m[order] = restless.reshape(points_m.shape)
    return result_m


def length_std_m(
    islands_m: FloatArray, below_m: float, track: Track, gripper_m: Point, points: ChainPoints
) -> FloatArray:
    r"""Return the standard uncertainties of points because the way may be longer or shorter than it seems, (3, r).

    Parameters
    ----------
    islands_m : (2, m) float64
        Where another layer may graze the profile: y, and the length of the way to it and back.
    below_m : float
        How much more there may be below, that is not seen.
    track : Track
        One frame's chain.
    gripper_m : (x, y, z)
        End point of the gripper.
    points : ChainPoints
        On it.

    Notes
    -----
    An island is there or not: the length is uncertain by :data:`ISLAND_SHARE` of the way, of which a point takes its
    share, or the rest if it lies below. Of what may be below it takes its share.
    """
    chain, arc_m = track.chain, points.arc_length_m
    share = arc_m / chain.length_m
    below = islands_m[0] < points.position_m[1][:, None]
    islands_m2 = ((share[:, None] - below) ** 2 * (ISLAND_SHARE * islands_m[1]) ** 2).sum(axis=1)
    along_m = np.sqrt(islands_m2 + (share * below_m) ** 2)
    nodes_m = np.column_stack([np.array(gripper_m), chain.position_m])
    path_m = np.append(0.0, chain.arc_length_m), nodes_m
    std_m: FloatArray = np.sqrt(slid_m2(path_m, points.position_m, arc_m, along_m))
    return std_m


def missing_m(stamp_ns: IntArray, length_m: FloatArray, whole: BoolArray) -> FloatArray:
    """Return how much of the garment is not seen where its hem is not: what it had more before and afterwards, (T,).

    Parameters
    ----------
    stamp_ns : (T,) int64
        When, in any order.
    length_m : (T,) float64
        What is seen of the profile's length.
    whole : (T,) bool
        Whether that is all; if it never is, what is missing is not known, and 0 here.
    """
    if whole.all() or not whole.any():
        return np.zeros(length_m.size)
    order = np.flatnonzero(whole)[np.argsort(stamp_ns[whole], kind="stable")]
    time_s, known_s = ((stamps - stamp_ns.min()) / 1e9 for stamps in (stamp_ns, stamp_ns[order]))
    expected_m = np.interp(time_s, known_s, length_m[order])
    lacking_m: FloatArray = np.where(whole, 0.0, np.maximum(expected_m - length_m, 0))
    return lacking_m
