"""rosbag2 recordings through the same interface."""

from __future__ import annotations

import sqlite3
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from ruamel.yaml import YAML

from garment_dataset.bags import Topic, open_bag
from garment_dataset.errors import BagError, DataWarning

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    WriteBag = Callable[..., Path]

IMAGE, STRING, TF = "sensor_msgs/msg/Image", "std_msgs/msg/String", "tf2_msgs/msg/TFMessage"
START_NS = 1_391_700_000_000_000_000
STORAGES = ["sqlite3", "mcap"]
SUFFIX = {"sqlite3": ".db3", "mcap": ".mcap"}


def depth_message(ros2: Any, number: int, **change: Any) -> bytes:
    data = np.full(6, number, "<u2").tobytes()
    parts = {"encoding": "16UC1", "width_px": 3, "height_px": 2, "step_bytes": 6, "stamp_ns": START_NS + number}
    message: bytes = ros2.image(data, **{**parts, **change})
    return message


def entries(ros2: Any, first: int = 0) -> list[tuple[str, str, int, bytes]]:
    start_ns = START_NS + first
    images = [("/depth", IMAGE, start_ns + 2 * n, depth_message(ros2, n)) for n in range(4)]
    images[1] = ("/depth", IMAGE, start_ns + 2, depth_message(ros2, 1, encoding="8UC7"))
    return [*images, ("/tf", TF, start_ns + 1, ros2.transforms("a")), ("/tf", TF, start_ns + 3, ros2.transforms("b"))]


def check(path: Path) -> None:
    with open_bag(path) as bag:
        assert list(bag.topics.values()) == [Topic("/depth", (IMAGE,), 4), Topic("/tf", (TF,), 2)]
        images = list(bag.images("/depth", "depth"))
        assert [message.index for message in images] == [0, 1, 2, 3]
        assert [message.record_stamp_ns for message in images] == [START_NS + 2 * n for n in range(4)]
        assert [message.stamp_ns for message in images] == [START_NS + n for n in range(4)]
        assert [message.fault is None for message in images] == [True, False, True, True]
        for number in (0, 2, 3):
            pixels = images[number].pixels()
            np.testing.assert_array_equal(pixels, np.full((2, 3), number, np.uint16))
            assert not pixels.flags.writeable
            assert not pixels.flags.owndata
            assert images[number].offset_bytes is None
        children = [message.data.transforms[0].child_frame_id for message in bag.messages("/tf")]
        assert children == ["a", "b"]
        both = [(message.topic, message.index) for message in bag.messages("/tf", "/depth")]
        assert both == [("/depth", 0), ("/tf", 0), ("/depth", 1), ("/tf", 1), ("/depth", 2), ("/depth", 3)]
        assert not list(bag.messages())


@pytest.mark.parametrize("compression", ["none", "message", "file"])
@pytest.mark.parametrize("storage", STORAGES)
def test_a_folder_gives_what_was_recorded(ros2: Any, write_rosbag2: WriteBag, storage: str, compression: str) -> None:
    check(write_rosbag2(entries(ros2), storage, compression))


@pytest.mark.parametrize("storage", STORAGES)
def test_a_storage_file_of_a_folder_gives_the_same(ros2: Any, write_rosbag2: WriteBag, storage: str) -> None:
    (path,) = write_rosbag2(entries(ros2), storage).glob(f"*{SUFFIX[storage]}")
    check(path)


@pytest.mark.parametrize("storage", STORAGES)
def test_files_of_a_split_recording_are_read_in_the_order_of_their_stamps(
    ros2: Any, write_rosbag2: WriteBag, storage: str
) -> None:
    folder, later = (write_rosbag2(entries(ros2, first), storage) for first in (0, 10))
    (one,), (two,) = (each.glob(f"*{SUFFIX[storage]}") for each in (folder, later))
    second = two.rename(folder / f"some_1{SUFFIX[storage]}")
    yaml = YAML(typ="safe")
    said = yaml.load((folder / "metadata.yaml").read_text("utf-8"))["rosbag2_bagfile_information"]
    said["relative_file_paths"] = [second.name, one.name]
    said["message_count"] *= 2
    for topic in said["topics_with_message_count"]:
        topic["message_count"] *= 2
    said["files"] = [{**said["files"][0], "path": name} for name in said["relative_file_paths"]]
    with (folder / "metadata.yaml").open("w", encoding="utf-8") as file:
        yaml.dump({"rosbag2_bagfile_information": said}, file)
    with open_bag(folder) as bag:
        stamps = [message.record_stamp_ns - START_NS for message in bag.images("/depth", "depth")]
        assert stamps == [0, 2, 4, 6, 10, 12, 14, 16]
        assert bag.contradictions() == []


@pytest.mark.parametrize("name", ["what?", "50%", "#1", "a b&c=d", "%41"])
@pytest.mark.parametrize("storage", STORAGES)
def test_a_folder_or_file_of_any_name_is_read(
    ros2: Any, write_rosbag2: WriteBag, storage: str, name: str, tmp_path: Path
) -> None:
    folder = write_rosbag2(entries(ros2), storage).rename(tmp_path / name)
    check(folder)
    file = next(folder.glob(f"*{SUFFIX[storage]}"))
    check(file.rename(tmp_path / f"{name}{SUFFIX[storage]}"))


@pytest.mark.parametrize("storage", STORAGES)
def test_metadata_without_a_storage_identifier_are_completed(ros2: Any, write_rosbag2: WriteBag, storage: str) -> None:
    """`ros2 bag reindex` has written such."""
    folder = write_rosbag2(entries(ros2), storage)
    metadata = folder / "metadata.yaml"
    text = metadata.read_text()
    metadata.write_text(text.replace(f"storage_identifier: {storage}", "storage_identifier: ''"))
    assert metadata.read_text() != text
    check(folder)
    with open_bag(folder) as bag:
        assert bag.contradictions() == []


