"""What a ROS 1 bag holds, found by walking its bytes past any damage; its index is not needed.

The file is one stream of records. The header of a plain chunk is a record like others, and the messages in it are the
next records, so that a chunk whose length is damaged or was never written loses nothing. Where no record can be read,
the next place that looks like one in every field is searched; what lies between is a gap.

A message is as long as it says only if another record follows it. One that runs into a gap is kept, but *doubtful*:
its length, or its last bytes, may be part of the damage. So is the first behind a gap, whose header may be.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.bags.rosbag1_layout import PAIR, Entry, add_connection
from garment_dataset.bags.rosbag1_records import (
    BAG_HEADER,
    CHUNK,
    CHUNK_INFO,
    CONNECTION,
    INDEX,
    MAGIC,
    MESSAGE,
    TIME,
    UINT32,
    RosRecord,
    read_fields,
)
from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Collection

    from garment_dataset.bags.rosbag1_layout import Fields

_FIELD_BYTES: dict[bytes, dict[bytes, int]] = {
    MESSAGE: {b"conn": 4, b"time": 8},
    BAG_HEADER: {b"index_pos": 8, b"conn_count": 4, b"chunk_count": 4},
    INDEX: {b"ver": 4, b"conn": 4, b"count": 4},
    CHUNK: {b"size": 4},
    CHUNK_INFO: {b"ver": 4, b"chunk_pos": 8, b"start_time": 8, b"end_time": 8, b"count": 4},
    CONNECTION: {b"conn": 4},
}
_ENTRY_BYTES = {INDEX: 12, CHUNK_INFO: 8}
_COMPRESSIONS = (b"none", b"bz2", b"lz4")
_OP = re.compile(rb"\x04\0\0\0op=[\x02-\x07]")
_ENTRY = struct.Struct("<III")
_STREAM = re.compile(rb"BZh[1-9]1AY&SY|\x04\x22\x4d\x18", re.DOTALL)
_LONGEST_HEADER_BYTES = 4096
_ALL = frozenset(_FIELD_BYTES)
_BEHIND_CHUNKS = frozenset({INDEX, CHUNK, CHUNK_INFO})  # compressed data may show others, lz4 has literals
IN_CHUNKS = frozenset({MESSAGE, CONNECTION})
"""The kinds of records that a chunk holds."""


class Saved(NamedTuple):
    """One message that was found.

    Parameters
    ----------
    offset : int
        Where its record begins, in what was scanned.
    connection, stamp_ns : int
        As its header says.
    data : slice
        Where its bytes lie.
    behind_gap, before_gap : bool
        Whether its header, or its end, is next to damage.
    """

    offset: int
    connection: int
    stamp_ns: int
    data: slice
    behind_gap: bool
    before_gap: bool


class Gap(NamedTuple):
    """Bytes that are no records, or a record that is not whole."""

    start: int
    end: int
    what: str


@dataclass
class ScannedChunk:
    """What was found of one chunk.

    Attributes
    ----------
    position : int
        Where its header is, or the first byte of what lost its header.
    compression : str
        "none", "bz2" or "lz4".
    stored : slice
        The bytes of its content: those that its header announces, or those up to the next record if the two differ.
    size_bytes : int or None
        How long the plain content is said to be.
    messages : list of Saved
        Of a plain chunk. A compressed one is inflated and scanned by itself.
    entries : list of Entry
        What the index records behind it name.
    is_index_whole : bool
        Whether nothing between its content and the next chunk is missing, as far as can be seen.
    """

    position: int
    compression: str
    stored: slice
    size_bytes: int | None
    messages: list[Saved] = field(default_factory=list)
    entries: list[Entry] = field(default_factory=list)
    is_index_whole: bool = True


@dataclass
class Scan:
    """What was found in a bag, or in the content of a chunk.

    Attributes
    ----------
    chunks : list of ScannedChunk
        In their order; messages outside of any are in one with no length.
    connections : dict of int to list of dict
        What connection records say, each description once for each time that it is there.
    table : dict of int to dict
        The chunk table: counts of messages by connection, by the place of the chunk.
    gaps : list of Gap
        What could not be read.
    cut : int or None
        Where the last record begins that runs beyond the end.
    said_chunks : int or None
        How many chunks the bag header announces; 0 while a recorder is at work.
    """

    chunks: list[ScannedChunk] = field(default_factory=list)
    connections: dict[int, list[Fields]] = field(default_factory=dict)
    table: dict[int, dict[int, int]] = field(default_factory=dict)
    gaps: list[Gap] = field(default_factory=list)
    cut: int | None = None
    said_chunks: int | None = None


def scan_bag(content: memoryview) -> Scan:
    """Scan a whole bag file; of compressed chunks only where they are."""
    scanner = _Scanner(content, _ALL)
    start = len(MAGIC) if content[: len(MAGIC)] == MAGIC else 0
    scanner.run(start)
    found = scanner.found
    if not found.table and found.chunks and found.chunks[-1].stored.stop > len(content):
        found.cut = found.chunks[-1].position
    return found


def scan_content(content: memoryview) -> Scan:
    """Scan the plain content of a chunk, or a part of it that may begin within a record."""
    scanner = _Scanner(content, IN_CHUNKS)
    scanner.run(0)
    return scanner.found


def record_at(content: memoryview, position: int, kinds: Collection[bytes] = _ALL) -> RosRecord | None:
    """Return the record at ``position`` if its header is right in every field; its data may run beyond the end."""
    if position + 8 > len(content):
        return None
    header_end = position + 4 + UINT32.unpack_from(content, position)[0]
    if header_end - position > _LONGEST_HEADER_BYTES or header_end + 4 > len(content):
        return None
    try:
        fields = read_fields(content, position + 4, header_end)
    except MessageError:
        return None
    data = slice(header_end + 4, header_end + 4 + UINT32.unpack_from(content, header_end)[0])
    record = RosRecord(position, fields, data)
    return record if fields.get(b"op") in kinds and _is_right(record) else None


def _is_right(record: RosRecord) -> bool:
    fields, op = record.fields, record.fields[b"op"]
    if any(len(fields.get(name, b"")) != size for name, size in _FIELD_BYTES[op].items()):
        return False
    if op == CHUNK:
        return fields.get(b"compression") in _COMPRESSIONS
    if op == MESSAGE:
        return bool(TIME.unpack(fields[b"time"])[1] < 10**9)
    size: int = record.data.stop - record.data.start
    return op not in _ENTRY_BYTES or size == _ENTRY_BYTES[op] * record.uint32(b"count")


def next_record(content: memoryview, start: int, kinds: Collection[bytes] = _ALL) -> int | None:
    """Return the first place from ``start`` on where a record begins; None if there is none."""
    for match in _OP.finditer(content, start):
        if match.group()[-1:] not in kinds:
            continue
        for position in range(match.start() - 4, max(start, match.start() - _LONGEST_HEADER_BYTES) - 1, -1):
            inside = match.start() - position - 4
            size = UINT32.unpack_from(content, position)[0]
            if inside < size <= _LONGEST_HEADER_BYTES and record_at(content, position, kinds):
                return position
    return None


class _Scanner:
    """Walks records, and notes what is none."""

    def __init__(self, content: memoryview, kinds: Collection[bytes]) -> None:
        self.found = Scan()
        self._content = content
        self._kinds = kinds
        self._end = len(content)
        self._behind_gap = False
        self._ahead: tuple[int, RosRecord | None] = (-1, None)

    def run(self, position: int) -> None:
        """Walk from ``position`` to the end."""
        if position == 0 and self._kinds is _ALL:
            position = self._gap(0, "the beginning of a bag is missing", 0)
        while position < self._end:
            record = self._record_at(position)
            if record is None:
                position = self._gap(position, "no record", position + 1)
            elif record.fields[b"op"] == CHUNK:
                position = self._take_chunk(record)
            else:
                position = self._take(record)

    def _record_at(self, position: int) -> RosRecord | None:
        if self._ahead[0] != position:
            self._ahead = position, record_at(self._content, position, self._kinds)
        return self._ahead[1]

    def _take(self, record: RosRecord) -> int:
        """Take a record that is no chunk, and return where to go on."""
        end: int = record.data.stop
        ends_well = end == self._end or (end < self._end and self._record_at(end) is not None)
        if not ends_well:
            following = next_record(self._content, record.data.start, self._kinds)
            if end > self._end and following is None:
                self.found.cut = record.position
                return self._gap(record.position, "cut off", self._end)
            if end > self._end or (following is not None and following < end):
                return self._gap(record.position, "a record of another length than it says", record.data.start)
        if record.fields[b"op"] == MESSAGE:
            number, stamp_ns = record.uint32(b"conn"), record.stamp_ns()
            message = Saved(record.position, number, stamp_ns, record.data, self._behind_gap, not ends_well)
            self._chunk().messages.append(message)
        else:
            self._take_description(record)
        self._behind_gap = False
        return end

    def _take_description(self, record: RosRecord) -> None:
        """Take a record that says what there is; nothing of one whose content cannot be read."""
        op = record.fields[b"op"]
        if op == CONNECTION:
            try:
                add_connection(self.found.connections, self._content, record)
            except MessageError as error:
                self.found.gaps.append(Gap(record.position, record.data.stop, f"a connection: {error}"))
        elif op == INDEX:
            number = record.uint32(b"conn")
            for seconds, nanoseconds, offset in _ENTRY.iter_unpack(self._content[record.data]):
                self._chunk().entries.append(Entry(offset, number, seconds * 10**9 + nanoseconds))
        elif op == CHUNK_INFO:
            self.found.table[record.uint64(b"chunk_pos")] = dict(PAIR.iter_unpack(self._content[record.data]))
        else:
            self.found.said_chunks = record.uint32(b"chunk_count")

    def _take_chunk(self, record: RosRecord) -> int:
        compression, data = record.fields[b"compression"].decode(), record.data
        self._behind_gap = False
        chunk = ScannedChunk(record.position, compression, data, record.uint32(b"size"))
        self.found.chunks.append(chunk)
        if compression == "none":
            return int(data.start)
        end: int = data.stop
        if end != self._end and (end > self._end or self._record_at(end) is None):
            following = next_record(self._content, data.start, _BEHIND_CHUNKS)
            end = self._end if following is None else following
            what = "the last chunk is cut off" if following is None else "a chunk of another length than it says"
            self.found.gaps.append(Gap(record.position, end, what))
            chunk.stored = slice(data.start, end)
        return end

    def _chunk(self) -> ScannedChunk:
        """Return the chunk that the current record belongs to; what stands before any has one without a length."""
        if not self.found.chunks:
            self.found.chunks.append(ScannedChunk(0, "none", slice(0, 0), None))
        return self.found.chunks[-1]

    def _gap(self, start: int, what: str, search: int) -> int:
        """Note that nothing can be read at ``start``, and return where the next record is, at ``search`` or behind."""
        following = next_record(self._content, search, self._kinds)
        end = self._end if following is None else following
        stream = _STREAM.search(self._content, start, end) if self._kinds is _ALL else None
        if stream is not None:
            following = next_record(self._content, stream.end(), _BEHIND_CHUNKS)
            end = self._end if following is None else following
        self.found.gaps.append(Gap(start, end, what))
        self._behind_gap = True
        if self.found.chunks:
            self.found.chunks[-1].is_index_whole = False
        if stream is not None:  # a chunk whose header is lost
            compression = "bz2" if stream.group().startswith(b"BZ") else "lz4"
            self.found.chunks.append(ScannedChunk(start, compression, slice(stream.start(), end), None))
        return end
