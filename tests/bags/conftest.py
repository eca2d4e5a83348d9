"""Small bags: written by rosbags, or byte by byte where rosbags would refuse."""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from rosbags.typesys.store import Typestore

STAMP_NS = 1_391_700_000_123_456_789
RECORD_STAMP_NS = 1_391_700_000_200_000_000


@dataclass(frozen=True)
class Wire:
    """Serialises messages as ROS 1 does, or in CDR of either byte order."""

    store: Typestore
    cdr: bool
    little_endian: bool = True

    def serialise(self, message_type: str, *fields: Any) -> bytes:
        message = self.store.types[message_type](*fields)
        if self.cdr:
            return bytes(self.store.serialize_cdr(message, message_type, little_endian=self.little_endian))
        return bytes(self.store.serialize_ros1(message, message_type))

    def header(self, stamp_ns: int = STAMP_NS, frame_id: str = "optical") -> Any:
        stamp = self.store.types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9))
        return self.store.types["std_msgs/msg/Header"](*([] if self.cdr else [7]), stamp, frame_id)

    def image(
        self,
        data: bytes,
        *,
        encoding: str,
        width_px: int,
        height_px: int,
        step_bytes: int,
        big_endian: bool = False,
        **header: Any,
    ) -> bytes:
        fields = (height_px, width_px, encoding, int(big_endian), step_bytes, np.frombuffer(data, np.uint8))
        return self.serialise("sensor_msgs/msg/Image", self.header(**header), *fields)

    def compressed(self, data: bytes, form: str, **header: Any) -> bytes:
        fields = (self.header(**header), form, np.frombuffer(data, np.uint8))
        return self.serialise("sensor_msgs/msg/CompressedImage", *fields)

    def camera_info(
        self, k: Iterable[float], d: Iterable[float] = (), size_px: tuple[int, int] = (640, 480), **header: Any
    ) -> bytes:
        region = self.store.types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        width_px, height_px = size_px
        arrays = (np.array(list(d), float), np.array(list(k), float), np.eye(3).ravel(), np.zeros(12))
        fields = (self.header(**header), height_px, width_px, "plumb_bob", *arrays, 0, 0, region)
        return self.serialise("sensor_msgs/msg/CameraInfo", *fields)

    def transforms(self, child: str, message_type: str = "tf2_msgs/msg/TFMessage", **header: Any) -> bytes:
        vector = self.store.types["geometry_msgs/msg/Vector3"](1.0, 2.0, 3.0)
        rotation = self.store.types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
        transform = self.store.types["geometry_msgs/msg/Transform"](vector, rotation)
        stamped = self.store.types["geometry_msgs/msg/TransformStamped"](self.header(**header), child, transform)
        return self.serialise(message_type, [stamped])


@pytest.fixture(scope="session")
def ros1() -> Wire:
    store = get_typestore(Stores.ROS1_NOETIC)
    for name in ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"):  # of no package that rosbags knows
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
    return Wire(store, cdr=False)


@pytest.fixture(scope="session")
def ros2() -> Wire:
    return Wire(get_typestore(Stores.ROS2_HUMBLE), cdr=True)


@pytest.fixture(scope="session", params=["ros1", "cdr", "big-endian cdr"])
def wire(request: pytest.FixtureRequest, ros1: Wire, ros2: Wire) -> Wire:
    return ros1 if request.param == "ros1" else replace(ros2, little_endian=request.param == "cdr")


