"""Messages that a scan of a damaged ROS 1 bag has found, held against what its index still says of them.

A message is *doubtful* when it is next to damage, stands in a chunk that no checksum proves, or is another one than the
index names. It is kept all the same, and counted.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from garment_dataset.bags.definitions import definition_digest
from garment_dataset.bags.partial_inflation import Segment, inflate_what_is_left
from garment_dataset.bags.rosbag1_layout import TOPIC
from garment_dataset.bags.rosbag1_scan import Gap, Saved, Scan, ScannedChunk, scan_content

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.bags.rosbag1_layout import Fields

_NEEDED = {b"type", b"md5sum", b"message_definition"}


@dataclass(frozen=True, slots=True)
class SavedMessage:
    """One message that can be written again.

    Parameters
    ----------
    connection : int
        The number of its connection.
    stamp_ns : int
        When it was received.
    data : memoryview
        Its bytes.
    doubtful : bool
        Whether nothing proves them, though the bag is known to be damaged there.
    """

    connection: int
    stamp_ns: int
    data: memoryview
    doubtful: bool


@dataclass
class Losses:
    """What is not there any more.

    Attributes
    ----------
    by_connection : Counter of int
        How many messages of each connection the index, or the chunk table, names beyond those that were found.
    gaps : list of Gap
        Where bytes of the file are no records.
    """

    by_connection: Counter[int] = field(default_factory=Counter)
    gaps: list[Gap] = field(default_factory=list)


def learn_connections(content: memoryview, scan: Scan) -> tuple[dict[int, Fields], set[int]]:
    """Return what is said of each connection, and those of which contradictory things are said.

    Of several descriptions the one that proves itself is taken: its definition has the digest that it names, and its
    topic is the same in both places. Else the first.
    """
    said = {number: list(each) for number, each in scan.connections.items()}
    for chunk in scan.chunks:
        for segment in _segments(content, scan, chunk) if chunk.compression != "none" else ():
            for number, fields in scan_content(memoryview(segment.data)).connections.items():
                known = said.setdefault(number, [])
                known += [each for each in fields if each not in known]
    chosen: dict[int, Fields] = {}
    contradicted: set[int] = set()
    for number, every in said.items():
        fields = [each for each in every if each.keys() >= _NEEDED]
        readable = [each for each in fields if each == _readable(each)] or [_readable(each) for each in fields]
        proven = [each for each in readable if _proves_itself(each)] if len(every) > 1 else readable
        if readable:
            chosen[number] = (proven or readable)[0]
        if len(proven) != 1 or chosen[number] not in every:
            contradicted.add(number)
    return chosen, contradicted


def _readable(fields: Fields) -> Fields:
    """Return a description that any reader can decode."""
    text = {name: value.decode(errors="replace").encode() for name, value in fields.items() if name.isascii()}
    return {name: value for name, value in text.items() if name != b"latching" or value.isdigit()}


def _proves_itself(fields: Fields) -> bool:
    if fields.get(b"topic", fields[TOPIC]) != fields[TOPIC]:
        return False
    digest = definition_digest(fields[b"message_definition"].decode(), fields[b"type"].decode())
    return digest is not None and digest.encode() == fields[b"md5sum"]


def recover(content: memoryview, scan: Scan, losses: Losses) -> Iterator[SavedMessage]:
    """Yield every message that can be had, in the order of the file.

    Parameters
    ----------
    content : memoryview
        The whole bag.
    scan : Scan
        What :func:`garment_dataset.bags.rosbag1_scan.scan_bag` found in it.
    losses : Losses
        Is filled: what is missing, as far as something names it.
    """
    losses.gaps += scan.gaps
    kept: Counter[int] = Counter()
    for chunk in scan.chunks:
        if chunk.compression == "none":
            parts = [(content, chunk.messages, True)]
        else:
            parts = list(_inflated(content, scan, chunk, losses))
        found = [message for _, messages, _ in parts for message in messages]
        expected = _Expected(chunk)
        losses.by_connection += expected.missing(found)
        for data, messages, sound in parts:
            for message in messages:
                kept[message.connection] += 1
                doubtful = not sound or expected.doubts(message)
                yield SavedMessage(message.connection, message.stamp_ns, data[message.data], doubtful)
    counted = sum((Counter(counts) for counts in scan.table.values()), Counter())
    if losses.by_connection.total() < counted.total() - kept.total():  # else the index records have told all
        losses.by_connection |= counted - kept


def _inflated(
    content: memoryview, scan: Scan, chunk: ScannedChunk, losses: Losses
) -> Iterator[tuple[memoryview, list[Saved], bool]]:
    segments = _segments(content, scan, chunk)
    if not segments or not segments[0].sound or len(segments[0].data) != chunk.size_bytes:
        held = sum(len(each.data) for each in segments)
        said = "an unknown number" if chunk.size_bytes is None else str(chunk.size_bytes)
        what = f"a damaged {chunk.compression} chunk: {held} of {said} bytes inflated"
        losses.gaps.append(Gap(chunk.position, min(chunk.stored.stop, len(content)), what))
    for segment in segments:
        plain = memoryview(segment.data)
        found = scan_content(plain)
        if segment.sound and len(plain) == chunk.size_bytes:
            texts = [f"{gap.what}, byte {gap.start} of its content" for gap in found.gaps]
            losses.gaps += [Gap(chunk.position, chunk.stored.stop, text) for text in texts]
        messages = [message for chunk in found.chunks for message in chunk.messages]
        yield plain, messages, segment.sound


def _segments(content: memoryview, scan: Scan, chunk: ScannedChunk) -> list[Segment]:
    is_cut = chunk.stored.stop >= len(content) and not scan.table
    stored = content[chunk.stored]
    return inflate_what_is_left(chunk.compression, stored, chunk.size_bytes, is_cut=is_cut)


class _Expected:
    """What the index records of one chunk say that it holds."""

    def __init__(self, chunk: ScannedChunk) -> None:
        self._start = chunk.stored.start if chunk.compression == "none" else 0
        self._named = Counter((entry.connection, entry.stamp_ns) for entry in chunk.entries)
        self._entries = chunk.entries
        self._names_all = bool(chunk.entries) and chunk.is_index_whole

    def doubts(self, message: Saved) -> bool:
        """Whether a message is next to damage and nothing confirms it, or the index names another."""
        is_named = (message.connection, message.stamp_ns) in self._named
        return message.before_gap or (not is_named and (message.behind_gap or self._names_all))

    def missing(self, found: list[Saved]) -> Counter[int]:
        """Count the messages that are named and not found, by connection; one found under another name is there."""
        missing = self._named - Counter((message.connection, message.stamp_ns) for message in found)
        places = {message.offset - self._start for message in found}
        lost: Counter[int] = Counter()
        for entry in self._entries:
            name = entry.connection, entry.stamp_ns
            if missing[name] > 0:
                missing[name] -= 1
                lost[entry.connection] += entry.offset not in places
        return +lost
