"""ROS 1 bags (format 2.0), read through a memory map with the bag's own index.

The index is read at once where it is as recorders write it, by rosbags where it is not; the messages themselves are
views of the mapped file, so that nobody copies, or even touches, pixels that no stage asks for. Of a bag recorded with
lz4 or bz2, a chunk is inflated when it is first needed, once, into a temporary file without a name, and mapped from
there: bags of either sort are never held in memory.

A mapped file must not shrink while it is read: the operating system kills a process that touches pages beyond the end.
:meth:`Bag.close` reports a bag that changed in any other way.
"""

from __future__ import annotations

import mmap
from functools import partial
from typing import TYPE_CHECKING, BinaryIO, cast

from rosbags.rosbag1 import Reader

from garment_dataset.bags.bag import Bag, summarise
from garment_dataset.bags.mapped import mapped
from garment_dataset.bags.messages import Payload, Record
from garment_dataset.bags.reindexed import Reindexed, index_anew
from garment_dataset.bags.reporting import reporting
from garment_dataset.bags.rosbag1_check import contradictions
from garment_dataset.bags.rosbag1_chunks import Chunks, file_state
from garment_dataset.bags.rosbag1_index import Index, from_entries, read_usual_index
from garment_dataset.bags.rosbag1_layout import USUAL_MESSAGE_BYTES, usual_message
from garment_dataset.bags.rosbag1_records import CONNECTION, MAGIC, MESSAGE, data_of, read_record
from garment_dataset.errors import BagError, MessageError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path

    from rosbags.interfaces.typing import RPath

_SALVAGE = "`garment salvage` writes what can be saved to a new bag."
_ANEW = "its index is missing or damaged; its messages are whole, and were read from the first to the last"


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
            state = file_state(path)
            self._content = mapped(path)
        with reporting(path, "its index cannot be read", _SALVAGE):
            self._index = self._read_index()
            self._connections = {each.id: each for each in self._index.connections}
            self._chunks: Chunks | None = Chunks(self._content, self._index.stored, state)
        self.topics = summarise(self._connections.values())

    def _read_index(self) -> Index:
        """Return the bag's own index; or a new one if nothing else is wrong with it."""
        try:
            with reporting(self.path, "its index cannot be read", _SALVAGE):
                if (usual := read_usual_index(self.path, self._content)) is not None:
                    return usual
                reader = Reader(self.path)
                reader.path = cast("RPath", _MappedPath(self.path))
                with reader:
                    read = Reindexed(list(reader.connections), dict(reader.indexes), dict(reader.chunks))
        except BagError as error:
            with reporting(self.path, error.what, _SALVAGE):
                anew = index_anew(self.path, self._content)
            if anew is None:
                raise
            self.is_indexed_anew, read = True, anew
        return from_entries(self._content, read)

    def _records(self, topics: Collection[str]) -> Iterator[Record]:
        self._check_open()
        numbers = [each.id for each in self._connections.values() if each.topic in topics]
        for stamp_ns, chunk, offset, connection_id in self._index.messages_of(numbers):
            read = partial(self._read, connection_id, stamp_ns, chunk, offset)
            yield Record(self._connections[connection_id], stamp_ns, read)

    def contradictions(self) -> list[str]:
        """Compare the index with what the chunks hold; inflates those that are not inflated yet."""
        self._check_open()
        assert self._chunks is not None
        if self.is_indexed_anew:
            return [_ANEW]
        return list(contradictions(self._content, self._index, self._chunks.content))

    def _read(self, connection_id: int, time_ns: int, chunk_position: int, offset: int) -> Payload:
        self._check_open()
        assert self._chunks is not None
        chunk = self._chunks.open(chunk_position)
        try:
            if usual_message(chunk.data, offset) == (offset, connection_id, time_ns):
                return _part(chunk, *data_of(chunk.data, offset + USUAL_MESSAGE_BYTES))
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
        return _part(chunk, record.data.start, record.data.stop)

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


def _part(chunk: Payload, start: int, stop: int) -> Payload:
    return Payload(chunk.data[start:stop], None if chunk.offset_bytes is None else chunk.offset_bytes + start)


def _check_magic(path: Path) -> None:
    if path.suffix == ".active":
        raise BagError("recording was not finished", where=path, hint=_SALVAGE)
    with reporting(path, "cannot be opened", _SALVAGE), path.open("rb") as file:
        found = file.read(len(MAGIC))
    if not found:
        raise BagError("is empty", where=path, hint="Record or copy it again.")
    if found != MAGIC:
        raise BagError("is not a ROS 1 bag", where=path, expected=MAGIC, found=found)
