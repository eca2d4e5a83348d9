"""What a bag says of itself and does not hold is said, in one line that names the place; a sound bag says nothing."""

from __future__ import annotations

import errno
import re
import sqlite3
import struct
from typing import TYPE_CHECKING, Any

import pytest

from garment_dataset.bags import open_bag
from garment_dataset.errors import BagError, SourceError
from tests.drills.fuzz_bags import DEPTH, ROS1, ROS2, Sample, make_sample
from tests.drills.fuzz_ros1 import Ros1

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

SALVAGE = "`garment salvage` writes a bag with a new index."


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Sample]:
    return {kind: make_sample(kind, tmp_path_factory.mktemp("whole")) for kind in (*ROS1, *ROS2)}


def contradictions(path: Path) -> list[str]:
    with open_bag(path) as bag:
        return bag.contradictions()


@pytest.mark.parametrize("kind", [*ROS1, *ROS2])
def test_a_sound_bag_says_nothing(samples: dict[str, Sample], kind: str, tmp_path: Path) -> None:
    assert contradictions(samples[kind].write(tmp_path, samples[kind].files)) == []


def test_real_recordings_say_nothing(real_data: Path) -> None:
    bags = sorted(real_data.glob("*/*.bag"))
    assert bags
    assert {path.name: contradictions(path) for path in bags} == {path.name: [] for path in bags}


@pytest.fixture
def lie(samples: dict[str, Sample], tmp_path: Path) -> Callable[..., list[str]]:
    """Return what a bag of a kind says after its parts were changed."""

    def told(change: Callable[[Ros1], None], kind: str = "none") -> list[str]:
        sample = samples[kind]
        bag = Ros1.parse(sample.files[sample.opened])
        change(bag)
        return contradictions(sample.write(tmp_path, {sample.opened: bag.build()}))

    return told


def depth_entries(bag: Ros1) -> list[bytes]:
    """Return the index of the depth images in the first chunk."""
    number = next(number for number, topic, _ in bag.connections if topic.decode() == DEPTH)
    return next(entries for each, entries in bag.chunks[0].index if each == number)


@pytest.mark.parametrize("kind", ["none", "bz2", "lz4"])
def test_an_index_entry_left_out(lie: Callable[..., list[str]], kind: str) -> None:
    def change(bag: Ros1) -> None:
        depth_entries(bag).pop()

    (text,) = lie(change, kind)
    assert text.startswith(f"its index leaves out 1 messages that are there, 1 of {DEPTH}; first at byte ")
    assert text.endswith(f" of the chunk at byte 4109. {SALVAGE}")


def test_an_index_entry_given_twice(lie: Callable[..., list[str]]) -> None:
    def change(bag: Ros1) -> None:
        entries = depth_entries(bag)
        entries.append(entries[0])

    (text,) = lie(change)
    assert text.startswith(f"its index names 1 messages that are not there, or twice, 1 of {DEPTH}; ")


def test_an_index_record_of_another_connection(lie: Callable[..., list[str]]) -> None:
    def change(bag: Ros1) -> None:
        bag.chunks[1].index[0] = (bag.chunks[1].index[1][0], bag.chunks[1].index[0][1])

    texts = lie(change)
    assert [text.partition(" messages")[0] for text in texts] == ["its index leaves out 1", "its index names 1"]


def test_a_chunk_table_that_miscounts(lie: Callable[..., list[str]]) -> None:
    def change(bag: Ros1) -> None:
        (number, count), *others = bag.chunks[1].counts
        bag.chunks[1].counts = [(number, count + 1), *others]

    (text,) = lie(change)
    assert text.startswith("its chunk table counts other messages than 1 of 6 chunks hold, first that at byte ")


def test_a_chunk_that_is_in_no_table(lie: Callable[..., list[str]]) -> None:
    def change(bag: Ros1) -> None:
        bag.chunks[0].listed_as = []

    text = "1 of 6 chunks are not in its chunk table and are left out, first that at byte 4109"
    assert lie(change) == [f"{text}. {SALVAGE}"]


