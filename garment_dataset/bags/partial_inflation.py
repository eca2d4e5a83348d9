"""Inflating what damage left of a compressed chunk.

bz2 is made of blocks with a CRC each: every block that is whole is proven, wherever it begins, at whatever bit. lz4 is
decoded block by block, and the damaged one as far as its bytes make sense. Its frames have at most one checksum, at
the end, so that nothing proves what was decoded from a damaged frame; only what stands before a cut is as good as ever.
"""

from __future__ import annotations

import bz2
import struct
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.bags.inflation import inflate
from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Iterator

_BLOCK, _END = 0x314159265359.to_bytes(6), 0x177245385090.to_bytes(6)
_MAGIC_BITS = 48
_HISTORY_BYTES = 65536
_LZ4_BLOCK_BYTES = {4: 2**16, 5: 2**18, 6: 2**20, 7: 2**22}
_RAW = 0x80000000
_LAST_LITERALS = 15
_UINT32 = struct.Struct("<I")


class Segment(NamedTuple):
    """Content without a hole in it.

    Parameters
    ----------
    data : bytes
        Plain.
    sound : bool
        Whether a checksum proves it, or nothing but a cut behind it is wrong.
    """

    data: bytes
    sound: bool


def inflate_what_is_left(compression: str, data: memoryview, size_bytes: int | None, *, is_cut: bool) -> list[Segment]:
    """Return the parts of a chunk's content that can be inflated, in their order.

    Parameters
    ----------
    compression : {"bz2", "lz4"}
        The format.
    data : memoryview
        What is stored: one stream or frame, cut or damaged, other bytes behind it or not.
    size_bytes : int or None
        How long the content is said to be.
    is_cut : bool
        Whether the file ends within ``data``.
    """
    if size_bytes is not None:
        try:
            return [Segment(inflate(compression, data, size_bytes), sound=True)]
        except MessageError:
            pass
    return list(_bz2_segments(data) if compression == "bz2" else _lz4_segments(data, size_bytes, is_cut=is_cut))


def _bz2_segments(data: memoryview) -> Iterator[Segment]:
    """Yield runs of whole blocks; each block is wrapped into a stream of its own, at whose end its CRC is verified."""
    bits = int.from_bytes(data)
    total = len(data) * 8
    starts = _places(data, bits, _BLOCK)
    ends = sorted([*starts, *_places(data, bits, _END), total])
    level = data[3:4] if bytes(data[:3]) == b"BZh" and 0x31 <= data[3] <= 0x39 else b"9"
    run: list[bytes] = []
    for start in starts:
        end = next(each for each in ends if each > start)
        block = (bits >> (total - end)) & ((1 << (end - start)) - 1)
        plain = _bz2_block(bytes(level), block, end - start)
        if plain is not None:
            run.append(plain)
        elif run:
            yield Segment(b"".join(run), sound=True)
            run = []
    if run:
        yield Segment(b"".join(run), sound=True)


def _places(data: memoryview, bits: int, magic: bytes) -> list[int]:
    """Return the bits at which ``magic`` begins, by its bytes in eight shifted copies."""
    found = []
    for shift in range(8):
        shifted = (bits << shift).to_bytes(len(data) + 1)
        at = shifted.find(magic)
        while at >= 0:
            found.append((at - 1) * 8 + shift)
            at = shifted.find(magic, at + 1)
    return sorted(place for place in found if place >= 0)


