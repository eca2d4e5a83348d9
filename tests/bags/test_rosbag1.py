"""ROS 1 bags: every message comes back, damage stays where it is, and pixels are never copied."""

from __future__ import annotations

import io
import itertools
import os
import struct
import warnings
from collections import Counter
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from rosbags.rosbag1 import Writer

from garment_dataset.bags import Topic, open_bag, rosbag1_chunks
from garment_dataset.bags.inflation import inflate
from garment_dataset.bags.rosbag1_scan import scan_bag
from garment_dataset.bags.rosbag1_writer import BagWriter
from garment_dataset.errors import BagError, DataWarning, GarmentError, MessageError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    WriteBag = Callable[..., Path]
    Pixels = np.ndarray[Any, Any]

IMAGE = "sensor_msgs/msg/Image"
STRING = "std_msgs/msg/String"
TF, TF_OLD = "tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"
START_NS = 1_391_700_000_000_000_000
COMPRESSIONS = ["none", "lz4", "bz2"]
RAW: dict[str, np.dtype[Any]] = {
    "16UC1": np.dtype("u2"),
    "mono16": np.dtype("u2"),
    "32FC1": np.dtype("f4"),
    "rgb8": np.dtype("u1"),
    "bgr8": np.dtype("u1"),
    "rgba8": np.dtype("u1"),
    "bgra8": np.dtype("u1"),
    "mono8": np.dtype("u1"),
}


def text(words: str) -> bytes:
    return struct.pack("<I", len(words)) + words.encode()


def depth_message(ros1: Any, number: int, **change: Any) -> bytes:
    """Return an image of 3x2 pixels that all have the value ``number``."""
    data = np.full(6, number, "<u2").tobytes()
    parts = {"encoding": "16UC1", "width_px": 3, "height_px": 2, "step_bytes": 6, "stamp_ns": START_NS + number}
    message: bytes = ros1.image(data, **{**parts, **change})
    return message


def encoded(canonical: Pixels, encoding: str) -> Pixels:
    """Return the rows that a camera of this encoding would publish."""
    if encoding == "32FC1":
        return np.where(canonical == 0, np.nan, canonical / 1000)
    if encoding == "mono8":
        return canonical[..., 0]
    ordered = canonical[..., ::-1] if encoding.startswith("bgr") else canonical
    return np.insert(ordered, 3, 77, axis=-1) if encoding.endswith("a8") else ordered


@st.composite
def streams(draw: st.DrawFn) -> tuple[str, bool, int, list[Pixels]]:
    """Draw an encoding, a byte order, a padding and some canonical images of one size."""
    encoding = draw(st.sampled_from(sorted(RAW)))
    shape = (draw(st.integers(1, 5)), draw(st.integers(1, 7)))
    if RAW[encoding].itemsize > 1:
        images = hnp.arrays(np.uint16, shape, elements=st.integers(0, 65534))  # 65535 is no return
    else:
        images = hnp.arrays(np.uint8, (*shape, 3))
        if encoding == "mono8":
            images = images.map(lambda image: np.repeat(image[..., :1], 3, axis=-1))
    return encoding, draw(st.booleans()), draw(st.integers(0, 3)), draw(st.lists(images, min_size=1, max_size=4))


