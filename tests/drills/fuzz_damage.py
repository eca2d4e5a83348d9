"""Damage, drawn from a seeded generator: of any bytes, and of the indexes of ROS 1 bags, which lie consistently."""

from __future__ import annotations

import sqlite3
import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from random import Random

    from tests.drills.fuzz_bags import Sample

NUMBERS = (0, 1, 2, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0xFFFFFFF0)


Spoiled = tuple[list[tuple[int, int]], str]
"""Which bytes were touched, and how."""


@dataclass
class Damage:
    """Files as they are after it, a description, and whether only bytes were touched that nothing covers."""

    files: dict[str, bytes]
    text: str
    uncovered: bool = False


def damage_bytes(sample: Sample, random: Random) -> Damage:
    """Spoil one file in one to three places, mostly where structure is."""
    name = random.choice([each for each in sample.files for _ in range(1 if each.endswith(".yaml") else 4)])
    content = bytearray(sample.files[name])
    texts, uncovered = [], False
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        ranges, text = random.choice(_SPOILERS)(content, _place(sample, name, random), random)
        uncovered |= any(not sample.covers(name, start, stop) for start, stop in ranges)
        texts.append(text)
    return Damage({**sample.files, name: bytes(content)}, f"{name}: {'; '.join(texts)}", uncovered)


def _place(sample: Sample, name: str, random: Random) -> int:
    size = len(sample.files[name])
    for _ in range(20 if random.random() < 0.8 else 1):
        place = random.randrange(size)
        if sample.covers(name, place, place + 1) and sample.files[name][place : place + 40] != b" " * 40:
            return place
    return place


def _flip(content: bytearray, place: int, random: Random) -> Spoiled:
    place = min(place, len(content) - 1)
    bit = random.randrange(8)
    content[place] ^= 1 << bit
    return [(place, place + 1)], f"bit {bit} of byte {place} flipped"


def _fill(content: bytearray, place: int, random: Random) -> Spoiled:
    stop = min(len(content), place + random.choice((1, 2, 4, 8, 30, 200, 3000)))
    value = random.choice((0, 0, 255, 32))
    content[place:stop] = bytes([value]) * (stop - place)
    return [(place, stop)], f"bytes {place} to {stop} are {value}"


def _number(content: bytearray, place: int, random: Random) -> Spoiled:
    place = min(place, len(content) - 4)
    number = random.choice((*NUMBERS, random.randrange(2**32), random.randrange(300)))
    struct.pack_into("<I", content, place, number)
    return [(place, place + 4)], f"number {number} at byte {place}"


def _cut(content: bytearray, place: int, _: Random) -> Spoiled:
    end = len(content)
    del content[place:]
    return [(place, end + 1)], f"cut at byte {place}"


def _remove(content: bytearray, place: int, random: Random) -> Spoiled:
    end, size = len(content), random.choice((1, 4, 50, 1000))
    del content[place : place + size]
    return [(place, end + 1)], f"{size} bytes removed at byte {place}"


def _repeat(content: bytearray, place: int, random: Random) -> Spoiled:
    end, size = len(content), random.choice((1, 4, 50, 1000))
    content[place:place] = content[place : place + size]
    return [(place, end + 1)], f"{size} bytes repeated at byte {place}"


def _swap(content: bytearray, place: int, random: Random) -> Spoiled:
    size, other = random.choice((1, 12, 100)), random.randrange(len(content))
    first, second = sorted((place, other))
    size = max(0, min(size, second - first, len(content) - second))
    one, two = content[first : first + size], content[second : second + size]
    content[first : first + size], content[second : second + size] = two, one
    return [(first, first + size), (second, second + size)], f"{size} bytes swapped at bytes {first} and {second}"


_SPOILERS: tuple[Callable[[bytearray, int, Random], Spoiled], ...] = (
    *(_flip, _flip, _flip, _flip, _fill, _fill, _number, _number),
    *(_cut, _remove, _repeat, _swap),
)


