"""Model the empty scene of a camera position from frames without a garment: thesis 5.2.1."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import Field

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.errors import BagError
from garment_dataset.stages.inputs import frames_within, usable_images
from garment_dataset.stages.stage import Stage, StageParams

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    import pyarrow as pa
    from numpy.typing import NDArray

    from garment_dataset.vision.color.background import Background


BACKGROUND = TableSpec(
    "background",
    1,
    "one row of the image of the empty scene, from the top",
    (
        Column("v_px", "int32", "px", "number of the row of the image, from 0"),
        Column("frame_count", "int32", "1", "number of frames that mean and std are of"),
        Column("mean", "list<float64>", "level", "mean by pixel and channel, thesis eq. (5.1): r, g, b, r, g, b, …"),
        Column("std", "list<float64>", "level", "sample standard deviation, thesis eq. (5.2), in the order of mean"),
    ),
    keys=("v_px",),
)
"""One file per camera position. ``np.stack(frame["mean"]).reshape(len(frame), -1, 3)`` is the image, (H, W, 3)."""


class BackgroundParams(StageParams):
    """Which frames show the empty scene; a row of catalog/backgrounds.csv overrides the interval."""

    from_s: float | None = Field(default=None, ge=0, description="begin, after the first colour stamp; null: the first")
    to_s: float | None = Field(
        default=None, gt=0, description="end, which does not belong to it, after the first colour stamp; null: the last"
    )


def background(bag: Path, frames: pa.Table, params: BackgroundParams) -> dict[str, pa.Table]:
    """Take mean and standard deviation of every pixel and channel, in one pass.

    Parameters
    ----------
    bag : Path
        The recording that shows the empty scene.
    frames : pyarrow.Table
        As ``decode`` made it of that recording.
    params : BackgroundParams
        See there.

    Returns
    -------
    dict of str to pyarrow.Table
        ``background``: one row per row of the image; thesis eqs. (5.1) and (5.2).

    Raises
    ------
    BagError
        If the bag has no colour images, or fewer than two in the interval, or of unequal sizes.
    """
    from garment_dataset.bags import open_bag
    from garment_dataset.vision.color.background import BackgroundAccumulator

    wanted = frames_within(frames, "color", params.from_s, params.to_s)
    if len(wanted) < 2:
        begin_s, end = params.from_s or 0.0, "its end" if params.to_s is None else f"{params.to_s:g} s"
        raise BagError(
            "too few frames of the empty scene",
            where=bag.name,
            expected=f"at least 2 usable colour frames from {begin_s:g} s to {end}",
            found=len(wanted),
        )
    accumulator = BackgroundAccumulator()
    with open_bag(bag) as opened:
        for image in usable_images(opened, frames, "color"):
            if image.index in wanted:
                accumulator.add(image.pixels())
    model = accumulator.finish()
    height_px = len(model.mean)
    return {
        "background": BACKGROUND.table(
            {
                "v_px": range(height_px),
                "frame_count": [model.count] * height_px,
                "mean": _by_row(model.mean),
                "std": _by_row(model.std),
            }
        )
    }


def background_model(table: pa.Table) -> Background:
    """Return what the table ``background`` holds.

    Parameters
    ----------
    table : pyarrow.Table
        As :func:`background` made it.
    """
    import pyarrow.compute as pc

    from garment_dataset.vision.color.background import Background

    height_px = table.num_rows
    mean, std = (pc.list_flatten(table[name]).to_numpy().reshape(height_px, -1, 3) for name in ("mean", "std"))
    return Background(mean, std, table["frame_count"][0].as_py())


def _by_row(values: NDArray[np.float64]) -> pa.Array[Any]:
    """Return an image as lists, one per row, the channels of a pixel together."""
    import numpy as np
    import pyarrow as pa

    height_px, width_px, channels = values.shape
    ends = np.arange(height_px + 1, dtype=np.int32) * (width_px * channels)
    return pa.ListArray.from_arrays(pa.array(ends), pa.array(values.ravel()))


STAGE = Stage(background, params=BackgroundParams, outputs=(BACKGROUND,), per="position")