@settings(max_examples=60, deadline=None)
@given(stream=streams(), compression=st.sampled_from(COMPRESSIONS), chunk_bytes=st.sampled_from([1, 10**6]))
def test_images_survive_any_encoding_and_compression(
    ros1: Any, write_bag: WriteBag, stream: Any, compression: str, chunk_bytes: int
) -> None:
    encoding, big_endian, padding_bytes, images = stream
    messages = []
    for canonical in images:
        stored = encoded(canonical, encoding).astype(RAW[encoding].newbyteorder(">" if big_endian else "<"))
        rows = b"".join(row.tobytes() + bytes(padding_bytes) for row in stored)
        height, width = canonical.shape[:2]
        step = len(rows) // height
        messages.append(
            ros1.image(
                rows, encoding=encoding, width_px=width, height_px=height, step_bytes=step, big_endian=big_endian
            )
        )
    entries = [("/image", IMAGE, START_NS + index, message) for index, message in enumerate(messages)]
    with open_bag(write_bag(entries, compression, chunk_bytes)) as bag:
        found = list(bag.images("/image", "depth" if images[0].dtype == np.uint16 else "color"))
        assert [message.index for message in found] == list(range(len(images)))
        for message, canonical in zip(found, images, strict=True):
            assert message.fault is None
            np.testing.assert_array_equal(message.pixels(), canonical)


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_an_image_message_says_what_was_recorded(ros1: Any, write_bag: WriteBag, compression: str) -> None:
    path = write_bag([("/depth", IMAGE, START_NS + 5, depth_message(ros1, 1070))], compression)
    with open_bag(path) as bag:
        (message,) = bag.images("/depth", "depth")
        assert (message.index, message.record_stamp_ns, message.stamp_ns) == (0, START_NS + 5, START_NS + 1070)
        assert (message.frame_id, message.encoding) == ("optical", "16UC1")
        assert (message.width_px, message.height_px, message.step_bytes, message.size_bytes) == (3, 2, 6, 12)
        if compression == "none":
            assert message.offset_bytes is not None
            assert path.read_bytes()[message.offset_bytes :][:12] == message.pixels().tobytes()
        else:
            assert message.offset_bytes is None


def test_plain_pixels_are_views_of_the_file(ros1: Any, write_bag: WriteBag) -> None:
    with open_bag(write_bag([("/depth", IMAGE, START_NS, depth_message(ros1, 1))])) as bag:
        (message,) = bag.images("/depth", "depth")
        pixels = message.pixels()
        assert not pixels.flags.owndata
        assert not pixels.flags.writeable
        assert pixels.base is not None
        assert np.shares_memory(pixels, message.pixels())
        with pytest.raises(MessageError, match="faulty image"):
            next(bag.images("/depth", "color")).pixels()


def test_pixels_outlive_the_bag_but_cannot_be_asked_for_after_it(ros1: Any, write_bag: WriteBag) -> None:
    with open_bag(write_bag([("/depth", IMAGE, START_NS, depth_message(ros1, 7))])) as bag:
        (message,) = bag.images("/depth", "depth")
        pixels = message.pixels()
    assert np.all(pixels == 7)
    with pytest.raises(BagError, match="is closed"):
        message.pixels()
    with pytest.raises(BagError, match="is closed"):
        next(bag.images("/depth", "depth"))
    with pytest.raises(BagError, match="is closed"):
        next(bag.messages("/depth"))
    bag.close()  # once more is no error


