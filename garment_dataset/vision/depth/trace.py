"""What the depth frames of a recording show of the garment, by either method: chain, points, or why there are none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import islice
from typing import TYPE_CHECKING, Literal

import numpy as np

from garment_dataset.vision.depth.carried import distance_m, judge_points, pixel_distance_m
from garment_dataset.vision.depth.chain import divide_chain, link_samples
from garment_dataset.vision.depth.cloud import (
    LEVEL_SPACING_PER_M,
    NOISE_LEVELS,
    PIXELS_PER_INDEPENDENT,
    select_pixels,
)
from garment_dataset.vision.depth.doubt import length_std_m, missing_m, unrest_m
from garment_dataset.vision.depth.hem import doubt_hem
from garment_dataset.vision.depth.material_line import divide_material_line, smooth_material_lines, trace_material_lines
from garment_dataset.vision.depth.pattern import usual_pattern
from garment_dataset.vision.depth.profile import Profile, find_profiles
from garment_dataset.vision.depth.samples import sample_windows
from garment_dataset.vision.depth.scale import measure_scale, spread_over
from garment_dataset.vision.depth.support import BridgeLimits
from garment_dataset.vision.depth.tracking import divide_track, track_profiles
from garment_dataset.vision.depth.uncertainty import ErrorSources, noise_factor

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from garment_dataset.arrays import DepthImage, FloatArray
    from garment_dataset.vision.depth.chain import Chain, ChainPoints
    from garment_dataset.vision.depth.cloud import Intrinsics, Point
    from garment_dataset.vision.depth.hem import LengthReason
    from garment_dataset.vision.depth.material_line import MaterialLine
    from garment_dataset.vision.depth.pattern import FixedPattern
    from garment_dataset.vision.depth.profile import DepthScale, ProfileSettings
    from garment_dataset.vision.depth.settings import TrackSettings, WindowSettings

_BATCH_FRAMES = 16
"""So many images share the calls that fit their surfaces; more would not stay in a processor's cache."""

Reason = Literal[
    "no_gripper",
    "image_size",
    "no_pixels",
    "few_pixels",
    "not_held",
    "gap",
    "short",
    "between_layers",
    "beyond_band",
    "unsupported",
]
"""Why there is no point.

Of a whole frame: ``no_gripper``: the end point is not known at this frame. ``image_size``: the image is not of the size
that K is for. ``no_pixels``: none in the band and strip below the gripper. ``few_pixels``: no window with
``min_pixels``, or fewer than five rows of cloth. ``not_held``: the first cloth is too far from the gripper. ``gap``:
too long a gap right below it. ``short``: a segment of the garment would be shorter than a window is high.

Of single points: ``gap``: in a stretch without pixels that is too long to bridge. ``between_layers``: where depth jumps
from one layer of the cloth to another. ``beyond_band``: outside of the band of eq. (5.8). ``unsupported``: the frame
has no pixel within three standard uncertainties and a level of the sensor, or, without a bridge, within a jump of
depth, of where the point would be.
"""


@dataclass(frozen=True, slots=True)
class Trace:
    """What one frame shows of the garment.

    Parameters
    ----------
    chain : Chain or None
        None when there is not even that.
    points : ChainPoints or None
        With reasons of their own.
    reason : str or None
        Why the frame has no points.
    length_reason : str or None
        Why the chain's length is not the garment's, which points then do not divide, but what is seen of it.
    material_m : (3, r) float64 or None
        Points on the material line.
    """

    chain: Chain | None = None
    points: ChainPoints | None = None
    reason: Reason | None = None
    length_reason: LengthReason | None = None
    material_m: FloatArray | None = None


USUAL_NOISE_PER_M = LEVEL_SPACING_PER_M * NOISE_LEVELS * PIXELS_PER_INDEPENDENT**0.5
"""Where a recording does not show it."""


@dataclass(frozen=True, slots=True, eq=False)
class KnownSensor:
    """What a recording says of its own errors.

    Parameters
    ----------
    pattern : FixedPattern or None
        What the sensor always adds; None: it shows none, and the usual one is taken.
    pixels_per_m : (H, W) float64 or None
        The part of it that is known pixel by pixel, 0 elsewhere, and is taken off.
    noise_per_m : float
        Standard deviation in time of one pixel, if all of a window were independent.
    noise_correlation : float
        Of a pixel's noise with the next frame.
    gripper_std_m : (x, y, z)
        Standard uncertainty of the gripper's calibration.
    """

    pattern: FixedPattern | None = None
    pixels_per_m: FloatArray | None = None
    noise_per_m: float = USUAL_NOISE_PER_M
    noise_correlation: float = 0.0
    gripper_std_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


