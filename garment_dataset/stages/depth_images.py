"""The depth images of a recording, and their camera, as ``depth_points`` takes them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from garment_dataset.errors import BagError
from garment_dataset.stages.inputs import usable_images
from garment_dataset.vision.depth.cloud import Intrinsics

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import pyarrow as pa

    from garment_dataset.arrays import DepthImage
    from garment_dataset.bags import Bag
    from garment_dataset.bags.images import DepthReading


@dataclass(frozen=True, slots=True)
class DepthImages:
    """The usable depth images of a bag, by index; None for one of another size. Read anew in every loop."""

    bag: Bag
    frames: pa.Table
    shape: tuple[int, int]
    reading: DepthReading

    def __iter__(self) -> Iterator[tuple[int, DepthImage | None]]:
        for image in usable_images(self.bag, self.frames, "depth"):
            depth_mm = image.pixels(self.reading)
            yield image.index, depth_mm if depth_mm.shape == self.shape else None


def depth_camera(bag: Path, camera: pa.Table) -> tuple[tuple[int, int], Intrinsics]:
    """Return the shape that images must have, and their K."""
    for row in camera.to_pylist():
        if row["stream"] == "depth":
            intrinsics = Intrinsics(row["fx_px"], row["fy_px"], row["cx_px"], row["cy_px"])
            return (row["height_px"], row["width_px"]), intrinsics
    raise BagError("no camera for the depth images", where=bag.name)
