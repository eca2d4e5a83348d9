"""What the stages that read images take from the tables of ``decode``, and from the bag."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from garment_dataset.errors import BagError

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pyarrow as pa

    from garment_dataset.bags import Bag, ImageMessage

Stream = Literal["depth", "color"]


def usable_stamps_ns(frames: pa.Table, stream: Stream) -> dict[int, int]:
    """Return the stamp of every usable image of a stream, by its index."""
    rows = zip(*(frames[name].to_pylist() for name in ("stream", "frame", "stamp_ns", "fault")), strict=True)
    return {frame: stamp_ns for found, frame, stamp_ns, fault in rows if found == stream and fault is None}


def frames_within(frames: pa.Table, stream: Stream, from_s: float | None, to_s: float | None) -> set[int]:
    """Return the usable images of a stream from one time to before another, after the first colour stamp.

    None is without bound. Where there is no colour, times count from the first stamp of the stream.
    """
    stamps_ns = usable_stamps_ns(frames, stream)
    begins_ns = usable_stamps_ns(frames, "color") or stamps_ns
    if not stamps_ns:
        return set()
    first_ns = min(begins_ns.values())
    begin_ns = None if from_s is None else first_ns + round(from_s * 1e9)
    end_ns = None if to_s is None else first_ns + round(to_s * 1e9)
    return {
        frame
        for frame, stamp_ns in stamps_ns.items()
        if (begin_ns is None or begin_ns <= stamp_ns) and (end_ns is None or stamp_ns < end_ns)
    }


def known_grippers_m(gripper: pa.Table, stream: Stream) -> dict[int, tuple[float, float, float]]:
    """Return the end point of the gripper in a stream's optical frame, by image, where it is known."""
    rows = zip(*(gripper[name].to_pylist() for name in ("stream", "frame", "x_m", "y_m", "z_m")), strict=True)
    return {frame: (x, y, z) for found, frame, x, y, z in rows if found == stream and None not in {x, y, z}}


def image_topic(frames: pa.Table, stream: Stream) -> str | None:
    """Return the topic that ``decode`` read a stream from; None when the bag has no such images."""
    streams, topics = frames["stream"].to_pylist(), frames["topic"].to_pylist()
    return next((topic for found, topic in zip(streams, topics, strict=True) if found == stream), None)


def usable_images(bag: Bag, frames: pa.Table, stream: Stream) -> Iterator[ImageMessage]:
    """Yield the usable images of a stream, in order; their pixels hold until the next one is asked for."""
    wanted = usable_stamps_ns(frames, stream)
    if (topic := image_topic(frames, stream)) is not None:
        yield from (image for image in bag.images(topic, stream) if image.index in wanted)


def require_images(frames: pa.Table, stream: Stream, where: str) -> None:
    """Refuse a recording that has no images of a stream.

    Raises
    ------
    BagError
        If there is not one message.
    """
    if image_topic(frames, stream) is None:
        name = {"depth": "depth", "color": "colour"}[stream]
        hint = f"{stream}_topic under [params.decode] names the topic."
        raise BagError(f"no {name} images", where=where, found="not one message of that stream", hint=hint)
