"""What is wrong with a bag, as far as its first and its last bytes tell: fit for every bag of a folder at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

from garment_dataset.bags.mapped import mapped
from garment_dataset.bags.rosbag1_records import BAG_HEADER, CHUNK, CHUNK_INFO, CONNECTION, MAGIC, read_record, walk
from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from pathlib import Path

    from garment_dataset.bags.rosbag1_records import RosRecord

Kind = Literal["empty", "foreign", "unindexed", "cut", "damaged", "unreadable"]


class Condition(NamedTuple):
    """What is wrong with a bag.

    Parameters
    ----------
    kind : {"empty", "foreign", "unindexed", "cut", "damaged", "unreadable"}
        unindexed: no recorder has closed it, its messages may be whole all the same; cut: bytes are missing at its end;
        damaged: its header or index makes no sense; unreadable: the machine does not let it be read.
    text : str
        The same in words.
    """

    kind: Kind
    text: str

    @property
    def hint(self) -> str:
        """What to do about it."""
        if self.kind in ("empty", "foreign"):
            return "Record or copy it again."
        if self.kind == "unreadable":
            return "See who owns it, and whether the disk is sound."
        return "`garment salvage` writes what can be saved to a new bag."


def look(path: Path) -> Condition | None:
    """Return what is wrong with a ROS 1 bag; None if nothing is, or if it is a rosbag2 folder.

    Its messages are not read: damage among them shows when it is built, or salvaged.
    """
    if path.is_dir():
        return None
    try:
        if path.stat().st_size == 0:
            return Condition("empty", "the file is empty")
        return _look(mapped(path))
    except OSError as error:
        return Condition("unreadable", f"cannot be read: {error.strerror}")
    except MessageError as error:
        return Condition("damaged", f"its index cannot be followed: {error}")


def _look(content: memoryview) -> Condition | None:
    if content[: len(MAGIC)] != MAGIC:
        return Condition("foreign", f"not a ROS 1 bag: it begins with {bytes(content[:13])!r}")
    header = read_record(content, len(MAGIC))
    if header.fields.get(b"op") != BAG_HEADER:
        return Condition("damaged", "its header is damaged")
    start, said = header.uint64(b"index_pos"), (header.uint32(b"conn_count"), header.uint32(b"chunk_count"))
    if start == 0:
        return Condition("unindexed", "its index was never written")
    if start > len(content):
        text = f"cut: {len(content)} bytes are there, its index would begin at byte {start}"
        return Condition("cut", text)
    return _look_at_index(content, start, said)


def _look_at_index(content: memoryview, start: int, said: tuple[int, int]) -> Condition | None:
    records: list[RosRecord] = []
    try:
        records.extend(walk(content, start, len(content), (CONNECTION, CHUNK_INFO)))
    except MessageError:
        if records or len(content) - start < 4:
            return Condition(
                "cut", f"cut in its index, or damaged there: {len(records)} of {sum(said)} records are whole"
            )
        raise
    found = [record.fields[b"op"] for record in records]
    if (found.count(CONNECTION), found.count(CHUNK_INFO)) != said:
        kind: Kind = "cut" if len(found) < sum(said) else "damaged"
        return Condition(kind, f"its index has {len(found)} records, its header counts {sum(said)}")
    for record in records:
        if record.fields[b"op"] == CHUNK_INFO:
            place = record.uint64(b"chunk_pos")
            if place >= start or read_record(content, place).fields.get(b"op") != CHUNK:
                return Condition("damaged", f"its index names a chunk at byte {place}, where none is")
    return None
