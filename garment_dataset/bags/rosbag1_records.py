"""Records, of which all of a ROS 1 bag is made: a header of named fields, then data.

Nothing here believes a length before it has seen that so many bytes are there.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = (bytes([op]) for op in range(2, 8))

UINT32 = struct.Struct("<I")
UINT64 = struct.Struct("<Q")
TIME = struct.Struct("<II")


class RosRecord(NamedTuple):
    """One record.

    Parameters
    ----------
    position : int
        Where it begins.
    fields : dict of bytes to bytes
        Its header.
    data : slice
        Where its data lie; the next record begins at their end.
    """

    position: int
    fields: dict[bytes, bytes]
    data: slice

    def uint32(self, name: bytes) -> int:
        """Return a field of 4 bytes, or MessageError."""
        return self._number(name, UINT32)

    def uint64(self, name: bytes) -> int:
        """Return a field of 8 bytes, or MessageError."""
        return self._number(name, UINT64)

    def stamp_ns(self) -> int:
        """Return the time of a message in nanoseconds, or MessageError."""
        seconds, nanoseconds = TIME.unpack(self._field(b"time", TIME))
        return int(seconds) * 10**9 + int(nanoseconds)

    def _number(self, name: bytes, form: struct.Struct) -> int:
        number: int = form.unpack(self._field(name, form))[0]
        return number

    def _field(self, name: bytes, form: struct.Struct) -> bytes:
        value = self.fields.get(name, b"")
        if len(value) != form.size:
            where, expected = f"record at byte {self.position}", f"{form.size} bytes"
            raise MessageError(f"field {name.decode()}", where=where, expected=expected, found=value[:16])
        return value


def read_fields(content: memoryview, start: int, end: int) -> dict[bytes, bytes]:
    """Return the named fields between two places; MessageError if they do not fill it exactly."""
    fields: dict[bytes, bytes] = {}
    while start < end:
        if start + 4 > end or (stop := start + 4 + UINT32.unpack_from(content, start)[0]) > end:
            raise MessageError("fields do not fit", where=f"byte {start}", expected=f"their end at byte {end}")
        name, _, value = bytes(content[start + 4 : stop]).partition(b"=")
        fields[name] = value
        start = stop
    return fields


def read_record(content: memoryview, position: int) -> RosRecord:
    """Return the record at ``position``.

    Raises
    ------
    MessageError
        If there is none that fits into ``content``.
    """
    head = _end(content, position, "header")
    try:
        fields = read_fields(content, position + 4, head)
    except MessageError as error:
        raise MessageError("record", where=f"byte {position}", found=error) from error
    return RosRecord(position, fields, slice(head + 4, _end(content, head, "data")))


def check_op(record: RosRecord, ops: Collection[bytes]) -> None:
    """Refuse a record of another kind than these by a MessageError."""
    if (op := record.fields.get(b"op")) not in ops:
        expected = " or ".join(str(each[0]) for each in ops)
        raise MessageError("record", where=f"byte {record.position}", expected=f"op {expected}", found=op)


def skip_record(content: memoryview, position: int) -> int:
    """Return the end of the record at ``position``, its header unread; MessageError if it does not fit."""
    return _end(content, _end(content, position, "header"), "data")


def data_of(content: memoryview, position: int) -> tuple[int, int]:
    """Return where the data of a record lie, whose header ends at ``position``; MessageError if they do not fit."""
    return position + UINT32.size, _end(content, position, "data")


def walk(content: memoryview, start: int, end: int, ops: Collection[bytes]) -> Iterator[RosRecord]:
    """Yield the records that follow each other from ``start`` to exactly ``end``, all of these kinds.

    Raises
    ------
    MessageError
        At the first that is not; those before it were yielded.
    """
    content = content[:end]
    while start < end:
        record = read_record(content, start)
        check_op(record, ops)
        yield record
        start = record.data.stop


def _end(content: memoryview, position: int, part: str) -> int:
    """Return the end of what the length at ``position`` announces."""
    if (left := len(content) - position - 4) < 0:
        raise MessageError("record does not fit", where=f"byte {position}", found=f"{left + 4} bytes left")
    size: int = UINT32.unpack_from(content, position)[0]
    if size > left:
        found = f"{size} bytes of {part}, {left} left"
        raise MessageError("record does not fit", where=f"byte {position}", found=found)
    return position + 4 + size
