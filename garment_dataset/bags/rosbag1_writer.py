"""Writing a ROS 1 bag (format 2.0) whose messages, and whose connections' descriptions, exist already as bytes."""

from __future__ import annotations

import bz2
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, BinaryIO

from garment_dataset.bags.rosbag1_layout import PAIR, TOPIC, Entry
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
    UINT64,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from garment_dataset.bags.rosbag1_layout import Fields

_HEADER_BYTES = 4096
_VERSION = UINT32.pack(1)


@dataclass
class _Chunk:
    """The chunk that is being filled."""

    content: bytearray = field(default_factory=bytearray)
    entries: list[Entry] = field(default_factory=list)


class BagWriter:
    """Writes messages to a file, chunk by chunk, with connections, index and chunk table.

    Parameters
    ----------
    file : BinaryIO
        New, and seekable.
    connections : mapping of int to dict
        What is said of each connection.
    compression : {"none", "bz2", "lz4"}
        Of every chunk; lz4 with the checksum that ROS expects.
    chunk_bytes : int
        A chunk is finished when its plain content is as long; rosbag's own default.
    """

    def __init__(
        self, file: BinaryIO, connections: Mapping[int, Fields], compression: str, chunk_bytes: int = 768 * 1024
    ) -> None:
        self._file = file
        self._connections = connections
        self._compression = compression
        self._chunk_bytes = chunk_bytes
        self._chunk = _Chunk()
        self._infos: list[tuple[int, list[Entry]]] = []
        self._written: set[int] = set()
        file.write(MAGIC + self._header(0))

    def write(self, connection: int, stamp_ns: int, data: bytes | memoryview) -> None:
        """Add a message."""
        content = self._chunk.content
        if connection not in self._written:
            self._written.add(connection)
            content += connection_record(connection, self._connections[connection])
        self._chunk.entries.append(Entry(len(content), connection, stamp_ns))
        head = {b"op": MESSAGE, b"conn": UINT32.pack(connection), b"time": _time(stamp_ns)}
        content += _record(head, data)
        if len(content) >= self._chunk_bytes:
            self._finish_chunk()

    def finish(self) -> None:
        """Write what is left, and the index; the file stays open."""
        if self._chunk.entries:
            self._finish_chunk()
        index_position = self._file.tell()
        for number in sorted(self._written):
            self._file.write(connection_record(number, self._connections[number]))
        for position, entries in self._infos:
            counts = sorted(Counter(entry.connection for entry in entries).items())
            stamps = [entry.stamp_ns for entry in entries]
            head = {b"op": CHUNK_INFO, b"ver": _VERSION, b"chunk_pos": UINT64.pack(position)}
            head |= {b"start_time": _time(min(stamps)), b"end_time": _time(max(stamps))}
            head |= {b"count": UINT32.pack(len(counts))}
            self._file.write(_record(head, b"".join(PAIR.pack(*pair) for pair in counts)))
        self._file.seek(len(MAGIC))
        self._file.write(self._header(index_position))

    def _header(self, index_position: int) -> bytes:
        head = {b"op": BAG_HEADER, b"index_pos": UINT64.pack(index_position)}
        head |= {b"conn_count": UINT32.pack(len(self._written)), b"chunk_count": UINT32.pack(len(self._infos))}
        return _record(head, b" " * (_HEADER_BYTES - len(_record(head, b""))))

    def _finish_chunk(self) -> None:
        content, entries = bytes(self._chunk.content), self._chunk.entries
        self._infos.append((self._file.tell(), entries))
        head = {b"op": CHUNK, b"compression": self._compression.encode(), b"size": UINT32.pack(len(content))}
        self._file.write(_record(head, _compressed(self._compression, content)))
        for number in sorted({entry.connection for entry in entries}):
            here = [entry for entry in entries if entry.connection == number]
            head = {b"op": INDEX, b"ver": _VERSION, b"conn": UINT32.pack(number), b"count": UINT32.pack(len(here))}
            body = b"".join(_time(entry.stamp_ns) + UINT32.pack(entry.offset) for entry in here)
            self._file.write(_record(head, body))
        self._chunk = _Chunk()


def _compressed(compression: str, content: bytes) -> bytes:
    if compression == "bz2":
        return bz2.compress(content)
    if compression == "lz4":
        import lz4.frame  # type: ignore[import-untyped]

        return bytes(lz4.frame.compress(content, content_checksum=True, store_size=False))
    return content


def connection_record(number: int, said: Fields) -> bytes:
    """Return the record that describes a connection."""
    fields = {name: value for name, value in said.items() if name != TOPIC}
    return _record({b"op": CONNECTION, b"conn": UINT32.pack(number), b"topic": said[TOPIC]}, _fields(fields))


def _record(head: Mapping[bytes, bytes], data: bytes | memoryview) -> bytes:
    header, content = _fields(head), memoryview(data)
    return b"".join((UINT32.pack(len(header)), header, UINT32.pack(content.nbytes), content))


def _fields(fields: Mapping[bytes, bytes]) -> bytes:
    return b"".join(UINT32.pack(len(name) + 1 + len(value)) + name + b"=" + value for name, value in fields.items())


def _time(stamp_ns: int) -> bytes:
    return TIME.pack(*divmod(stamp_ns, 10**9))
