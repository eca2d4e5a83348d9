"""What a recording says of its own depth sensor: noise, its correlations, the fixed pattern, the step of its levels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import Field

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.stages.cameras import depth_reading
from garment_dataset.stages.inputs import known_grippers_m, usable_stamps_ns
from garment_dataset.stages.stage import Stage, StageParams

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import pyarrow as pa

    from garment_dataset.arrays import DepthImage, FloatArray
    from garment_dataset.vision.depth.pixel_pattern import PatternShare, ShareReason

_PER_M = "inverse depth, in which a sensor that measures disparity errs alike at every distance"

SENSOR = TableSpec(
    "sensor",
    2,
    "the depth stream of a recording",
    (
        Column("openni_levels", "bool", "1", "whether depths are those that OpenNI's driver can report"),
        Column("step_per_m", "float64", "1/m", f"distance of the levels it reports near the garment; {_PER_M}", True),
        Column("noise_per_m", "float64", "1/m", "standard deviation in time of a pixel at rest near the garment", True),
        Column("noise_far_per_m", "float64", "1/m", "the same of what stands still behind it", True),
        Column("noise_correlation", "float64", "1", "of that noise with the next frame", True),
        Column("pixels_per_independent", "float64", "1", "pixels that tell as much as an independent one would", True),
        Column("noise_reason", "string", "", "why there is no noise near the garment: few_frames at rest", True),
        Column(
            "pattern_pixels", "list<float64>", "1", "sizes of windows on the plane behind the garment, rising", True
        ),
        Column(
            "pattern_per_m",
            "list<float64>",
            "1/m",
            "standard deviation, among windows of these sizes, of what is always added to their means, after the "
            "columns' own errors are taken off, and what is known pixel by pixel",
            True,
        ),
        Column("pattern_reason", "string", "", "why there is no pattern: no_plane behind the garment", True),
        Column(
            "pixel_share",
            "float64",
            "1",
            "how much of the pattern of the empty scene is taken off, pixel by pixel: what the garment shows, "
            "regressed on it, and shrunk by its uncertainty",
            True,
            "pixel_share_std",
        ),
        Column("pixel_share_std", "float64", "1", "standard uncertainty of that regression", True),
        Column(
            "pixel_share_reason",
            "string",
            "",
            "why nothing is taken off: no_empty_scene of the camera position; image_size: it is of another; "
            "no_pattern: it shows no smooth surface; few_pixels of the garment to compare; not_predictive: the garment "
            "does not follow it",
            True,
        ),
        *(
            Column(
                f"gripper_{axis}_error_m",
                "float64",
                "m",
                f"standard uncertainty of the gripper's calibration along {axis}, by how far /tf and topic are apart; "
                "the same in all frames. Null: only one of them says where it is",
                True,
            )
            for axis in "xyz"
        ),
    ),
)


class SensorParams(StageParams):
    """Which frames are looked at."""

    rest_frames: int = Field(default=24, ge=3, description="most consecutive frames at rest that show the noise")
    rest_m: float = Field(default=0.001, gt=0, description="the gripper rests as long as it moves less than that")
    pattern_frames: int = Field(default=24, ge=2, description="frames of the whole recording that show the pattern")
    beyond_m: float = Field(default=1.4, gt=0, description="what is farther is background, and may be a plane")
    reach_m: float = Field(default=0.27, gt=0, description="depth from the gripper's within which the garment is")


def sensor(
    bag: Path,
    frames: pa.Table,
    camera: pa.Table,
    gripper: pa.Table,
    params: SensorParams,
    pixel_pattern: pa.Table | None = None,
) -> dict[str, pa.Table]:
    """Measure what the depth images of a recording say of their sensor.

    Parameters
    ----------
    bag : Path
        The recording.
    frames, camera, gripper : pyarrow.Table
        As ``decode`` made them.
    params : SensorParams
        See there.
    pixel_pattern : pyarrow.Table, optional
        Of the empty scene of its camera position, as the stage of that name made it.

    Returns
    -------
    dict of str to pyarrow.Table
        ``sensor``: one row; null, with a reason, what it does not show. No row for a recording without depth images.
    """
    from garment_dataset.vision.depth.flat_field import inverse_depth_table

    names = [column.name for column in SENSOR.columns]
    if not usable_stamps_ns(frames, "depth"):
        return {"sensor": SENSOR.table({name: [] for name in names})}
    grippers_m = known_grippers_m(gripper, "depth")
    rest, spread = _read(bag, frames, camera, (_at_rest(frames, grippers_m, params), params.pattern_frames))
    table, on_ladder = inverse_depth_table([*rest, *spread])
    row: dict[str, Any] = dict.fromkeys(names)
    row["openni_levels"] = on_ladder
    row |= _noise(rest, table, next(iter(grippers_m.values()), None), params)
    row |= _patterns(spread, table, pixel_pattern, grippers_m, params)
    row |= _gripper(gripper)
    return {"sensor": SENSOR.table({name: [row[name]] for name in names})}


def _at_rest(frames: pa.Table, grippers_m: dict[int, tuple[float, float, float]], params: SensorParams) -> list[int]:
    """Return the first consecutive frames in which the gripper does not move; all of them if it is never known."""
    import numpy as np

    known = [frame for frame in usable_stamps_ns(frames, "depth") if frame in grippers_m]
    if not known:
        return list(usable_stamps_ns(frames, "depth"))[: params.rest_frames]
    place_m = np.array([grippers_m[frame] for frame in known])
    moved = np.flatnonzero(np.linalg.norm(place_m - place_m[0], axis=1) > params.rest_m)
    return known[: moved[0] if moved.size else None][: params.rest_frames]


def _read(
    bag: Path, frames: pa.Table, camera: pa.Table, wanted: tuple[list[int], int]
) -> tuple[list[DepthImage], list[DepthImage]]:
    """Return the images at rest, and others spread over the recording."""
    import numpy as np

    from garment_dataset.bags import open_bag
    from garment_dataset.stages.depth_images import DepthImages, depth_camera
    from garment_dataset.vision.depth.scale import spread_over

    rest, count = wanted
    numbers = list(usable_stamps_ns(frames, "depth"))
    spread = spread_over(numbers, count)
    shape, _ = depth_camera(bag, camera)
    with open_bag(bag) as opened:
        images = {
            frame: np.array(depth_mm)
            for frame, depth_mm in DepthImages(opened, frames, shape, depth_reading(camera), spread.union(rest))
            if depth_mm is not None
        }
    return [images[frame] for frame in rest if frame in images], [
        images[frame] for frame in sorted(spread & set(images))
    ]


def _noise(
    rest: Sequence[DepthImage], table: FloatArray, gripper_m: tuple[float, float, float] | None, params: SensorParams
) -> dict[str, Any]:
    """Return what the frames at rest say of the noise, near the garment and behind it."""
    import numpy as np

    from garment_dataset.vision.depth.sensor_noise import level_step_per_m, time_noise

    nothing = {"noise_reason": "few_frames"}
    if len(rest) < 3 or gripper_m is None:
        return nothing
    inverse = [table.take(frame) for frame in rest]
    count = sum((frame > 0).astype(np.int32) for frame in rest)
    often = count > 0.75 * len(rest)
    depth_m = count / np.where(often, sum(inverse), np.nan)
    for each, frame in zip(inverse, rest, strict=True):
        each[frame == 0] = np.nan
    near = time_noise(inverse, often & (np.abs(depth_m - gripper_m[2]) < params.reach_m))
    far = time_noise(inverse, often & (depth_m > params.beyond_m))
    limits_mm = [max(int(1000 * (gripper_m[2] + side * params.reach_m)), 1) for side in (-1, 1)]
    found: dict[str, Any] = {"step_per_m": level_step_per_m(rest, table, limits_mm[0], limits_mm[1])}
    if far is not None:
        found["noise_far_per_m"] = far.std_per_m
    if near is None:
        return found | nothing
    # the larger of the regions tells the correlations better
    shape = near if far is None else far
    return found | {
        "noise_per_m": near.std_per_m,
        "noise_correlation": shape.correlation,
        "pixels_per_independent": shape.pixels_per_independent,
    }


def _patterns(
    spread: Sequence[DepthImage],
    table: FloatArray,
    pixel_pattern: pa.Table | None,
    grippers_m: dict[int, tuple[float, float, float]],
    params: SensorParams,
) -> dict[str, Any]:
    """Return what a plane behind the garment says of what is always added, and how the empty scene's pattern helps."""
    from garment_dataset.vision.depth.flat_field import column_offsets
    from garment_dataset.vision.depth.pattern import less_known, measured_pattern
    from garment_dataset.vision.depth.pixel_pattern import PatternShare

    offset = column_offsets(spread, table, beyond_m=params.beyond_m) if spread else None
    known = _pattern_of(pixel_pattern, spread)
    share = known if isinstance(known, str) else _share(spread, table, offset, known, grippers_m, params)
    found = measured_pattern(spread, table, offset, beyond_m=params.beyond_m)
    row: dict[str, Any] = {}
    if isinstance(share, PatternShare):
        row |= {"pixel_share": share.used, "pixel_share_std": share.std}
        if found is not None and not isinstance(known, str):
            found = less_known(found, share.used * known)
    else:
        row["pixel_share_reason"] = share
    if found is None:
        return row | {"pattern_reason": "no_plane"}
    return row | {"pattern_pixels": found.pixels.tolist(), "pattern_per_m": found.std_per_m.tolist()}


