"""Salvage of damaged bags: known damage, known answers. tests/drills/test_salvage.py does it thousandfold."""

from __future__ import annotations

import json
import lzma
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rosbags.rosbag1 import Reader, Writer
from typer.testing import CliRunner

from garment_dataset.bags import open_bag
from garment_dataset.bags.partial_inflation import inflate_what_is_left, lz4_prefix
from garment_dataset.bags.rosbag1_scan import next_record, record_at, scan_bag
from garment_dataset.bags.salvage import default_output, salvage
from garment_dataset.cli import application
from garment_dataset.errors import BagError

WriteBag = Callable[..., Path]
STRING, START_NS = "std_msgs/msg/String", 1_391_700_000_000_000_000
COMPRESSIONS = ("none", "bz2", "lz4")


def text(word: str) -> bytes:
    return len(word).to_bytes(4, "little") + word.encode()


def entries(count: int = 40) -> list[tuple[str, str, int, bytes]]:
    """Messages that compress badly, on two topics."""
    noise = lzma.compress(bytes(range(256)) * 40)
    return [(f"/{'ab'[n % 2]}", STRING, START_NS + n, text(f"{n} {noise[n : n + 90].hex()}")) for n in range(count)]


def messages(path: Path) -> list[tuple[str, int, bytes]]:
    with Reader(path) as reader:
        return [(connection.topic, stamp, bytes(data)) for connection, stamp, data in reader.messages()]


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_sound_bag_is_left_alone(write_bag: WriteBag, compression: str) -> None:
    path = write_bag(entries(), compression, chunk_bytes=2000)
    report = salvage(path)
    assert (report.is_sound, report.out, report.kept, report.lost) == (True, None, 40, 0)
    assert not default_output(path).exists()


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_bag_that_lacks_its_last_byte_loses_nothing(write_bag: WriteBag, compression: str) -> None:
    path = write_bag(entries(), compression, chunk_bytes=2000)
    whole = messages(path)
    path.write_bytes(path.read_bytes()[:-1])
    report = salvage(path)
    assert report.out is not None
    assert messages(report.out) == whole
    assert (report.doubtful, report.lost) == (0, 0)


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_the_new_bag_is_compressed_as_the_old_one(write_bag: WriteBag, compression: str) -> None:
    path = write_bag(entries(), compression, chunk_bytes=2000)
    path.write_bytes(path.read_bytes()[:-1])
    out = salvage(path).out
    assert out is not None
    content = memoryview(out.read_bytes())
    assert {chunk.compression for chunk in scan_bag(content).chunks} == {compression}
    with open_bag(out) as bag:
        assert bag.contradictions() == []


def test_a_bag_of_a_killed_recorder_gives_its_last_half_chunk(tmp_path: Path, ros1: Any) -> None:
    """A recorder writes the length of a chunk when it closes it; until then it is 0."""
    path = tmp_path / "one.bag"
    writer = Writer(path)
    writer.open()
    connection = writer.add_connection("/a", STRING, typestore=ros1.store)
    for n in range(5):
        writer.write(connection, START_NS + n, text(f"word {n}"))
    writer.write_chunk(writer.chunks[-1])
    writer.abort()
    content = bytearray(path.read_bytes())
    chunk = scan_bag(memoryview(content)).chunks[0]
    size_at = content.index(b"size=", chunk.position) + 5
    content[size_at : size_at + 4] = content[chunk.stored.start - 4 : chunk.stored.start] = bytes(4)
    active = tmp_path / "one.bag.active"
    active.write_bytes(content[: chunk.messages[-1].data.stop - 1])
    report = salvage(active)
    assert report.out == tmp_path / "one.salvaged.bag"
    assert [stamp - START_NS for _, stamp, _ in messages(report.out)] == [0, 1, 2, 3]
    assert report.cut_at is not None
    assert not report.lost_is_known


def test_a_chunk_in_the_middle_is_lost_alone(write_bag: WriteBag) -> None:
    path = write_bag(entries(), "bz2", chunk_bytes=2000)
    whole = messages(path)
    content = bytearray(path.read_bytes())
    chunk = scan_bag(memoryview(content)).chunks[2]
    content[chunk.stored.start + 40] ^= 1
    path.write_bytes(content)
    lost = {(entry.stamp_ns, "/ab"[1 + entry.connection]) for entry in chunk.entries}
    report = salvage(path)
    assert report.out is not None
    assert messages(report.out) == [each for each in whole if each[1] not in {stamp for stamp, _ in lost}]
    assert (report.kept + report.lost, report.lost, report.lost_is_known) == (40, len(lost), True)
    assert any("damaged bz2 chunk" in gap.what for gap in report.gaps)


def test_a_message_whose_length_is_damaged_takes_no_other_with_it(write_bag: WriteBag) -> None:
    path = write_bag(entries(), chunk_bytes=2000)
    content = bytearray(path.read_bytes())
    victim = scan_bag(memoryview(content)).chunks[1].messages[1]
    content[victim.data.start - 2] ^= 0x10  # a length of a megabyte more
    path.write_bytes(content)
    report = salvage(path)
    assert (report.kept, report.lost) == (39, 1)


def test_a_message_under_another_number_is_doubtful(write_bag: WriteBag) -> None:
    path = write_bag(entries(), chunk_bytes=2000)
    content = bytearray(path.read_bytes())
    victim = scan_bag(memoryview(content)).chunks[1].messages[1]
    at = content.index(b"conn=", victim.offset) + 5
    content[at] ^= 1
    path.write_bytes(content)
    report = salvage(path)
    assert (report.kept, report.doubtful, report.lost) == (40, 1, 0)


