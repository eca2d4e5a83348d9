"""The chunks of a ROS 1 bag: views of the mapped file, or of a temporary one where they lie inflated.

What was inflated of a bag is kept for whoever opens it next in this process, until another is opened: the stages of one
recording follow each other, and each would inflate it anew.
"""

from __future__ import annotations

import mmap
import os
import tempfile
import weakref
from contextlib import contextmanager
from functools import lru_cache
from itertools import accumulate
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.bags.inflation import inflate
from garment_dataset.bags.messages import Payload
from garment_dataset.errors import BagError, MessageError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from garment_dataset.bags.rosbag1_index import StoredChunk

_MOST_INFLATED_BYTES = 256 * 2**20  # rosbag writes chunks of 0.75 MiB unless told otherwise
_SURE_AGE_NS = 2_000_000_000  # of two changes that follow each other faster, the file system may tell one time

Sizes = tuple[tuple[int, int], ...]


class FileState(NamedTuple):
    """What tells one content of a file from another, without reading it."""

    device: int
    inode: int
    size_bytes: int
    changed_ns: int


def file_state(path: Path) -> FileState:
    """Return the state of a file as it is now."""
    found = path.stat()
    return FileState(found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns)


class Chunks:
    """The chunks of an open bag.

    Parameters
    ----------
    content : memoryview
        The mapped file.
    stored : mapping of int to StoredChunk
        What it holds of them, by place.
    state : FileState
        Of the file before it was mapped.
    """

    def __init__(self, content: memoryview, stored: Mapping[int, StoredChunk], state: FileState) -> None:
        self._content = content
        self._stored = stored
        self._state = state
        self._open_scratch: _Scratch | None = None
        if all(each.compression == "none" for each in stored.values()):
            _kept.cache_clear()

    def content(self, position: int) -> memoryview:
        """Return the plain content of the chunk at ``position``; MessageError if it is lost."""
        return self.open(position).data

    def open(self, position: int) -> Payload:
        """Return the plain content of a chunk, and where it lies in the file; MessageError if it is lost."""
        stored = self._stored[position]
        if stored.compression == "none":
            return Payload(self._content[stored.start : stored.stop], stored.start)
        found = self._scratch.found.get(position)
        if found is None:
            found = self._scratch.keep(position, self._inflated(stored))
        if isinstance(found, str):
            raise MessageError(found)
        return Payload(found, None)

    def close(self) -> None:
        """Let go of the temporary file; arrays that somebody holds keep what they show of either file."""
        self._open_scratch = None

    @property
    def _scratch(self) -> _Scratch:
        """The temporary file: that which was kept, if the bag is surely the same."""
        if self._open_scratch is None:
            sizes = [
                (position, each.inflated_bytes)
                for position, each in sorted(self._stored.items())
                if each.compression != "none" and each.inflated_bytes <= _MOST_INFLATED_BYTES
            ]
            scratch = _kept(self._state, tuple(sizes))
            if scratch.made_ns - self._state.changed_ns < _SURE_AGE_NS:
                _kept.cache_clear()
                scratch = _Scratch(tuple(sizes))
            self._open_scratch = scratch
        return self._open_scratch

    def _inflated(self, stored: StoredChunk) -> bytes | str:
        """Return the content, or why it is lost."""
        where, size_bytes = f"chunk at byte {stored.position}", stored.inflated_bytes
        if size_bytes > _MOST_INFLATED_BYTES:
            expected = f"at most {_MOST_INFLATED_BYTES} bytes"
            return str(
                MessageError("too large to inflate", where=where, expected=expected, found=f"{size_bytes} bytes")
            )
        try:
            return inflate(stored.compression, self._content[stored.start : stored.stop], size_bytes)
        except MessageError as error:
            return str(MessageError(error.what, where=where, expected=error.expected, found=error.found))


class _Scratch:
    """A temporary file without a name, mapped once; the system frees it with the last view, whatever happens.

    Each chunk has its own place in it, so that whoever shares the file, a forked process or another thread, writes the
    same bytes to the same place.

    Attributes
    ----------
    found : dict of int to memoryview or str
        The content of chunks, by place in the bag, or why it is lost.
    made_ns : int
        When it was made, by the clock of the file system.
    """

    def __init__(self, sizes: Sizes) -> None:
        starts = [0, *accumulate(size_bytes for _, size_bytes in sizes)]
        self.found: dict[int, memoryview | str] = {}
        self._starts = dict(zip((position for position, _ in sizes), starts, strict=False))
        with self._reporting():
            file = tempfile.TemporaryFile()  # noqa: SIM115 - stays open as long as this object
            weakref.finalize(self, file.close)
            file.truncate(starts[-1] + 1)  # takes no room yet; nothing cannot be mapped
            self._file = file.fileno()
            self.made_ns = os.fstat(self._file).st_mtime_ns
            self._content = memoryview(mmap.mmap(self._file, 0, access=mmap.ACCESS_READ))

    def keep(self, position: int, content: bytes | str) -> memoryview | str:
        """Return a read-only view of a copy of ``content`` that is in the file, not in memory; faults as they are."""
        kept: memoryview | str = content if isinstance(content, str) else self._written(self._starts[position], content)
        self.found[position] = kept
        return kept

    def _written(self, start: int, content: bytes) -> memoryview:
        rest, at = memoryview(content), start
        with self._reporting():  # through the mapping, a full disk would kill the process instead
            while rest:
                written = os.pwrite(self._file, rest, at)
                rest, at = rest[written:], at + written
        return self._content[start : start + len(content)]

    @contextmanager
    def _reporting(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            hint = "Point TMPDIR to a folder with room for the inflated bag."
            raise BagError("no room to inflate a chunk", where=tempfile.gettempdir(), found=error, hint=hint) from error


@lru_cache(maxsize=1)
def _kept(state: FileState, sizes: Sizes) -> _Scratch:  # noqa: ARG001 - the state tells one bag from another
    return _Scratch(sizes)