def test_a_chunk_that_is_in_its_table_twice(lie: Callable[..., list[str]]) -> None:
    def change(bag: Ros1) -> None:
        bag.chunks[0].listed_as *= 2

    twice, named = lie(change)
    assert twice == f"its chunk table names 1 chunks more than once, first that at byte 4109. {SALVAGE}"
    assert named.startswith("its index names ")


def test_a_header_that_announces_fewer_chunks(lie: Callable[..., list[str]]) -> None:
    def change(bag: Ros1) -> None:
        bag.counts[1] = -1

    assert lie(change) == [f"its header announces 5 chunks, its index section has 6. {SALVAGE}"]


def test_connections_that_change_places(lie: Callable[..., list[str]]) -> None:
    def change(bag: Ros1) -> None:
        (one, *first), (two, *second) = bag.connections[:2]
        bag.connections[:2] = [(two, first[0], first[1]), (one, second[0], second[1])]

    texts = lie(change)
    assert [text.partition(":")[0] for text in texts] == [
        "connection 0, /xtion1/depth/camera_info, is described in two ways",
        f"connection 1, {DEPTH}, is described in two ways",
    ]


@pytest.mark.parametrize("kind", ["bz2", "lz4"])
def test_a_flipped_bit_in_a_compressed_chunk(samples: dict[str, Sample], kind: str, tmp_path: Path) -> None:
    """The chunk is lost, said and counted; all others are read."""
    sample = samples[kind]
    content = bytearray(sample.files[sample.opened])
    position = content.index(b"BZh" if kind == "bz2" else b"\x04\x22\x4d\x18")
    for place in range(position + 20, position + struct.unpack_from("<I", content, position - 4)[0], 97):
        spoiled = bytearray(content)
        spoiled[place] ^= 16
        path = sample.write(tmp_path, {sample.opened: bytes(spoiled)})
        with open_bag(path) as bag:
            (text,) = bag.contradictions()
            faults = [image.fault for image in bag.images(DEPTH, "depth")]
        assert " chunks are lost, " in text
        assert re.search("first: chunk at byte 4109: (cannot be inflated|inflates to another size): ", text)
        assert [fault is None for fault in faults] == [False, True, True, True, True]


@pytest.fixture
def storage(samples: dict[str, Sample], tmp_path: Path) -> Callable[..., tuple[Path, Path]]:
    """Write a rosbag2 folder; return it and its storage file."""

    def write(kind: str, name: str = "some") -> tuple[Path, Path]:
        folder = samples[kind].write(tmp_path / name, samples[kind].files)
        return folder, next(each for each in folder.iterdir() if each.suffix != ".yaml")

    return write


def execute(path: Path, statement: str) -> None:
    connection = sqlite3.connect(path)
    connection.executescript(statement)
    connection.close()


def test_rows_that_are_missing(storage: Callable[..., tuple[Path, Path]]) -> None:
    folder, file = storage("sqlite3")
    execute(file, "DELETE FROM messages WHERE id = 1")
    assert contradictions(folder) == [
        f"{DEPTH}: 4 messages are there, 5 in metadata.yaml",
        "34 messages are there, 35 in metadata.yaml",
        "some.db3: 34 messages are there, 35 in metadata.yaml",
    ]
    execute(file, "UPDATE messages SET topic_id = 99 WHERE id = 8")
    assert "some.db3: 1 messages belong to no topic and are left out" in contradictions(folder)


def test_a_topic_that_metadata_do_not_know(storage: Callable[..., tuple[Path, Path]]) -> None:
    folder, file = storage("sqlite3")
    execute(file, "UPDATE topics SET name = '/other' WHERE name = '/tf'")
    assert "some.db3: 5 messages of /other (tf2_msgs/msg/TFMessage) are left out" in contradictions(folder)[0]


def test_a_file_of_another_recording(storage: Callable[..., tuple[Path, Path]]) -> None:
    folder, file = storage("sqlite3")
    execute(file, "UPDATE messages SET timestamp = timestamp + 86400000000000")
    (text,) = contradictions(folder)
    assert text.startswith("its messages begin +86400.000 s and end +86400.000 s off what metadata.yaml says")
    (folder / "some_1.db3").write_bytes(file.read_bytes())
    (folder / "notes.txt").touch()
    assert "metadata.yaml does not list some_1.db3, which is left out" in contradictions(folder)


