"""Whether a PNG or JPEG file is whole, before any decoder is trusted with it.

Decoders differ in what they forgive: a wrong checksum may be a line on stderr and an image all the same, a missing end
may be grey rows. Of a PNG every chunk has a CRC, so that no flipped bit passes. A JPEG has no checksum: only its frame
is checked, and a flipped bit in its data is wrong pixels that nothing can tell from right ones.
"""

from __future__ import annotations

import struct
import zlib

from garment_dataset.errors import MessageError

PNG = b"\x89PNG\r\n\x1a\n"
JPEG = b"\xff\xd8\xff"
"""How these files begin."""

MOST_PIXELS = 2**26
"""A larger image is damage, not to be allocated."""

_PNG_CHUNK = struct.Struct(">I4s")
_PNG_CRC = struct.Struct(">I")
_PNG_SIZE = struct.Struct(">II")
_JPEG_SEGMENT = struct.Struct(">BBH")
_JPEG_SIZE = struct.Struct(">HH")
_JPEG_START_OF_SCAN = 0xDA
_JPEG_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}  # tables share the range
_JPEG_END = b"\xff\xd9"


def check_file(data: memoryview) -> None:
    """Check a PNG or JPEG file; what is neither is left to the decoder.

    Raises
    ------
    MessageError
        If a checksum is wrong, the end is missing, or the size is no image's.
    """
    if data[: len(PNG)] == PNG:
        _check_png(data)
    elif data[: len(JPEG)] == JPEG:
        _check_jpeg(data)


def _check_png(data: memoryview) -> None:
    position, name = len(PNG), b""
    while name != b"IEND":
        end = position + _PNG_CHUNK.size
        if end > len(data):
            raise MessageError("png is cut", expected="its end chunk", found=f"{len(data)} bytes")
        size, name = _PNG_CHUNK.unpack_from(data, position)
        stop = end + size
        if stop + _PNG_CRC.size > len(data):
            found = f"{len(data) - end} bytes, {size + _PNG_CRC.size} needed"
            raise MessageError("png is cut", where=f"byte {position} of the image", found=found)
        if zlib.crc32(data[end - 4 : stop]) != _PNG_CRC.unpack_from(data, stop)[0]:
            raise MessageError("png is damaged", where=f"byte {position} of the image", found="a wrong checksum")
        if position == len(PNG):
            if name != b"IHDR" or size < _PNG_SIZE.size:
                raise MessageError("png is damaged", expected="a header first", found=name)
            _check_size("png", *_PNG_SIZE.unpack_from(data, end))
        position = stop + _PNG_CRC.size


def _check_jpeg(data: memoryview) -> None:
    position, frames, marker = 2, 0, 0
    while marker != _JPEG_START_OF_SCAN:
        if position + _JPEG_SEGMENT.size > len(data):
            raise MessageError("jpeg is cut", expected="image data", found=f"{len(data)} bytes")
        prefix, marker, size = _JPEG_SEGMENT.unpack_from(data, position)
        if prefix != 0xFF or size < 2:
            found = bytes(data[position : position + _JPEG_SEGMENT.size])
            raise MessageError(
                "jpeg is damaged", where=f"byte {position} of the image", expected="a segment", found=found
            )
        if marker == 0xFF:  # any number of them may stand before a marker
            position += 1
            continue
        if marker in _JPEG_FRAMES and size >= 3 + _JPEG_SIZE.size and position + size < len(data):
            height_px, width_px = _JPEG_SIZE.unpack_from(data, position + 5)
            _check_size("jpeg", width_px, height_px)
            frames += 1
        position += 2 + size
    if not frames or data.tobytes().find(_JPEG_END, position) < 0:
        raise MessageError("jpeg is cut", expected="its end marker", found=f"{len(data)} bytes")


def _check_size(form: str, width_px: int, height_px: int) -> None:
    if not 0 < width_px * height_px <= MOST_PIXELS:
        expected = f"1 to {MOST_PIXELS} pixels"
        raise MessageError(f"{form} size", expected=expected, found=f"{width_px} x {height_px}")
