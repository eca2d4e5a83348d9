"""The chunks of a ROS 1 bag, opened when they are first needed."""

from __future__ import annotations

import mmap
import tempfile
from contextlib import contextmanager
from typing import TYPE_CHECKING

from garment_dataset.bags.inflation import inflate
from garment_dataset.bags.messages import Payload
from garment_dataset.errors import BagError, MessageError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from garment_dataset.bags.rosbag1_index import StoredChunk

_MOST_INFLATED_BYTES = 256 * 2**20  # rosbag writes chunks of 0.75 MiB unless told otherwise


class Chunks:
    """The chunks of a bag: views of the mapped file, or of a temporary one where they lie inflated.

    Parameters
    ----------
    content : memoryview
        The mapped file.
    stored : mapping of int to StoredChunk
        What it holds of them, by place.
    """

    def __init__(self, content: memoryview, stored: Mapping[int, StoredChunk]) -> None:
        self._content = content
        self._stored = stored
        self._inflated: dict[int, Payload | str] = {}  # the content, or why it is lost
        self._scratch: _Scratch | None = None

    def content(self, position: int) -> memoryview:
        """Return the plain content of the chunk at ``position``; MessageError if it is lost."""
        return self.open(position).data

    def open(self, position: int) -> Payload:
        """Return the plain content of a chunk, and where it lies in the file; MessageError if it is lost."""
        stored = self._stored[position]
        if stored.compression == "none":
            return Payload(self._content[stored.start : stored.stop], stored.start)
        if position not in self._inflated:
            if self._scratch is None:
                sizes = [each.inflated_bytes for each in self._stored.values() if each.compression != "none"]
                self._scratch = _Scratch(sum(filter(_is_inflatable, sizes)))
            try:
                self._inflated[position] = Payload(self._scratch.add(self._inflate(stored)), None)
            except MessageError as error:
                self._inflated[position] = str(error)
        content = self._inflated[position]
        if isinstance(content, str):
            raise MessageError(content)
        return content

    def _inflate(self, stored: StoredChunk) -> bytes:
        where, size_bytes = f"chunk at byte {stored.position}", stored.inflated_bytes
        if not _is_inflatable(size_bytes):
            expected = f"at most {_MOST_INFLATED_BYTES} bytes"
            raise MessageError("too large to inflate", where=where, expected=expected, found=f"{size_bytes} bytes")
        try:
            return inflate(stored.compression, self._content[stored.start : stored.stop], size_bytes)
        except MessageError as error:
            parts = {"expected": error.expected, "found": error.found}
            raise MessageError(error.what, where=where, **parts) from error

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


def _is_inflatable(size_bytes: int) -> bool:
    return size_bytes <= _MOST_INFLATED_BYTES
