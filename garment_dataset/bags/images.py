"""Pixel data as arrays: pure functions from buffers to canonical pixels.

Canonical are depth as (H, W) uint16 millimetres with 0 for no return, and colour as (H, W, 3) uint8 RGB. The encodings
are those of ``sensor_msgs/image_encodings.h``.
"""

from __future__ import annotations

import struct
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import cv2
import numpy as np

from garment_dataset.bags.image_files import MOST_PIXELS, PNG, check_file
from garment_dataset.bags.rvl import decode_rvl
from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

Kind = Literal["depth", "color"]

_PNG_SEARCH_BYTES = 64  # a ConfigHeader of 12 bytes, or none, or a longer one of another transport


_NO_RETURN = np.iinfo(np.uint16).max  # some drivers write it instead of 0; as a distance it is beyond every sensor
_RVL_HEADER = struct.Struct("<iffII")  # ConfigHeader, columns, rows


class DepthReading(NamedTuple):
    """What the depths of a recording are, where its messages do not say so.

    Parameters
    ----------
    unit_mm : float
        How many millimetres a stored integer is; stored metres (``32FC1``) are multiplied by it.
    swapped : bool
        Whether the rows are in the byte order opposite to the one that ``is_bigendian`` says.
    """

    unit_mm: float = 1.0
    swapped: bool = False


AS_SAID = DepthReading()
"""Millimetres or metres (REP 118), in the byte order that the message says."""


class Encoding(NamedTuple):
    """How one ROS encoding lies in memory, and how it becomes canonical.

    Parameters
    ----------
    dtype, channels
        Of one pixel.
    to_rgb : callable or None
        Makes colour canonical; None for depth.
    columns : int
        The width is a multiple of it: pixels that share their colour.
    least_px : int
        Smallest width and height from which colour can be told.
    """

    dtype: str
    channels: int
    to_rgb: Callable[[NDArray[Any]], NDArray[Any]] | None = None
    columns: int = 1
    least_px: int = 1


def depth_in_millimetres(stored: NDArray[Any], unit_mm: float = 1.0) -> NDArray[np.uint16]:
    """Return depth as whole millimetres.

    Parameters
    ----------
    stored : (H, W) uint16 or float
        Integers in units of ``unit_mm``, where 0 and 65535 are no return; or metres, NaN, infinite, zero or negative
        where the sensor saw nothing (REP 118).
    unit_mm : float
        As in :class:`DepthReading`.

    Returns
    -------
    (H, W) uint16
        Millimetres, halves to even; 0 for no return and for 65.535 m and more. ``stored`` itself where nothing changes.
    """
    whole = stored.dtype.kind in "iu"
    if whole and unit_mm == 1:
        native = stored.astype(stored.dtype.newbyteorder("="), copy=False)  # the same memory in the machine's order
        if native.max(initial=0) < _NO_RETURN:
            return native
        return np.where(native == _NO_RETURN, np.uint16(0), native)
    with np.errstate(invalid="ignore", over="ignore"):
        depth_mm = np.rint(stored.astype(np.float64) * (unit_mm if whole else 1e3 * unit_mm))
        depth_mm[~((depth_mm > 0) & (depth_mm < _NO_RETURN))] = 0
    if whole:
        depth_mm[stored == _NO_RETURN] = 0
    return depth_mm.astype(np.uint16)


def _same(stored: NDArray[Any]) -> NDArray[Any]:
    return stored


def _converted(code: int) -> Callable[[NDArray[Any]], NDArray[Any]]:
    return partial(cv2.cvtColor, code=code)


def _yuv(code: int) -> Encoding:
    """Two bytes a pixel, two pixels a colour; by ITU-R BT.601, Y from 16 to 235, as cv_bridge converts them."""
    return Encoding("u1", 2, _converted(code), columns=2)


def _bayer(code: int) -> Encoding:
    """One colour a pixel; the others are interpolated from the neighbours."""
    return Encoding("u1", 1, _converted(code), least_px=3)


_BGR = Encoding("u1", 3, _converted(cv2.COLOR_BGR2RGB))
_GREY = Encoding("u1", 1, _converted(cv2.COLOR_GRAY2RGB))

ENCODINGS: dict[Kind, dict[str, Encoding]] = {
    "depth": {"16UC1": Encoding("u2", 1), "mono16": Encoding("u2", 1), "32FC1": Encoding("f4", 1)},
    "color": {
        "rgb8": Encoding("u1", 3, _same),
        "bgr8": _BGR,
        "rgba8": Encoding("u1", 4, _converted(cv2.COLOR_RGBA2RGB)),
        "bgra8": Encoding("u1", 4, _converted(cv2.COLOR_BGRA2RGB)),
        "mono8": _GREY,
        # Named by their type alone, they come from OpenCV, whose own order is BGR; cv_bridge takes them so, too
        "8UC3": _BGR,
        "8UC1": _GREY,
        "yuv422": _yuv(cv2.COLOR_YUV2RGB_UYVY),
        "yuv422_yuy2": _yuv(cv2.COLOR_YUV2RGB_YUY2),
        # ROS names the pattern by the first two rows of two pixels, OpenCV by the second two of the second two rows
        "bayer_rggb8": _bayer(cv2.COLOR_BayerBG2RGB),
        "bayer_bggr8": _bayer(cv2.COLOR_BayerRG2RGB),
        "bayer_gbrg8": _bayer(cv2.COLOR_BayerGR2RGB),
        "bayer_grbg8": _bayer(cv2.COLOR_BayerGB2RGB),
    },
}
"""The raw encodings that each kind of stream may have."""