def test_a_file_that_is_there_is_never_overwritten(write_bag: WriteBag, tmp_path: Path) -> None:
    path = write_bag(entries())
    path.write_bytes(path.read_bytes()[:-1])
    default_output(path).write_text("mine")
    with pytest.raises(BagError, match="there is such a file already"):
        salvage(path)
    assert default_output(path).read_text() == "mine"
    assert salvage(path, tmp_path / "other.bag").kept == 40
    with pytest.raises(BagError, match=r"cannot be written.*No such file"):
        salvage(path, tmp_path / "nowhere" / "other.bag")
    assert list(path.parent.glob(".*")) == []


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"", "is empty"), (b"no bag at all" * 40, "nothing in it can be saved"), (None, "no such ROS 1 bag")],
)
def test_what_holds_nothing_is_refused_in_one_line(tmp_path: Path, content: bytes | None, message: str) -> None:
    path = tmp_path / "some.bag"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BagError, match=message) as error:
        salvage(path)
    assert "\n" not in str(error.value)
    assert [each.name for each in tmp_path.iterdir()] == (["some.bag"] if content is not None else [])


def test_the_command_says_what_was_kept_and_what_was_lost(write_bag: WriteBag) -> None:
    path = write_bag(entries(), chunk_bytes=2000)
    assert "is sound: 40 messages" in CliRunner().invoke(application(), ["salvage", str(path)]).stdout
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    result = CliRunner().invoke(application(), ["salvage", str(path)])
    assert result.exit_code == 0
    assert "nothing tells how many messages more there were" in result.stderr
    assert result.stdout.splitlines()[-1].endswith("some.salvaged.bag")
    told = json.loads(
        CliRunner().invoke(application(), ["salvage", str(path), "--json", "--out", f"{path}.2.bag"]).stdout
    )
    assert told["kept"] == sum(topic["kept"] for topic in told["topics"]) == len(messages(Path(told["out"])))
    assert told["lost_is_known"] is False


# The parts


def test_records_are_found_at_any_place_and_nowhere_else(write_bag: WriteBag) -> None:
    content = memoryview(write_bag(entries(4)).read_bytes())
    places, position = [], 13
    while (found := next_record(content, position)) is not None:
        places.append(found)
        record = record_at(content, found)
        assert record is not None
        position = found + 1
    walked = {13, *(message.offset for chunk in scan_bag(content).chunks for message in chunk.messages)}
    assert walked <= set(places)
    assert all(record_at(content, place) is not None for place in places)


@pytest.mark.parametrize("level", [1, 9])
def test_every_whole_block_of_a_bz2_stream_is_proven(level: int) -> None:
    import bz2
    from random import Random

    plain = Random(3).randbytes(450_000)
    stored = bytearray(bz2.compress(plain, level))
    assert [each.data for each in inflate_what_is_left("bz2", memoryview(stored), None, is_cut=False)] == [plain]
    stored[200_000] ^= 4
    left = inflate_what_is_left("bz2", memoryview(stored), len(plain), is_cut=False)
    assert all(each.sound and each.data in plain for each in left)
    assert sum(len(each.data) for each in left) > (300_000 if level == 1 else -1)


def test_a_cut_lz4_frame_gives_every_byte_up_to_the_cut() -> None:
    import lz4.frame  # type: ignore[import-untyped]

    plain = b"".join(bytes([n % 7]) * (n % 50) + n.to_bytes(3) for n in range(20_000))
    stored = lz4.frame.compress(plain, content_checksum=True)
    whole = inflate_what_is_left("lz4", memoryview(stored), len(plain), is_cut=False)
    assert [(each.data, each.sound) for each in whole] == [(plain, True)]
    before = 0
    for end in range(8, len(stored), 997):
        left = inflate_what_is_left("lz4", memoryview(stored[:end]), len(plain), is_cut=True)
        held = b"".join(each.data for each in left)
        assert plain.startswith(held)
        assert len(held) >= before
        before = len(held)
    assert before > 0.9 * len(plain)


def test_the_prefix_of_an_lz4_block_is_what_the_library_decodes() -> None:
    import lz4.block  # type: ignore[import-untyped]

    plain = b"".join(f"{n * n} and again {n}, ".encode() for n in range(3000))
    block = lz4.block.compress(plain, store_size=False)
    assert lz4_prefix(memoryview(block), len(plain), b"") == plain
    history = plain[:5000]
    linked = lz4.block.compress(plain, store_size=False, dict=history)
    assert lz4_prefix(memoryview(linked), len(plain), history) == plain


@pytest.mark.real
@pytest.mark.parametrize(
    ("name", "at_60_percent"),
    [
        ("recordings/RealGarments_Floor_01_pi16_0.1_R1", 87),
        ("tf/real_turtle_bz2", 8647),
        ("tf/real_turtle_lz4", 7943),
    ],
)
def test_real_bags_lose_nothing_with_their_last_byte_and_little_with_their_tail(
    real_data: Path, tmp_path: Path, name: str, at_60_percent: int
) -> None:
    """The turtle's one chunk of bz2 ends before 60 % of the file; that of lz4 is cut."""
    content = (real_data / f"{name}.bag").read_bytes()
    path = tmp_path / "cut.bag"
    path.write_bytes(content)
    whole = messages(path)
    path.write_bytes(content[:-1])
    report = salvage(path, tmp_path / "all.bag")
    assert messages(tmp_path / "all.bag") == whole
    path.write_bytes(content[: len(content) * 6 // 10])
    report = salvage(path)
    assert report.out is not None
    assert (report.kept, report.doubtful) == (at_60_percent, 0)
    assert set(messages(report.out)) <= set(whole)
