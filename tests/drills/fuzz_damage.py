"""Damage, drawn from a seeded generator: of any bytes, and of the indexes of ROS 1 bags, which lie consistently."""

from __future__ import annotations

import sqlite3
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tests.drills.fuzz_ros1 import LIES, NUMBERS, Ros1

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from random import Random

    from tests.drills.fuzz_bags import Sample

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


def damage_index(sample: Sample, random: Random) -> Damage:
    """Make the index of a ROS 1 bag lie, all lengths and places in the file being right."""
    bag = Ros1.parse(sample.files[sample.opened])
    lie = random.choice(LIES)
    lie(bag, random)
    return Damage({sample.opened: bag.build()}, lie.__name__.strip("_").replace("_", " "))


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
