"""From the profiles of a whole recording to chains and points: smoothing in time, as far as the data allow it.

Profiles are put on a raster below the gripper, relative to it, and each raster point is followed over time. Local
polynomials of growing length replace its values as long as they agree with the shorter ones (the intersection of
confidence intervals of Goldenshluger and Nemirovski, 1997): long where the cloth rests, short where it turns, not at
all where a fold passes. Noise is judged by the data, so what is stated as uncertainty is what was seen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from garment_dataset.vision.depth.chain import Chain, ChainPoints, Track
from garment_dataset.vision.depth.smoothing import NOISE_FRAMES, adaptive_mean, local_fit, unrest
from garment_dataset.vision.depth.support import bridge_gaps
from garment_dataset.vision.depth.uncertainty import point_std_m

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import FloatArray, IntArray
    from garment_dataset.vision.depth.cloud import Intrinsics, Point
    from garment_dataset.vision.depth.profile import Profile
    from garment_dataset.vision.depth.support import BridgeLimits
    from garment_dataset.vision.depth.uncertainty import ErrorSources

_SHAPE_DEGREE = 2

_HOLD_FRAMES = (5, 9, 17, 33, 65, 129, 257)
"""How the cloth is held changes little, so it may be followed over the whole recording."""

_STEEPEST = 4.0
_END_FIT_M = 0.04
"""Length of the stretch whose line draws a profile out beyond its ends."""

_FARTHEST_HOLD_M = 0.03
"""Cloth that seems farther from the gripper's end point is not held there: its line upwards means nothing."""

_SEEN_WITHIN_M = 0.004
"""Two rows of pixels: a sample farther from any of them is not seen."""


def track_profiles(
    profiles: Sequence[Profile],
    stamp_ns: IntArray,
    gripper_m: FloatArray,
    limits: BridgeLimits,
    *,
    step_m: float,
    frames: Sequence[int],
) -> list[Track]:
    """Smooth the profiles of a recording over time and link them.

    Parameters
    ----------
    profiles : sequence of Profile, length T
        In any order of their stamps.
    stamp_ns : (T,) int64
        When they were seen.
    gripper_m : (T, 3) float64
        End point of the gripper.
    limits : BridgeLimits
        Which gaps are bridged.
    step_m : float
        Distance of the samples along y.
    frames : sequence of int
        Lengths of the polynomials in time, see :func:`adaptive_mean`.

    Returns
    -------
    list of Track, length T
    """
    order = np.argsort(stamp_ns, kind="stable")
    # frames of one stamp are kept apart by a nanosecond each: their polynomials stay solvable
    time_s = (stamp_ns[order] - stamp_ns[order[0]]) / 1e9 + 1e-9 * np.arange(order.size)
    ends_m = np.array([profiles[i].end_y_m - gripper_m[i, 1] for i in order])
    end_m, end_noise_m = _one_series(time_s, ends_m, frames, _SHAPE_DEGREE)
    raster_m: FloatArray = step_m * np.arange(int(max(ends_m.max(), end_m.max()) / step_m) + 2, dtype=np.float64)
    shape_m = np.stack([_on_raster(profiles[i], gripper_m[i], raster_m) for i in order])
    smooth_m, noise_m = adaptive_mean(time_s, shape_m, frames, degree=_SHAPE_DEGREE)
    lengths_m = _lengths(raster_m, shape_m, ends_m)[:, None]
    unrest_m = unrest(lengths_m - local_fit(time_s, lengths_m, NOISE_FRAMES, _SHAPE_DEGREE)[0])[:, 0]
    end_noise_m = np.hypot(end_noise_m, unrest_m)
    top_m, top_noise_m = _one_series(time_s, shape_m[:, 0], _HOLD_FRAMES if frames else (), 1)
    held = np.abs(top_m) < _FARTHEST_HOLD_M
    # the square of a distance is too large by the variance of its noise
    hold_distance_m = np.sqrt(np.maximum(top_m**2 - top_noise_m**2, 0)) * held
    tracks = [
        _track(
            profiles[i],
            gripper_m[i],
            _Smoothed(
                raster_m,
                smooth_m[row],
                noise_m[row],
                end_m[row],
                end_noise_m[row],
                hold_distance_m[row],
                top_noise_m[row],
                bool(held[row]),
            ),
            limits,
        )
        for row, i in enumerate(order)
    ]
    return [tracks[row] for row in np.argsort(order)]


def _lengths(raster_m: FloatArray, z_m: FloatArray, end_m: FloatArray) -> FloatArray:
    """Return the lengths of profiles on a raster, (T,), to the raster point before their ends."""
    links_m = _links(np.broadcast_to(raster_m, z_m.shape), z_m)
    lengths: FloatArray = (links_m * (raster_m[1:] <= end_m[:, None])).sum(axis=1)
    return lengths


def _links(y_m: FloatArray, z_m: FloatArray) -> FloatArray:
    """Return the lengths of the links between samples, along the last axis.

    No camera sees cloth so steep that it could be a jump from one surface to another: such a link goes down one
    surface and then straight to the other.
    """
    down_m, away_m = np.diff(y_m, axis=-1), np.abs(np.diff(z_m, axis=-1))
    lengths: FloatArray = np.where(away_m > _STEEPEST * down_m, down_m + away_m, np.hypot(down_m, away_m))
    return lengths


def _one_series(
    time_s: FloatArray, values: FloatArray, frames: Sequence[int], degree: int
) -> tuple[FloatArray, FloatArray]:
    smooth, noise = adaptive_mean(time_s, values[:, None], frames, degree=degree)
    return smooth[:, 0], noise[:, 0]


