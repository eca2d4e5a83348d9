"""From the profiles of a whole recording to chains and points: smoothing in time, as far as the data allow it.

Points are divided frame by frame, and then followed over time; for the chain, profiles are put on a raster below the
gripper, relative to it, and each raster point is followed. Local
polynomials of growing length replace its values as long as they agree with the shorter ones (the intersection of
confidence intervals of Goldenshluger and Nemirovski, 1997): long where the cloth rests, short where it turns, not at
all where a fold passes. Noise is judged by the data, so what is stated as uncertainty is what was seen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from garment_dataset.vision.depth.chain import Chain, ChainPoints, Track
from garment_dataset.vision.depth.curl import follow_curl
from garment_dataset.vision.depth.dividing import divide_profile, smooth_points
from garment_dataset.vision.depth.hold import follow_hold
from garment_dataset.vision.depth.smoothing import NOISE_FRAMES, adaptive_mean, local_fit, seconds_apart, unrest
from garment_dataset.vision.depth.support import bridge_gaps
from garment_dataset.vision.depth.uncertainty import point_std_m
from garment_dataset.vision.depth.windows import choose_windows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import BoolArray, FloatArray, IntArray
    from garment_dataset.vision.depth.cloud import Intrinsics, Point
    from garment_dataset.vision.depth.hold import Hold
    from garment_dataset.vision.depth.pattern import FixedPattern
    from garment_dataset.vision.depth.profile import Profile
    from garment_dataset.vision.depth.support import BridgeLimits
    from garment_dataset.vision.depth.uncertainty import ErrorSources

_SHAPE_DEGREE = 2

_END_FIT_M = 0.04
"""Length of the stretch whose line draws a profile out beyond its ends."""

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
    point_count: int,
    pattern: FixedPattern,
    noise_per_m: float,
    hem_seen: BoolArray,
) -> tuple[list[Track], FloatArray]:
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
    point_count : int
        r.
    pattern : FixedPattern
        What the sensor always adds.
    noise_per_m : float
        See :func:`~garment_dataset.vision.depth.windows.choose_windows`.
    hem_seen : (T,) bool
        Whether a profile ends with the garment.

    Returns
    -------
    tracks : list of Track, length T
    points_m : (T, 3, r) float64
        Points in the middles of equal segments, divided before they were smoothed.
    """
    order = np.argsort(stamp_ns, kind="stable")
    gripper_m = gripper_m[order]
    profiles = choose_windows([profiles[i] for i in order], gripper_m, pattern, noise_per_m)
    profiles = follow_curl(profiles, hem_seen[order])
    time_s = seconds_apart(stamp_ns[order])
    hold = follow_hold(profiles, gripper_m, time_s, over_time=bool(frames))
    divided_m = np.stack(
        [
            divide_profile(profile, gripper_m[row], float(hold.past_m[row]), point_count, held=bool(hold.held[row]))
            for row, profile in enumerate(profiles)
        ]
    )
    points_y_m, points_z_m, length_m = smooth_points(time_s, divided_m, frames)
    smoothed = _smooth(profiles, gripper_m, time_s, hold, length_m, step_m, frames)
    tracks = [_track(profile, gripper_m[row], smoothed[row], limits) for row, profile in enumerate(profiles)]
    points_m = gripper_m[:, :, None] + np.stack([np.zeros_like(points_y_m), points_y_m, points_z_m], axis=1)
    back = np.argsort(order)
    return [tracks[row] for row in back], points_m[back]


def _smooth(
    profiles: Sequence[Profile],
    gripper_m: FloatArray,
    time_s: FloatArray,
    hold: Hold,
    length_m: FloatArray,
    step_m: float,
    frames: Sequence[int],
) -> list[_Smoothed]:
    """Follow depths on a raster below the gripper, and the hem, over time."""
    ends_m = np.array([profile.end_y_m - gripper_m[row, 1] for row, profile in enumerate(profiles)])
    end_m, end_noise_m = _one_series(time_s, ends_m, frames, _SHAPE_DEGREE)
    raster_m: FloatArray = step_m * np.arange(int(max(ends_m.max(), end_m.max()) / step_m) + 2, dtype=np.float64)
    shape_m = np.stack(
        [_on_raster(profile, gripper_m[row], raster_m, hold.past_m[row]) for row, profile in enumerate(profiles)]
    )
    smooth_m, noise_m = adaptive_mean(time_s, shape_m, frames, degree=_SHAPE_DEGREE)
    lengths_m = _lengths(raster_m, shape_m, ends_m)[:, None]
    unrest_m = unrest(lengths_m - local_fit(time_s, lengths_m, NOISE_FRAMES, _SHAPE_DEGREE)[0])[:, 0]
    end_noise_m = np.hypot(end_noise_m, unrest_m)
    columns = (end_m, end_noise_m, hold.distance_m, hold.noise_m, hold.held, length_m)
    return [
        _Smoothed(raster_m, smooth_m[row], noise_m[row], *(column[row] for column in columns))
        for row in range(time_s.size)
    ]