def test_messages_that_a_killed_recorder_left_in_the_log(storage: Callable[..., tuple[Path, Path]]) -> None:
    folder, file = storage("sqlite3")
    file.with_name("some.db3-wal").write_bytes(b"log")
    assert contradictions(folder)[0].startswith("some.db3: messages in some.db3-wal are left out")


def test_a_damaged_database_is_refused(storage: Callable[..., tuple[Path, Path]]) -> None:
    folder, file = storage("sqlite3")
    whole = file.read_bytes()
    file.write_bytes(whole[:-30])
    with pytest.raises(BagError, match=r"some.db3: its database is cut: expected \d+ pages of 4096 bytes, found"):
        contradictions(folder)
    stamp = struct.pack(">Q", 1_391_700_000_020_000_000)
    place = whole.index(stamp)
    file.write_bytes(whole[:place] + struct.pack(">Q", 1_391_700_000_020_000_001) + whole[place + 8 :])
    with pytest.raises(BagError, match=r"some.db3: its database is damaged: found .*timestamp_idx"):
        contradictions(folder)


def changed(file: Path, op: int, shift: int, form: str, value: int) -> None:
    """Overwrite a number in the first record of a kind in an mcap file."""
    content, position = bytearray(file.read_bytes()), 8
    while content[position] != op:
        position += 9 + struct.unpack_from("<Q", content, position + 1)[0]
    struct.pack_into(form, content, position + 9 + shift, value)
    file.write_bytes(content)


@pytest.mark.parametrize(
    ("op", "shift", "form", "value", "text"),
    [
        (7, 0, "<H", 2, "the index of 1 chunks names other messages than they hold"),
        (
            8,
            0,
            "<Q",
            1,
            "its summary describes 1 chunks otherwise than they are, first that at byte ",
        ),
        (8, 16, "<Q", 9, "its summary names 1 chunks that are not there, first at byte 9"),
        (8, 36, "<H", 77, "its summary names other index records than 1 chunks have"),
        (11, 46 + 2, "<Q", 4, "5 messages are there, 4 in its statistics"),
        (4, 2, "<H", 5, "channel 1 is described in two ways: /xtion1/depth/image_raw"),
        (6, 0, "<Q", 2**62, "35 messages have stamps outside of those of their chunk"),
    ],
)
def test_an_mcap_file_whose_indexes_and_chunks_differ(
    storage: Callable[..., tuple[Path, Path]], op: int, shift: int, form: str, value: int, text: str
) -> None:
    folder, file = storage("mcap")
    changed(file, op, shift, form, value)
    assert any(text in each for each in contradictions(folder)), contradictions(folder)


@pytest.mark.parametrize("kind", ["mcap with checksums", "mcap zstd with checksums"])
def test_a_flipped_bit_in_an_mcap_chunk_refuses_the_file(storage: Callable[..., tuple[Path, Path]], kind: str) -> None:
    folder, file = storage(kind)
    content = bytearray(file.read_bytes())
    content[5000] ^= 1
    file.write_bytes(content)
    with pytest.raises(BagError, match=r"some: its storage is damaged: found chunk at byte \d+: (wrong|cannot)"):
        contradictions(folder)


@pytest.mark.parametrize("kind", ["none", "mcap"])
@pytest.mark.parametrize("error", [PermissionError(errno.EACCES, "Permission denied"), MemoryError()])
def test_what_the_machine_cannot_read_is_no_damage(
    samples: dict[str, Sample], kind: str, error: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = samples[kind].write(tmp_path, samples[kind].files)

    def fail(*_: Any, **__: Any) -> None:
        raise error

    monkeypatch.setattr("mmap.mmap", fail)
    with pytest.raises(SourceError, match=r"cannot be read: found (Permission denied|not enough memory)"):
        open_bag(path)
