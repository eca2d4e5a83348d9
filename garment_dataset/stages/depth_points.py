"""Follow the garment down from the gripper in every depth frame, and put points on it: thesis 5.3.1 to 5.3.4."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from garment_dataset.errors import DataWarning
from garment_dataset.stages.cameras import depth_reading
from garment_dataset.stages.depth_tables import CHAINS, POINTS
from garment_dataset.stages.inputs import known_grippers_m, usable_stamps_ns
from garment_dataset.stages.stage import Stage, StageParams

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import pyarrow as pa

    from garment_dataset.vision.depth.settings import TrackSettings, WindowSettings
    from garment_dataset.vision.depth.trace import Trace


class DepthPointsParams(StageParams):
    """Where the garment can be, how it is sampled, and how many points it gets."""

    method: Literal["profile", "thesis"] = Field(
        default="profile",
        description="thesis: means over windows, eqs. (5.6) to (5.11), each frame alone. profile: surfaces fitted to "
        "the inverse depth around the plane x = x_gripper, smoothed over time; docs/accuracy.md compares them",
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
        description="thesis: empty samples that are crossed: a quarter of the 0.128 m between the points of the towel; "
        "where the cloth has a radius of curvature of 0.1 m, its length loses 0.1 mm",
    )
    min_pixels: int = Field(
        default=1, ge=1, description="thesis: pixels below which a sample counts as empty; the thesis takes any"
    )
    windows_px: tuple[tuple[int, int], ...] = Field(
        default=((12, 12), (36, 24)),
        min_length=1,
        description="profile: half widths and half heights of the windows that surfaces of second order are fitted to, "
        "rising, and a plane to the last; the one with the least error is used, by bend and fixed pattern. At 1.07 m "
        "they are 4.7 x 4.7 and 14 x 9 cm large",
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
        description="neighbouring depths that differ by more are two surfaces: 3 to 4 levels of the sensor",
    )
    profile_max_gap_m: float = Field(
        default=0.15,
        ge=0,
        description="profile: longest stretch without pixels that the chain crosses, straight: along the edge of a "
        "fold they miss, over 0.15 m at most in simulated recordings. Points lie on it only where it is bridged",
    )
    longest_bridge_m: float = Field(
        default=0.06,
        ge=0,
        description="profile: longest stretch without pixels, between two pieces of one surface, on which points may "
        "lie; in simulated recordings longer ones are between layers",
    )
    hold_reach_m: float = Field(
        default=0.1,
        gt=0,
        description="the first cloth is no farther from the gripper's end point, in space, or it is not held: 93 mm at "
        "most in simulated recordings, of a garment held at a random point; 27 mm by corner, collar and ruler",
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

    common_std_m: float = Field(
        default=0.002,
        ge=0,
        description="standard uncertainty of an error common to all depths, at 1 m; it grows with the square of the "
        "distance: such sensors are off by some millimetres there unless calibrated (Smisek et al., 2011)",
    )

    def window_settings(self) -> WindowSettings:
        """Return the knobs of the thesis' method."""
        from garment_dataset.vision.depth.settings import WindowSettings

        return WindowSettings(
            point_count=self.point_count,
            band_half_width_m=self.band_half_width_m,
            strip_half_width_m=self.strip_half_width_m,
            sample_step_m=self.sample_step_m,
            window_half_height_m=self.window_half_height_m,
            max_gap_m=self.max_gap_m,
            min_pixels=self.min_pixels,
            jump_m=self.jump_m,
            hold_reach_m=self.hold_reach_m,
        )

    def track_settings(self) -> TrackSettings:
        """Return the knobs of the method ``profile``."""
        from garment_dataset.vision.depth.profile import ProfileSettings
        from garment_dataset.vision.depth.settings import TrackSettings

        profile = ProfileSettings(
            band_half_width_m=self.band_half_width_m,
            clearance_m=self.clearance_m,
            jump_m=self.jump_m,
            max_gap_m=self.profile_max_gap_m,
            hold_reach_m=self.hold_reach_m,
            windows_px=self.windows_px,
        )
        return TrackSettings(
            point_count=self.point_count,
            profile=profile,
            longest_bridge_m=self.longest_bridge_m,
            sample_step_m=self.sample_step_m,
            shortest_m=2 * self.point_count * self.window_half_height_m,
            smoothing_frames=self.smoothing_frames,
            flat_field_frames=self.flat_field_frames,
            flat_field_beyond_m=self.flat_field_beyond_m,
            gripper_std_m=self.gripper_std_m,
        )


def depth_points(
    bag: Path,
    frames: pa.Table,
    camera: pa.Table,
    gripper: pa.Table,
    params: DepthPointsParams,
    sensor: pa.Table | None = None,
    pixel_pattern: pa.Table | None = None,
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
    sensor : pyarrow.Table, optional
        As the stage of that name made it; without it the sensor is taken to err as real ones usually do.
    pixel_pattern : pyarrow.Table, optional
        As the stage of that name made it of the empty scene; as much as ``sensor`` says is taken off.

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
        If chains end at a gap too long to cross, with more of the garment or something else below it.
    """
    from garment_dataset.bags import open_bag
    from garment_dataset.stages.depth_columns import chain_columns, point_columns
    from garment_dataset.stages.depth_images import DepthImages, depth_camera, known_sensor
    from garment_dataset.vision.depth.scale import spread_over
    from garment_dataset.vision.depth.trace import Trace, trace_profiles, trace_windows

    stamps_ns = usable_stamps_ns(frames, "depth")
    traces: dict[int, Trace] = {}
    if stamps_ns:
        shape, intrinsics = depth_camera(bag, camera)
        grippers_m = known_grippers_m(gripper, "depth")
        with open_bag(bag) as opened:
            images = DepthImages(opened, frames, shape, depth_reading(camera))
            if params.method == "thesis":
                windows = params.window_settings()
                for frame, depth_mm in images:
                    traces[frame] = (
                        Trace(reason="image_size")
                        if depth_mm is None
                        else trace_windows(depth_mm, intrinsics, grippers_m.get(frame), windows)
                    )
            else:
                settings, known = params.track_settings(), known_sensor(sensor, pixel_pattern, shape)
                some = replace(images, only=spread_over(list(stamps_ns), settings.flat_field_frames))
                traces = trace_profiles(images, stamps_ns, intrinsics, grippers_m, settings, known, some)
    _warn_of_gaps(bag.name, traces)
    return {
        "chains": CHAINS.table(chain_columns(stamps_ns, traces)),
        "points": POINTS.table(point_columns(stamps_ns, traces, params.point_count, params.common_std_m)),
    }


def _warn_of_gaps(where: str, traces: Mapping[int, Trace]) -> None:
    if ended := [frame for frame, trace in traces.items() if trace.chain is not None and trace.chain.ends_at_gap]:
        text = (
            f"{where}: in {len(ended)} of {len(traces)} depth frames the chain ends at a gap, first in frame {ended[0]}"
        )
        warnings.warn(f"{text}; what is below is left out", DataWarning, stacklevel=3)


STAGE = Stage(depth_points, params=DepthPointsParams, outputs=(CHAINS, POINTS))