def trace_windows(
    depth_mm: DepthImage, intrinsics: Intrinsics, gripper_m: Point | None, settings: WindowSettings
) -> Trace:
    """Select pixels, average them into samples, link these to a chain, and divide it.

    Parameters
    ----------
    depth_mm : (H, W) uint16
        Depth image in millimetres; 0 means no return.
    intrinsics : Intrinsics
        Of this image.
    gripper_m : (x, y, z) or None
        End point of the gripper in the optical frame; None when it is not known.
    settings : WindowSettings
        See there.
    """
    if gripper_m is None:
        return Trace(reason="no_gripper")
    step_m, half_height_m = settings.sample_step_m, settings.window_half_height_m
    cloud = select_pixels(
        depth_mm,
        intrinsics,
        gripper_m,
        band_half_width_m=settings.band_half_width_m,
        strip_half_width_m=settings.strip_half_width_m,
    )
    if cloud.z_mm.size == 0:
        return Trace(reason="no_pixels")
    samples = sample_windows(cloud, gripper_m[1], step_m=step_m, half_height_m=half_height_m)
    chain = link_samples(
        samples,
        gripper_m,
        step_m=step_m,
        max_gap_m=settings.max_gap_m,
        min_pixels=settings.min_pixels,
        jump_m=settings.jump_m,
    )
    if chain.pixels.size == 0:
        return Trace(reason="gap" if chain.ends_at_gap else "few_pixels")
    if _distance_m(chain.position_m[:, np.argmax(chain.pixels > 0)], gripper_m) > settings.hold_reach_m:
        return Trace(reason="not_held")
    window_m = 2 * half_height_m
    if chain.length_m < settings.point_count * window_m:
        return Trace(chain, reason="short")
    points = divide_chain(chain, intrinsics, point_count=settings.point_count, step_m=step_m, window_m=window_m)
    limits = {"band_half_width_m": settings.band_half_width_m, "jump_m": settings.jump_m}
    points = judge_points(points, chain, pixel_distance_m(points, depth_mm, intrinsics), gripper_m[2], **limits)
    hem = doubt_hem(
        depth_mm, intrinsics, chain.position_m[:, -1].tolist(), gripper_m[2], ends_at_gap=chain.ends_at_gap, **limits
    )
    return Trace(chain, points, length_reason=hem)


def _distance_m(position_m: FloatArray, gripper_m: Point) -> float:
    return float(np.sqrt(((position_m - gripper_m) ** 2).sum()))