class _Smoothed(NamedTuple):
    """One frame's row of the smoothed series, relative to the gripper.

    ``hold_distance_m`` is how far the cloth is from the gripper's end point at its height, ``top_noise_m`` its noise;
    ``held`` whether the cloth leads up there at all.
    """

    raster_m: FloatArray
    z_m: FloatArray
    z_noise_m: FloatArray
    end_m: float
    end_noise_m: float
    hold_distance_m: float
    top_noise_m: float
    held: bool


def _on_raster(profile: Profile, gripper_m: FloatArray, raster_m: FloatArray) -> FloatArray:
    """Return z relative to the gripper's at the raster; beyond both ends the profile is drawn out straight."""
    y_m, z_m = profile.y_m - gripper_m[1], profile.z_m - gripper_m[2]
    values: FloatArray = np.interp(raster_m, y_m, z_m)
    first = (profile.piece == 0) & (y_m <= y_m[0] + _END_FIT_M)
    above = raster_m < y_m[0]
    start_m, slope = _line(y_m[first], z_m[first])
    values[above] = start_m + slope * raster_m[above]
    last = (profile.piece == profile.piece[-1]) & (y_m >= y_m[-1] - _END_FIT_M)
    below = raster_m > y_m[-1]
    start_m, slope = _line(y_m[last], z_m[last])
    values[below] = z_m[-1] + slope * (raster_m[below] - y_m[-1])
    return values


def _line(y_m: FloatArray, z_m: FloatArray) -> tuple[float, float]:
    """Return the line through nodes: its z at y = 0 and its slope, 0 for a short stretch, whose slope is noise."""
    if y_m[-1] - y_m[0] < _END_FIT_M / 2:
        return float(z_m.mean()), 0.0
    slope = float(((y_m - y_m.mean()) * z_m).sum() / ((y_m - y_m.mean()) ** 2).sum())
    return float(z_m.mean() - slope * y_m.mean()), slope


def _track(profile: Profile, gripper_m: FloatArray, smoothed: _Smoothed, limits: BridgeLimits) -> Track:
    """Cut the raster at the hem and measure the way along it, the cloth's distance from the end point included.

    A sample is carried if the nearest row of this very frame shows a surface there: what smoothing over time, planes
    or lines drawn out put anywhere else is not. Bridges are straight.
    """
    end_m = max(float(smoothed.end_m), 1e-6)
    y_m = np.append(smoothed.raster_m[smoothed.raster_m < end_m - 1e-6], end_m)
    z_m = np.interp(y_m, smoothed.raster_m, smoothed.z_m)
    noise_m = np.interp(y_m, smoothed.raster_m, smoothed.z_noise_m)
    real = np.flatnonzero(np.isfinite(profile.measured_m))
    nodes_m = profile.y_m[real] - gripper_m[1]
    after = np.clip(np.searchsorted(nodes_m, y_m), 1, nodes_m.size - 1)
    nearest = after - (y_m - nodes_m[after - 1] < nodes_m[after] - y_m)
    seen = np.abs(nodes_m[nearest] - y_m) <= _SEEN_WITHIN_M
    nearest = real[nearest]
    seen &= np.abs(profile.measured_m[nearest] - gripper_m[2] - z_m) <= limits.jump_m
    support = bridge_gaps(y_m, z_m, seen, 0.0 if smoothed.held else None, limits)
    between = (support.bridged_m > 0) & (np.cumsum(seen) > 0)
    if between.any():
        z_m[between] = np.interp(y_m[between], y_m[seen], z_m[seen])
    arc_m = smoothed.hold_distance_m + np.concatenate([[0.0], np.cumsum(_links(y_m, z_m))])
    chain = Chain(
        np.stack([np.full(y_m.size, gripper_m[0]), y_m + gripper_m[1], z_m + gripper_m[2]]),
        arc_m,
        np.where(seen, profile.pixels[nearest], 0),
        np.where(seen, profile.z_spread_m[nearest], np.nan),
        profile.ends_at_gap,
        support,
    )
    lean = profile.lean[nearest]
    return Track(chain, noise_m, float(smoothed.end_noise_m), float(smoothed.top_noise_m), lean)


def divide_track(
    track: Track, gripper_m: Point, intrinsics: Intrinsics, *, point_count: int, sources: ErrorSources
) -> ChainPoints:
    r"""Put points in the middles of equal segments of the way from the gripper's end point to the hem.

    Parameters
    ----------
    track : Track
        One frame's chain.
    gripper_m : (x, y, z)
        End point of the gripper: a point may lie between it and the cloth.
    intrinsics : Intrinsics
        Of the image.
    point_count : int
        r; point q = 1..r is at :math:`(2 q - 1) / (2 r)` of the length.
    sources : ErrorSources
        For the uncertainties, which :func:`~garment_dataset.vision.depth.uncertainty.point_std_m` explains.

    Returns
    -------
    ChainPoints
    """
    chain = track.chain
    arc_m = (np.arange(point_count) + 0.5) / point_count * chain.length_m
    nodes_m = np.column_stack([np.array(gripper_m), chain.position_m])
    node_arc_m = np.append(0.0, chain.arc_length_m)
    position_m = np.stack([np.interp(arc_m, node_arc_m, axis) for axis in nodes_m])
    nearest = np.clip(np.searchsorted(chain.arc_length_m, arc_m), 1, chain.arc_length_m.size - 1)
    std_m = point_std_m(track, position_m, arc_m, (node_arc_m, nodes_m), intrinsics, sources)
    return ChainPoints(position_m, std_m, arc_m, chain.pixels[nearest], np.zeros(point_count), (None,) * point_count)