@dataclass
class Indexed:
    """A chunk as it is stored, with its index records and its entry in the chunk table."""

    stored: bytes
    index: list[tuple[int, list[bytes]]]
    counts: list[tuple[int, int]]
    info: bytes
    listed_as: list[int] = field(default_factory=lambda: [0])
    """Where the chunk table says that it is, as a shift; once for each time that it is listed."""


@dataclass
class Ros1:
    """A ROS 1 bag taken apart, to be put together again with every place in it right."""

    chunks: list[Indexed]
    connections: list[tuple[int, bytes, bytes]]
    counts: list[int]
    shift: int = 0

    @classmethod
    def parse(cls, data: bytes) -> Ros1:
        bag = cls([], [], [0, 0])
        position = _record_end(data, 13)
        tables: dict[int, list[tuple[int, int]]] = {}
        places = []
        while position < len(data):
            end, (fields, body) = _record_end(data, position), _record(data, position)
            op = fields[b"op"]
            if op == b"\x05":
                places.append(position)
                bag.chunks.append(Indexed(data[position:end], [], [], b""))
            elif op == b"\x04":
                entries = [body[start : start + 12] for start in range(0, len(body), 12)]
                bag.chunks[-1].index.append((_u4(fields[b"conn"]), entries))
            elif op == b"\x07":
                bag.connections.append((_u4(fields[b"conn"]), fields[b"topic"], body))
            else:
                place = struct.unpack("<Q", fields[b"chunk_pos"])[0]
                tables[place] = list(struct.iter_unpack("<II", body))
                chunk = bag.chunks[places.index(place)]
                chunk.counts, chunk.info = tables[place], fields[b"start_time"] + fields[b"end_time"]
            position = end
        return bag

    def build(self) -> bytes:
        body, places = b"", []
        for chunk in self.chunks:
            places.append(13 + 4096 + len(body))
            body += chunk.stored
            for number, entries in chunk.index:
                fields = {b"op": b"\x04", b"ver": _p4(1), b"conn": _p4(number), b"count": _p4(len(entries))}
                body += _made(fields, b"".join(entries))
        index_position = 13 + 4096 + len(body) + self.shift
        for number, topic, said in self.connections:
            body += _made({b"op": b"\x07", b"conn": _p4(number), b"topic": topic}, said)
        listed = [
            (place + shift, chunk)
            for place, chunk in zip(places, self.chunks, strict=True)
            for shift in chunk.listed_as
        ]
        for place, chunk in listed:
            fields = {
                b"op": b"\x06",
                b"ver": _p4(1),
                b"chunk_pos": struct.pack("<Q", place),
                b"count": _p4(len(chunk.counts)),
            }
            fields |= {b"start_time": chunk.info[:8], b"end_time": chunk.info[8:]}
            body += _made(fields, b"".join(struct.pack("<II", *pair) for pair in chunk.counts))
        header = {b"op": b"\x03", b"index_pos": struct.pack("<Q", max(0, index_position))}
        header |= {b"conn_count": _p4(len(self.connections) + self.counts[0])}
        header |= {b"chunk_count": _p4(len(listed) + self.counts[1])}
        bare = _made(header, b"")
        return b"#ROSBAG V2.0\n" + bare[:-4] + _p4(4096 - len(bare)) + b" " * (4096 - len(bare)) + body


def damage_index(sample: Sample, random: Random) -> Damage:
    """Make the index of a ROS 1 bag lie, all lengths and places in the file being right."""
    bag = Ros1.parse(sample.files[sample.opened])
    lie = random.choice(_LIES)
    lie(bag, random)
    return Damage({sample.opened: bag.build()}, lie.__name__.strip("_").replace("_", " "))


def _some_entries(bag: Ros1, random: Random) -> list[bytes]:
    return random.choice([entries for chunk in bag.chunks for _, entries in chunk.index if entries])