@pytest.mark.parametrize("compression", ["lz4", "bz2"])
def test_a_chunk_is_inflated_once(
    ros1: Any, write_bag: WriteBag, compression: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    entries = [(topic, IMAGE, START_NS + n, depth_message(ros1, n)) for n in range(6) for topic in ("/a", "/b")]
    calls = Counter[bytes]()

    def counted(name: str, data: memoryview, size_bytes: int) -> bytes:
        calls[bytes(data)] += 1
        return inflate(name, data, size_bytes)

    monkeypatch.setattr(rosbag1_chunks, "inflate", counted)
    with open_bag(write_bag(entries, compression)) as bag:
        for topic in ("/a", "/b", "/a"):
            assert [message.pixels()[0, 0] for message in bag.images(topic, "depth")] == list(range(6))
    assert set(calls.values()) == {1}
    assert len(calls) == 12


def inflations(path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[int, list[int]]:
    """Open a bag and read its images: how many chunks are inflated for it, and a pixel of each image."""
    count = Counter[str]()

    def counted(name: str, data: memoryview, size_bytes: int) -> bytes:
        count[name] += 1
        return inflate(name, data, size_bytes)

    with monkeypatch.context() as patched, open_bag(path) as bag:
        patched.setattr(rosbag1_chunks, "inflate", counted)
        assert bag.contradictions() == []
        pixels = [int(message.pixels()[0, 0]) for message in bag.images("/depth", "depth")]
    return count.total(), pixels


@pytest.mark.parametrize("compression", ["lz4", "bz2"])
def test_the_same_bag_is_not_inflated_again(
    ros1: Any, write_bag: WriteBag, compression: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, other = (
        write_bag([("/depth", IMAGE, START_NS + n, depth_message(ros1, n + more)) for n in range(20)], compression)
        for more in (0, 100)
    )
    for path in (one, other):
        os.utime(path, (10**9, 10**9))
    assert inflations(one, monkeypatch) == (20, list(range(20)))
    assert inflations(one, monkeypatch) == (0, list(range(20)))
    assert inflations(other, monkeypatch) == (20, list(range(100, 120)))
    assert inflations(one, monkeypatch)[0] == 20  # only the last is kept


def test_a_bag_that_has_changed_is_inflated_again(
    ros1: Any, write_bag: WriteBag, monkeypatch: pytest.MonkeyPatch
) -> None:
    bags = {
        value: write_bag([("/depth", IMAGE, START_NS, depth_message(ros1, value))], "lz4").read_bytes()
        for value in range(1, 9)
    }
    alike = Counter(map(len, bags.values())).most_common(1)[0][0]
    one, other = [value for value, content in bags.items() if len(content) == alike][:2]
    path = write_bag([("/depth", IMAGE, START_NS, depth_message(ros1, 1))], "lz4")
    for changed_s, value in ((10**9, one), (10**9 + 1, other), (10**9, one)):
        path.write_bytes(bags[value])
        os.utime(path, (changed_s, changed_s))
        assert inflations(path, monkeypatch) == (1, [value])


def test_of_a_bag_that_has_just_changed_nothing_is_kept(
    ros1: Any, write_bag: WriteBag, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_bag([("/depth", IMAGE, START_NS, depth_message(ros1, 1))], "lz4")
    assert [inflations(path, monkeypatch)[0] for _ in range(2)] == [1, 1]


def test_messages_come_by_record_stamp_then_by_place(write_bag: WriteBag) -> None:
    stamps = [START_NS + shift for shift in (5, 3, 3, 9, 0, 3)]
    entries = [("/ab"[: 1 + n % 2 + 1], STRING, stamp, text(str(n))) for n, stamp in enumerate(stamps)]
    with open_bag(write_bag(entries)) as bag:
        found = [(message.data.data, message.record_stamp_ns, message.topic) for message in bag.messages("/a", "/ab")]
        order = sorted(range(len(stamps)), key=lambda n: (stamps[n], n))
        assert found == [(str(n), stamps[n], entries[n][0]) for n in order]
        assert [message.index for message in bag.messages("/a")] == [0, 1, 2]


def test_topics_tell_types_and_counts(ros1: Any, write_bag: WriteBag) -> None:
    entries = [
        ("/tf", TF, START_NS, ros1.transforms("a")),
        ("/tf", TF_OLD, START_NS + 1, ros1.transforms("b", TF_OLD)),
        ("/a", STRING, START_NS + 2, text("")),
        ("/tf", TF, START_NS + 3, ros1.transforms("c")),
    ]
    with open_bag(write_bag(entries)) as bag:
        assert list(bag.topics.items()) == [("/a", Topic("/a", (STRING,), 1)), ("/tf", Topic("/tf", (TF_OLD, TF), 3))]
        found = [(message.type, message.data.transforms[0].child_frame_id) for message in bag.messages("/tf")]
        assert found == [(TF, "a"), (TF_OLD, "b"), (TF, "c")]
        assert not list(bag.messages())
        assert not list(bag.messages("/none"))


def test_the_image_topic_is_the_plain_one_or_a_compressed_form(ros1: Any, write_bag: WriteBag) -> None:
    compressed = ros1.compressed(b"", "png")
    entries = [
        ("/a", IMAGE, START_NS, depth_message(ros1, 0)),
        ("/a/compressed", "sensor_msgs/msg/CompressedImage", START_NS, compressed),
        ("/b/compressed", "sensor_msgs/msg/CompressedImage", START_NS, compressed),
        ("/b/compressedDepth", "sensor_msgs/msg/CompressedImage", START_NS, compressed),
        ("/c/compressed", "sensor_msgs/msg/CompressedImage", START_NS, compressed),
    ]
    with open_bag(write_bag(entries)) as bag:
        found = [bag.image_topic(base) for base in ("/a", "/b", "/c", "/d")]
        assert found == ["/a", "/b/compressedDepth", "/c/compressed", None]
        with pytest.raises(BagError, match=r"no such topic: expected /d, found /a, /a/compressed, "):
            bag.images("/d", "depth")


def test_a_faulty_image_is_counted_and_the_rest_is_used(ros1: Any, write_bag: WriteBag) -> None:
    good = [depth_message(ros1, number) for number in range(4)]
    spoiled = [good[0], depth_message(ros1, 1, encoding="16UC9"), good[2][:-1], depth_message(ros1, 3, step_bytes=4)]
    entries = [("/depth", IMAGE, START_NS + n, message) for n, message in enumerate([*spoiled, good[3]])]
    with open_bag(write_bag(entries)) as bag:
        found = list(bag.images("/depth", "depth"))
        assert [message.fault is None for message in found] == [True, False, False, False, True]
        assert [message.stamp_ns for message in found] == [START_NS + n for n in (0, 1, 2, 3, 3)]
        assert np.all(found[4].pixels() == 3)
        with pytest.raises(MessageError, match=r"message 1: faulty image: found encoding: expected .*, found '16UC9'"):
            found[1].pixels()
        assert found[2].fault == "data: expected 12 bytes, found 11 bytes before the end of the message"


def test_an_unreadable_message_is_left_out_with_a_warning(write_bag: WriteBag) -> None:
    entries = [("/a", STRING, START_NS + n, text("word")) for n in range(3)]
    entries[1] = ("/a", STRING, START_NS + 1, struct.pack("<I", 99) + b"word")
    path = write_bag(entries)
    with open_bag(path) as bag:
        with pytest.warns(
            DataWarning, match=r"some.bag: /a: left out 1 of 3 messages: 1 \(cannot be read: found"
        ) as caught:
            found = list(bag.messages("/a"))
        assert [message.index for message in found] == [0, 2]
    assert len(caught) == 1


def test_each_publisher_is_read_by_its_own_definition(forge_bag: WriteBag) -> None:
    publishers = (
        ("/a", "demo/Sample", "int32 value"),
        ("/a", "demo/Sample", "string value"),
        ("/b", "demo/Other", "this is no definition"),
    )
    messages = [(0, START_NS, struct.pack("<i", -5)), (1, START_NS + 1, text("five")), (2, START_NS + 2, b"")]
    with open_bag(forge_bag(messages, publishers=publishers)) as bag:
        assert [message.data.value for message in bag.messages("/a")] == [-5, "five"]
        with pytest.warns(DataWarning, match="/b: left out 1 of 1 messages"):
            assert not list(bag.messages("/b"))


@pytest.mark.parametrize("damage", [("float64 x", "float64 w"), ("float64 x", "int64 x"), ("float64 x\n", "")])
def test_a_definition_that_lost_a_field_of_the_common_one_is_not_used(
    ros1: Any, forge_bag: WriteBag, damage: tuple[str, str]
) -> None:
    common, _ = ros1.store.generate_msgdef("geometry_msgs/msg/Point")
    point = struct.pack("<3d", 1, 2, 3)
    publishers = [("/a", "geometry_msgs/Point", text) for text in (common, f"{common}\nuint8[] more", "")]
    publishers[2] = ("/b", "geometry_msgs/Point", common.replace(*damage))
    messages = [(0, START_NS, point), (1, START_NS + 1, point + bytes(4)), (2, START_NS + 2, point)]
    with open_bag(forge_bag(messages, publishers=tuple(publishers))) as bag:
        assert [message.data.x for message in bag.messages("/a")] == [1, 1]
        with pytest.warns(DataWarning, match="left out 1 of 1 .*definition of geometry_msgs/msg/Point lacks fields"):
            assert not list(bag.messages("/b"))


def test_an_index_may_point_to_the_connection_before_a_message(forge_bag: WriteBag) -> None:
    messages = [(0, START_NS + n, text(str(n))) for n in range(3)]
    with open_bag(forge_bag(messages, connection_first=True)) as bag:
        assert [message.data.data for message in bag.messages("/text")] == ["0", "1", "2"]


@pytest.mark.parametrize(
    ("forgery", "fault"),
    [
        ({"message_op": b"\x05"}, r"record at byte 0: expected op, conn, time \(b'\\x02', .* found \(b'\\x05'"),
        ({"message_connection": 3}, r"record at byte 0: expected op, conn, time"),
        ({"message_stamp_ns": START_NS + 10**9}, r"record at byte 0: expected op, conn, time"),
        ({"offset_shift": 10**6}, r"record at byte 1000000: found .* record does not fit: found -\d+ bytes left"),
        ({"offset_shift": 2}, r"record at byte 2: found byte 2: record does not fit: found \d+ bytes of header"),
    ],
)
def test_an_index_that_misleads_costs_the_messages_it_misleads_to(
    forge_bag: WriteBag, forgery: dict[str, Any], fault: str
) -> None:
    path = forge_bag([(0, START_NS, text("a"))], publishers=(("/a", "sensor_msgs/Image", ""),), **forgery)
    with open_bag(path) as bag:
        (message,) = bag.images("/a", "depth")
        assert message.record_stamp_ns == START_NS
        assert message.stamp_ns is None
        with pytest.raises(MessageError, match=fault):
            message.pixels()
        with pytest.warns(DataWarning, match="left out 1 of 1"):
            assert not list(bag.messages("/a"))


@pytest.mark.parametrize("compression", ["lz4", "bz2"])
def test_a_lost_chunk_costs_only_its_own_messages(ros1: Any, write_bag: WriteBag, compression: str) -> None:
    path = write_bag([("/depth", IMAGE, START_NS + n, depth_message(ros1, n)) for n in range(3)], compression)
    content = bytearray(path.read_bytes())
    second = content.index(b"compression=", content.index(b"compression=") + 1)
    start = content.index(b"\x04\x22\x4d\x18" if compression == "lz4" else b"BZh", second)
    content[start + 4 : start + 40] = b"\xff" * 36
    path.write_bytes(content)
    with open_bag(path) as bag:
        found = list(bag.images("/depth", "depth"))
        assert [message.fault is None for message in found] == [True, False, True]
        assert found[1].fault is not None
        assert found[1].fault.startswith("chunk at byte ")
        assert ": cannot be inflated: found " in found[1].fault
        assert np.all(found[2].pixels() == 2)


@pytest.mark.parametrize(("claim", "fault"), [(2**31, "too large to inflate"), (5, "inflates to another size")])
def test_a_chunk_that_lies_about_its_size_is_lost(ros1: Any, write_bag: WriteBag, claim: int, fault: str) -> None:
    path = write_bag([("/depth", IMAGE, START_NS, depth_message(ros1, 1))], "lz4")
    content = path.read_bytes()
    place = content.index(b"size=", content.index(b"compression=")) + 5
    path.write_bytes(content[:place] + struct.pack("<I", claim) + content[place + 4 :])
    with open_bag(path) as bag:
        (message,) = bag.images("/depth", "depth")
        assert message.fault is not None
        assert fault in message.fault


def test_no_room_to_inflate_is_an_error_with_a_hint(
    ros1: Any, write_bag: WriteBag, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tempfile.TemporaryFile", full)
    path = write_bag([("/depth", IMAGE, START_NS, depth_message(ros1, 1))], "lz4")
    with open_bag(path) as bag, pytest.raises(BagError, match=r"no room to inflate a chunk.*TMPDIR"):
        next(bag.images("/depth", "depth"))


def one_line(error: pytest.ExceptionInfo[BagError], path: Path) -> str:
    line = str(error.value)
    assert "\n" not in line
    assert line.startswith(f"{path}: ")
    return line


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.bag", b"", "is empty"),
        ("a.bag", b"hello", "is not a ROS 1 bag: expected b'#ROSBAG V2.0\\n', found b'hello'"),
        ("a.bag", b"#ROSBAG V1.2\n" + bytes(100), "is not a ROS 1 bag"),
        ("a.bag", b"#ROSBAG V2.0\n", "its index cannot be read"),
        ("a.bag", b"#ROSBAG V2.0\n" + b"\xff" * 5000, "its index cannot be read"),
        ("a.bag.active", b"#ROSBAG V2.0\n", "recording was not finished"),
    ],
)
def test_what_is_no_bag_is_refused_in_one_line(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(BagError) as error:
        open_bag(path)
    assert message in one_line(error, path)


def test_a_missing_path_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BagError) as error:
        open_bag(tmp_path / "none.bag")
    assert "no such recording" in one_line(error, tmp_path / "none.bag")


def test_a_bag_whose_index_was_never_written_is_read_all_the_same(tmp_path: Path, ros1: Any) -> None:
    path = tmp_path / "killed.bag"
    writer = Writer(path)
    writer.open()
    connection = writer.add_connection("/a", STRING, typestore=ros1.store)
    writer.write(connection, START_NS, text("word"))
    writer.write_chunk(writer.chunks[-1])
    writer.abort()
    with open_bag(path) as bag:
        assert [message.data.data for message in bag.messages("/a")] == ["word"]
        assert ["its index is missing" in note for note in bag.contradictions()] == [True]


def test_a_recording_that_was_not_finished_is_refused_whatever_is_in_it(write_bag: WriteBag) -> None:
    path = write_bag([("/a", STRING, START_NS, text("word"))])
    active = path.rename(path.with_name("some.bag.active"))
    with pytest.raises(BagError, match=r"recording was not finished.*garment salvage"):
        open_bag(active)


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_truncated_bag_is_refused_with_a_hint(ros1: Any, write_bag: WriteBag, share: float) -> None:
    path = write_bag([("/depth", IMAGE, START_NS + n, depth_message(ros1, n)) for n in range(50)])
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * share)])
    with pytest.raises(BagError) as error:
        open_bag(path)
    assert "garment salvage" in one_line(error, path)


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
@pytest.mark.parametrize("missing_bytes", [1, 200, 3000])
def test_a_bag_that_lacks_a_part_of_its_index_gives_every_message(
    ros1: Any, write_bag: WriteBag, compression: str, missing_bytes: int
) -> None:
    path = write_bag([("/depth", IMAGE, START_NS + n, depth_message(ros1, n)) for n in range(50)], compression)
    with open_bag(path) as bag:
        whole = [image.pixels().tobytes() for image in bag.images("/depth", "depth")]
    path.write_bytes(path.read_bytes()[:-missing_bytes])
    with open_bag(path) as bag:
        assert [image.pixels().tobytes() for image in bag.images("/depth", "depth")] == whole
        assert len(bag.contradictions()) == 1


