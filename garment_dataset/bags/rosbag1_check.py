"""Where the index of a ROS 1 bag and what its chunks hold contradict each other, one line each.

The index decides what is read, so that a message it does not name would vanish without a word, and a message that it
gives to another connection would be read as one of another topic.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from garment_dataset.bags.rosbag1_layout import BagLayout, ChunkContent, Entry, read_chunk, read_layout, topic_of
from garment_dataset.bags.rosbag1_sound import sound_chunks
from garment_dataset.errors import MessageError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from garment_dataset.bags.rosbag1_index import Index
    from garment_dataset.bags.rosbag1_layout import Fields

_SALVAGE = "`garment salvage` writes a bag with a new index."


@dataclass
class _Findings:
    """What is wrong, collected over the chunks; each with the place of its chunk."""

    lost: list[tuple[MessageError, int]] = field(default_factory=list)
    broken: list[str] = field(default_factory=list)
    unnamed: list[tuple[int, Entry]] = field(default_factory=list)
    absent: list[tuple[int, Entry]] = field(default_factory=list)
    miscounted: list[int] = field(default_factory=list)
    connections: dict[int, list[Fields]] = field(default_factory=dict)


def contradictions(
    file: memoryview,
    index: Index,
    open_chunk: Callable[[int], memoryview],
) -> Iterator[str]:
    """Yield what is wrong with a bag, in one line each.

    Parameters
    ----------
    file : memoryview
        The whole bag.
    index : Index
        What its index says.
    open_chunk : callable
        Returns the plain content of one of them, or raises MessageError.
    """
    layout = index.layout or read_layout(file)
    table = dict(layout.table)
    entries: dict[int, list[Entry]] = {position: [] for position in index.stored}
    columns = (index.chunks, index.offsets, index.numbers, index.stamps_ns)
    for position, *entry in zip(*[each.tolist() for each in columns], strict=True):
        entries[position].append(Entry(*entry))
    found = _Findings()
    sound = sound_chunks(entries, table, open_chunk)
    for position, named in sorted(entries.items()):
        if position in sound:
            continue
        try:
            content = read_chunk(open_chunk(position))
        except MessageError as error:
            found.lost.append((error, len(named)))
            continue
        _compare(found, position, content, named, table.get(position))
    yield from _of_layout(layout)
    yield from _of_chunks(found, layout)
    yield from _of_connections(found.connections, layout.connections)


def _compare(
    found: _Findings, position: int, content: ChunkContent, named: list[Entry], counts: Mapping[int, int] | None
) -> None:
    """Add what the index, and the table, say otherwise of one chunk."""
    for number, said in content.connections.items():
        known = found.connections.setdefault(number, [])
        known += [each for each in said if each not in known]
    wanted = [
        each._replace(offset=content.ways[each.offset]) if each.offset in content.ways else each for each in named
    ]
    if content.damage is not None:
        found.broken.append(f"the chunk at byte {position}: {content.damage}")
        last = content.messages[-1].offset if content.messages else -1
        wanted = [each for each in wanted if each.offset <= last]
    elif counts is not None and Counter(each.connection for each in content.messages) != Counter(counts):
        found.miscounted.append(position)
    if sorted(wanted) != content.messages:  # those are in their order
        indexed, there = Counter(wanted), Counter(content.messages)
        found.unnamed += [(position, each) for each in (there - indexed).elements()]
        found.absent += [(position, each) for each in (indexed - there).elements()]


def _of_layout(layout: BagLayout) -> Iterator[str]:
    if layout.damage:
        yield f"its records cannot be followed to the end, {'; '.join(layout.damage)}"
        return
    listed = Counter(position for position, _ in layout.table)
    if unlisted := sorted(layout.chunks.keys() - listed.keys()):
        text = f"{len(unlisted)} of {len(layout.chunks)} chunks are not in its chunk table and are left out"
        yield f"{text}, first that at byte {unlisted[0]}. {_SALVAGE}"
    table = "its chunk table names"
    if repeated := [position for position, count in listed.items() if count > 1]:
        yield f"{table} {len(repeated)} chunks more than once, first that at byte {repeated[0]}. {_SALVAGE}"
    if stray := sorted(listed.keys() - layout.chunks.keys()):
        yield f"{table} {len(stray)} places that are within other records, first byte {stray[0]}. {_SALVAGE}"
    records = {position: len(counts) for position, counts in layout.table}
    if wrong := [at for at, count in layout.chunks.items() if count != records.get(at, count)]:
        found = f"expected {records[wrong[0]]}, found {layout.chunks[wrong[0]]}"
        text = f"{len(wrong)} chunks have more or fewer index records than its chunk table says"
        yield f"{text}, first that at byte {wrong[0]}: {found}"
    numbers = {"chunks": len(layout.table), "conns": sum(map(len, layout.connections.values()))}
    for name, plural in (("chunks", "chunks"), ("conns", "connections")):
        if layout.said[name] != numbers[name]:
            text = f"its header announces {layout.said[name]} {plural}, its index section has {numbers[name]}"
            yield f"{text}. {_SALVAGE}"


def _of_chunks(found: _Findings, layout: BagLayout) -> Iterator[str]:
    total = len(layout.chunks)
    if found.lost:
        messages = sum(count for _, count in found.lost)
        yield f"{len(found.lost)} of {total} chunks are lost, {messages} messages with them, first: {found.lost[0][0]}"
    if found.broken:
        text = f"the records of {len(found.broken)} of {total} chunks cannot be followed to their end"
        yield f"{text}, first those of {found.broken[0]}"
    connections = {**found.connections, **layout.connections}
    if found.unnamed:
        text = f"its index leaves out {len(found.unnamed)} messages that are there"
        yield f"{text}, {_places(found.unnamed, connections)}. {_SALVAGE}"
    if found.absent:
        text = f"its index names {len(found.absent)} messages that are not there, or twice"
        yield f"{text}, {_places(found.absent, connections)}. {_SALVAGE}"
    if found.miscounted:
        text = f"its chunk table counts other messages than {len(found.miscounted)} of {total} chunks hold"
        yield f"{text}, first that at byte {found.miscounted[0]}"


def _of_connections(in_chunks: Mapping[int, list[Fields]], in_index: Mapping[int, list[Fields]]) -> Iterator[str]:
    """Tell of connections that are described in more than one way."""
    for number in sorted({*in_chunks, *in_index}):
        first, *others = [*in_index.get(number, []), *in_chunks.get(number, [])]
        if number not in in_index:
            yield f"connection {number}, {topic_of(in_chunks, number)}, is not in its index section and is left out"
        if other := next((each for each in others if each != first), None):
            name = next(each for each in sorted({*other, *first}) if other.get(each) != first.get(each))
            both = " and ".join(repr(each.get(name, b"")[:80].decode(errors="replace")) for each in (first, other))
            text = f"connection {number}, {topic_of(in_index, number)}, is described in two ways"
            yield f"{text}: {name.decode(errors='replace')} {both}"


def _places(found: Sequence[tuple[int, Entry]], connections: Mapping[int, list[Fields]]) -> str:
    counts = Counter(topic_of(connections, entry.connection) for _, entry in found)
    topics = ", ".join(f"{count} of {topic}" for topic, count in sorted(counts.items()))
    position, entry = found[0]
    return f"{topics}; first at byte {entry.offset} of the chunk at byte {position}"
