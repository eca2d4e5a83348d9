"""The depth images of a recording, and their camera, as ``depth_points`` takes them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.errors import BagError
from garment_dataset.stages.inputs import usable_images
from garment_dataset.vision.depth.cloud import Intrinsics
from garment_dataset.vision.depth.pattern import FixedPattern
from garment_dataset.vision.depth.trace import USUAL_NOISE_PER_M, KnownSensor

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import pyarrow as pa

    from garment_dataset.arrays import DepthImage, FloatArray
    from garment_dataset.bags import Bag
    from garment_dataset.bags.images import DepthReading


@dataclass(frozen=True, slots=True)
class DepthImages:
    """The usable depth images of a bag, by index; None for one of another size. Read anew in every loop.

    Of those that are not in ``only``, if that is given, no pixel is touched.
    """

    bag: Bag
    frames: pa.Table
    shape: tuple[int, int]
    reading: DepthReading
    only: frozenset[int] | None = None

    def __iter__(self) -> Iterator[tuple[int, DepthImage | None]]:
        for image in usable_images(self.bag, self.frames, "depth"):
            if self.only is not None and image.index not in self.only:
                continue
            depth_mm = image.pixels(self.reading)
            yield image.index, depth_mm if depth_mm.shape == self.shape else None


def depth_camera(bag: Path, camera: pa.Table) -> tuple[tuple[int, int], Intrinsics]:
    """Return the shape that images must have, and their K."""
    for row in camera.to_pylist():
        if row["stream"] == "depth":
            intrinsics = Intrinsics(row["fx_px"], row["fy_px"], row["cx_px"], row["cy_px"])
            return (row["height_px"], row["width_px"]), intrinsics
    raise BagError("no camera for the depth images", where=bag.name)


def pattern_image(table: pa.Table) -> FloatArray:
    """Return what the table ``pixel_pattern`` holds, (H, W), in 1/m; NaN where nothing is known."""
    width_px = table["width_px"][0].as_py() if table.num_rows else 0
    image = np.full((table.num_rows, width_px), np.nan)
    for v, (columns, values) in enumerate(zip(table["u_px"], table["pattern_per_m"], strict=True)):
        image[v, columns.values.to_numpy()] = values.values.to_numpy()
    return image


def known_sensor(
    sensor: pa.Table | None, pixel_pattern: pa.Table | None = None, shape: tuple[int, int] | None = None
) -> KnownSensor:
    """Return what the table of the stage ``sensor`` says, and, for images of a shape, ``pixel_pattern``.

    Without them it is what is usual.
    """
    rows = [] if sensor is None else sensor.to_pylist()
    if not rows:
        return KnownSensor()
    (row,) = rows
    pattern = None
    if row["pattern_pixels"] is not None:
        pattern = FixedPattern(np.array(row["pattern_pixels"]), np.array(row["pattern_per_m"]))
    pixels_per_m = None
    if pixel_pattern is not None and row["pixel_share"] is not None:
        added = pattern_image(pixel_pattern)
        pixels_per_m = row["pixel_share"] * np.nan_to_num(added) if added.shape == shape else None
    noise_per_m = USUAL_NOISE_PER_M
    if row["noise_per_m"] is not None:
        noise_per_m = row["noise_per_m"] * row["pixels_per_independent"] ** 0.5
    x_m, y_m, z_m = (row[f"gripper_{axis}_error_m"] or 0.0 for axis in "xyz")
    return KnownSensor(pattern, pixels_per_m, noise_per_m, row["noise_correlation"] or 0.0, (x_m, y_m, z_m))
