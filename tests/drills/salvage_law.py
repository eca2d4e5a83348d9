"""Small ROS 1 bags, damage at seeded places, and the law that salvage obeys.

Nothing is invented: a saved message is one of the original's, byte by byte, or is counted as doubtful. Nothing is left:
whoever knows where every record was finds no message untouched by the damage that salvage did not find. And nothing
vanishes without a word: what is not saved is counted as lost, unless the end of the file is.

What no reader can notice is let pass: bytes within a message of a plain chunk, or of an lz4 chunk without a checksum.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from rosbags import rosbag1
from rosbags.typesys import Stores, get_typestore

from garment_dataset.bags import open_bag
from garment_dataset.bags.rosbag1_writer import BagWriter
from garment_dataset.bags.salvage import salvage
from garment_dataset.errors import BagError

if TYPE_CHECKING:
    from pathlib import Path
    from random import Random

    from garment_dataset.bags.salvage import SalvageReport

START_NS = 1_391_700_000_000_000_000
TYPES = {"/depth": "sensor_msgs/msg/CompressedImage", "/note": "std_msgs/msg/String", "/ee": "geometry_msgs/msg/Point"}
KINDS = ("none", "bz2", "lz4", "lz4 without checksums")


class Told(NamedTuple):
    """One message, by what a reader learns of it."""

    topic: str
    stamp_ns: int
    data: bytes


@dataclass(frozen=True)
class Whole:
    """A sound bag, and where its parts are.

    Attributes
    ----------
    kind : str
        One of :data:`KINDS`.
    data : bytes
        The file.
    places : list of (slice, Told)
        Every message, and which bytes of the file it depends on: its record, or its compressed chunk.
    """

    kind: str
    data: bytes
    places: list[tuple[slice, Told]]

    @property
    def told(self) -> Counter[Told]:
        return Counter(told for _, told in self.places)


@dataclass(frozen=True)
class Damage:
    """Bytes of a file replaced by others."""

    what: str
    start: int
    removed: int
    added: bytes

    def apply(self, data: bytes) -> bytes:
        return data[: self.start] + self.added + data[self.start + self.removed :]

    def touches(self, place: slice) -> bool:
        """Whether a part of the file is not as it was; what was added between two bytes touches both."""
        between = int(not self.removed)
        return bool(place.start < self.start + self.removed + between and place.stop + between > self.start)


def make_whole(kind: str, folder: Path) -> Whole:
    """Write a bag of some 20 chunks."""
    random = np.random.default_rng(7)
    store = get_typestore(Stores.ROS1_NOETIC)
    path = folder / f"{kind.replace(' ', '-')}.bag"
    writer = rosbag1.Writer(path)
    writer.chunk_threshold = 1500
    if kind != "none":
        writer.set_compression(rosbag1.Writer.CompressionFormat[kind[:3].upper()])
    with writer:
        connections = {topic: writer.add_connection(topic, name, typestore=store) for topic, name in TYPES.items()}
        for index in range(60):
            topic = list(TYPES)[index % 3]
            size = {"/depth": 700, "/note": 30, "/ee": 24}[topic]
            data = random.integers(0, 16, size, np.uint8).tobytes()
            writer.write(connections[topic], START_NS + index * 10**7, data)
    if kind == "lz4":
        path = _with_checksums(path)
    return Whole(kind, path.read_bytes(), list(_places(path)))


def _with_checksums(path: Path) -> Path:
    """Write a bag again as ROS does, whose lz4 frames have a checksum of their content."""
    from garment_dataset.bags.mapped import mapped
    from garment_dataset.bags.rosbag1_recovery import Losses, learn_connections, recover
    from garment_dataset.bags.rosbag1_scan import scan_bag

    content = mapped(path)
    scan = scan_bag(content)
    out = path.with_name("checked.bag")
    with out.open("xb") as file:
        writer = BagWriter(file, learn_connections(content, scan)[0], "lz4", chunk_bytes=1500)
        for message in recover(content, scan, Losses()):
            writer.write(message.connection, message.stamp_ns, message.data)
        writer.finish()
    return out


def _places(path: Path) -> list[tuple[slice, Told]]:
    """Return what each message depends on, as rosbags' own index has it."""
    found = []
    with rosbag1.Reader(path) as reader:
        topics = {each.id: each.topic for each in reader.connections}
        told = [Told(each.topic, stamp, bytes(data)) for each, stamp, data in reader.messages()]
        entries = sorted(
            (e.time, e.chunk_pos, e.offset, number) for number, all_ in reader.indexes.items() for e in all_
        )
        for (_, position, offset, number), message in zip(entries, told, strict=True):
            assert topics[number] == message.topic
            chunk = reader.chunks[position]
            start, stop = position, chunk.datapos + chunk.datasize
            if b"none" in path.read_bytes()[position : chunk.datapos]:
                start = chunk.datapos + offset
                stop = start + len(message.data) + 4 + 38 + 4
            found.append((slice(start, stop), message))
    return found