def test_an_index_record_of_the_wrong_size_is_not_believed(forge_bag: WriteBag) -> None:
    """rosbags only asserts it."""
    path = forge_bag([(0, START_NS, text("a"))], index_size_shift=1)
    with open_bag(path) as bag:
        assert [message.data.data for message in bag.messages(*bag.topics)] == ["a"]
        assert len(bag.contradictions()) == 1


def test_a_bag_that_changes_while_it_is_read_is_reported(ros1: Any, write_bag: WriteBag) -> None:
    path = write_bag([("/depth", IMAGE, START_NS, depth_message(ros1, 1))])
    with pytest.raises(BagError, match="changed while it was read"), open_bag(path):
        path.write_bytes(path.read_bytes() + b"more")
    with pytest.raises(BagError, match="changed while it was read"), open_bag(path):
        path.unlink()


def test_an_error_of_the_reader_is_not_hidden_by_a_change(ros1: Any, write_bag: WriteBag) -> None:
    path = write_bag([("/depth", IMAGE, START_NS, depth_message(ros1, 1))])

    def fail() -> None:
        path.unlink()
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError), open_bag(path):
        fail()


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data(), compression=st.sampled_from(COMPRESSIONS))
def test_no_damage_to_a_file_is_a_bug(
    ros1: Any, write_bag: WriteBag, tmp_path: Path, data: st.DataObject, compression: str
) -> None:
    """Whatever bytes are spoiled: an error that a user can read, or messages of which each is whole or faulty."""
    content = bytearray(_small_bag(ros1, write_bag, compression).read_bytes())
    padding = range(120, 13 + 4096)  # spaces behind the bag header that nobody reads
    places = [place for place in range(len(content)) if place not in padding]
    for place in data.draw(st.lists(st.sampled_from(places), min_size=1, max_size=6)):
        content[place] = data.draw(st.integers(0, 255))
    path = tmp_path / "spoiled.bag"
    path.write_bytes(content)
    with warnings.catch_warnings(), suppress(GarmentError), open_bag(path) as bag:
        warnings.simplefilter("ignore", DataWarning)
        for topic in bag.topics:
            for message in bag.images(topic, "depth"):
                if message.fault is None:
                    message.pixels()
        list(bag.messages(*bag.topics))