def _lengths(raster_m: FloatArray, z_m: FloatArray, end_m: FloatArray) -> FloatArray:
    """Return the lengths of profiles on a raster, (T,), to the raster point before their ends."""
    links_m = np.hypot(np.diff(raster_m), np.diff(z_m, axis=1))
    lengths: FloatArray = (links_m * (raster_m[1:] <= end_m[:, None])).sum(axis=1)
    return lengths


def _one_series(
    time_s: FloatArray, values: FloatArray, frames: Sequence[int], degree: int
) -> tuple[FloatArray, FloatArray]:
    smooth, noise = adaptive_mean(time_s, values[:, None], frames, degree=degree)
    return smooth[:, 0], noise[:, 0]


class _Smoothed(NamedTuple):
    """One frame's row of the smoothed series, relative to the gripper.

    ``hold_distance_m`` is how far past the gripper's end point the cloth leads at its height, 0 where the way down is
    straight; ``top_noise_m`` the noise of where it would be; ``held`` whether the cloth leads up there at all.
    ``length_m`` is of the divided profiles.
    """

    raster_m: FloatArray
    z_m: FloatArray
    z_noise_m: FloatArray
    end_m: float
    end_noise_m: float
    hold_distance_m: float
    top_noise_m: float
    held: bool
    length_m: float


def _on_raster(profile: Profile, gripper_m: FloatArray, raster_m: FloatArray, top_m: float) -> FloatArray:
    """Return z relative to the gripper's at the raster: straight from ``top_m`` to the first node, and on below."""
    y_m, z_m = profile.y_m - gripper_m[1], profile.z_m - gripper_m[2]
    values: FloatArray = np.interp(raster_m, y_m, z_m)
    above = raster_m < y_m[0]
    values[above] = top_m + (z_m[0] - top_m) / y_m[0] * raster_m[above]
    last = (profile.piece == profile.piece[-1]) & (y_m >= y_m[-1] - _END_FIT_M)
    below = raster_m > y_m[-1]
    values[below] = z_m[-1] + _slope(y_m[last], z_m[last]) * (raster_m[below] - y_m[-1])
    return values


def _slope(y_m: FloatArray, z_m: FloatArray) -> float:
    """Return the slope of the line through nodes; 0 for a short stretch, whose slope is noise."""
    if y_m[-1] - y_m[0] < _END_FIT_M / 2:
        return 0.0
    return float(((y_m - y_m.mean()) * z_m).sum() / ((y_m - y_m.mean()) ** 2).sum())


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
    arc_m = smoothed.hold_distance_m + np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(y_m), np.diff(z_m)))])
    # the chain is smoothed on a raster, the length is not: what is divided counts
    arc_m *= smoothed.length_m / max(float(arc_m[-1]), 1e-9)
    chain = Chain(
        np.stack([np.full(y_m.size, gripper_m[0]), y_m + gripper_m[1], z_m + gripper_m[2]]),
        arc_m,
        np.where(seen, profile.pixels[nearest], 0),
        np.where(seen, profile.z_spread_m[nearest], np.nan),
        profile.ends_at_gap,
        support,
    )
    lean = profile.lean[nearest]
    return Track(chain, noise_m, float(smoothed.end_noise_m), float(smoothed.top_noise_m), lean, profile.hidden_std_m)


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
    std = point_std_m(track, position_m, arc_m, (node_arc_m, nodes_m), intrinsics, sources)
    pixels, none = chain.pixels[nearest], (None,) * point_count
    return ChainPoints(position_m, std.all_m, std.fixed_m, arc_m, pixels, np.zeros(point_count), none)