def _entry_left_out(bag: Ros1, random: Random) -> None:
    entries = _some_entries(bag, random)
    del entries[random.randrange(len(entries))]


def _entry_twice(bag: Ros1, random: Random) -> None:
    entries = _some_entries(bag, random)
    entries.append(random.choice(entries))


def _entry_changed(bag: Ros1, random: Random) -> None:
    entries = _some_entries(bag, random)
    number, place = random.randrange(len(entries)), random.choice((0, 4, 8))
    value = random.choice((*NUMBERS, random.randrange(4000)))
    entries[number] = entries[number][:place] + _p4(value) + entries[number][place + 4 :]


def _index_record_left_out(bag: Ros1, random: Random) -> None:
    chunk = random.choice(bag.chunks)
    number, _ = chunk.index.pop(random.randrange(len(chunk.index)))
    if random.random() < 0.7:
        chunk.counts = [pair for pair in chunk.counts if pair[0] != number]


def _index_record_renumbered(bag: Ros1, random: Random) -> None:
    chunk = random.choice(bag.chunks)
    place = random.randrange(len(chunk.index))
    chunk.index[place] = (random.randrange(9), chunk.index[place][1])


def _counts_changed(bag: Ros1, random: Random) -> None:
    chunk = random.choice(bag.chunks)
    place = random.randrange(len(chunk.counts))
    number, count = chunk.counts[place]
    changed = [(number, random.choice((0, count + 1, 2**32 - 1))), (random.randrange(9), count)]
    chunk.counts = [*chunk.counts[:place], random.choice(changed), *chunk.counts[place + 1 :]]


def _chunk_unlisted(bag: Ros1, random: Random) -> None:
    random.choice(bag.chunks).listed_as = []


def _chunk_listed_twice(bag: Ros1, random: Random) -> None:
    random.choice(bag.chunks).listed_as *= 2


def _chunk_listed_elsewhere(bag: Ros1, random: Random) -> None:
    number = random.randrange(len(bag.chunks) - 1)
    size = len(Ros1([bag.chunks[number]], [], [0, 0]).build()) - len(Ros1([], [], [0, 0]).build())
    info = len(_made({b"op": b"\x06", b"ver": _p4(1), b"chunk_pos": bytes(8), b"count": _p4(0)}, b""))
    size -= info + 2 * 12 + len(_p4(0)) * 2 + 2 + 8 * len(bag.chunks[number].counts)
    bag.chunks[number].listed_as = [random.choice((size, 1, -7, 2**40))]


def _chunks_swapped(bag: Ros1, random: Random) -> None:
    one, two = random.sample(range(len(bag.chunks)), 2)
    bag.chunks[one].index, bag.chunks[two].index = bag.chunks[two].index, bag.chunks[one].index


def _chunk_removed(bag: Ros1, random: Random) -> None:
    chunk = random.choice(bag.chunks)
    bag.chunks.remove(chunk)


def _header_counts_changed(bag: Ros1, random: Random) -> None:
    bag.counts[random.randrange(2)] += random.choice((-1, 1, -2, 5))


def _index_position_changed(bag: Ros1, random: Random) -> None:
    bag.shift = random.choice((-8, 1, 100, -3000, len(_made({b"op": b"\x07"}, b"")), 2**40))


def _connection_left_out(bag: Ros1, random: Random) -> None:
    del bag.connections[random.randrange(len(bag.connections))]


def _connections_renumbered(bag: Ros1, random: Random) -> None:
    one, two = random.sample(range(len(bag.connections)), 2)
    first, second = bag.connections[one], bag.connections[two]
    bag.connections[one], bag.connections[two] = (second[0], *first[1:]), (first[0], *second[1:])


def _connection_twice(bag: Ros1, random: Random) -> None:
    one, two = random.sample(range(len(bag.connections)), 2)
    bag.connections[one] = (bag.connections[two][0], *bag.connections[one][1:])