def test_files_that_name_no_storage_are_refused(ros2: Any, write_rosbag2: WriteBag) -> None:
    folder = write_rosbag2(entries(ros2), "sqlite3")
    metadata = folder / "metadata.yaml"
    text = metadata.read_text().replace("storage_identifier: sqlite3", "storage_identifier: ''")
    metadata.write_text(text.replace(".db3", ".dat"))
    next(folder.glob("*.db3")).rename(next(folder.glob("*.db3")).with_suffix(".dat"))
    with pytest.raises(BagError, match="Storage plugin '' not supported"):
        open_bag(folder)


def test_a_topic_in_another_serialisation_is_left_out_with_a_word(ros2: Any, write_rosbag2: WriteBag) -> None:
    strange = ("/notes", STRING, START_NS, b"\0\1\0\0\0\0\0\0")
    folder = write_rosbag2([*entries(ros2), strange], "sqlite3")
    yaml, metadata = YAML(typ="safe"), folder / "metadata.yaml"
    said = yaml.load(metadata.read_text())
    for topic in said["rosbag2_bagfile_information"]["topics_with_message_count"]:
        if topic["topic_metadata"]["name"] == "/notes":
            topic["topic_metadata"]["serialization_format"] = "json"
    with metadata.open("w") as file:
        yaml.dump(said, file)
    check(folder)
    with open_bag(folder) as bag:
        assert any("1 messages of /notes" in text and "left out" in text for text in bag.contradictions())


@pytest.mark.parametrize("storage", STORAGES)
def test_an_unreadable_message_is_left_out_with_a_warning(ros2: Any, write_rosbag2: WriteBag, storage: str) -> None:
    words = [ros2.serialise(STRING, word) for word in ("one", "two")]
    spoiled = words[0][:4] + b"\xff\xff\xff\x7f" + words[0][8:]
    path = write_rosbag2([("/a", STRING, START_NS + n, data) for n, data in enumerate([spoiled, words[1]])], storage)
    with open_bag(path) as bag, pytest.warns(DataWarning, match=r"left out 1 of 2 messages: 0 \(cannot be read"):
        assert [(message.index, message.data.data) for message in bag.messages("/a")] == [(1, "two")]


def test_old_storage_without_definitions_is_read_by_those_of_humble(ros2: Any, write_rosbag2: WriteBag) -> None:
    folder = write_rosbag2(entries(ros2), "sqlite3")
    (path,) = folder.glob("*.db3")
    connection = sqlite3.connect(path)
    connection.execute("UPDATE schema SET schema_version = 3")
    connection.execute("DROP TABLE message_definitions")
    connection.commit()
    connection.close()
    check(folder)


def test_a_folder_without_metadata_is_refused_with_a_hint(ros2: Any, write_rosbag2: WriteBag) -> None:
    path = write_rosbag2(entries(ros2), "mcap")
    (path / "metadata.yaml").unlink()
    with pytest.raises(BagError, match=r"some: is not a rosbag2 folder: expected metadata.yaml in it\. Run `ros2 bag"):
        open_bag(path)


@pytest.mark.parametrize("content", [b"", b"hello", b"rosbag2_bagfile_information: 3", b"a: [", b"\xff\xfe"])
def test_metadata_that_cannot_be_read_are_refused(ros2: Any, write_rosbag2: WriteBag, content: bytes) -> None:
    path = write_rosbag2(entries(ros2), "mcap")
    (path / "metadata.yaml").write_bytes(content)
    with pytest.raises(BagError, match="cannot be opened: found ") as error:
        open_bag(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("size", [0, 5, 200])
def test_truncated_storage_is_refused(ros2: Any, write_rosbag2: WriteBag, storage: str, size: int) -> None:
    (path,) = write_rosbag2(entries(ros2), storage).glob(f"*{SUFFIX[storage]}")
    path.write_bytes(path.read_bytes()[:size])
    for where in (path, path.parent):
        with pytest.raises(BagError, match="cannot be opened"):
            open_bag(where)


def test_damage_in_storage_ends_the_reading_with_an_error(ros2: Any, write_rosbag2: WriteBag) -> None:
    path = write_rosbag2(entries(ros2), "mcap", "storage")
    (file,) = path.glob("*.mcap")
    content = bytearray(file.read_bytes())
    start = content.index(b"\x28\xb5\x2f\xfd")  # a zstd frame
    content[start + 8 : start + 40] = b"\xff" * 32
    file.write_bytes(content)
    with open_bag(path) as bag, pytest.raises(BagError, match="cannot be read to its end"):
        list(bag.images("/depth", "depth"))


@pytest.mark.parametrize("storage", STORAGES)
def test_a_recording_that_changes_while_it_is_read_is_reported(
    ros2: Any, write_rosbag2: WriteBag, storage: str
) -> None:
    path = write_rosbag2(entries(ros2), storage)
    with pytest.raises(BagError, match="changed while it was read"), open_bag(path):
        (path / "metadata.yaml").write_text("")


@pytest.mark.parametrize("storage", STORAGES)
def test_a_closed_recording_is_not_read(ros2: Any, write_rosbag2: WriteBag, storage: str) -> None:
    with open_bag(write_rosbag2(entries(ros2), storage)) as bag:
        (first, *_) = bag.images("/depth", "depth")
        pixels = first.pixels()
    assert np.all(pixels == 0)
    with pytest.raises(BagError, match="is closed"):
        next(bag.images("/depth", "depth"))
