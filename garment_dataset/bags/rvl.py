"""RVL: lossless depth images, as ``compressedDepth rvl`` holds them.

The format is that of A. D. Wilson, *Fast Lossless Depth Image Compression* (ISS 2017), as ``RvlCodec`` of
image_transport_plugins writes it: little-endian words of 32 bit, each of 8 nibbles, the highest first. A number is a
run of nibbles, its lowest 3 bits first; the fourth bit of a nibble says that more follow. The numbers are, until all
pixels are there: how many pixels are 0, how many are not, and for each of these its difference to the last one that was
not, folded as 0, -1, 1, -2, 2 … to 0, 1, 2, 3, 4 …
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    IntArray = NDArray[np.int64]

_NIBBLES = 8
_HIGHEST_FIRST = np.arange(28, -1, -4, dtype=np.uint32)
_MOST_NIBBLES = 11  # those of 32 bit; longer numbers are damage


def decode_rvl(data: memoryview, *, width_px: int, height_px: int) -> NDArray[np.uint16]:
    """Return the pixels of an RVL stream.

    Parameters
    ----------
    data : memoryview
        Words of 4 bytes.
    width_px, height_px : int
        Size of the image, which the stream itself does not say.

    Returns
    -------
    (H, W) uint16

    Raises
    ------
    MessageError
        If the stream does not hold exactly these pixels.
    """
    numbers, rest = _numbers(data)
    count = width_px * height_px
    firsts, places, lengths, used = _runs(numbers, count)
    if numbers[used:].any() or rest.any():
        raise MessageError("rvl data", expected=f"no more than {count} pixels", found="further data behind them")
    within = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    folded = numbers[np.repeat(firsts, lengths) + within]
    values = np.cumsum((folded >> 1) ^ -(folded & 1))
    if values.size and (values.min() < 1 or values.max() > np.iinfo(np.uint16).max):
        raise MessageError("rvl data", expected="depths of 1 to 65535", found=f"{values.min()} to {values.max()}")
    pixels = np.zeros(count, np.uint16)
    pixels[np.repeat(places, lengths) + within] = values
    return pixels.reshape(height_px, width_px)


def _numbers(data: memoryview) -> tuple[IntArray, NDArray[np.uint8]]:
    """Return the numbers of a stream, and the nibbles behind the last whole one."""
    if not data or len(data) % 4:
        raise MessageError("rvl data", expected="words of 4 bytes", found=f"{len(data)} bytes")
    words = np.frombuffer(data, "<u4")
    nibbles: NDArray[Any] = ((words[:, None] >> _HIGHEST_FIRST) & 0xF).astype(np.uint8).ravel()
    ends = np.flatnonzero(nibbles < _NIBBLES)
    if not ends.size:
        return np.empty(0, np.int64), nibbles
    starts = np.concatenate([[0], ends[:-1] + 1])
    lengths = ends - starts + 1
    if lengths.max() > _MOST_NIBBLES:
        raise MessageError("rvl data", expected="numbers of 32 bit", found=f"one of {3 * lengths.max()} bit")
    whole = nibbles[: ends[-1] + 1]
    shifts = 3 * (np.arange(whole.size) - np.repeat(starts, lengths))
    return np.add.reduceat((whole & 7).astype(np.int64) << shifts, starts), nibbles[whole.size :]


def _runs(numbers: IntArray, count: int) -> tuple[IntArray, IntArray, IntArray, int]:
    """Walk from run to run.

    Returns
    -------
    firsts, places, lengths : (N,) int64
        Of every run of pixels that are not 0: its first number, its first pixel, its length.
    used : int
        How many numbers the pixels take.
    """
    runs: list[tuple[int, int, int]] = []
    number, pixel = 0, 0
    while pixel < count and number + 1 < numbers.size:
        zeros, length = int(numbers[number]), int(numbers[number + 1])
        runs.append((number + 2, pixel + zeros, length))
        number, pixel = number + 2 + length, pixel + zeros + length
    if pixel != count or number > numbers.size:
        reached = min(pixel, pixel - (number - numbers.size))
        raise MessageError("rvl data", expected=f"{count} pixels", found=f"{reached} pixels")
    firsts, places, lengths = np.array(runs, np.int64).reshape(-1, 3).T
    return firsts, places, lengths, number