_small_bags: dict[str, Any] = {}


def _small_bag(ros1: Any, write_bag: WriteBag, compression: str) -> Path:
    if compression not in _small_bags:
        images = [("/depth", IMAGE, START_NS + n, depth_message(ros1, n)) for n in range(3)]
        others = [("/tf", TF, START_NS + n, ros1.transforms("a")) for n in range(2)]
        entries = list(itertools.chain(images, others))
        _small_bags[compression] = write_bag(entries, compression, 400)
    path: Path = _small_bags[compression]
    return path


def test_definitions_without_their_parts_are_completed_from_the_common_ones(ros1: Any, write_bag: WriteBag) -> None:
    """Some recorders write the outermost definition alone; a type that is nowhere stays unreadable."""
    path = write_bag([("/tf", "tf2_msgs/msg/TFMessage", START_NS, ros1.transforms("a"))])
    content = path.read_bytes()
    with open_bag(path) as bag:
        (whole,) = bag.messages("/tf")
    for part in (b"geometry_msgs/TransformStamped", b"nowhere_msgs/TransformStamped"):
        path.write_bytes(_with_definition(content, part + b"[] transforms\n"))
        with open_bag(path) as bag:
            if part.startswith(b"nowhere"):
                with pytest.warns(DataWarning, match="left out 1 of 1 messages"):
                    assert list(bag.messages("/tf")) == []
            else:
                (alone,) = bag.messages("/tf")
                assert repr(alone.data) == repr(whole.data)


def _with_definition(content: bytes, definition: bytes) -> bytes:
    """Write a plain bag again with another definition of its only connection."""
    scan = scan_bag(memoryview(content))
    (number,) = scan.connections
    said = {**scan.connections[number][0], b"message_definition": definition}
    file = io.BytesIO()
    writer = BagWriter(file, {number: said}, "none")
    for chunk in scan.chunks:
        for message in chunk.messages:
            writer.write(number, message.stamp_ns, content[message.data])
    writer.finish()
    return file.getvalue()
