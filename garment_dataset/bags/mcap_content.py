"""What an mcap file holds, found by walking its records from the first to the last, its chunks inflated.

Nothing here believes a length before it has seen that so many bytes are there; all checksums are verified that the
writer made: of chunks, of the data section where no chunk's covers it, and of the summary.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.bags.inflation import inflate
from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Iterator

MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _INDEX, _CHUNK_INDEX = range(2, 9)
_STATISTICS, _DATA_END = 0x0B, 0x0F
_MOST_CHUNK_BYTES = 2**30

_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQI")
_CHUNK_INDEX_HEAD = struct.Struct("<QQQQ")
_STATISTICS_HEAD = struct.Struct("<QHIIIIQQ")
_FOOTER_FIELDS = struct.Struct("<QQI")
_UINT16 = struct.Struct("<H")
_UINT32 = struct.Struct("<I")
_UINT64 = struct.Struct("<Q")
_TIME_AND_OFFSET = struct.Struct("<QQ")
_CHANNEL_AND_COUNT = _CHANNEL_AND_PLACE = struct.Struct("<HQ")


class Chunk(NamedTuple):
    """A chunk, as its own record or the summary's index describes it."""

    position: int
    size_bytes: int
    start_ns: int
    end_ns: int
    compression: str
    stored_bytes: int
    plain_bytes: int


class Entry(NamedTuple):
    """One message of a chunk."""

    channel: int
    stamp_ns: int
    offset: int


@dataclass
class McapContent:
    """The records of an mcap file.

    Attributes
    ----------
    chunks, summary_chunks : dict of int to Chunk
        The chunks that are there, and those that the summary names, by their place.
    messages, indexed : dict of int to list of Entry
        The messages in each chunk, and those that the index records behind it name.
    index_places, summary_index_places : dict of int to dict of int to int
        Where these index records are, by chunk and channel, and where the summary says they are.
    loose : Counter
        Messages outside of chunks, by channel.
    described, summarised : dict of (int, int) to set of bytes
        What schema and channel records say, by kind and number, in the data and in the summary.
    statistics : dict of int to int or None
        Messages by channel, as the summary counts them.
    """

    chunks: dict[int, Chunk] = field(default_factory=dict)
    summary_chunks: dict[int, Chunk] = field(default_factory=dict)
    messages: dict[int, list[Entry]] = field(default_factory=dict)
    indexed: dict[int, list[Entry]] = field(default_factory=dict)
    index_places: dict[int, dict[int, int]] = field(default_factory=dict)
    summary_index_places: dict[int, dict[int, int]] = field(default_factory=dict)
    loose: Counter[int] = field(default_factory=Counter)
    described: dict[tuple[int, int], set[bytes]] = field(default_factory=dict)
    summarised: dict[tuple[int, int], set[bytes]] = field(default_factory=dict)
    statistics: dict[int, int] | None = None


def read_mcap(file: memoryview) -> McapContent:
    """Walk an mcap file.

    Raises
    ------
    MessageError
        At the first record that does not fit, or checksum that is wrong.
    """
    content = McapContent()
    _check_summary(file)
    covered, in_summary, chunk = True, False, -1
    for op, position, body in records(file):
        if op == _DATA_END:
            in_summary = True
            if not covered and (wanted := _UINT32.unpack_from(body)[0]):
                _check_crc(file[:position], wanted, "data section")
        elif in_summary:
            _read_summary(content, op, body)
        elif op == _CHUNK:
            chunk = position
            covered &= _read_chunk(content, position, body)
        elif op == _INDEX and chunk >= 0:
            channel, entries = _read_index(_Fields(body))
            content.indexed[chunk] += entries
            content.index_places[chunk][channel] = position
        elif op == _MESSAGE:
            covered = False
            content.loose[_MESSAGE_HEAD.unpack_from(body)[0]] += 1
        elif op in {_SCHEMA, _CHANNEL}:
            _describe(content.described, op, body)
    return content


def records(file: memoryview) -> Iterator[tuple[int, int, memoryview]]:
    """Yield op, place and body of the records of a file; MessageError at the first that does not fit."""
    return _records(file, len(MAGIC), len(file) - len(MAGIC))


def _records(data: memoryview, start: int, end: int) -> Iterator[tuple[int, int, memoryview]]:
    """Yield op, place and body of the records between two places, which they must fill."""
    while start < end:
        if start + _HEAD.size > end:
            raise MessageError("record does not fit", where=f"byte {start}", found=f"{end - start} bytes left")
        op, size = _HEAD.unpack_from(data, start)
        body = start + _HEAD.size
        if size > end - body or op == 0 or size < _LEAST_BYTES.get(op, 0):
            found = f"op {op} of {size} bytes, {end - body} left"
            raise MessageError("record does not fit", where=f"byte {start}", found=found)
        yield op, start, data[body : body + size]
        start = body + size


_LEAST_BYTES = {
    _FOOTER: _FOOTER_FIELDS.size,
    _SCHEMA: _UINT16.size,
    _CHANNEL: _UINT16.size,
    _MESSAGE: _MESSAGE_HEAD.size,
    _CHUNK: _CHUNK_HEAD.size,
    _CHUNK_INDEX: _CHUNK_INDEX_HEAD.size,
    _STATISTICS: _STATISTICS_HEAD.size,
    _DATA_END: _UINT32.size,
}


