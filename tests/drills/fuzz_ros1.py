"""A ROS 1 bag taken apart and put together again, its index lying where it is told to."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable
    from random import Random

NUMBERS = (0, 1, 2, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0xFFFFFFF0)


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


LIES: tuple[Callable[[Ros1, Random], None], ...] = (
    *(_entry_left_out, _entry_twice, _entry_changed, _index_record_left_out, _index_record_renumbered),
    *(_counts_changed, _chunk_unlisted, _chunk_listed_twice, _chunk_listed_elsewhere, _chunks_swapped),
    *(_header_counts_changed, _index_position_changed, _connection_left_out, _connections_renumbered),
    *(_connection_twice, _definition_changed),
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