def _bz2_block(level: bytes, block: int, size_bits: int) -> bytes | None:
    if size_bits < _MAGIC_BITS + 32:
        return None
    crc = (block >> (size_bits - _MAGIC_BITS - 32)) & 0xFFFFFFFF
    value = (((block << _MAGIC_BITS) | int.from_bytes(_END)) << 32) | crc
    size = size_bits + _MAGIC_BITS + 32
    padding = -size % 8
    try:
        return bz2.decompress(b"BZh" + level + (value << padding).to_bytes((size + padding) // 8))
    except (OSError, ValueError):
        return None


def _lz4_segments(data: memoryview, size_bytes: int | None, *, is_cut: bool) -> Iterator[Segment]:
    content, ended, whole = _lz4_content(data)
    is_proven = is_cut and whole and not ended
    if content:
        most = len(content) if size_bytes is None else max(size_bytes, 0)
        yield Segment(content[:most] if ended or not is_cut else content, sound=is_proven)


def _lz4_content(data: memoryview) -> tuple[bytes, bool, bool]:
    """Return what the blocks of a frame hold, whether its end mark was reached, and whether every block was sound."""
    frame = _lz4_frame(data)
    if frame is None:
        return b"", False, False
    position, most_bytes, linked, checksum_bytes = frame
    content, whole = bytearray(), True
    while position + 4 <= len(data):
        said: int = _UINT32.unpack_from(data, position)[0]
        if said == 0:
            return bytes(content), True, whole
        block = data[position + 4 : position + 4 + (said & ~_RAW)]
        is_last = position + 4 + (said & ~_RAW) > len(data)
        history = bytes(content[-_HISTORY_BYTES:]) if linked else b""
        plain = bytes(block[:most_bytes]) if said & _RAW else _lz4_block(block, most_bytes, history)
        if plain is None:
            plain, whole = lz4_prefix(block, most_bytes, history), whole and is_last
            if not is_last:  # the next block refers to what would stand there
                plain = plain.ljust(most_bytes, b"\0")
        content += plain
        position += 4 + (said & ~_RAW) + checksum_bytes
    return bytes(content), False, whole


def _lz4_frame(data: memoryview) -> tuple[int, int, bool, int] | None:
    """Return where the blocks begin, how long one is at most, whether they refer back, and the size of checksums."""
    if len(data) < 7:
        return None
    flags, descriptor = data[4], data[5]
    most_bytes = _LZ4_BLOCK_BYTES.get(descriptor >> 4 & 7)
    if flags >> 6 != 1 or most_bytes is None:
        flags, most_bytes = 0x40, _LZ4_BLOCK_BYTES[7]
    start = 7 + (8 if flags & 8 else 0) + (4 if flags & 1 else 0)
    return start, most_bytes, not flags & 0x20, 4 if flags & 0x10 else 0


def _lz4_block(block: memoryview, most_bytes: int, history: bytes) -> bytes | None:
    import lz4.block  # type: ignore[import-untyped]

    try:
        return bytes(lz4.block.decompress(block, uncompressed_size=most_bytes, dict=history))
    except (lz4.block.LZ4BlockError, ValueError):
        return None


def lz4_prefix(block: memoryview, most_bytes: int, history: bytes) -> bytes:
    """Return what a cut or damaged lz4 block decodes to, up to where its bytes end or make no sense.

    Parameters
    ----------
    block : memoryview
        Sequences of literals and of matches, as lz4's block format has them.
    most_bytes : int
        The content of a block is no longer.
    history : bytes
        What stands before it, for matches that reach back.
    """
    out = bytearray(history)
    most = len(history) + most_bytes
    position, end = 0, len(block)
    while position < end and len(out) < most:
        token = block[position]
        count, position = _lz4_length(block, position + 1, token >> 4)
        out += block[position : min(position + count, end)]
        position += count
        if position + 2 > end:
            break
        distance = block[position] | block[position + 1] << 8
        count, position = _lz4_length(block, position + 2, token & 15)
        if not 0 < distance <= len(out) or position > end:
            break
        start, count = len(out) - distance, min(count + 4, most - len(out))
        repeated = out[start : start + count]
        out += (repeated * (count // len(repeated) + 1))[:count] if count else b""
    return bytes(out[len(history) : most])


def _lz4_length(block: memoryview, position: int, count: int) -> tuple[int, int]:
    """Return a length, and the place behind it; one that is cut off is as long as its bytes say."""
    if count == _LAST_LITERALS:
        while position < len(block):
            count += block[position]
            position += 1
            if block[position - 1] != 0xFF:
                break
    return count, position
