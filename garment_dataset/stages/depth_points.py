"""Follow the garment down from the gripper in every depth frame, and put points on it: thesis 5.3.1 to 5.3.4."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.errors import BagError, DataWarning
from garment_dataset.stages.columns import FRAME, STAMP
from garment_dataset.stages.inputs import known_grippers_m, usable_images, usable_stamps_ns
from garment_dataset.stages.stage import Stage, StageParams

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    import pyarrow as pa
    from numpy.typing import NDArray

    from garment_dataset.arrays import DepthImage
    from garment_dataset.bags import Bag
    from garment_dataset.vision.depth.cloud import Intrinsics
    from garment_dataset.vision.depth.trace import Trace, TrackSettings, WindowSettings


CHAINS = TableSpec(
    "chains",
    1,
    "one sample of one depth frame, from the gripper down",
    (
        FRAME,
        STAMP,
        Column("sample", "int32", "1", "number of the sample, from 0 at the gripper"),
        Column("x_m", "float64", "m", "mean of the window, depth optical frame, right"),
        Column("y_m", "float64", "m", "middle of the window, depth optical frame, down"),
        Column("z_m", "float64", "m", "mean of the window, depth optical frame, forward"),
        Column("arc_length_m", "float64", "m", "along the chain, from the gripper's end point"),
        Column("pixels", "int32", "1", "number of pixels in the window; 0 where a gap was bridged"),
        Column("z_spread_m", "float64", "m", "standard deviation of z in the window", nullable=True),
    ),
    keys=("frame", "sample"),
)

POINTS = TableSpec(
    "points",
    2,
    "one point of one depth frame",
    (
        FRAME,
        STAMP,
        Column("point", "int32", "1", "number of the point, 1 next to the gripper"),
        Column("x_m", "float64", "m", "depth optical frame, right", nullable=True, uncertainty="x_std_m"),
        Column("y_m", "float64", "m", "depth optical frame, down", nullable=True, uncertainty="y_std_m"),
        Column("z_m", "float64", "m", "depth optical frame, forward", nullable=True, uncertainty="z_std_m"),
        Column("x_std_m", "float64", "m", "standard uncertainty of x", nullable=True),
        Column("y_std_m", "float64", "m", "standard uncertainty of y", nullable=True),
        Column("z_std_m", "float64", "m", "standard uncertainty of z", nullable=True),
        *(
            Column(
                f"material_{axis}_m",
                "float64",
                "m",
                f"the point on the material line, estimated as the middle of the sheet, {side}; null: cannot be had",
                nullable=True,
            )
            for axis, side in (("x", "right"), ("y", "down"), ("z", "forward"))
        ),
        Column("arc_length_m", "float64", "m", "along the garment, from the gripper's end point", nullable=True),
        Column("garment_length_m", "float64", "m", "length of the garment the points divide", nullable=True),
        Column("pixels", "int32", "1", "number of pixels the point rests on"),
        Column("reason", "string", "", "why there is no point; null when there is one", nullable=True),
    ),
    keys=("frame", "point"),
)


class DepthPointsParams(StageParams):
    """Where the garment can be, how it is sampled, and how many points it gets."""

    method: Literal["profile", "thesis"] = Field(
        default="profile",
        description="thesis: means over windows, eqs. (5.6) to (5.11), each frame alone. profile: planes fitted to the "
        "inverse depth around the plane x = x_gripper, smoothed over time; docs/accuracy.md compares them",
    )
    band_half_width_m: float = Field(
        default=0.27,
        gt=0,
        description="depth from the gripper's that is kept, eq. (5.8): the garments stay within 0.80 to 1.16 m and the "
        "gripper hangs at 1.06 to 1.07 m",
    )
    strip_half_width_m: float = Field(
        default=0.02,
        gt=0,
        description="thesis: x from the gripper's that is kept, eq. (5.9): some 20 columns, narrow enough for cloth to "
        "be flat",
    )
    sample_step_m: float = Field(default=0.0025, gt=0, description="distance of samples along y: the thesis' raster")
    window_half_height_m: float = Field(
        default=0.005, gt=0, description="thesis: y from a sample's that it averages, 5 mm"
    )
    point_count: int = Field(default=5, ge=1, description="points on the garment: the thesis' r")
    max_gap_m: float = Field(
        default=0.03,
        ge=0,
        description="thesis: empty samples that are bridged: a quarter of the 0.128 m between the points of the towel; "
        "where the cloth has a radius of curvature of 0.1 m, its length loses 0.1 mm",
    )
    min_pixels: int = Field(
        default=1, ge=1, description="thesis: pixels below which a sample counts as empty; the thesis takes any"
    )
    windows_px: tuple[tuple[int, int], ...] = Field(
        default=((4, 7), (12, 12), (36, 18), (70, 20)),
        min_length=1,
        description="profile: half widths and half heights of the windows, rising; the largest that agrees with the "
        "smaller ones is used. At 1.07 m they are 1.7 x 2.8 to 26 x 7.7 cm large",
    )
    smoothing_frames: tuple[Annotated[int, Field(ge=4)], ...] = Field(
        default=(5, 9, 13),
        description="profile: lengths of the parabolas in time, rising, at least 4 each; the longest that agrees with "
        "the shorter ones is used. None: no smoothing over time",
    )
    clearance_m: float = Field(
        default=0.012,
        ge=0,
        description="profile: so far below the gripper's end point its fingers, tilted by pi/8, can be in the way",
    )
    jump_m: float = Field(
        default=0.012,
        gt=0,
        description="profile: neighbouring depths that differ by more are two surfaces: 3 to 4 levels of the sensor",
    )
    profile_max_gap_m: float = Field(
        default=0.3,
        ge=0,
        description="profile: longest stretch without pixels that is bridged; along the edge of a fold they miss",
    )
    flat_field_frames: int = Field(
        default=8, ge=1, description="profile: images from which the fixed errors of the columns are measured"
    )
    flat_field_beyond_m: float = Field(
        default=1.4, gt=0, description="profile: what is farther is background, and may be a plane to measure them on"
    )
    gripper_std_m: float = Field(
        default=0.0005, ge=0, description="profile: standard uncertainty of the end point's coordinates: interpolation"
    )

    def window_settings(self) -> WindowSettings:
        """Return the knobs of the thesis' method."""
        from garment_dataset.vision.depth.trace import WindowSettings

        return WindowSettings(
            point_count=self.point_count,
            band_half_width_m=self.band_half_width_m,
            strip_half_width_m=self.strip_half_width_m,
            sample_step_m=self.sample_step_m,
            window_half_height_m=self.window_half_height_m,
            max_gap_m=self.max_gap_m,
            min_pixels=self.min_pixels,
        )

    def track_settings(self) -> TrackSettings:
        """Return the knobs of the method ``profile``."""
        from garment_dataset.vision.depth.profile import ProfileSettings
        from garment_dataset.vision.depth.trace import TrackSettings

        profile = ProfileSettings(
            band_half_width_m=self.band_half_width_m,
            clearance_m=self.clearance_m,
            jump_m=self.jump_m,
            max_gap_m=self.profile_max_gap_m,
            windows_px=self.windows_px,
        )
        return TrackSettings(
            point_count=self.point_count,
            profile=profile,
            sample_step_m=self.sample_step_m,
            shortest_m=2 * self.point_count * self.window_half_height_m,
            smoothing_frames=self.smoothing_frames,
            flat_field_frames=self.flat_field_frames,
            flat_field_beyond_m=self.flat_field_beyond_m,
            gripper_std_m=self.gripper_std_m,
        )


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
        If the depth stream has no camera.

    Warns
    -----
    DataWarning
        If chains end at a gap too long to bridge, with more of the garment or something else below it.
    """
    from garment_dataset.bags import open_bag
    from garment_dataset.vision.depth.trace import Trace, trace_profiles, trace_windows

    stamps_ns = usable_stamps_ns(frames, "depth")
    traces: dict[int, Trace] = {}
    if stamps_ns:
        shape, intrinsics = _depth_camera(bag, camera)
        grippers_m = known_grippers_m(gripper, "depth")
        with open_bag(bag) as opened:
            images = _Images(opened, frames, shape)
            if params.method == "thesis":
                windows = params.window_settings()
                for frame, depth_mm in images:
                    traces[frame] = (
                        Trace(reason="image_size")
                        if depth_mm is None
                        else trace_windows(depth_mm, intrinsics, grippers_m.get(frame), windows)
                    )
            else:
                traces = trace_profiles(images, stamps_ns, intrinsics, grippers_m, params.track_settings())
    _warn_of_gaps(bag.name, traces)
    return {"chains": _chains(stamps_ns, traces), "points": _points(stamps_ns, traces, params.point_count)}


@dataclass(frozen=True, slots=True)
class _Images:
    """The usable depth images of a bag, by index; None for one of another size. Read anew in every loop."""

    bag: Bag
    frames: pa.Table
    shape: tuple[int, int]

    def __iter__(self) -> Iterator[tuple[int, DepthImage | None]]:
        for image in usable_images(self.bag, self.frames, "depth"):
            depth_mm = image.pixels()
            yield image.index, depth_mm if depth_mm.shape == self.shape else None


def _depth_camera(bag: Path, camera: pa.Table) -> tuple[tuple[int, int], Intrinsics]:
    """Return the shape that images must have, and their K."""
    from garment_dataset.vision.depth.cloud import Intrinsics

    for row in camera.to_pylist():
        if row["stream"] == "depth":
            intrinsics = Intrinsics(row["fx_px"], row["fy_px"], row["cx_px"], row["cy_px"])
            return (row["height_px"], row["width_px"]), intrinsics
    raise BagError("no camera for the depth images", where=bag.name)


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
    return CHAINS.table(
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

    position_m, std_m, material_m = np.full((3, 3, len(traces), point_count), np.nan)
    arc_length_m, garment_length_m = np.full((2, len(traces), point_count), np.nan)
    pixels = np.zeros((len(traces), point_count), np.int64)
    for row, trace in enumerate(traces.values()):
        if trace.chain is not None and trace.points is not None:
            position_m[:, row], std_m[:, row] = trace.points.position_m, trace.points.std_m
            arc_length_m[row], garment_length_m[row] = trace.points.arc_length_m, trace.chain.length_m
            pixels[row] = trace.points.pixels
        if trace.material_m is not None:
            material_m[:, row] = trace.material_m
    axes = {f"{axis}_m": values.ravel() for axis, values in zip("xyz", position_m, strict=True)}
    axes |= {f"{axis}_std_m": values.ravel() for axis, values in zip("xyz", std_m, strict=True)}
    axes |= {f"material_{axis}_m": values.ravel() for axis, values in zip("xyz", material_m, strict=True)}
    return POINTS.table(
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
