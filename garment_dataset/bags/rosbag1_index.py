"""The index of a ROS 1 bag, read at once where it is as recorders write it.

Whatever is not exactly so is left to rosbags, which refuses or reads it: nothing is accepted here that rosbags would
refuse, or would read otherwise.
"""

from __future__ import annotations

import io
import re
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from rosbags.rosbag1 import Reader
from rosbags.rosbag1.reader import Header, ReaderError, RecordType

from garment_dataset.bags.definitions import UNREADABLE
from garment_dataset.bags.rosbag1_layout import PAIR, USUAL_INDEX, USUAL_INDEX_BYTES, BagLayout, add_connection
from garment_dataset.bags.rosbag1_records import CONNECTION, MAGIC, UINT32, UINT64, RosRecord, read_record, walk
from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence
    from pathlib import Path

    from numpy.typing import NDArray
    from rosbags.interfaces import Connection

    from garment_dataset.bags.reindexed import Reindexed

_USUAL_CHUNK = re.compile(
    rb"[\x28\x29]\0\0\0(?:\x04\0\0\0op=\x05|\x09\0\0\0size=(?P<size>.{4})"
    rb"|\x10\0\0\0compression=(?P<plain>none)|\x0f\0\0\0compression=(?P<packed>lz4|bz2)){3}",
    re.DOTALL,
)
_USUAL_INFO = re.compile(
    rb"\x64\0\0\0(?:\x04\0\0\0(?P<op>op)=\x06|\x08\0\0\0(?P<ver>ver)=\x01\0\0\0|\x0a\0\0\0count=(?P<count>.{4})"
    rb"|\x12\0\0\0chunk_pos=(?P<place>.{8})|\x13\0\0\0start_time=(?P<start>.{8})|\x11\0\0\0end_time=(?P<end>.{8})){6}",
    re.DOTALL,
)
_INDEX_HEAD_BYTES = USUAL_INDEX_BYTES + UINT32.size
_ENTRY_BYTES = 12
_MOST_DESCRIBED_BYTES = 2**24  # of all connections; it is copied


class StoredChunk(NamedTuple):
    """A chunk as the file holds it.

    Parameters
    ----------
    position : int
        Where its record begins.
    start, stop : int
        Where its content lies, compressed or not.
    compression : str
        ``none``, ``lz4`` or ``bz2``.
    inflated_bytes : int
        What the content is said to take.
    """

    position: int
    start: int
    stop: int
    compression: str
    inflated_bytes: int


@dataclass(frozen=True, eq=False, slots=True)
class Index:
    """What the index of a bag says.

    Parameters
    ----------
    connections : sequence of Connection
        Each number once, its messages counted.
    numbers, stamps_ns, chunks, offsets : (N,) int64
        The messages: their connection, record stamp, place of their chunk, place in its content. In the order of the
        connections, and by time within one.
    stored : dict of int to StoredChunk
        The chunks, by place.
    layout : BagLayout or None
        The records outside of the chunks, where they are known to be as they should; None where nobody looked.
    """

    connections: Sequence[Connection]
    numbers: NDArray[np.int64]
    stamps_ns: NDArray[np.int64]
    chunks: NDArray[np.int64]
    offsets: NDArray[np.int64]
    stored: dict[int, StoredChunk]
    layout: BagLayout | None

    def messages_of(self, numbers: Collection[int]) -> list[tuple[int, int, int, int]]:
        """Return stamp, chunk, offset and connection of each message of these connections, in that order."""
        wanted = np.isin(self.numbers, list(numbers))
        keys = [each[wanted] for each in (self.stamps_ns, self.chunks, self.offsets, self.numbers)]
        order = np.lexsort(keys[::-1])
        return list(zip(*[each[order].tolist() for each in keys], strict=True))