def make_damage(whole: Whole, random: Random) -> Damage:
    """Choose some damage."""
    size = len(whole.data)
    start = random.randrange(13, size)
    count = min(random.choice((1, 1, 2, 4, 40, 300, 3000)), size - start)
    what = random.choice(("cut", "flip", "flip", "overwritten", "zeros", "removed", "inserted"))
    if what == "cut":
        return Damage(what, start, size - start, b"")
    if what == "flip":
        return Damage(what, start, 1, bytes([whole.data[start] ^ 1 << random.randrange(8)]))
    if what == "removed":
        return Damage(what, start, count, b"")
    added = bytes(count) if what == "zeros" else random.randbytes(count)
    return Damage(what, start, 0 if what == "inserted" else count, added)


def judge(whole: Whole, damage: Damage, folder: Path) -> str:
    """Salvage the damaged bag; say how that went, or fail with an AssertionError."""
    path = folder / "damaged.bag"
    path.write_bytes(damage.apply(whole.data))
    before = path.read_bytes()
    untouched = Counter(told for place, told in whole.places if not damage.touches(place))
    report = _salvaged(path)
    if report is None:
        assert not untouched, f"{untouched.total()} messages are untouched"
        return "nothing left"
    assert path.read_bytes() == before
    saved = _told(path if report.out is None else report.out)
    _check(whole, damage, report, saved, untouched)
    return "sound" if report.is_sound else "saved"


def _salvaged(path: Path) -> SalvageReport | None:
    try:
        return salvage(path)
    except BagError:
        return None


def _check(whole: Whole, damage: Damage, report: SalvageReport, saved: Counter[Told], untouched: Counter[Told]) -> None:
    missing = untouched - saved
    assert not missing, f"{missing.total()} untouched messages are not saved, first {_text(missing)}"
    strange = saved - whole.told
    hidden = sum(_is_hidden(whole, damage, told) for told in strange.elements())
    assert strange.total() - hidden <= report.doubtful, (
        f"{strange.total()} strange, {report.doubtful} doubtful: {_text(strange)}"
    )
    assert saved.total() == report.kept
    if report.lost_is_known:
        assert report.kept + report.lost >= whole.told.total(), f"{report.kept} kept, {report.lost} lost"


def _is_hidden(whole: Whole, damage: Damage, told: Told) -> bool:
    """Whether a message differs from one of the original in bytes alone that nothing covers."""
    if whole.kind not in ("none", "lz4 without checksums"):
        return False
    return any(
        damage.touches(place)
        and (told.topic, told.stamp_ns, len(told.data)) == (one.topic, one.stamp_ns, len(one.data))
        for place, one in whole.places
    )


def _told(path: Path) -> Counter[Told]:
    """Read a bag with rosbags' own reader, after ours had nothing to say against it."""
    with open_bag(path) as bag:
        assert bag.contradictions() == []
    with rosbag1.Reader(path) as reader:
        return Counter(Told(each.topic, stamp, bytes(data)) for each, stamp, data in reader.messages())


def _text(some: Counter[Told]) -> str:
    first = next(iter(some))
    return f"{first.topic} {first.stamp_ns - START_NS} {len(first.data)} bytes"
