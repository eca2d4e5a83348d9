"""Salvage: what the bytes of a damaged ROS 1 bag still allow, written to a new bag.

Everything is read past the first and every later damage: chunk by chunk, record by record, into the last half chunk.
The bag itself is never touched, and no file is ever overwritten.
"""

from __future__ import annotations

import os
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from garment_dataset.bags.mapped import mapped
from garment_dataset.bags.reporting import reporting
from garment_dataset.bags.rosbag1 import Rosbag1
from garment_dataset.bags.rosbag1_layout import TOPIC
from garment_dataset.bags.rosbag1_recovery import Losses, learn_connections, recover
from garment_dataset.bags.rosbag1_scan import Gap, scan_bag
from garment_dataset.bags.rosbag1_writer import BagWriter
from garment_dataset.errors import BagError

if TYPE_CHECKING:
    from pathlib import Path

    from garment_dataset.bags.rosbag1_layout import Fields
    from garment_dataset.bags.rosbag1_scan import Scan

SUFFIX = ".salvaged.bag"
"""What the names of salvaged bags end with; such a file is no recording until it takes its original's place."""

_ANOTHER = "Name another with --out, or move that away."


@dataclass(frozen=True, slots=True)
class TopicReport:
    """What became of one topic.

    Parameters
    ----------
    topic : str
        Its name, or the number of a connection that nothing describes.
    kept, doubtful : int
        Messages in the new bag; of these, those that stand next to damage or in a chunk that nothing proves.
    lost : int
        Messages that the index, or the chunk table, names beyond these.
    """

    topic: str
    kept: int
    doubtful: int
    lost: int


@dataclass(frozen=True, slots=True)
class SalvageReport:
    """What was done with a bag.

    Parameters
    ----------
    path : pathlib.Path
        The bag.
    out : pathlib.Path or None
        The new bag; None if the old one is sound.
    topics : tuple of TopicReport
        By name.
    gaps : tuple of Gap
        Where its bytes were no records, or could not be inflated.
    cut_at : int or None
        Where the record begins that the end of the file cuts.
    lost_is_known : bool
        Whether all chunks are known by their index, so that ``lost`` is all; else there may be more.
    """

    path: Path
    out: Path | None
    topics: tuple[TopicReport, ...]
    gaps: tuple[Gap, ...]
    cut_at: int | None
    lost_is_known: bool

    @property
    def is_sound(self) -> bool:
        """Whether there was nothing to mend."""
        return self.out is None

    @property
    def kept(self) -> int:
        """How many messages there are."""
        return sum(topic.kept for topic in self.topics)

    @property
    def doubtful(self) -> int:
        """How many of them nothing proves."""
        return sum(topic.doubtful for topic in self.topics)

    @property
    def lost(self) -> int:
        """How many messages are known to be missing."""
        return sum(topic.lost for topic in self.topics)


def default_output(path: Path) -> Path:
    """Return where the salvaged bag goes unless told otherwise: beside the original."""
    stem = path.name.removesuffix(".active")
    return path.with_name((stem[:-4] if stem.lower().endswith(".bag") else stem) + SUFFIX)


def salvage(path: Path, out: Path | None = None) -> SalvageReport:
    """Write all that can be had of a damaged ROS 1 bag to a new one, sound and indexed.

    Parameters
    ----------
    path : pathlib.Path
        A ``.bag``, or a ``.bag.active`` that no recorder is at work on.
    out : pathlib.Path, optional
        The new bag; by default :func:`default_output`. Its chunks are compressed as those of the original.

    Raises
    ------
    BagError
        If there is no file, nothing that can be saved, or ``out`` exists.
    SourceError
        If the machine cannot read it, or write the new one.
    """
    if not path.is_file():
        found = "a folder" if path.is_dir() else None
        hint = "Of rosbag2, `ros2 bag reindex` makes a new metadata.yaml." if found else None
        raise BagError("no such ROS 1 bag", where=path, expected="a .bag or .bag.active file", found=found, hint=hint)
    if path.stat().st_size == 0:
        raise BagError("is empty", where=path, hint="Record or copy it again.")
    if (whole := _report_of_sound(path)) is not None:
        return whole
    out = default_output(path) if out is None else out
    if os.path.lexists(out):
        raise BagError("there is such a file already", where=out, hint=_ANOTHER)
    with reporting(path, "cannot be salvaged", "It may be on a failing disk: copy it first."):
        content = mapped(path)
        scan = scan_bag(content)
        saving = _Saving(content, scan)
        if not saving.connections:
            raise BagError("nothing in it can be saved", where=path, expected="a connection and its messages")
        _write_new(out, saving)
    if not saving.kept:
        raise BagError("nothing in it can be saved", where=path, expected="a whole message")
    gaps = tuple(sorted(saving.losses.gaps))
    return SalvageReport(path, out, saving.topics(), gaps, scan.cut, lost_is_known=_is_counted(scan))