@pytest.fixture(scope="session")
def write_bag(ros1: Wire, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Write (topic, type, record stamp, bytes) to a ROS 1 bag, one publisher for each topic and type."""

    def write(entries: Iterable[tuple[str, str, int, bytes]], compression: str = "none", chunk_bytes: int = 1) -> Path:
        path = tmp_path_factory.mktemp("bag") / "some.bag"
        writer = rosbag1.Writer(path)
        writer.chunk_threshold = chunk_bytes
        if compression != "none":
            writer.set_compression(rosbag1.Writer.CompressionFormat[compression.upper()])
        connections: dict[tuple[str, str], Any] = {}
        with writer:
            for topic, message_type, stamp_ns, data in entries:
                if (topic, message_type) not in connections:
                    connection = writer.add_connection(topic, message_type, typestore=ros1.store)
                    connections[topic, message_type] = connection
                writer.write(connections[topic, message_type], stamp_ns, data)
        return path

    return write


@pytest.fixture(scope="session")
def write_rosbag2(ros2: Wire, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Write (topic, type, record stamp, bytes) to a rosbag2 folder."""

    def write(entries: Iterable[tuple[str, str, int, bytes]], storage: str, compression: str = "none") -> Path:
        path = tmp_path_factory.mktemp("bag") / "some"
        plugin = rosbag2.StoragePlugin[storage.upper()]
        writer = rosbag2.Writer(path, version=8, storage_plugin=plugin)
        if compression != "none":
            mode = rosbag2.CompressionMode[compression.upper()]
            writer.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
        connections: dict[tuple[str, str], Any] = {}
        with writer:
            for topic, message_type, stamp_ns, data in entries:
                if (topic, message_type) not in connections:
                    connection = writer.add_connection(topic, message_type, typestore=ros2.store)
                    connections[topic, message_type] = connection
                writer.write(connections[topic, message_type], stamp_ns, data)
        return path

    return write


def _u4(*values: int) -> bytes:
    return struct.pack(f"<{len(values)}I", *values)


def _u8(value: int) -> bytes:
    return struct.pack("<Q", value)


def _fields(**fields: bytes) -> bytes:
    named = [name.encode() + b"=" + value for name, value in fields.items()]
    return b"".join(_u4(len(each)) + each for each in named)


def _record(data: bytes, **header: bytes) -> bytes:
    fields = _fields(**header)
    return _u4(len(fields)) + fields + _u4(len(data)) + data


def _stamp(stamp_ns: int) -> bytes:
    return _u4(*divmod(stamp_ns, 10**9))


def _connection(number: int, topic: str, message_type: str, definition: str) -> bytes:
    data = _fields(
        topic=topic.encode(), type=message_type.encode(), md5sum=b"*", message_definition=definition.encode()
    )
    return _record(data, op=b"\x07", conn=_u4(number), topic=topic.encode())


@dataclass
class Forgery:
    """A ROS 1 bag of one chunk, put together byte by byte; each part is as it should be unless told otherwise."""

    messages: list[tuple[int, int, bytes]]
    """Connection, record stamp and bytes of each."""
    publishers: tuple[tuple[str, str, str], ...] = (("/text", "std_msgs/String", "string data"),)
    """Topic, type and definition of each connection."""
    connection_first: bool = False
    """Have the index point to a connection record before each message, as that of a first message may."""
    message_op: bytes = b"\x02"
    message_connection: int | None = None
    message_stamp_ns: int | None = None
    offset_shift: int = 0
    index_size_shift: int = 0
    compression: bytes = b"none"
    claimed_chunk_bytes: int | None = None

    def write(self, path: Path) -> Path:
        connections = [_connection(number, *publisher) for number, publisher in enumerate(self.publishers)]
        chunk, index = self._chunk(connections)
        start = 13 + 4096
        stamps = [stamp_ns for _, stamp_ns, _ in self.messages]
        info = _record(
            b"".join(_u4(number, len(entries) // 12) for number, entries in index.items()),
            op=b"\x06",
            ver=_u4(1),
            chunk_pos=_u8(start),
            start_time=_stamp(min(stamps)),
            end_time=_stamp(max(stamps)),
            count=_u4(len(index)),
        )
        header = {
            "op": b"\x03",
            "index_pos": _u8(start + len(chunk)),
            "conn_count": _u4(len(connections)),
            "chunk_count": _u4(1),
        }
        padding = b" " * (4096 - len(_record(b"", **header)))
        path.write_bytes(b"#ROSBAG V2.0\n" + _record(padding, **header) + chunk + b"".join(connections) + info)
        return path

    def _chunk(self, connections: list[bytes]) -> tuple[bytes, dict[int, bytes]]:
        content, index = b"", dict.fromkeys(range(len(connections)), b"")
        for number, stamp_ns, data in self.messages:
            index[number] += _stamp(stamp_ns) + _u4(len(content) + self.offset_shift)
            if self.connection_first:
                content += connections[number]
            conn = number if self.message_connection is None else self.message_connection
            time = stamp_ns if self.message_stamp_ns is None else self.message_stamp_ns
            content += _record(data, op=self.message_op, conn=_u4(conn), time=_stamp(time))
        size = len(content) if self.claimed_chunk_bytes is None else self.claimed_chunk_bytes
        chunk = _record(content, op=b"\x05", compression=self.compression, size=_u4(size))
        for number, entries in index.items():
            count = len(entries) // 12 + self.index_size_shift
            chunk += _record(entries, op=b"\x04", ver=_u4(1), conn=_u4(number), count=_u4(count))
        return chunk, index


@pytest.fixture
def forge_bag(tmp_path: Path) -> Callable[..., Path]:
    """Write a :class:`Forgery`."""

    def forge(messages: list[tuple[int, int, bytes]], **parts: Any) -> Path:
        return Forgery(messages, **parts).write(tmp_path / "forged.bag")

    return forge


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Return the folder of real recordings, or skip."""
    if not (folder := os.environ.get("GARMENT_REAL_DATA")):
        pytest.skip("GARMENT_REAL_DATA names no folder of real recordings")
    return Path(folder)
