"""What the stages that read images take from the tables of ``decode``, and from the bag."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from garment_dataset.errors import BagError

if TYPE_CHECKING:
    import pyarrow as pa

    from garment_dataset.bags import Bag

Stream = Literal["depth", "color"]


def usable_stamps_ns(frames: pa.Table, stream: Stream) -> dict[int, int]:
    """Return the stamp of every usable image of a stream, by its index."""
    rows = zip(*(frames[name].to_pylist() for name in ("stream", "frame", "stamp_ns", "fault")), strict=True)
    return {frame: stamp_ns for found, frame, stamp_ns, fault in rows if found == stream and fault is None}


def known_grippers_m(gripper: pa.Table, stream: Stream) -> dict[int, tuple[float, float, float]]:
    """Return the end point of the gripper in a stream's optical frame, by image, where it is known."""
    rows = zip(*(gripper[name].to_pylist() for name in ("stream", "frame", "x_m", "y_m", "z_m")), strict=True)
    return {frame: (x, y, z) for found, frame, x, y, z in rows if found == stream and None not in {x, y, z}}


def image_topic(bag: Bag, base: str, stream: Stream) -> str:
    """Return the topic of a stream's images: the one named, or its compressed variant.

    Raises
    ------
    BagError
        If the bag has neither.
    """
    if (topic := bag.image_topic(base)) is None:
        name = {"depth": "depth", "color": "colour"}[stream]
        raise BagError(f"no {name} images", where=bag.path.name, expected=base, found=", ".join(bag.topics))
    return topic
