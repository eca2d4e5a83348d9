"""ROS 1 bags (format 2.0), read through a memory map with the bag's own index.

rosbags parses the index; the messages themselves are views of the mapped file, so that nobody copies, or even touches,
pixels that no stage asks for. Of a bag recorded with lz4 or bz2, a chunk is inflated when it is first needed, once,
into a temporary file without a name, and mapped from there: bags of either sort are never held in memory.

A mapped file must not shrink while it is read: the operating system kills a process that touches pages beyond the end.
:meth:`Bag.close` reports a bag that changed in any other way.
"""

from __future__ import annotations

import mmap
import struct
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from rosbags.rosbag1 import Reader, ReaderError

from garment_dataset.bags.bag import Bag, reason, summarise
from garment_dataset.bags.messages import Payload, Record
from garment_dataset.errors import BagError, MessageError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping
    from pathlib import Path

    from rosbags.rosbag1.reader import Chunk, IndexData

_MAGIC = b"#ROSBAG V2.0\n"
_REINDEX = "Run `rosbag reindex` on a copy of it."
_MOST_INFLATED_BYTES = 256 * 2**20  # rosbag writes chunks of 0.75 MiB unless told otherwise
_UINT32 = struct.Struct("<I")
_TIME = struct.Struct("<II")
_MESSAGE, _CONNECTION = b"\x02", b"\x07"

# rosbags asserts what a damaged file may break, and lets the errors of what it calls through.
_DAMAGE = (
    ReaderError,
    AssertionError,
    ValueError,
    LookupError,
    ArithmeticError,
    OSError,
    EOFError,
    MemoryError,
    RuntimeError,
    struct.error,
)


class Rosbag1(Bag):
    """A ROS 1 bag: uncompressed, lz4 or bz2.

    Raises
    ------
    BagError
        If the file is missing, empty, still being recorded, of another format, not indexed or damaged in its index.
    """

    _cdr = False

    def __init__(self, path: Path) -> None:
        super().__init__(path, [path])
        _check_magic(path)
        try:
            with Reader(path) as reader:
                self._connections = {each.id: each for each in reader.connections}
                self._index: Mapping[int, list[IndexData]] = dict(reader.indexes)
                self._chunks: _Chunks | None = _Chunks(path, reader.chunks)
        except (*_DAMAGE, MessageError) as error:
            raise BagError("its index cannot be read", where=path, found=reason(error), hint=_REINDEX) from error
        self.topics = summarise(self._connections.values())

    def _records(self, topics: Collection[str]) -> Iterator[Record]:
        self._check_open()
        entries = sorted(
            (entry.time, entry.chunk_pos, entry.offset, connection.id)
            for connection in self._connections.values()
            if connection.topic in topics
            for entry in self._index[connection.id]
        )
        for stamp_ns, chunk, offset, connection_id in entries:
            read = partial(self._read, connection_id, stamp_ns, chunk, offset)
            yield Record(self._connections[connection_id], stamp_ns, read)

    def _read(self, connection_id: int, stamp_ns: int, chunk_position: int, offset: int) -> Payload:
        self._check_open()
        assert self._chunks is not None
        chunk = self._chunks.open(chunk_position)
        fields, data = _read_record(chunk.data, offset)
        while fields.get(b"op") == _CONNECTION:  # stands before the first message of its publisher, and is indexed too
            fields, data = _read_record(chunk.data, data.stop)
        expected = (_MESSAGE, _UINT32.pack(connection_id), _TIME.pack(*divmod(stamp_ns, 10**9)))
        found = tuple(fields.get(name) for name in (b"op", b"conn", b"time"))
        if found != expected:
            raise MessageError("record", expected=f"op, conn, time {expected}", found=found)
        offset_bytes = None if chunk.offset_bytes is None else chunk.offset_bytes + data.start
        return Payload(chunk.data[data], offset_bytes)

    def _release(self) -> None:
        if self._chunks is not None:
            self._chunks.close()
        self._chunks = None


@dataclass(frozen=True, slots=True)
class _Stored:
    """A chunk as the file holds it."""

    payload: Payload
    compressed: bool
    inflated_bytes: int
    inflate: Callable[[bytes], bytes]

    @property
    def inflatable(self) -> bool:
        return self.compressed and self.inflated_bytes <= _MOST_INFLATED_BYTES


