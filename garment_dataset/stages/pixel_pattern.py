"""What the depth sensor of a camera position adds pixel by pixel, measured on its empty scene."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import Field

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.stages.cameras import depth_reading
from garment_dataset.stages.inputs import frames_within
from garment_dataset.stages.stage import Stage, StageParams

if TYPE_CHECKING:
    from pathlib import Path

    import pyarrow as pa

    from garment_dataset.arrays import DepthImage

PIXEL_PATTERN = TableSpec(
    "pixel_pattern",
    1,
    "one row of the depth image of the empty scene, from the top",
    (
        Column("v_px", "int32", "px", "number of the row of the image, from 0"),
        Column("width_px", "int32", "px", "width of the image"),
        Column("frame_count", "int32", "1", "number of frames that it was measured on"),
        Column("u_px", "list<int32>", "px", "columns in which it is known: on smooth surfaces that are seen often"),
        Column(
            "pattern_per_m",
            "list<float64>",
            "1/m",
            "what is always added to inverse depth in these columns, finer than some 60 px and less what whole columns "
            "share; a level of an OpenNI sensor is 0.00292 / m",
            uncertainty="pattern_std_per_m",
        ),
        Column("pattern_std_per_m", "list<float64>", "1/m", "its standard uncertainty by the noise of the frames"),
    ),
    keys=("v_px",),
)
"""One file per camera position; no row where its empty scene has fewer than two depth images."""


class PixelPatternParams(StageParams):
    """Which frames show the empty scene; a row of catalog/backgrounds.csv overrides the interval."""

    from_s: float | None = Field(default=None, ge=0, description="begin, after the first colour stamp; null: the first")
    to_s: float | None = Field(
        default=None, gt=0, description="end, which does not belong to it, after the first colour stamp; null: the last"
    )
    most_frames: int = Field(default=90, ge=2, description="so many frames are looked at, spread over the interval")
    beyond_m: float = Field(
        default=1.4, gt=0, description="what is farther may be the plane that shows what whole columns share"
    )


def pixel_pattern(bag: Path, frames: pa.Table, camera: pa.Table, params: PixelPatternParams) -> dict[str, pa.Table]:
    """Measure the pattern of the pixels that see smooth surfaces.

    Parameters
    ----------
    bag : Path
        The recording that shows the empty scene.
    frames, camera : pyarrow.Table
        As ``decode`` made them of that recording.
    params : PixelPatternParams
        See there.

    Returns
    -------
    dict of str to pyarrow.Table
        ``pixel_pattern``: one row per row of the image.

    Raises
    ------
    BagError
        If it has depth images, but no camera for them.
    """
    import numpy as np

    from garment_dataset.vision.depth.flat_field import column_offsets, inverse_depth_table
    from garment_dataset.vision.depth.pixel_pattern import pixel_pattern as measured

    images = _images(bag, frames, camera, params)
    columns: dict[str, Any] = {column.name: [] for column in PIXEL_PATTERN.columns}
    if len(images) < 2:
        return {"pixel_pattern": PIXEL_PATTERN.table(columns)}
    table, _ = inverse_depth_table(images)
    found = measured(images, table, column_offsets(images, table, beyond_m=params.beyond_m))
    for v, (per_m, std_per_m) in enumerate(zip(found.per_m, found.std_per_m, strict=True)):
        known = np.flatnonzero(np.isfinite(per_m))
        row = (v, per_m.size, len(images), known.tolist(), per_m[known].tolist(), std_per_m[known].tolist())
        for values, value in zip(columns.values(), row, strict=True):
            values.append(value)
    return {"pixel_pattern": PIXEL_PATTERN.table(columns)}


def _images(bag: Path, frames: pa.Table, camera: pa.Table, params: PixelPatternParams) -> list[DepthImage]:
    import numpy as np

    from garment_dataset.bags import open_bag
    from garment_dataset.stages.depth_images import DepthImages, depth_camera

    wanted = sorted(frames_within(frames, "depth", params.from_s, params.to_s))
    chosen = frozenset(wanted[:: max(-(-len(wanted) // params.most_frames), 1)])
    if not chosen:
        return []
    shape, _ = depth_camera(bag, camera)
    with open_bag(bag) as opened:
        return [
            np.array(depth_mm)
            for _, depth_mm in DepthImages(opened, frames, shape, depth_reading(camera), chosen)
            if depth_mm is not None
        ]


STAGE = Stage(pixel_pattern, params=PixelPatternParams, outputs=(PIXEL_PATTERN,), per="position")
