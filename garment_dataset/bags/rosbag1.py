"""ROS 1 bags (format 2.0), read through a memory map with the bag's own index.

rosbags parses the index; the messages themselves are views of the mapped file, so that nobody copies, or even touches,
pixels that no stage asks for. Of a bag recorded with lz4 or bz2, a chunk is inflated when it is first needed, once,
into a temporary file without a name, and mapped from there: bags of either sort are never held in memory.

A mapped file must not shrink while it is read: the operating system kills a process that touches pages beyond the end.
:meth:`Bag.close` reports a bag that changed in any other way.
"""

from __future__ import annotations

import mmap
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, BinaryIO, cast

from rosbags.rosbag1 import Reader

from garment_dataset.bags.bag import Bag, reporting, summarise
from garment_dataset.bags.inflation import inflate
from garment_dataset.bags.mapped import mapped
from garment_dataset.bags.messages import Payload, Record
from garment_dataset.bags.reindexed import Reindexed, index_anew
from garment_dataset.bags.rosbag1_check import contradictions
from garment_dataset.bags.rosbag1_records import CONNECTION, MAGIC, MESSAGE, read_record
from garment_dataset.errors import BagError, MessageError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping
    from pathlib import Path

    from rosbags.interfaces.typing import RPath
    from rosbags.rosbag1.reader import Chunk

_SALVAGE = "`garment salvage` writes what can be saved to a new bag."
_ANEW = "its index is missing or damaged; its messages are whole, and were read from the first to the last"
_MOST_INFLATED_BYTES = 256 * 2**20  # rosbag writes chunks of 0.75 MiB unless told otherwise


class Rosbag1(Bag):
    """A ROS 1 bag: uncompressed, lz4 or bz2.

    Raises
    ------
    BagError
        If the file is missing, empty, still being recorded, of another format, or damaged in its index and elsewhere.

    Attributes
    ----------
    is_indexed_anew : bool
        Whether the index was made from the records, because the file lacks it while all messages are whole.
    """

    _cdr = False

    def __init__(self, path: Path) -> None:
        super().__init__(path, [path])
        _check_magic(path)
        self.is_indexed_anew = False
        with reporting(path, "cannot be opened", _SALVAGE):
            self._content = mapped(path)
        with reporting(path, "its index cannot be read", _SALVAGE):
            connections, self._index, chunks = self._read_index()
            self._connections = {each.id: each for each in connections}
            self._chunks: _Chunks | None = _Chunks(self._content, chunks)
        self.topics = summarise(self._connections.values())

    def _read_index(self) -> Reindexed:
        """Return the bag's own index; or a new one if nothing else is wrong with it."""
        try:
            with reporting(self.path, "its index cannot be read", _SALVAGE):
                reader = Reader(self.path)
                reader.path = cast("RPath", _MappedPath(self.path))
                with reader:
                    return Reindexed(list(reader.connections), dict(reader.indexes), dict(reader.chunks))
        except BagError as error:
            with reporting(self.path, error.what, _SALVAGE):
                anew = index_anew(self.path, self._content)
            if anew is None:
                raise
            self.is_indexed_anew = True
            return anew

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

    def contradictions(self) -> list[str]:
        """Compare the index with what the chunks hold; inflates those that are not inflated yet."""
        self._check_open()
        assert self._chunks is not None
        if self.is_indexed_anew:
            return [_ANEW]
        return list(contradictions(self._content, self._index, self._chunks.places, self._chunks.content))

    def _read(self, connection_id: int, time_ns: int, chunk_position: int, offset: int) -> Payload:
        self._check_open()
        assert self._chunks is not None
        chunk = self._chunks.open(chunk_position)
        try:
            record = read_record(chunk.data, offset)
            while record.fields.get(b"op") == CONNECTION:  # before the first message of its publisher; indexed too
                record = read_record(chunk.data, record.data.stop)
            found = record.fields.get(b"op"), record.uint32(b"conn"), record.stamp_ns()
        except MessageError as error:
            raise MessageError(
                f"record at byte {offset}", where=f"chunk at byte {chunk_position}", found=error
            ) from error
        if found != (expected := (MESSAGE, connection_id, time_ns)):
            where = f"chunk at byte {chunk_position}"
            raise MessageError(
                f"record at byte {offset}", where=where, expected=f"op, conn, time {expected}", found=found
            )
        offset_bytes = None if chunk.offset_bytes is None else chunk.offset_bytes + record.data.start
        return Payload(chunk.data[record.data], offset_bytes)

    def _release(self) -> None:
        if self._chunks is not None:
            self._chunks.close()
        self._chunks = None


class _MappedPath:
    """What rosbags opens: a mapped file, which reads no more than is there, whatever length a record claims."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def open(self, _: str) -> BinaryIO:
        with self._path.open("rb") as file:
            return cast("BinaryIO", mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))


@dataclass(frozen=True, slots=True)
class _Stored:
    """A chunk as the file holds it."""

    position: int
    payload: Payload
    compression: str
    inflated_bytes: int

    @property
    def compressed(self) -> bool:
        return self.compression != "none"

    @property
    def inflatable(self) -> bool:
        return self.compressed and self.inflated_bytes <= _MOST_INFLATED_BYTES


class _Chunks:
    """The chunks of a bag: views of the mapped file, or of a temporary one where they lie inflated."""

    def __init__(self, content: memoryview, chunks: Mapping[int, Chunk]) -> None:
        self._stored = {position: _stored(content, position, chunk) for position, chunk in chunks.items()}
        self._inflated: dict[int, Payload | str] = {}  # the content, or why it is lost
        self._scratch: _Scratch | None = None

    @property
    def places(self) -> Collection[int]:
        """Where the chunks begin in the file."""
        return self._stored.keys()

    def content(self, position: int) -> memoryview:
        """Return the plain content of the chunk at ``position``; MessageError if it is lost."""
        return self.open(position).data

    def open(self, position: int) -> Payload:
        """Return the plain content of a chunk, and where it lies in the file; MessageError if it is lost."""
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
    record = read_record(content, position)
    payload = Payload(content[chunk.datapos : chunk.datapos + chunk.datasize], chunk.datapos)
    return _Stored(position, payload, record.fields[b"compression"].decode(), record.uint32(b"size"))


def _inflate(stored: _Stored) -> bytes:
    where, size_bytes = f"chunk at byte {stored.position}", stored.inflated_bytes
    if not stored.inflatable:
        expected = f"at most {_MOST_INFLATED_BYTES} bytes"
        raise MessageError("too large to inflate", where=where, expected=expected, found=f"{size_bytes} bytes")
    try:
        return inflate(stored.compression, stored.payload.data, size_bytes)
    except MessageError as error:
        parts = {"expected": error.expected, "found": error.found}
        raise MessageError(error.what, where=where, **parts) from error


def _check_magic(path: Path) -> None:
    if path.suffix == ".active":
        raise BagError("recording was not finished", where=path, hint=_SALVAGE)
    with reporting(path, "cannot be opened", _SALVAGE), path.open("rb") as file:
        found = file.read(len(MAGIC))
    if not found:
        raise BagError("is empty", where=path, hint="Record or copy it again.")
    if found != MAGIC:
        raise BagError("is not a ROS 1 bag", where=path, expected=MAGIC, found=found)