def trace_profiles(
    images: Iterable[tuple[int, DepthImage | None]],
    stamps_ns: Mapping[int, int],
    intrinsics: Intrinsics,
    grippers_m: Mapping[int, Point],
    settings: TrackSettings,
    known: KnownSensor | None = None,
    some: Iterable[tuple[int, DepthImage | None]] | None = None,
) -> dict[int, Trace]:
    """Trace the profile in every image, smooth the profiles over time, and divide them.

    Parameters
    ----------
    images : iterable of (int, (H, W) uint16 or None)
        Frame and its depth in millimetres, None for an image of the wrong size. No iterator, unless ``some`` is given.
    stamps_ns : mapping
        Stamp by frame.
    intrinsics : Intrinsics
        Of the images.
    grippers_m : mapping
        End point of the gripper by frame, where it is known.
    settings : TrackSettings
        See there.
    known : KnownSensor, optional
        What the recording says of its sensor; by default it is taken to be as real ones usually are.
    some : iterable, optional
        Those of the images that :func:`~garment_dataset.vision.depth.scale.flat_field_frames` names, or more of them.
    """
    known = KnownSensor() if known is None else known
    chosen, some = spread_over(list(stamps_ns), settings.flat_field_frames), images if some is None else some
    flat = [np.array(depth_mm) for frame, depth_mm in some if frame in chosen and depth_mm is not None]
    scale, columns_per_m = measure_scale(flat, settings, known.pixels_per_m, measured=known.pattern is not None)
    traces, profiles, lines = _trace_each(images, intrinsics, grippers_m, scale, settings.profile)
    if not profiles:
        return traces
    pattern = known.pattern or usual_pattern()
    x_m, y_m, z_m = (float(np.hypot(settings.gripper_std_m, seen_m)) for seen_m in known.gripper_std_m)
    sources = ErrorSources(
        columns_per_m,
        pattern,
        (x_m, y_m, z_m),
        settings.profile.windows_px[-1],
        noise_factor(known.noise_correlation),
    )
    frames = list(profiles)
    tracked_ns = np.array([stamps_ns[frame] for frame in frames], np.int64)
    ends_m = np.array([grippers_m[frame] for frame in frames])
    whole = np.array([traces[frame].length_reason is None for frame in frames])
    tracks, points_m = track_profiles(
        list(profiles.values()),
        tracked_ns,
        ends_m,
        BridgeLimits(settings.profile.jump_m, settings.longest_bridge_m),
        step_m=settings.sample_step_m,
        frames=settings.smoothing_frames,
        point_count=settings.point_count,
        pattern=pattern,
        noise_per_m=known.noise_per_m,
        hem_seen=whole,
    )
    restless_m = unrest_m(tracked_ns, points_m - ends_m[:, :, None])
    limits = {"band_half_width_m": settings.profile.band_half_width_m, "jump_m": settings.profile.jump_m}
    lacking_m = missing_m(tracked_ns, np.array([track.chain.length_m for track in tracks]), whole)
    lines = smooth_material_lines(lines, tracked_ns, frames=settings.smoothing_frames)
    for row, (frame, track, line) in enumerate(zip(frames, tracks, lines, strict=True)):
        if track.chain.length_m < settings.shortest_m:
            traces[frame] = Trace(track.chain, reason="short")
            continue
        count, gripper_m = settings.point_count, grippers_m[frame]
        points = divide_track(track, gripper_m, intrinsics, point_count=count, sources=sources)
        below_m = float(np.hypot(lacking_m[row], profiles[frame].end_std_m))
        doubt_m = length_std_m(profiles[frame].islands_m, below_m, track, gripper_m, points)
        points = replace(points, position_m=points_m[row])
        away_m = distance_m(points, profiles[frame].measured_position_m(gripper_m[0]))
        points = judge_points(points, track.chain, away_m, gripper_m[2], **limits)
        # doubt about the way is no reason to believe in a point
        points = replace(points, std_m=np.sqrt(points.std_m**2 + doubt_m**2 + restless_m[row] ** 2))
        material_m = None if line is None else divide_material_line(line, track, gripper_m, count)
        traces[frame] = replace(traces[frame], chain=track.chain, points=points, material_m=material_m)
    return traces


def _trace_each(
    images: Iterable[tuple[int, DepthImage | None]],
    intrinsics: Intrinsics,
    grippers_m: Mapping[int, Point],
    scale: DepthScale,
    settings: ProfileSettings,
) -> tuple[dict[int, Trace], dict[int, Profile], list[MaterialLine | None]]:
    """Return what every image shows alone: traces without points; and of those with a profile it and a middle."""
    traces: dict[int, Trace] = {}
    profiles: dict[int, Profile] = {}
    limits = {"band_half_width_m": settings.band_half_width_m, "jump_m": settings.jump_m}
    lines: list[MaterialLine | None] = []
    for batch in _batches(images):
        usable = {frame: depth_mm for frame, depth_mm in batch if depth_mm is not None and frame in grippers_m}
        several = [(depth_mm, grippers_m[frame]) for frame, depth_mm in usable.items()]
        found = dict(zip(usable, find_profiles(several, intrinsics, scale, settings), strict=True))
        sheets: list[tuple[DepthImage, Point, Profile]] = []
        for frame, depth_mm in batch:
            if depth_mm is None or frame not in grippers_m:
                traces[frame] = Trace(reason="image_size" if depth_mm is None else "no_gripper")
                continue
            profile = found[frame]
            if not isinstance(profile, Profile):
                traces[frame] = Trace(reason=profile)
                continue
            profiles[frame], gripper_m = profile, grippers_m[frame]
            sheets.append((depth_mm, gripper_m, profile))
            end_m, gaps = profile.end_m(gripper_m[0]), profile.ends_at_gap
            hem = doubt_hem(depth_mm, intrinsics, end_m, gripper_m[2], ends_at_gap=gaps, **limits)
            traces[frame] = Trace(length_reason=hem)
        lines += trace_material_lines(sheets, intrinsics, band_half_width_m=limits["band_half_width_m"])
    return traces, profiles, lines


def _batches(images: Iterable[tuple[int, DepthImage | None]]) -> Iterator[list[tuple[int, DepthImage | None]]]:
    each = iter(images)
    while batch := list(islice(each, _BATCH_FRAMES)):
        yield batch