def decode_rows(
    data: memoryview,
    reading: DepthReading,
    *,
    encoding: Encoding,
    width_px: int,
    height_px: int,
    step_bytes: int,
    big_endian: bool,
) -> NDArray[Any]:
    """Return the canonical pixels of rows that lie ``step_bytes`` apart.

    Parameters
    ----------
    data : memoryview, ``height_px * step_bytes`` bytes
        Rows of pixels, top first, each with its padding.
    reading : DepthReading
        What depths are; without meaning for colour.

    Returns
    -------
    (H, W) uint16 or (H, W, 3) uint8
        Read-only; a view of ``data`` for ``rgb8``, and for ``16UC1`` and ``mono16`` of millimetres in the machine's
        byte order without a 65535.
    """
    dtype = np.dtype(encoding.dtype).newbyteorder(">" if big_endian != reading.swapped else "<")
    shape = (height_px, width_px, encoding.channels)
    strides = (step_bytes, dtype.itemsize * encoding.channels, dtype.itemsize)
    axes = 2 if encoding.channels == 1 else 3
    stored: NDArray[Any] = np.ndarray(shape[:axes], dtype, buffer=data, strides=strides[:axes])
    if encoding.to_rgb is None:
        return _read_only(depth_in_millimetres(stored, reading.unit_mm))
    return _read_only(encoding.to_rgb(stored))


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


def decode_compressed_depth(data: memoryview, reading: DepthReading, *, encoding: str) -> NDArray[np.uint16]:
    """Return the canonical pixels of a PNG file behind the header of ``compressed_depth_image_transport``, or none.

    The header is ``{int32 format; float32 a; float32 b}``. For ``16UC1`` the PNG holds depths as they are and the
    header means nothing; for ``32FC1`` it holds inverse depth, :math:`z = a / (p - b)` metres for a pixel value p > 0
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
    inverse = source_encoding(encoding) == "32FC1"
    if inverse and start < 12:
        raise MessageError("header of inverse depth", expected="12 bytes before the PNG", found=f"{start} bytes")
    scale = struct.unpack_from("<ff", data, start - 8) if inverse else None
    return _decompressed(image, scale, reading)


def decode_rvl_depth(data: memoryview, reading: DepthReading, *, encoding: str) -> NDArray[np.uint16]:
    """Return the canonical pixels of RVL data behind the header of ``compressed_depth_image_transport``.

    The header is that of PNG files, then ``{uint32 columns; uint32 rows}``; what the pixels mean is the same.

    Raises
    ------
    MessageError
        If the data do not hold exactly the pixels that their header says.
    """
    if len(data) < _RVL_HEADER.size:
        raise MessageError("rvl header", expected=f"{_RVL_HEADER.size} bytes", found=f"{len(data)} bytes")
    _, a, b, width_px, height_px = _RVL_HEADER.unpack_from(data)
    if not 0 < width_px * height_px <= MOST_PIXELS:
        raise MessageError("rvl size", expected=f"1 to {MOST_PIXELS} pixels", found=f"{width_px} x {height_px}")
    image = decode_rvl(data[_RVL_HEADER.size :], width_px=width_px, height_px=height_px)
    return _decompressed(image, (a, b) if source_encoding(encoding) == "32FC1" else None, reading)


def _decompressed(
    image: NDArray[np.uint16], scale: tuple[float, float] | None, reading: DepthReading
) -> NDArray[np.uint16]:
    """Return canonical depth of decompressed pixels: depths as they are, or inverse ones of this a and b."""
    if scale is None:
        return _read_only(depth_in_millimetres(image, reading.unit_mm))
    a, b = (np.float32(each) for each in scale)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):  # damage shows as no distance
        depth_m = a / (image.astype(np.float32) - b)
    depth_m[image == 0] = np.nan
    return _read_only(depth_in_millimetres(depth_m, reading.unit_mm))


def _decode_file(data: memoryview, flags: int) -> NDArray[Any]:
    check_file(data)
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


def is_rvl(encoding: str) -> bool:
    """Return whether a format string names RVL: ``16UC1; compressedDepth rvl``."""
    return "rvl" in encoding.partition(";")[2].split()


def png_start(data: memoryview) -> int:
    """Return where the PNG file begins in ``compressedDepth`` data; -1 when there is none."""
    return bytes(data[:_PNG_SEARCH_BYTES]).find(PNG)


def source_encoding(encoding: str) -> str:
    """Return what was compressed: ``16UC1`` of ``16UC1; compressedDepth png``."""
    return encoding.partition(";")[0].strip()
