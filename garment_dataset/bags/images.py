"""Pixel data as arrays: pure functions from buffers to canonical pixels.

Canonical are depth as (H, W) uint16 millimetres with 0 for no return, and colour as (H, W, 3) uint8 RGB.
"""

from __future__ import annotations

import struct
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import cv2
import numpy as np

from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

Kind = Literal["depth", "color"]

PNG = b"\x89PNG\r\n\x1a\n"
JPEG = b"\xff\xd8\xff"
"""How these files begin."""

_PNG_SEARCH_BYTES = 64  # a ConfigHeader of 12 bytes, or none, or a longer one of another transport


class Encoding(NamedTuple):
    """How one ROS encoding lies in memory, and how it becomes canonical."""

    dtype: str
    channels: int
    canonical: Callable[[NDArray[Any]], NDArray[Any]]


def depth_in_millimetres(depth_m: NDArray[np.floating[Any]]) -> NDArray[np.uint16]:
    """Round a depth image in metres to whole millimetres.

    Parameters
    ----------
    depth_m : (H, W) float
        NaN, infinite, zero or negative where the sensor saw nothing (REP 118).

    Returns
    -------
    (H, W) uint16
        Millimetres, halves to even; 0 for no return and for what exceeds 65.535 m.
    """
    with np.errstate(invalid="ignore"):
        depth_mm = np.rint(depth_m.astype(np.float64) * 1e3)
        depth_mm[~((depth_mm > 0) & (depth_mm <= np.iinfo(np.uint16).max))] = 0
    return depth_mm.astype(np.uint16)


def _native(stored: NDArray[Any]) -> NDArray[Any]:
    """Return the very same memory, unless its byte order is not the machine's."""
    return stored.astype(stored.dtype.newbyteorder("="), copy=False)


def _converted(code: int) -> Callable[[NDArray[Any]], NDArray[Any]]:
    return partial(cv2.cvtColor, code=code)


ENCODINGS: dict[Kind, dict[str, Encoding]] = {
    "depth": {
        "16UC1": Encoding("u2", 1, _native),
        "mono16": Encoding("u2", 1, _native),
        "32FC1": Encoding("f4", 1, depth_in_millimetres),
    },
    "color": {
        "rgb8": Encoding("u1", 3, _native),
        "bgr8": Encoding("u1", 3, _converted(cv2.COLOR_BGR2RGB)),
        "rgba8": Encoding("u1", 4, _converted(cv2.COLOR_RGBA2RGB)),
        "bgra8": Encoding("u1", 4, _converted(cv2.COLOR_BGRA2RGB)),
        "mono8": Encoding("u1", 1, _converted(cv2.COLOR_GRAY2RGB)),
    },
}
"""The raw encodings that each kind of stream may have."""


def decode_rows(
    data: memoryview, *, encoding: Encoding, width_px: int, height_px: int, step_bytes: int, big_endian: bool
) -> NDArray[Any]:
    """Return the canonical pixels of rows that lie ``step_bytes`` apart.

    Parameters
    ----------
    data : memoryview, ``height_px * step_bytes`` bytes
        Rows of pixels, top first, each with its padding.

    Returns
    -------
    (H, W) uint16 or (H, W, 3) uint8
        Read-only; a view of ``data`` for ``16UC1``, ``mono16`` and ``rgb8`` in the machine's byte order.
    """
    dtype = np.dtype(encoding.dtype).newbyteorder(">" if big_endian else "<")
    shape = (height_px, width_px, encoding.channels)
    strides = (step_bytes, dtype.itemsize * encoding.channels, dtype.itemsize)
    axes = 2 if encoding.channels == 1 else 3
    stored: NDArray[Any] = np.ndarray(shape[:axes], dtype, buffer=data, strides=strides[:axes])
    return _read_only(encoding.canonical(stored))


def decode_compressed_color(data: memoryview, *, encoding: str) -> NDArray[np.uint8]:
    """Return the canonical pixels of a JPEG or PNG file.

    The publisher states in ``encoding`` ("rgb8; jpeg compressed bgr8") which channel order it handed to the compressor,
    which takes BGR (image_transport_plugins, ``compressed_image_transport``).

    Raises
    ------
    MessageError
        If the file is damaged.
    """
    # An orientation tag must not turn the image away from the camera's calibration.
    image = _decode_file(data, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    return _read_only(image if "compressed rgb" in encoding else cv2.cvtColor(image, cv2.COLOR_BGR2RGB))


def decode_compressed_depth(data: memoryview, *, encoding: str) -> NDArray[np.uint16]:
    """Return the canonical pixels of a PNG file behind the header of ``compressed_depth_image_transport``, or none.

    The header is ``{int32 format; float32 a; float32 b}``. For ``16UC1`` the PNG holds millimetres and the header means
    nothing; for ``32FC1`` it holds inverse depth, :math:`z = a / (p - b)` metres for a pixel value p > 0
    (image_transport_plugins, ``codec.cpp``).

    Raises
    ------
    MessageError
        If the file is damaged, is not of 16 bit and one channel, or lacks the header that ``32FC1`` needs.
    """
    start = png_start(data)
    image = _decode_file(data[start:], cv2.IMREAD_UNCHANGED)
    if image.dtype != np.uint16 or image.ndim != 2:
        raise MessageError("pixels", expected="uint16 in one channel", found=f"{image.dtype}, shape {image.shape}")
    if source_encoding(encoding) != "32FC1":
        return _read_only(image)
    if start < 12:
        raise MessageError("header of inverse depth", expected="12 bytes before the PNG", found=f"{start} bytes")
    a, b = struct.unpack_from("<ff", data, start - 8)
    with np.errstate(divide="ignore"):
        depth_m = np.float32(a) / (image.astype(np.float32) - np.float32(b))
    depth_m[image == 0] = np.nan
    return _read_only(depth_in_millimetres(depth_m))


def _decode_file(data: memoryview, flags: int) -> NDArray[Any]:
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise MessageError("compressed data cannot be decoded", found=error) from error
    if image is None:
        raise MessageError("compressed data cannot be decoded", expected="a whole image file")
    return image


def _read_only(pixels: NDArray[Any]) -> NDArray[Any]:
    pixels.flags.writeable = False
    return pixels


def png_start(data: memoryview) -> int:
    """Return where the PNG file begins in ``compressedDepth`` data; -1 when there is none."""
    return bytes(data[:_PNG_SEARCH_BYTES]).find(PNG)


def source_encoding(encoding: str) -> str:
    """Return what was compressed: ``16UC1`` of ``16UC1; compressedDepth png``."""
    return encoding.partition(";")[0].strip()