def _is_counted(scan: Scan) -> bool:
    """Return whether the chunk table, or the index records of as many chunks as there were, count all messages."""
    named = [chunk for chunk in scan.chunks if chunk.entries]
    return bool(scan.said_chunks) and scan.said_chunks in (len(scan.table), len(named))


def _report_of_sound(path: Path) -> SalvageReport | None:
    if path.suffix == ".active":
        return None
    try:
        with Rosbag1(path) as bag:
            if bag.is_indexed_anew or bag.contradictions():
                return None
            topics = tuple(TopicReport(topic.name, topic.count, 0, 0) for topic in bag.topics.values())
    except BagError:
        return None
    return SalvageReport(path, None, topics, (), None, lost_is_known=True)


class _Saving:
    """The messages of one bag on their way into another."""

    def __init__(self, content: memoryview, scan: Scan) -> None:
        self.losses = Losses()
        self.kept: Counter[int] = Counter()
        self.connections, self._contradicted = learn_connections(content, scan)
        compressions = Counter(chunk.compression for chunk in scan.chunks)
        self.compression = compressions.most_common(1)[0][0] if compressions else "none"
        self._doubtful: Counter[int] = Counter()
        self._content, self._scan = content, scan

    def write_to(self, writer: BagWriter) -> None:
        """Write every message whose connection is described."""
        for message in recover(self._content, self._scan, self.losses):
            number = message.connection
            if number not in self.connections:
                self.losses.by_connection[number] += 1
                continue
            writer.write(number, message.stamp_ns, message.data)
            self.kept[number] += 1
            self._doubtful[number] += message.doubtful or number in self._contradicted
        writer.finish()

    def topics(self) -> tuple[TopicReport, ...]:
        """Add up the connections of each topic."""
        rows: dict[str, list[int]] = {}
        for number in sorted({*self.connections, *self.losses.by_connection}):
            row = rows.setdefault(_topic(self.connections.get(number), number), [0, 0, 0])
            counted = self.kept[number], self._doubtful[number], self.losses.by_connection[number]
            row[:] = (one + other for one, other in zip(row, counted, strict=True))
        return tuple(TopicReport(name, *row) for name, row in sorted(rows.items()))


def _topic(said: Fields | None, number: int) -> str:
    return f"connection {number}, which nothing describes" if said is None else said[TOPIC].decode(errors="replace")


def _write_new(out: Path, saving: _Saving) -> None:
    """Write under another name first: the right one is given to a whole bag, and only if it is free."""
    part = out.with_name(f".{out.name}.{os.getpid()}.part")
    try:
        with part.open("xb") as file:
            saving.write_to(BagWriter(file, saving.connections, saving.compression))
            file.flush()
            os.fsync(file.fileno())
        if saving.kept:
            _give_name(part, out)
    except OSError as error:
        raise BagError("cannot be written", where=out, found=error.strerror or error) from error
    finally:
        with suppress(OSError):
            part.unlink()


def _give_name(part: Path, out: Path) -> None:
    try:
        out.hardlink_to(part)
    except FileExistsError:
        raise BagError("there is such a file already", where=out, hint=_ANOTHER) from None
    except OSError:  # a file system without hard links
        part.rename(out)
