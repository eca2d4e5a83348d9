"""Inflating with every check that a format offers, and never beyond the size that was announced.

What a flipped bit cannot hide from depends on who wrote it. bz2 has a CRC of each block and of the stream. lz4 frames
have a checksum of their header, and of the content if the writer asked for one: ROS's own recorder always does (roslz4
refuses frames without it), the Python package rosbags does not, so that damage to literals in *its* lz4 chunks shows
only where it breaks the framing. zstd frames may have one of the content; in mcap files the chunk has its own CRC.
"""

from __future__ import annotations

import bz2
import sys
from typing import TYPE_CHECKING, Protocol

from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Callable

_LZ4_MOST_RATIO = 255  # a byte of a length field stands for no more


class _Decompressor(Protocol):
    @property
    def eof(self) -> bool: ...

    @property
    def unused_data(self) -> bytes | None: ...

    def decompress(self, data: bytes, max_length: int = ...) -> bytes: ...


def inflate(compression: str, data: memoryview, size_bytes: int) -> bytes:
    """Return the content of compressed data, its checksums verified.

    Parameters
    ----------
    compression : {"none", "bz2", "lz4", "zstd"}
        The format of ``data``.
    data : memoryview
        One whole stream or frame.
    size_bytes : int
        What the content is said to take; no more is ever allocated.

    Raises
    ------
    MessageError
        If the data are damaged, cut, or do not hold exactly ``size_bytes``.
    """
    content = bytes(data[: size_bytes + 1]) if compression == "none" else _inflated(compression, data, size_bytes)
    if len(content) != size_bytes:
        found = f"{len(content)} bytes" if len(content) < size_bytes else "more"
        raise MessageError("inflates to another size", expected=f"{size_bytes} bytes", found=found)
    return content


def _inflated(compression: str, data: memoryview, size_bytes: int) -> bytes:
    if compression not in _DECOMPRESSORS:
        raise MessageError("unknown compression", expected=" or ".join(_DECOMPRESSORS), found=compression)
    if compression == "lz4" and size_bytes > _LZ4_MOST_RATIO * len(data):
        found = f"{size_bytes} bytes said to be in {len(data)}"
        raise MessageError("inflates to another size", expected=f"no more than {_LZ4_MOST_RATIO} times", found=found)
    decompressor = _DECOMPRESSORS[compression]()
    try:
        # One byte more than there should be: only then does the end of the stream, and its checksum, come into reach
        content = decompressor.decompress(bytes(data), max_length=size_bytes + 1)
    except Exception as error:  # each library has its own, down to a plain RuntimeError
        if isinstance(error, MemoryError):
            raise
        raise MessageError("cannot be inflated", found=str(error) or type(error).__name__) from error
    if len(content) <= size_bytes and not decompressor.eof:
        raise MessageError("cannot be inflated", found=f"no end of the stream in {len(data)} bytes")
    if decompressor.unused_data:
        raise MessageError("cannot be inflated", found=f"{len(decompressor.unused_data)} bytes behind its end")
    return content


def _lz4() -> _Decompressor:
    from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

    decompressor: _Decompressor = LZ4FrameDecompressor()
    return decompressor


def _zstd() -> _Decompressor:
    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd
    return zstd.ZstdDecompressor()


_DECOMPRESSORS: dict[str, Callable[[], _Decompressor]] = {"bz2": bz2.BZ2Decompressor, "lz4": _lz4, "zstd": _zstd}