class _Fields:
    """The fields of a record, read one after the other and never beyond its end."""

    def __init__(self, data: memoryview, start: int = 0) -> None:
        self._data = data
        self._position = start

    def unpack(self, form: struct.Struct) -> tuple[int, ...]:
        return form.unpack(self.take(form.size))

    def sized(self, form: struct.Struct = _UINT32) -> memoryview:
        return self.take(self.unpack(form)[0])

    def take(self, size: int) -> memoryview:
        start, self._position = self._position, self._position + size
        if self._position > len(self._data):
            raise MessageError("field does not fit", expected=f"{size} bytes", found=f"{len(self._data) - start} left")
        return self._data[start : self._position]

    def text(self) -> str:
        return bytes(self.sized()).decode(errors="replace")

    def pairs(self, form: struct.Struct) -> list[tuple[int, int]]:
        data = self.sized()
        if len(data) % form.size:
            raise MessageError("field", expected=f"a multiple of {form.size} bytes", found=f"{len(data)} bytes")
        return [(first, second) for first, second in form.iter_unpack(data)]


def _read_chunk(content: McapContent, position: int, body: memoryview) -> bool:
    """Add a chunk; return whether it has a checksum of its own."""
    where = f"chunk at byte {position}"
    start_ns, end_ns, plain_bytes, crc = _CHUNK_HEAD.unpack_from(body)
    fields = _Fields(body, _CHUNK_HEAD.size)
    compression, stored = fields.text(), fields.sized(_UINT64)
    if plain_bytes > _MOST_CHUNK_BYTES:
        raise MessageError("too large to inflate", where=where, expected=f"at most {_MOST_CHUNK_BYTES} bytes")
    plain = memoryview(inflate(compression, stored, plain_bytes)) if compression else stored
    if crc:
        _check_crc(plain, crc, where)
    if len(plain) != plain_bytes:
        raise MessageError("size", where=where, expected=f"{plain_bytes} bytes", found=f"{len(plain)} bytes")
    size_bytes = _HEAD.size + len(body)
    content.chunks[position] = Chunk(position, size_bytes, start_ns, end_ns, compression, len(stored), plain_bytes)
    content.indexed[position], content.index_places[position] = [], {}
    messages = content.messages[position] = []
    for op, offset, record in _records(plain, 0, len(plain)):
        if op == _MESSAGE:
            channel, _, stamp_ns, _ = _MESSAGE_HEAD.unpack_from(record)
            messages.append(Entry(channel, stamp_ns, offset))
        elif op in {_SCHEMA, _CHANNEL}:
            _describe(content.described, op, record)
    return bool(crc)


def _read_index(fields: _Fields) -> tuple[int, list[Entry]]:
    (channel,) = fields.unpack(_UINT16)
    return channel, [Entry(channel, stamp_ns, offset) for stamp_ns, offset in fields.pairs(_TIME_AND_OFFSET)]


def _read_summary(content: McapContent, op: int, body: memoryview) -> None:
    if op in {_SCHEMA, _CHANNEL}:
        _describe(content.summarised, op, body)
    elif op == _STATISTICS:
        content.statistics = dict(_Fields(body, _STATISTICS_HEAD.size).pairs(_CHANNEL_AND_COUNT))
    elif op == _CHUNK_INDEX:
        start_ns, end_ns, position, size_bytes = _CHUNK_INDEX_HEAD.unpack_from(body)
        fields = _Fields(body, _CHUNK_INDEX_HEAD.size)
        content.summary_index_places[position] = dict(fields.pairs(_CHANNEL_AND_PLACE))
        fields.unpack(_UINT64)
        compression, (stored_bytes,), (plain_bytes,) = fields.text(), fields.unpack(_UINT64), fields.unpack(_UINT64)
        chunk = Chunk(position, size_bytes, start_ns, end_ns, compression, stored_bytes, plain_bytes)
        content.summary_chunks[position] = chunk


def _describe(known: dict[tuple[int, int], set[bytes]], op: int, body: memoryview) -> None:
    known.setdefault((op, _UINT16.unpack_from(body)[0]), set()).add(bytes(body))


def _check_summary(file: memoryview) -> None:
    """Check the summary's own checksum, which the footer holds; 0 means none."""
    end = len(file) - len(MAGIC) - _UINT32.size
    start = end - _FOOTER_FIELDS.size + _UINT32.size
    if start < len(MAGIC):
        raise MessageError("no footer", found=f"{len(file)} bytes")
    summary, _, crc = _FOOTER_FIELDS.unpack_from(file, start)
    if crc:
        _check_crc(file[summary or start - _HEAD.size : end], crc, "summary")


def _check_crc(data: memoryview, wanted: int, where: str) -> None:
    if zlib.crc32(data) != wanted:
        raise MessageError("wrong checksum", where=where)


def topic_of(described: dict[tuple[int, int], set[bytes]], channel: int) -> str:
    """Name the topic of a channel, or its number."""
    for body in described.get((_CHANNEL, channel), ()):
        return _Fields(memoryview(body), 2 * _UINT16.size).text()
    return f"channel {channel}"