def _pattern_of(pixel_pattern: pa.Table | None, spread: Sequence[DepthImage]) -> FloatArray | ShareReason:
    """Return the pattern of the empty scene, if it is one of such images."""
    from garment_dataset.stages.depth_images import pattern_image

    if pixel_pattern is None or pixel_pattern.num_rows == 0:
        return "no_empty_scene"
    known = pattern_image(pixel_pattern)
    return "image_size" if any(image.shape != known.shape for image in spread) else known


def _share(
    spread: Sequence[DepthImage],
    table: FloatArray,
    offset: FloatArray | None,
    known: FloatArray,
    grippers_m: dict[int, tuple[float, float, float]],
    params: SensorParams,
) -> PatternShare | ShareReason:
    """Return how much of a pattern is seen where the garment can be: as near to the gripper as it ever is."""
    from garment_dataset.vision.depth.pixel_pattern import pattern_share

    depths_m = [place_m[2] for place_m in grippers_m.values()]
    if not depths_m:
        return "few_pixels"
    near_m, far_m = min(depths_m) - params.reach_m, min(max(depths_m) + params.reach_m, params.beyond_m)
    return pattern_share(spread, table, offset, known, (max(int(1000 * near_m), 1), int(1000 * far_m)))


def _gripper(gripper: pa.Table) -> dict[str, float]:
    r"""Return the standard uncertainty of the gripper's calibration.

    Two sources that err alike and are apart by d: the variance of each is estimated by :math:`\sigma^2 = |d|^2 / 6` per
    axis, and given d, the error of either has the mean square :math:`d_i^2 / 4 + \sigma^2 / 2`.
    """
    import numpy as np

    depth = gripper["stream"].to_numpy(zero_copy_only=False) == "depth"
    apart_m = np.stack([gripper[f"apart_{axis}_m"].to_numpy()[depth] for axis in "xyz"])
    known = np.isfinite(apart_m).all(axis=0)
    if not known.any():
        return {}
    mean_m = np.median(apart_m[:, known], axis=1)
    std_m = np.sqrt(mean_m**2 / 4 + (mean_m**2).sum() / 12)
    return {f"gripper_{axis}_error_m": float(value) for axis, value in zip("xyz", std_m, strict=True)}


STAGE = Stage(sensor, params=SensorParams, outputs=(SENSOR,))
