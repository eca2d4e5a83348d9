"""What an image message says of itself: its header read by hand, every field checked, no pixel touched.

rosbags would deserialise the message as well, but a damaged one only to an exception; here the fields before the damage
survive, and the fault says what was expected and found.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from garment_dataset.bags.fields import Fields
from garment_dataset.bags.image_files import JPEG, PNG
from garment_dataset.bags.images import (
    ENCODINGS,
    DepthReading,
    Encoding,
    Kind,
    decode_compressed_color,
    decode_compressed_depth,
    decode_rows,
    decode_rvl_depth,
    is_rvl,
    png_start,
    source_encoding,
)
from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.bags.definitions import Leading

Decode = Callable[[memoryview, DepthReading], "NDArray[Any]"]


@dataclass(slots=True)
class ImageHeader:
    """What an image message says of itself, as far as it could be read.

    Attributes
    ----------
    start_bytes, size_bytes : int
        Where the pixel data lie in the serialised message.
    compressed : bool
        Whether they are a JPEG or PNG file, or RVL data, instead of rows of pixels.
    fault : str or None
        Why the message cannot be used, in one line.
    decode : callable or None
        Takes the pixel data, and what depths are; returns canonical pixels. None when there is a fault.
    """

    stamp_ns: int | None = None
    frame_id: str | None = None
    encoding: str | None = None
    width_px: int | None = None
    height_px: int | None = None
    step_bytes: int | None = None
    start_bytes: int | None = None
    size_bytes: int | None = None
    compressed: bool = False
    fault: str | None = None
    decode: Decode | None = None

    def at(self, stamp_ns: int) -> ImageHeader:
        """Return the same header at another time, without the detours of ``dataclasses.replace``."""
        what = (self.frame_id, self.encoding, self.width_px, self.height_px, self.step_bytes)
        where = (self.start_bytes, self.size_bytes, self.compressed)
        return ImageHeader(stamp_ns, *what, *where, self.fault, self.decode)


def _read_raw(fields: Fields, header: ImageHeader, kind: Kind) -> Decode:
    header.height_px = fields.length("height")
    header.width_px = fields.length("width")
    header.encoding = fields.text("encoding")
    big_endian = fields.uint8("is_bigendian") != 0
    header.step_bytes = fields.length("step")
    header.start_bytes, header.size_bytes = fields.sequence("data")
    fields.end()
    width, height, step = header.width_px, header.height_px, header.step_bytes
    if (encoding := ENCODINGS[kind].get(header.encoding)) is None:
        raise MessageError("encoding", expected=" or ".join(ENCODINGS[kind]), found=repr(header.encoding))
    _check_size(encoding, width, height)
    row = width * encoding.channels * np.dtype(encoding.dtype).itemsize
    if step < row:
        raise MessageError("step", expected=f"at least {row} bytes for {width} pixels", found=f"{step} bytes")
    if header.size_bytes != height * step:
        expected = f"{height * step} bytes, {height} rows of {step}"
        raise MessageError("data", expected=expected, found=f"{header.size_bytes} bytes")
    return partial(
        decode_rows, encoding=encoding, width_px=width, height_px=height, step_bytes=step, big_endian=big_endian
    )


def _check_size(encoding: Encoding, width_px: int, height_px: int) -> None:
    found = f"{width_px} x {height_px}"
    if width_px == 0 or height_px == 0:
        raise MessageError("size", expected="at least one pixel", found=found)
    if width_px % encoding.columns:
        raise MessageError("size", expected=f"a width that is a multiple of {encoding.columns}", found=found)
    if min(width_px, height_px) < encoding.least_px:
        expected = f"at least {encoding.least_px} x {encoding.least_px} pixels"
        raise MessageError("size", expected=expected, found=found)


def _read_compressed(fields: Fields, header: ImageHeader, kind: Kind) -> Decode:
    header.compressed = True
    header.encoding = fields.text("format")
    header.start_bytes, header.size_bytes = fields.sequence("data")
    fields.end()
    other: Kind = "color" if kind == "depth" else "depth"
    if source_encoding(header.encoding) in ENCODINGS[other]:
        raise MessageError("format", expected=f"a {kind} image", found=repr(header.encoding))
    data = fields.view(header.start_bytes, header.size_bytes)
    if kind == "depth":
        if is_rvl(header.encoding):
            return partial(decode_rvl_depth, encoding=header.encoding)
        if png_start(data) < 0:
            raise MessageError("data", expected="a PNG image", found=f"{header.encoding!r}, {bytes(data[:20])!r}")
        return partial(decode_compressed_depth, encoding=header.encoding)
    if not bytes(data[:8]).startswith((PNG, JPEG)):
        raise MessageError("data", expected="a JPEG or PNG image", found=f"{header.encoding!r}, {bytes(data[:8])!r}")
    color = partial(decode_compressed_color, encoding=header.encoding)
    return lambda data, _: color(data)


_RAW = "sensor_msgs/msg/Image"
_STAMP, _LENGTH = struct.Struct("<II"), struct.Struct("<I")
_STAMP_START, _FRAME_START = 4, 12
_MOST_HEAD_BYTES = 256

_READERS: dict[str, Callable[[Fields, ImageHeader, Kind], Decode]] = {
    _RAW: _read_raw,
    "sensor_msgs/msg/CompressedImage": _read_compressed,
}


IMAGES = tuple(_READERS)
"""Message types of images."""


def read_image(data: memoryview, message_type: str, kind: Kind, *, cdr: bool) -> ImageHeader:
    """Read what a serialised image message says of itself, and check that it fits together.

    Parameters
    ----------
    data : memoryview
        The whole message, in ROS 1 serialisation or in plain CDR (ROS 2).
    message_type : str
        ``sensor_msgs/msg/Image`` or ``sensor_msgs/msg/CompressedImage``.
    kind : {"depth", "color"}
        What the stream is meant to be; an encoding of the other kind is a fault.
    cdr : bool
        Whether the message is in CDR.

    Returns
    -------
    ImageHeader
        With ``fault`` set when something does not fit; the fields before the fault are filled. Width, height and step
        of a compressed image are known only once it is decoded.
    """
    header = ImageHeader()
    if message_type not in _READERS:
        header.fault = f"type: expected {' or '.join(_READERS)}, found {message_type}"
        return header
    try:
        fields = Fields(data, cdr=cdr)
        header.stamp_ns = fields.stamp_ns()
        header.frame_id = fields.text("frame_id")
        header.decode = _READERS[message_type](fields, header, kind)
    except MessageError as error:
        header.fault = str(error)
    return header


class ImageHeaders:
    """Reads the headers of one stream, as :func:`read_image` does; most differ from the last in their stamp alone.

    Parameters
    ----------
    kind : {"depth", "color"}
        What the stream is meant to be.
    cdr : bool
        Whether its messages are in CDR.
    """

    def __init__(self, kind: Kind, *, cdr: bool) -> None:
        self._kind: Kind = kind
        self._cdr = cdr
        self._sound: dict[tuple[bytes, int], ImageHeader] = {}

    def read(self, data: memoryview, message_type: str) -> ImageHeader:
        """Read what a message says of itself."""
        said = None if self._cdr or message_type != _RAW else _behind_stamp(data)
        if said is None:
            return read_image(data, message_type, self._kind, cdr=self._cdr)
        seconds, nanoseconds = _STAMP.unpack_from(data, _STAMP_START)
        if (known := self._sound.get(said)) is not None and nanoseconds < 10**9:
            return known.at(seconds * 10**9 + nanoseconds)
        header = read_image(data, message_type, self._kind, cdr=self._cdr)
        if header.fault is None:
            self._sound[said] = header
        return header


def _behind_stamp(data: memoryview) -> tuple[bytes, int] | None:
    """Return all that the header of a raw ROS 1 image depends on beside its stamp; None where it is unusually long.

    That is what stands between the stamp and the first pixel, and the length of the message.
    """
    try:
        (frame_bytes,) = _LENGTH.unpack_from(data, _FRAME_START)
        (encoding_bytes,) = _LENGTH.unpack_from(data, _FRAME_START + frame_bytes + 12)  # behind height and width
    except struct.error:
        return None
    end = _FRAME_START + frame_bytes + encoding_bytes + 25
    return (bytes(data[_FRAME_START:end]), len(data)) if end <= _MOST_HEAD_BYTES else None


def read_stamp_ns(data: memoryview, leading: Leading, *, cdr: bool) -> int | None:
    """Read the stamp that a serialised message begins with; of a list of parts, that of the first.

    Parameters
    ----------
    data : memoryview
        The whole message, in ROS 1 serialisation or in plain CDR (ROS 2).
    leading : {"header", "headers"}
        What it begins with.
    cdr : bool
        Whether the message is in CDR.

    Returns
    -------
    int or None
        Nanoseconds since the Unix epoch; None when the list is empty.

    Raises
    ------
    MessageError
        If the message ends before, or the stamp is none.
    """
    fields = Fields(data, cdr=cdr)
    if leading == "headers" and not fields.length("number of parts"):
        return None
    return fields.stamp_ns()
