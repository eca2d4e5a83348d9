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

_MOST_TEXT_BYTES = 256  # frame ids and encodings are names; what is longer is damage


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


class _Fields:
    """The fields of a serialised message, read one after the other and never beyond its end."""

    def __init__(self, data: memoryview, *, cdr: bool) -> None:
        self.position = 0
        self._data = data
        self._cdr = cdr
        self._uint32 = struct.Struct("<I")
        if cdr:
            if (encapsulation := bytes(data[:2])) not in {b"\0\0", b"\0\1"}:
                raise MessageError("encapsulation", expected="plain CDR", found=encapsulation)
            self._uint32 = struct.Struct("<I" if encapsulation[1] else ">I")
            self.position = 4  # what CDR aligns to; a multiple of 4 itself

    def uint8(self, name: str) -> int:
        self._need(name, 1)
        self.position += 1
        return self._data[self.position - 1]

    def uint32(self, name: str) -> int:
        if self._cdr:
            self.position += -self.position % 4
        self._need(name, 4)
        self.position += 4
        value: int = self._uint32.unpack_from(self._data, self.position - 4)[0]
        return value

    def length(self, name: str) -> int:
        if (value := self.uint32(name)) >= 2**31:
            raise MessageError(name, expected="less than 2**31", found=value)
        return value

    def sequence(self, name: str) -> tuple[int, int]:
        """Return where the bytes of a string or an array start, and how many there are."""
        size = self.uint32(name)
        self._need(name, size)
        self.position += size
        return self.position - size, size

    def view(self, start: int, size: int) -> memoryview:
        return self._data[start : start + size]

    def text(self, name: str) -> str:
        raw = bytes(self.view(*self.sequence(name)))
        text = (raw.removesuffix(b"\0") if self._cdr else raw).decode(errors="replace")
        if len(raw) > _MOST_TEXT_BYTES or "\N{REPLACEMENT CHARACTER}" in text or not text.isprintable():
            raise MessageError(name, expected=f"printable text of at most {_MOST_TEXT_BYTES} bytes", found=raw[:32])
        return text

    def stamp_ns(self) -> int:
        if not self._cdr:
            self.uint32("seq")
        seconds, nanoseconds = self.uint32("stamp"), self.uint32("stamp")
        if nanoseconds >= 10**9:
            raise MessageError("stamp", expected="less than 1e9 nanoseconds", found=nanoseconds)
        return seconds * 10**9 + nanoseconds

    def end(self) -> None:
        padding = 3 if self._cdr else 0
        if len(self._data) - self.position > padding:
            raise MessageError("message", expected=f"{self.position} bytes", found=f"{len(self._data)} bytes")

    def _need(self, name: str, size: int) -> None:
        if (left := len(self._data) - self.position) < size:
            raise MessageError(name, expected=f"{size} bytes", found=f"{left} bytes before the end of the message")


def _read_raw(fields: _Fields, header: ImageHeader, kind: Kind) -> Decode:
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


def _read_compressed(fields: _Fields, header: ImageHeader, kind: Kind) -> Decode:
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


_READERS: dict[str, Callable[[_Fields, ImageHeader, Kind], Decode]] = {
    "sensor_msgs/msg/Image": _read_raw,
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
        fields = _Fields(data, cdr=cdr)
        header.stamp_ns = fields.stamp_ns()
        header.frame_id = fields.text("frame_id")
        header.decode = _READERS[message_type](fields, header, kind)
    except MessageError as error:
        header.fault = str(error)
    return header


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
    fields = _Fields(data, cdr=cdr)
    if leading == "headers" and not fields.length("number of parts"):
        return None
    return fields.stamp_ns()
