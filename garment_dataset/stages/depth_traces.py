"""What a depth frame shows of the garment, by either method: its chain, its points, or why there are none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from garment_dataset.stages.depth_points import DepthPointsParams
    from garment_dataset.vision.depth.chain import Chain, ChainPoints
    from garment_dataset.vision.depth.cloud import Intrinsics, Point

Reason = Literal["no_gripper", "image_size", "no_pixels", "few_pixels", "gap", "short"]
"""Why a frame has no points.

``no_gripper``: its end point is not known at this frame. ``image_size``: the image is not of the size that K is for.
``no_pixels``: none in the band and strip below the gripper. ``few_pixels``: no window with ``min_pixels``, or fewer
than five rows of cloth. ``gap``: too long a gap right below the gripper. ``short``: a segment of the garment would be
shorter than a window is high.
"""


@dataclass(frozen=True, slots=True)
class Trace:
    """What one frame shows of the garment; ``material_m``, (3, r), are points on its middle line."""

    chain: Chain | None = None
    points: ChainPoints | None = None
    reason: Reason | None = None
    material_m: NDArray[np.float64] | None = None


def trace_garment(
    depth_mm: NDArray[np.uint16], intrinsics: Intrinsics, gripper_m: Point | None, params: DepthPointsParams
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
    params : DepthPointsParams
        See there.
    """
    from garment_dataset.vision.depth.chain import divide_chain, link_samples, sample_windows
    from garment_dataset.vision.depth.cloud import select_pixels

    if gripper_m is None:
        return Trace(reason="no_gripper")
    step_m, half_height_m = params.sample_step_m, params.window_half_height_m
    cloud = select_pixels(
        depth_mm,
        intrinsics,
        gripper_m,
        band_half_width_m=params.band_half_width_m,
        strip_half_width_m=params.strip_half_width_m,
    )
    if cloud.z_mm.size == 0:
        return Trace(reason="no_pixels")
    samples = sample_windows(cloud, gripper_m[1], step_m=step_m, half_height_m=half_height_m)
    chain = link_samples(samples, gripper_m, step_m=step_m, max_gap_m=params.max_gap_m, min_pixels=params.min_pixels)
    if chain.pixels.size == 0:
        return Trace(reason="gap" if chain.ends_at_gap else "few_pixels")
    window_m = 2 * half_height_m
    if chain.length_m < params.point_count * window_m:
        return Trace(chain, reason="short")
    points = divide_chain(chain, intrinsics, point_count=params.point_count, step_m=step_m, window_m=window_m)
    return Trace(chain, points)


def trace_profiles(
    images: Iterable[tuple[int, NDArray[np.uint16] | None]],
    stamps_ns: Mapping[int, int],
    intrinsics: Intrinsics,
    grippers_m: Mapping[int, Point],
    params: DepthPointsParams,
) -> dict[int, Trace]:
    """Trace the profile in every image, smooth the profiles over time, and divide them.

    Parameters
    ----------
    images : iterable of (int, (H, W) uint16 or None)
        Frame and its depth in millimetres, None for an image of the wrong size. Iterated twice, so
        no iterator.
    stamps_ns : mapping
        Stamp by frame.
    intrinsics : Intrinsics
        Of the images.
    grippers_m : mapping
        End point of the gripper by frame, where it is known.
    params : DepthPointsParams
        See there.
    """
    import numpy as np

    from garment_dataset.vision.depth.centre_line import Centre, divide_centre, smooth_centres, trace_centre
    from garment_dataset.vision.depth.flat_field import column_offsets, fixed_error_levels, inverse_depth_table
    from garment_dataset.vision.depth.profile import Profile, trace_profile
    from garment_dataset.vision.depth.tracking import divide_track, track_profiles
    from garment_dataset.vision.depth.uncertainty import ErrorSources

    chosen = set(list(stamps_ns)[:: max(len(stamps_ns) // params.flat_field_frames, 1)])
    some = [np.array(depth_mm) for frame, depth_mm in images if frame in chosen and depth_mm is not None]
    table, on_ladder = inverse_depth_table(some)
    offset = column_offsets(some, table, beyond_m=params.flat_field_beyond_m) if on_ladder else None
    traces: dict[int, Trace] = {}
    profiles: dict[int, Profile] = {}
    centres: list[Centre | None] = []
    for frame, depth_mm in images:
        if depth_mm is None:
            traces[frame] = Trace(reason="image_size")
        elif (gripper_m := grippers_m.get(frame)) is None:
            traces[frame] = Trace(reason="no_gripper")
        else:
            found = trace_profile(
                depth_mm,
                intrinsics,
                gripper_m,
                table,
                offset,
                band_half_width_m=params.band_half_width_m,
                clearance_m=params.clearance_m,
                jump_m=params.jump_m,
                max_gap_m=params.profile_max_gap_m,
                windows_px=params.windows_px,
            )
            if isinstance(found, Profile):
                profiles[frame] = found
                centres.append(
                    trace_centre(depth_mm, intrinsics, gripper_m, found, band_half_width_m=params.band_half_width_m)
                )
                traces[frame] = Trace()
            else:
                traces[frame] = Trace(reason=found)
    if not profiles:
        return traces
    frames = list(profiles)
    profile_stamps_ns = np.array([stamps_ns[frame] for frame in frames], np.int64)
    tracks = track_profiles(
        list(profiles.values()),
        profile_stamps_ns,
        np.array([grippers_m[frame] for frame in frames]),
        step_m=params.sample_step_m,
        frames=params.smoothing_frames,
    )
    window_px = params.windows_px[-1]
    levels = fixed_error_levels(offset, 2.0 * window_px[0], some[0].shape[1]) if on_ladder else None
    sources = ErrorSources(levels, params.gripper_std_m, window_px)
    centres = smooth_centres(centres, profile_stamps_ns, frames=params.smoothing_frames)
    for frame, track, centre in zip(frames, tracks, centres, strict=True):
        if track.chain.length_m < 2 * params.point_count * params.window_half_height_m:
            traces[frame] = Trace(track.chain, reason="short")
            continue
        points = divide_track(track, grippers_m[frame], intrinsics, point_count=params.point_count, sources=sources)
        material_m = None if centre is None else divide_centre(centre, track, grippers_m[frame], params.point_count)
        traces[frame] = Trace(track.chain, points, material_m=material_m)
    return traces