def _definition_changed(bag: Ros1, random: Random) -> None:
    place = random.randrange(len(bag.connections))
    number, topic, said = bag.connections[place]
    words = [(b"float64 x", b"float64 w"), (b"Header header", b"Header hesder"), (b"uint32 ", b"uint16 "), (b"/", b"_")]
    bag.connections[place] = (number, topic, said.replace(*random.choice(words)))


_LIES = (
    *(_entry_left_out, _entry_twice, _entry_changed, _index_record_left_out, _index_record_renumbered),
    *(_counts_changed, _chunk_unlisted, _chunk_listed_twice, _chunk_listed_elsewhere, _chunks_swapped),
    *(_header_counts_changed, _index_position_changed, _connection_left_out, _connections_renumbered),
    *(_connection_twice, _definition_changed),
)


def damage_database(sample: Sample, random: Random, folder: Path) -> Damage:
    """Change rows of a database, its structure being right."""
    (name,) = (each for each in sample.files if each.endswith(".db3"))
    path = folder / "changed.db3"
    path.write_bytes(sample.files[name])
    statement = random.choice(_STATEMENTS).format(row=random.randrange(1, 36), topic=random.randrange(1, 8))
    connection = sqlite3.connect(path)
    connection.executescript(f"PRAGMA synchronous = OFF; {statement}")
    connection.close()
    files = {**sample.files, name: path.read_bytes()}
    path.unlink()
    return Damage(files, statement)


_STATEMENTS = (
    "DELETE FROM messages WHERE id = {row}",
    "DELETE FROM messages WHERE id > {row}",
    "UPDATE messages SET topic_id = {topic} WHERE id = {row}",
    "UPDATE messages SET topic_id = 99 WHERE id = {row}",
    "INSERT INTO messages (topic_id, timestamp, data) SELECT topic_id, timestamp, data FROM messages WHERE id = {row}",
    "UPDATE messages SET data = 'text' WHERE id = {row}",
    "UPDATE messages SET timestamp = 'text' WHERE id = {row}",
    "UPDATE messages SET timestamp = 1.5 WHERE id = {row}",
    "UPDATE messages SET timestamp = -timestamp WHERE id = {row}",
    "UPDATE messages SET data = x'' WHERE id = {row}",
    "UPDATE topics SET name = name || 'x' WHERE id = {topic}",
    "UPDATE topics SET type = 'std_msgs/msg/String' WHERE id = {topic}",
    "UPDATE topics SET offered_qos_profiles = '[' WHERE id = {topic}",
    "UPDATE topics SET id = 50 WHERE id = {topic}",
    "DELETE FROM topics WHERE id = {topic}",
    "DELETE FROM message_definitions WHERE id = {topic}",
    "UPDATE message_definitions SET encoded_message_definition = 'float64 z' WHERE id = {topic}",
    "DROP TABLE message_definitions",
    "DROP INDEX timestamp_idx",
    "UPDATE schema SET schema_version = {topic}",
)


def _u4(value: bytes) -> int:
    number: int = struct.unpack("<I", value)[0]
    return number


def _p4(value: int) -> bytes:
    return struct.pack("<I", value)


def _record_end(data: bytes, position: int) -> int:
    head = position + 4 + _u4(data[position : position + 4])
    return head + 4 + _u4(data[head : head + 4])


def _record(data: bytes, position: int) -> tuple[dict[bytes, bytes], bytes]:
    fields, end = {}, position + 4 + _u4(data[position : position + 4])
    position += 4
    while position < end:
        size = _u4(data[position : position + 4])
        name, _, value = data[position + 4 : position + 4 + size].partition(b"=")
        fields[name] = value
        position += 4 + size
    return fields, data[end + 4 : end + 4 + _u4(data[end : end + 4])]


def _made(fields: dict[bytes, bytes], body: bytes) -> bytes:
    header = b"".join(_p4(len(name) + 1 + len(value)) + name + b"=" + value for name, value in fields.items())
    return _p4(len(header)) + header + _p4(len(body)) + body