class _Chunks:
    """The chunks of a bag: views of the mapped file, or of a temporary one where they lie inflated."""

    def __init__(self, path: Path, chunks: Mapping[int, Chunk]) -> None:
        with path.open("rb") as file:
            content = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
        self._stored = {position: _stored(content, position, chunk) for position, chunk in chunks.items()}
        self._inflated: dict[int, Payload | str] = {}  # the content, or why it is lost
        self._scratch: _Scratch | None = None

    def open(self, position: int) -> Payload:
        """Return the plain content of the chunk at ``position``; MessageError if it is lost."""
        stored = self._stored[position]
        if not stored.compressed:
            return stored.payload
        if position not in self._inflated:
            if self._scratch is None:
                self._scratch = _Scratch(sum(each.inflated_bytes for each in self._stored.values() if each.inflatable))
            try:
                self._inflated[position] = Payload(self._scratch.add(_inflate(stored)), None)
            except MessageError as error:
                self._inflated[position] = str(error)
        content = self._inflated[position]
        if isinstance(content, str):
            raise MessageError(content)
        return content

    def close(self) -> None:
        """Let go of the temporary file; arrays that somebody holds keep what they show of either file."""
        if self._scratch is not None:
            self._scratch.close()


class _Scratch:
    """A temporary file without a name, mapped once; the system frees it with the last view, whatever happens."""

    def __init__(self, most_bytes: int) -> None:
        with self._reporting():
            self._file = tempfile.TemporaryFile()  # noqa: SIM115 - stays open with the bag
            self._file.truncate(most_bytes + 1)  # takes no room yet; nothing cannot be mapped
            self._content = memoryview(mmap.mmap(self._file.fileno(), 0, access=mmap.ACCESS_READ))

    def add(self, data: bytes) -> memoryview:
        """Return a read-only view of a copy of ``data`` that is in the file, not in memory."""
        start = self._file.tell()
        with self._reporting():  # through the mapping, a full disk would kill the process instead
            self._file.write(data)
            self._file.flush()
        return self._content[start : start + len(data)]

    def close(self) -> None:
        self._file.close()

    @contextmanager
    def _reporting(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            hint = "Point TMPDIR to a folder with room for the inflated bag."
            raise BagError("no room to inflate a chunk", where=tempfile.gettempdir(), found=error, hint=hint) from error


def _stored(content: memoryview, position: int, chunk: Chunk) -> _Stored:
    fields, _ = _read_record(content, position)
    payload = Payload(content[chunk.datapos : chunk.datapos + chunk.datasize], chunk.datapos)
    (inflated_bytes,) = _UINT32.unpack(fields[b"size"])
    return _Stored(payload, fields[b"compression"] != b"none", inflated_bytes, chunk.decompressor)


def _inflate(stored: _Stored) -> bytes:
    if not stored.inflatable:
        found = f"{stored.inflated_bytes} bytes"
        raise MessageError("chunk too large to inflate", expected=f"at most {_MOST_INFLATED_BYTES} bytes", found=found)
    try:
        data = stored.inflate(bytes(stored.payload.data))
    except _DAMAGE as error:
        raise MessageError("chunk cannot be inflated", found=reason(error)) from error
    if len(data) != stored.inflated_bytes:
        expected = f"{stored.inflated_bytes} bytes"
        raise MessageError("chunk inflates to another size", expected=expected, found=f"{len(data)} bytes")
    return data


def _read_record(content: memoryview, position: int) -> tuple[dict[bytes, bytes], slice]:
    """Return the header fields of the record at ``position``, and where its data lie."""
    fields: dict[bytes, bytes] = {}
    start = position
    try:
        (size,) = _UINT32.unpack_from(content, start)
        start += 4
        end = start + size
        while start < end:
            (size,) = _UINT32.unpack_from(content, start)
            name, _, value = bytes(content[start + 4 : start + 4 + size]).partition(b"=")
            fields[name] = value
            start += 4 + size
        (size,) = _UINT32.unpack_from(content, end)
    except struct.error as error:
        found = f"a header beyond its {len(content)} bytes"
        raise MessageError("record", where=f"byte {position} of the chunk", found=found) from error
    if start != end or end + 4 + size > len(content):
        found = f"{size} bytes of data, {len(content) - end - 4} left"
        raise MessageError("record does not fit", where=f"byte {position} of the chunk", found=found)
    return fields, slice(end + 4, end + 4 + size)


def _check_magic(path: Path) -> None:
    if path.suffix == ".active":
        raise BagError("recording was not finished", where=path, hint=_REINDEX)
    try:
        with path.open("rb") as file:
            found = file.read(len(_MAGIC))
    except OSError as error:
        raise BagError("cannot be opened", where=path, found=error.strerror) from error
    if not found:
        raise BagError("is empty", where=path, hint="Record or copy it again.")
    if found != _MAGIC:
        raise BagError("is not a ROS 1 bag", where=path, expected=_MAGIC, found=found)