def from_entries(content: memoryview, index: Reindexed) -> Index:
    """Return an index that was read message by message."""
    rows = [(number, each.time, each.chunk_pos, each.offset) for number, said in index.entries.items() for each in said]
    stored = {}
    for position, chunk in index.chunks.items():
        record = read_record(content, position)
        compression, size_bytes = record.fields[b"compression"].decode(), record.uint32(b"size")
        stop = chunk.datapos + chunk.datasize
        stored[position] = StoredChunk(position, chunk.datapos, stop, compression, size_bytes)
    numbers, stamps_ns, chunks, offsets = np.array(rows, np.int64).reshape(-1, 4).T
    return Index(index.connections, numbers, stamps_ns, chunks, offsets, stored, None)


def read_usual_index(path: Path, content: memoryview) -> Index | None:
    """Return the index of a bag that is laid out as recorders do; None for whatever has to be looked at more closely.

    Parameters
    ----------
    path : pathlib.Path
        The bag.
    content : memoryview
        What it holds.
    """
    try:
        header = _read_header(content)
        connections, layout, table_start = _read_connections(path, content, header)
    except (*UNREADABLE, ReaderError, MessageError):
        return None
    ids = [each.id for each in connections]
    if len(set(ids)) < len(ids) or not _read_table(layout, content, table_start):
        return None
    records = _read_records(layout, content)
    messages = None if records is None else _messages(records, ids)
    if records is None or messages is None:
        return None
    numbers, stamps_ns, chunks, offsets = messages
    counts = Counter(numbers.tolist())
    counted = [each._replace(msgcount=counts[each.id]) for each in connections]
    starts, ends = sorted(records.stored), [end for _, end in sorted(records.ends.items())]
    follow = [header.data.stop, *ends] == [*starts, header.uint64(b"index_pos")]
    known = layout if follow else None
    return Index(counted, numbers, stamps_ns, chunks, offsets, records.stored, known)


def _read_header(content: memoryview) -> RosRecord:
    """Return the record of the bag's header; MessageError or ReaderError if there is none that is as usual."""
    record = read_record(content, len(MAGIC))
    Header.read(io.BytesIO(content[len(MAGIC) : record.data.start]), RecordType.BAGHEADER)
    if record.fields.get(b"encryptor") or not record.uint64(b"index_pos") or not record.uint32(b"chunk_count"):
        raise MessageError("bag header")
    return record


def _read_connections(path: Path, content: memoryview, header: RosRecord) -> tuple[list[Connection], BagLayout, int]:
    """Return the connections that the index section begins with, what is said of them, and where they end."""
    start, count = header.uint64(b"index_pos"), header.uint32(b"conn_count")
    reader = Reader(path)
    reader.bio = io.BytesIO(content[start : start + _MOST_DESCRIBED_BYTES])
    connections = [reader.read_connection() for _ in range(count)]
    end = start + reader.bio.tell()
    layout = BagLayout(said={"chunks": header.uint32(b"chunk_count"), "conns": count})
    for record in walk(content, start, end, (CONNECTION,)):
        add_connection(layout.connections, content, record)
    if not connections:
        raise MessageError("no connections")
    return connections, layout, end


def _read_table(layout: BagLayout, content: memoryview, position: int) -> bool:
    """Add the chunk table to a layout; return whether it is as usual, names each chunk once, and ends the file."""
    for _ in range(layout.said["chunks"]):
        match = _USUAL_INFO.match(content, position)
        if match is None or None in match.groups() or len(content) < match.end() + UINT32.size:
            return False
        count, start = UINT32.unpack(match["count"])[0], match.end() + UINT32.size
        position = start + count * PAIR.size
        if position > len(content) or UINT32.unpack_from(content, match.end())[0] != position - start:
            return False
        counts = dict(PAIR.iter_unpack(content[start:position]))
        if len(counts) != count:
            return False
        layout.table.append((UINT64.unpack(match["place"])[0], counts))
    return position == len(content) and len(dict(layout.table)) == len(layout.table)


