"""What a ROS 1 bag holds, found by walking its records from the first to the last, without its index.

Only headers are touched, no message: as many pages as there are messages at most.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

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
    check_op,
    read_fields,
    read_record,
    skip_record,
    walk,
)
from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Mapping

# The headers that nearly all records have, their fields in any order: to match one is far faster than to read it.
# Of fields so long, a header of that length has each once; or, in an index record, at least the op.
USUAL_MESSAGE = re.compile(
    rb"\x26\0\0\0(?:\x04\0\0\0op=\x02|\x09\0\0\0conn=(?P<conn>.{4})|\x0d\0\0\0time=(?P<time>.{8})){3}", re.DOTALL
)
USUAL_INDEX = re.compile(
    rb"\x2f\0\0\0(?:\x04\0\0\0(?P<op>op)=\x04|\x08\0\0\0ver=(?P<ver>.{4})"
    rb"|\x09\0\0\0conn=(?P<conn>.{4})|\x0a\0\0\0count=(?P<count>.{4})){4}",
    re.DOTALL,
)
USUAL_MESSAGE_BYTES, USUAL_INDEX_BYTES = 4 + 0x26, 4 + 0x2F
PAIR = struct.Struct("<II")
TOPIC = b"topic of the record"  # it stands in the header of a connection record, too

Fields = dict[bytes, bytes]


class Entry(NamedTuple):
    """One message, as its record or its index entry has it."""

    offset: int
    connection: int
    stamp_ns: int


@dataclass
class ChunkContent:
    """The records of one chunk.

    Attributes
    ----------
    messages : list of Entry
        In their order.
    ways : dict of int to int
        From each connection record that stands right before a message to that message; indexes may name either.
    connections : dict of int to list of dict
        What the connection records say, by number.
    damage : MessageError or None
        Why the records could not be followed to the end.
    """

    messages: list[Entry] = field(default_factory=list)
    ways: dict[int, int] = field(default_factory=dict)
    connections: dict[int, list[Fields]] = field(default_factory=dict)
    damage: MessageError | None = None


@dataclass
class BagLayout:
    """The records of a bag outside of its chunks.

    Attributes
    ----------
    chunks : dict of int to int
        The chunks found one behind the other, by their place: the number of index records behind each.
    table : list of (int, dict)
        The chunk table: place of a chunk, and its count of messages by connection.
    connections : dict of int to list of dict
        What the index section says of each connection; two of one number are one too many.
    said : dict of str to int
        How many chunks and connections the bag header announces.
    damage : list of str
        Why records could not be followed.
    """

    chunks: dict[int, int] = field(default_factory=dict)
    table: list[tuple[int, dict[int, int]]] = field(default_factory=list)
    connections: dict[int, list[Fields]] = field(default_factory=dict)
    said: dict[str, int] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)


def read_chunk(content: memoryview) -> ChunkContent:
    """Walk the records of a chunk, of its plain content."""
    found = ChunkContent()
    waiting: list[int] = []
    position = 0
    try:
        while position < len(content):
            if (entry := usual_message(content, position)) is not None:
                end = skip_record(content, position)
            else:
                record = read_record(content, position)
                check_op(record, (MESSAGE, CONNECTION))
                end = record.data.stop
                if record.fields[b"op"] == CONNECTION:
                    add_connection(found.connections, content, record)
                    waiting.append(position)
                else:
                    entry = Entry(position, record.uint32(b"conn"), record.stamp_ns())
            if entry is not None:
                found.messages.append(entry)
                found.ways |= dict.fromkeys(waiting, position)
                waiting.clear()
            position = end
    except MessageError as error:
        found.damage = error
    return found


def usual_message(content: memoryview, position: int) -> Entry | None:
    """Return the message at ``position`` if its header is of the usual length."""
    match = USUAL_MESSAGE.match(content, position)
    if match is None or match.end() - position != USUAL_MESSAGE_BYTES:
        return None
    seconds, nanoseconds = TIME.unpack(match["time"])
    return Entry(position, UINT32.unpack(match["conn"])[0], seconds * 10**9 + nanoseconds)


def read_layout(content: memoryview) -> BagLayout:
    """Walk the records of a bag, its chunks unopened."""
    layout = BagLayout()
    try:
        header = next(walk(content, len(MAGIC), len(content), (BAG_HEADER,)))
        index_position = header.uint64(b"index_pos")
        layout.said = {name: header.uint32(f"{name[:-1]}_count".encode()) for name in ("chunks", "conns")}
    except MessageError as error:
        layout.damage.append(str(error))
        return layout
    for part in (_read_chunks, _read_index):
        try:
            part(layout, content, header.data.stop, index_position)
        except MessageError as error:
            layout.damage.append(str(error))
    return layout


def _read_chunks(layout: BagLayout, content: memoryview, start: int, end: int) -> None:
    content = content[:end]
    last = -1
    while start < end:
        if last >= 0 and (match := USUAL_INDEX.match(content, start)) and match.end() - start == USUAL_INDEX_BYTES:
            layout.chunks[last] += 1
            start = skip_record(content, start)
            continue
        record = read_record(content, start)
        check_op(record, (CHUNK,) if last < 0 else (CHUNK, INDEX))
        if record.fields[b"op"] == CHUNK:
            last = start
            layout.chunks[last] = 0
        else:
            layout.chunks[last] += 1
        start = record.data.stop


def _read_index(layout: BagLayout, content: memoryview, _: int, start: int) -> None:
    for record in walk(content, start, len(content), (CONNECTION, CHUNK_INFO)):
        if record.fields[b"op"] == CONNECTION:
            add_connection(layout.connections, content, record)
        else:
            pairs = content[record.data]
            if len(pairs) % PAIR.size or len(pairs) // PAIR.size != record.uint32(b"count"):
                raise MessageError(
                    "chunk table", where=f"byte {record.position}", found=f"{len(pairs)} bytes of counts"
                )
            layout.table.append((record.uint64(b"chunk_pos"), dict(PAIR.iter_unpack(pairs))))


def add_connection(connections: dict[int, list[Fields]], content: memoryview, record: RosRecord) -> None:
    """Add what a connection record says, unless it is known; MessageError if its data are no fields."""
    said = read_fields(content, record.data.start, record.data.stop) | {TOPIC: record.fields.get(b"topic", b"")}
    known = connections.setdefault(record.uint32(b"conn"), [])
    if said not in known:
        known.append(said)


def topic_of(connections: Mapping[int, list[Fields]], number: int) -> str:
    """Name the topic of a connection, or its number."""
    said = connections.get(number)
    return said[0][TOPIC].decode(errors="replace") if said else f"connection {number}"
