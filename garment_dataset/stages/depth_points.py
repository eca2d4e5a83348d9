"""Follow the garment down from the gripper in every depth frame, and put points on it: thesis 5.3.1 to 5.3.4."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from garment_dataset.engine.stage import Stage, StageParams
from garment_dataset.errors import BagError, DataWarning
from garment_dataset.tables import CHAINS, POINTS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    import numpy as np
    import pyarrow as pa
    from numpy.typing import NDArray

    from garment_dataset.vision.chain import Chain, ChainPoints
    from garment_dataset.vision.cloud import Intrinsics, Point

Reason = Literal["no_gripper", "image_size", "no_pixels", "few_pixels", "gap", "short"]
"""Why a frame has no points.

``no_gripper``: its end point is not known at this frame. ``image_size``: the image is not of the size that K is for.
``no_pixels``: none in the band and strip below the gripper. ``few_pixels``: no window with ``min_pixels``. ``gap``: too
long a gap right below the gripper. ``short``: a segment of the garment would be shorter than a window is high.
"""


class DepthPointsParams(StageParams):
    """Where the garment can be, how it is sampled, and how many points it gets."""

    method: Literal["thesis"] = Field(default="thesis", description="thesis: means over windows, eqs. (5.6) to (5.11)")
    depth_topic: str = Field(default="/xtion1/depth/image_raw", description="depth images, or their compressed variant")
    band_half_width_m: float = Field(
        default=0.27,
        gt=0,
        description="depth from the gripper's that is kept, eq. (5.8): the garments stay within 0.80 to 1.16 m and the "
        "gripper hangs at 1.06 to 1.07 m",
    )
    strip_half_width_m: float = Field(
        default=0.02,
        gt=0,
        description="x from the gripper's that is kept, eq. (5.9): some 20 columns, narrow enough for cloth to be flat",
    )
    sample_step_m: float = Field(default=0.0025, gt=0, description="distance of samples along y: the thesis' raster")
    window_half_height_m: float = Field(
        default=0.005, gt=0, description="y from a sample's that it averages: the thesis' 5 mm"
    )
    point_count: int = Field(default=5, ge=1, description="points on the garment: the thesis' r")
    max_gap_m: float = Field(
        default=0.03,
        ge=0,
        description="empty samples that are bridged: a quarter of the 0.128 m between the points of the towel; where "
        "the cloth has a radius of curvature of 0.1 m, its length loses 0.1 mm",
    )
    min_pixels: int = Field(
        default=1, ge=1, description="pixels below which a sample counts as empty; the thesis takes any"
    )


@dataclass(frozen=True, slots=True)
class Trace:
    """What one frame shows of the garment."""

    chain: Chain | None = None
    points: ChainPoints | None = None
    reason: Reason | None = None


def depth_points(
    bag: Path, frames: pa.Table, camera: pa.Table, gripper: pa.Table, params: DepthPointsParams
) -> dict[str, pa.Table]:
    """Trace the garment in every usable depth frame.

    Parameters
    ----------
    bag : Path
        The recording.
    frames, camera, gripper : pyarrow.Table
        As ``decode`` made them; rows are matched by the index of the image.
    params : DepthPointsParams
        See there.

    Returns
    -------
    dict of str to pyarrow.Table
        ``chains``: the samples of every frame in which a chain was found. ``points``: ``point_count`` rows for every
        usable frame, null with a reason where there are none.

    Raises
    ------
    BagError
        If the bag has no such topic, or the depth stream no camera.

    Warns
    -----
    DataWarning
        If chains end at a gap too long to bridge, with more of the garment or something else below it.
    """
    from garment_dataset.bags import open_bag

    stamps_ns = _usable_stamps_ns(frames)
    traces: dict[int, Trace] = {}
    if stamps_ns:
        shape, intrinsics = _depth_camera(bag, camera)
        grippers_m = _grippers_m(gripper)
        with open_bag(bag) as opened:
            if (topic := opened.image_topic(params.depth_topic)) is None:
                found = ", ".join(opened.topics)
                raise BagError("no depth images", where=bag.name, expected=params.depth_topic, found=found)
            for image in opened.images(topic, "depth"):
                if image.index not in stamps_ns:
                    continue
                depth_mm = image.pixels()
                if depth_mm.shape == shape:
                    traces[image.index] = trace_garment(depth_mm, intrinsics, grippers_m.get(image.index), params)
                else:
                    traces[image.index] = Trace(reason="image_size")
    _warn_of_gaps(bag.name, traces)
    return {"chains": _chains(stamps_ns, traces), "points": _points(stamps_ns, traces, params.point_count)}


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
    from garment_dataset.vision.chain import divide_chain, link_samples, sample_windows
    from garment_dataset.vision.cloud import select_pixels

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


def _usable_stamps_ns(frames: pa.Table) -> dict[int, int]:
    """Return the stamp of every usable depth frame, by its index."""
    names = ("stream", "frame", "stamp_ns", "fault")
    rows = zip(*(frames[name].to_pylist() for name in names), strict=True)
    return {frame: stamp_ns for stream, frame, stamp_ns, fault in rows if stream == "depth" and fault is None}


def _depth_camera(bag: Path, camera: pa.Table) -> tuple[tuple[int, int], Intrinsics]:
    """Return the shape that images must have, and their K."""
    from garment_dataset.vision.cloud import Intrinsics

    for row in camera.to_pylist():
        if row["stream"] == "depth":
            intrinsics = Intrinsics(row["fx_px"], row["fy_px"], row["cx_px"], row["cy_px"])
            return (row["height_px"], row["width_px"]), intrinsics
    raise BagError("no camera for the depth images", where=bag.name)


def _grippers_m(gripper: pa.Table) -> dict[int, Point]:
    """Return the end point of the gripper by frame, where it is known."""
    rows = zip(*(gripper[name].to_pylist() for name in ("frame", "x_m", "y_m", "z_m")), strict=True)
    return {frame: (x_m, y_m, z_m) for frame, x_m, y_m, z_m in rows if None not in {x_m, y_m, z_m}}


def _warn_of_gaps(where: str, traces: Mapping[int, Trace]) -> None:
    if ended := [frame for frame, trace in traces.items() if trace.chain is not None and trace.chain.ends_at_gap]:
        text = (
            f"{where}: in {len(ended)} of {len(traces)} depth frames the chain ends at a gap, first in frame {ended[0]}"
        )
        warnings.warn(f"{text}; what is below is left out", DataWarning, stacklevel=3)


def _chains(stamps_ns: Mapping[int, int], traces: Mapping[int, Trace]) -> pa.Table:
    import numpy as np

    found = [(frame, trace.chain) for frame, trace in traces.items() if trace.chain is not None]
    sizes = [chain.pixels.size for _, chain in found]

    def joined(arrays: Iterator[NDArray[Any]], empty: NDArray[Any]) -> NDArray[Any]:
        return np.concatenate([empty, *arrays], axis=-1)

    none, nobody = np.empty(0), np.empty(0, np.int64)
    position_m = joined((chain.position_m for _, chain in found), np.empty((3, 0)))
    return CHAINS.build(
        {
            "frame": np.repeat([frame for frame, _ in found], sizes),
            "stamp_ns": np.repeat(np.array([stamps_ns[frame] for frame, _ in found], np.int64), sizes),
            "sample": joined((np.arange(size) for size in sizes), nobody),
            "x_m": position_m[0],
            "y_m": position_m[1],
            "z_m": position_m[2],
            "arc_length_m": joined((chain.arc_length_m for _, chain in found), none),
            "pixels": joined((chain.pixels for _, chain in found), nobody),
            "z_spread_m": joined((chain.z_spread_m for _, chain in found), none),
        }
    )


def _points(stamps_ns: Mapping[int, int], traces: Mapping[int, Trace], point_count: int) -> pa.Table:
    import numpy as np

    position_m, std_m = np.full((2, 3, len(traces), point_count), np.nan)
    arc_length_m, garment_length_m = np.full((2, len(traces), point_count), np.nan)
    pixels = np.zeros((len(traces), point_count), np.int64)
    for row, trace in enumerate(traces.values()):
        if trace.chain is not None and trace.points is not None:
            position_m[:, row], std_m[:, row] = trace.points.position_m, trace.points.std_m
            arc_length_m[row], garment_length_m[row] = trace.points.arc_length_m, trace.chain.length_m
            pixels[row] = trace.points.pixels
    axes = {f"{axis}_m": values.ravel() for axis, values in zip("xyz", position_m, strict=True)}
    axes |= {f"{axis}_std_m": values.ravel() for axis, values in zip("xyz", std_m, strict=True)}
    return POINTS.build(
        {
            "frame": np.repeat(np.array(list(traces), np.int64), point_count),
            "stamp_ns": np.repeat(np.array([stamps_ns[frame] for frame in traces], np.int64), point_count),
            "point": np.tile(np.arange(1, point_count + 1), len(traces)),
            **axes,
            "arc_length_m": arc_length_m.ravel(),
            "garment_length_m": garment_length_m.ravel(),
            "pixels": pixels.ravel(),
            "reason": [trace.reason for trace in traces.values() for _ in range(point_count)],
        }
    )


STAGE = Stage(depth_points, params=DepthPointsParams, outputs=(CHAINS, POINTS))
