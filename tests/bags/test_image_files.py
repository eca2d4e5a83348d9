"""PNG and JPEG files: what is damaged is a fault, whatever the decoder would forgive."""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest

from garment_dataset.bags.image_files import MOST_PIXELS, PNG, check_file
from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from numpy.typing import NDArray


def encoded(form: str, pixels: NDArray[Any], *options: int) -> bytes:
    return bytes(cv2.imencode(form, pixels, options)[1])


DEPTH = encoded(".png", np.arange(600, 600 + 12 * 9, dtype=np.uint16).reshape(9, 12))
COLOR = np.random.default_rng(0).integers(0, 255, (24, 32, 3), dtype=np.uint8)
JPEG_FILES = [
    encoded(".jpg", COLOR),
    encoded(".jpg", COLOR, cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
    encoded(".jpg", COLOR, cv2.IMWRITE_JPEG_RST_INTERVAL, 1),
    encoded(".jpg", COLOR[..., 0]),
]


@pytest.mark.parametrize("data", [DEPTH, encoded(".png", COLOR), *JPEG_FILES, b"neither", b""])
def test_a_whole_file_and_what_is_no_such_file_pass(data: bytes) -> None:
    check_file(memoryview(data))
    check_file(memoryview(data + bytes(7)))  # some cameras fill their buffers up


@pytest.mark.parametrize("bit", range(8))
def test_no_flipped_bit_of_a_png_passes(bit: int) -> None:
    for place in range(len(PNG), len(DEPTH)):
        spoiled = bytearray(DEPTH)
        spoiled[place] ^= 1 << bit
        with pytest.raises(MessageError, match="png"):
            check_file(memoryview(spoiled))


@pytest.mark.parametrize("data", [DEPTH, *JPEG_FILES])
def test_no_cut_file_passes(data: bytes) -> None:
    for size in range(8, len(data)):
        with pytest.raises(MessageError, match=r"png is cut|jpeg is cut"):
            check_file(memoryview(data[:size]))


def png_of_size(width_px: int, height_px: int) -> bytes:
    header = b"IHDR" + struct.pack(">IIBBBBB", width_px, height_px, 16, 0, 0, 0, 0)
    parts = [header, b"IDAT", b"IEND"]
    return PNG + b"".join(
        struct.pack(">I", len(part) - 4) + part + struct.pack(">I", zlib.crc32(part)) for part in parts
    )


def jpeg_of_size(width_px: int, height_px: int) -> bytes:
    data = bytearray(JPEG_FILES[0])
    frame = data.index(b"\xff\xc0")
    data[frame + 5 : frame + 9] = struct.pack(">HH", height_px, width_px)
    return bytes(data)


def test_an_absurd_size_is_refused_before_it_is_allocated() -> None:
    check_file(memoryview(png_of_size(2**13, 2**13)))
    check_file(memoryview(jpeg_of_size(2**13, 2**13)))
    for data in (
        png_of_size(2**31, 2**31),
        png_of_size(2**13, 2**13 + 1),
        png_of_size(0, 9),
        jpeg_of_size(65535, 65535),
    ):
        with pytest.raises(MessageError, match=f"size: expected 1 to {MOST_PIXELS} pixels"):
            check_file(memoryview(data))


def test_a_jpeg_whose_segments_cannot_be_followed_is_refused() -> None:
    data = bytearray(JPEG_FILES[0])
    data[20] = 0
    with pytest.raises(MessageError, match="byte 20 of the image: jpeg is damaged: expected a segment"):
        check_file(memoryview(data))