class _Records(NamedTuple):
    """The chunks, and the index records behind each."""

    stored: dict[int, StoredChunk]
    ends: dict[int, int]
    """Where the index records of each chunk end."""
    chunks: list[int]
    """To which chunk each index record belongs."""
    heads: bytes
    """Their headers and lengths."""
    entries: bytes


def _read_records(layout: BagLayout, content: memoryview) -> _Records | None:
    """Return what the chunk table leads to, and count it in a layout; None where something is not as usual."""
    stored: dict[int, StoredChunk] = {}
    ends: dict[int, int] = {}
    chunks: list[int] = []
    heads: list[memoryview] = []
    entries: list[memoryview] = []
    last_start = len(content) - _INDEX_HEAD_BYTES
    for chunk, counts in layout.table:
        if (found := _usual_chunk(content, chunk)) is None:
            return None
        stored[chunk], position = found, found.stop
        for _ in counts:
            if position > last_start:
                return None
            start = position + _INDEX_HEAD_BYTES
            heads.append(content[position:start])
            position = start + UINT32.unpack_from(content, start - UINT32.size)[0]
            entries.append(content[start:position])
            chunks.append(chunk)
        ends[chunk], layout.chunks[chunk] = position, len(counts)
    return _Records(stored, ends, chunks, b"".join(heads), b"".join(entries))


def _usual_chunk(content: memoryview, position: int) -> StoredChunk | None:
    match = _USUAL_CHUNK.match(content, position)
    if match is None or match.end() - position - UINT32.size != content[position] or not match["size"]:
        return None
    start = match.end() + UINT32.size
    if start > len(content) or (stop := start + UINT32.unpack_from(content, match.end())[0]) > len(content):
        return None
    compression = (match["plain"] or match["packed"]).decode()
    return StoredChunk(position, start, stop, compression, UINT32.unpack(match["size"])[0])


def _messages(records: _Records, ids: Sequence[int]) -> NDArray[np.int64] | None:
    """Return connection, stamp, chunk and offset of each message, shape (4, N); None if any header is unusual."""
    heads = np.frombuffer(records.heads, np.uint8).reshape(-1, _INDEX_HEAD_BYTES)
    match = USUAL_INDEX.match(records.heads)
    if match is None or match.end() != USUAL_INDEX_BYTES or match["ver"] != UINT32.pack(1) or not match["op"]:
        return None
    places = {name: match.start(name) for name in ("conn", "count")}
    if -1 in places.values():
        return None
    numbers, counts = (_numbers(heads, place) for place in places.values())
    fixed = np.ones(USUAL_INDEX_BYTES, bool)
    for place in places.values():
        fixed[place : place + UINT32.size] = False
    same = (heads[:, :USUAL_INDEX_BYTES] == heads[0, :USUAL_INDEX_BYTES])[:, fixed].all()
    rank_of = {number: rank for rank, number in enumerate(ids)}
    if not same or (_numbers(heads, USUAL_INDEX_BYTES) != counts * _ENTRY_BYTES).any():
        return None
    if not rank_of.keys() >= set(numbers.tolist()) or counts.sum() * _ENTRY_BYTES != len(records.entries):
        return None
    seconds, nanoseconds, offsets = np.frombuffer(records.entries, "<u4").astype(np.int64).reshape(-1, 3).T
    stamps_ns = seconds * 10**9 + nanoseconds
    ranks = np.repeat([rank_of[number] for number in numbers.tolist()], counts)
    order = np.lexsort((stamps_ns, ranks))
    found = np.stack([np.repeat(numbers, counts), stamps_ns, np.repeat(records.chunks, counts), offsets])
    return found[:, order]


def _numbers(rows: NDArray[np.uint8], place: int) -> NDArray[np.int64]:
    """Return the uint32 that stands at a place in every row."""
    return np.ascontiguousarray(rows[:, place : place + UINT32.size]).view("<u4")[:, 0].astype(np.int64)
