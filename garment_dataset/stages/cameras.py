"""The table ``camera``: how the images of each stream are measured, and what their depths are."""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Literal

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.errors import BagError, DataWarning

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pyarrow as pa

    from garment_dataset.bags import Bag, Camera, ImageMessage
    from garment_dataset.bags.images import DepthReading

    Row = dict[str, Any]
    Columns = dict[str, list[Any]]

Stream = Literal["depth", "color"]

CAMERA = TableSpec(
    "camera",
    2,
    "one image stream",
    (
        Column("stream", "string", "", "depth or color"),
        Column("frame_id", "string", "", "optical frame: x right, y down, z forward"),
        Column("width_px", "int32", "px", "width of the images that the row is for"),
        Column("height_px", "int32", "px", "height of the images that the row is for"),
        Column("fx_px", "float64", "px", "focal length along u, binning corrected"),
        Column("fy_px", "float64", "px", "focal length along v, binning corrected"),
        Column("cx_px", "float64", "px", "principal point, u, in the image; the centre of the first pixel is 0"),
        Column("cy_px", "float64", "px", "principal point, v, in the image; the centre of the first pixel is 0"),
        Column("distortion_model", "string", "", "as in sensor_msgs/CameraInfo; empty for rectified images"),
        Column("distortion", "list<float64>", "1", "coefficients of that model"),
        Column("matrix", "string", "", "of CameraInfo: K, or P for rectified images, or where the other is all zero"),
        Column("depth_unit_mm", "float64", "mm", "what a stored depth of 1 is; null for color", nullable=True),
        Column("bytes_swapped", "bool", "", "whether is_bigendian is wrong; null for color", nullable=True),
    ),
    keys=("stream",),
)


def read_cameras(
    bag: Bag,
    usable: Mapping[Stream, list[Row]],
    topics: Mapping[Stream, str],
    depth_images: Sequence[ImageMessage],
    *,
    depth_unit_mm: float,
) -> Columns:
    """Return the camera of each stream.

    Parameters
    ----------
    bag : Bag
        An open recording.
    usable : mapping of str to list of dict
        Rows of ``frames`` without a fault, by stream.
    topics : mapping of str to str
        The ``camera_info`` of each stream.
    depth_images : sequence of ImageMessage
        All of them, by their number.
    depth_unit_mm : float
        How many millimetres a stored depth is.

    Returns
    -------
    dict of str to list
        Columns of ``camera``.

    Raises
    ------
    BagError
        If the depth images have no usable camera: nothing can be measured in them. Colour images may have none, and a
        DataWarning says so.
    """
    columns: Columns = {column.name: [] for column in CAMERA.columns}
    for name, rows in usable.items():
        try:
            camera = _read_camera(bag, name, topics[name], rows)
        except BagError as error:
            if name == "depth":
                raise
            warnings.warn(f"camera of the color images left out: {error}", DataWarning, stacklevel=2)
            continue
        depths: Row = {"depth_unit_mm": None, "bytes_swapped": None}
        if name == "depth":
            depths = _settle_depths(bag, rows, depth_images, depth_unit_mm)
        for column, value in {"stream": name, **asdict(camera), **depths}.items():
            columns[column].append(value)
    return columns


def depth_reading(camera: pa.Table) -> DepthReading:
    """Return what the depths of a recording are, by its table ``camera``; as the messages say where that says nothing.

    Parameters
    ----------
    camera : pyarrow.Table
        As ``decode`` made it.

    Returns
    -------
    DepthReading
        For :meth:`garment_dataset.bags.ImageMessage.pixels`.
    """
    from garment_dataset.bags.images import AS_SAID, DepthReading

    for row in camera.to_pylist():
        if row["stream"] == "depth" and row["depth_unit_mm"] is not None:
            return DepthReading(row["depth_unit_mm"], bool(row["bytes_swapped"]))
    return AS_SAID


def _read_camera(bag: Bag, name: Stream, info_topic: str, usable: list[Row]) -> Camera:
    """Return the camera of one stream, for images of the size that most of them have."""
    from garment_dataset.bags.camera import is_rectified, read_camera

    sizes = Counter((row["width_px"], row["height_px"]) for row in usable)
    size_px = max(sizes, key=sizes.__getitem__, default=None)
    rectified = bool(usable) and is_rectified(usable[0]["topic"])
    camera = read_camera(bag, info_topic, rectified=rectified, image_size_px=size_px)
    if others := sorted(set(sizes) - {(camera.width_px, camera.height_px)}):
        text = f"{info_topic} is for {camera.width_px} x {camera.height_px} pixels"
        found = ", ".join(f"{width} x {height}" for width, height in others)
        warnings.warn(f"{bag.path.name}: {text}, {name} images have {found}", DataWarning, stacklevel=3)
    return camera


def _settle_depths(bag: Bag, usable: list[Row], images: Sequence[ImageMessage], unit_mm: float) -> Row:
    """Return in which unit and byte order the depths are, by a few images that are spread over the recording."""
    from garment_dataset.bags.depth_reading import SAMPLE, settle_reading

    if not usable:
        return {"depth_unit_mm": unit_mm, "bytes_swapped": False}
    topic = usable[0]["topic"]
    wanted = sorted({usable[len(usable) * part // SAMPLE]["frame"] for part in range(SAMPLE)})
    chosen = [images[number] for number in wanted]
    # every fourth row: neighbours within a row are compared
    reading, notes = settle_reading(lambda reading: [image.pixels(reading)[::4] for image in chosen], unit_mm)
    for note in notes:
        warnings.warn(f"{bag.path.name}: {topic}: {note}", DataWarning, stacklevel=3)
    return {"depth_unit_mm": reading.unit_mm, "bytes_swapped": reading.swapped}
