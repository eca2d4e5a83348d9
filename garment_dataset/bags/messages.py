"""What a recording is made of: topics, messages, and images whose pixels wait until they are asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from garment_dataset.bags.images import AS_SAID
from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray
    from rosbags.interfaces import Connection

    from garment_dataset.bags.headers import ImageHeader
    from garment_dataset.bags.images import DepthReading


class Payload(NamedTuple):
    """The bytes of one message, and where they begin in the bag file (None when the file holds them compressed)."""

    data: memoryview
    offset_bytes: int | None


@dataclass(frozen=True, slots=True)
class Record:
    """One message as a bag stores it; ``read`` fetches its bytes, or raises MessageError when they are lost."""

    connection: Connection
    stamp_ns: int
    read: Callable[[], Payload]


@dataclass(frozen=True, slots=True)
class Topic:
    """One topic of a bag.

    Parameters
    ----------
    name : str
        As recorded, with its leading slash.
    types : tuple of str
        Message types on it, sorted, as ``package/msg/Type``; several publishers may differ.
    count : int
        Number of messages.
    """

    name: str
    types: tuple[str, ...]
    count: int


def image_forms(base: str) -> tuple[str, str, str]:
    """Return the topics that may carry the images of ``base``: itself, and its compressed forms."""
    return base, f"{base}/compressedDepth", f"{base}/compressed"


@dataclass(frozen=True, slots=True)
class Message:
    """One deserialised message.

    Parameters
    ----------
    topic, type : str
        Where it was published, and as what (``package/msg/Type``).
    index : int
        In its topic, from 0, unreadable ones counted.
    record_stamp_ns : int
        When the recorder received it.
    data : object
        With the fields of its definition; arrays are read-only and valid as long as they are referenced.
    """

    topic: str
    type: str
    index: int
    record_stamp_ns: int
    data: Any


class Glance(NamedTuple):
    """What the first and the last bytes of a message tell.

    Parameters
    ----------
    record_stamp_ns : int
        When the recorder received it.
    stamp_ns : int or None
        Header stamp; None when its type has none, or it cannot be read.
    digest : bytes
        Of its length, its beginning and its end: messages that differ in it differ.
    fault : str or None
        Why it cannot be read, in one line.
    """

    record_stamp_ns: int
    stamp_ns: int | None
    digest: bytes
    fault: str | None


@dataclass(frozen=True, slots=True)
class ImageMessage:
    """One image message; its pixels are touched only by :meth:`pixels`.

    Parameters
    ----------
    index : int
        In its topic, from 0, faulty ones counted.
    record_stamp_ns : int
        When the recorder received it.
    stamp_ns : int or None
        Header stamp: when the camera saw it.
    frame_id, encoding : str or None
        As the message says; the encoding of a compressed image is its format string.
    width_px, height_px, step_bytes : int or None
        As the message says; None for a compressed image.
    offset_bytes : int or None
        Where the first pixel lies in the bag file; None when it is compressed, or the bag is no single plain file.
    size_bytes : int or None
        Length of the pixel data as stored.
    fault : str or None
        Why the message cannot be used, in one line. The fields before the fault are filled, the others None.
    """

    index: int
    record_stamp_ns: int
    stamp_ns: int | None
    frame_id: str | None
    encoding: str | None
    width_px: int | None
    height_px: int | None
    step_bytes: int | None
    offset_bytes: int | None
    size_bytes: int | None
    fault: str | None
    _record: Record = field(repr=False, compare=False)
    _header: ImageHeader = field(repr=False, compare=False)

    def pixels(self, reading: DepthReading = AS_SAID) -> NDArray[Any]:
        """Return the canonical pixels, read-only.

        Parameters
        ----------
        reading : DepthReading
            What the depths of the recording are, where its messages do not say so; without meaning for colour.

        Returns
        -------
        (H, W) uint16 or (H, W, 3) uint8
            Depth in millimetres, 0 for no return; or colour as RGB. A view of the bag where nothing needs converting.

        Raises
        ------
        MessageError
            If the message is faulty or its compressed data cannot be decoded.
        BagError
            If the ROS 1 bag is closed. Arrays handed out before stay valid as long as they are referenced.
        """
        header = self._header
        if header.decode is None or header.start_bytes is None or header.size_bytes is None:
            raise MessageError("faulty image", where=f"message {self.index}", found=self.fault)
        data = self._record.read().data
        return header.decode(data[header.start_bytes : header.start_bytes + header.size_bytes], reading)
