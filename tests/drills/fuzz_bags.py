"""Small recordings of every storage, and where in their files bytes lie that no checksum covers."""

from __future__ import annotations

import struct
import sys
import zlib
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import lz4.frame  # type: ignore[import-untyped]
import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Message = tuple[str, str, int, bytes]

START_NS, PERIOD_NS = 1_391_700_000_000_000_000, 33_000_000
WIDTH_PX, HEIGHT_PX, FOCAL_PX = 32, 24, 28.5
FRAMES = 5
DEPTH, COLOR = "/xtion1/depth/image_raw", "/xtion1/rgb/image_raw"
DEPTH_FRAME, COLOR_FRAME = "xtion1_depth_optical_frame", "xtion1_rgb_optical_frame"
IMAGE, COMPRESSED, INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo"
JOINTS, POINT, TF = "sensor_msgs/msg/JointState", "geometry_msgs/msg/PointStamped", "tf2_msgs/msg/TFMessage"

ROS1 = ("none", "png", "jpeg", "bz2", "lz4", "lz4 of rosbags")
ROS2 = ("sqlite3", "mcap", "mcap with checksums", "mcap zstd", "mcap zstd with checksums")


FORMS = ("png", "jpeg")


@dataclass(frozen=True)
class Sample:
    """A recording: the bytes of its files, which of them is opened, and what in them nothing covers."""

    kind: str
    files: dict[str, bytes]
    opened: str
    uncovered: dict[str, list[tuple[int, int]]]

    def write(self, folder: Path, files: dict[str, bytes]) -> Path:
        for name, content in files.items():
            (folder / name).parent.mkdir(exist_ok=True, parents=True)
            (folder / name).write_bytes(content)
        return folder / self.opened

    def covers(self, name: str, start: int, stop: int) -> bool:
        """Return whether a checksum or a second copy covers any of these bytes."""
        return not any(first <= start and stop <= last for first, last in self.uncovered.get(name, []))


class Maker:
    """Makes the messages of a sheet that hangs from the gripper, in the serialisation of ROS 1 or 2."""

    def __init__(self, ros: int) -> None:
        self._ros = ros
        self.store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
        if ros == 1:
            self.store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))

    def make(self, kind: str, *values: Any) -> Any:
        return self.store.types[kind](*values)

    def pack(self, kind: str, *values: Any) -> bytes:
        message = self.make(kind, *values)
        packed = self.store.serialize_ros1 if self._ros == 1 else self.store.serialize_cdr
        return bytes(packed(message, kind))

    def header(self, stamp_ns: int, frame: str) -> Any:
        stamp = self.make("builtin_interfaces/msg/Time", *divmod(stamp_ns, 10**9))
        return self.make("std_msgs/msg/Header", *([3] if self._ros == 1 else []), stamp, frame)

    def image(self, stamp_ns: int, frame: str, pixels: NDArray[Any]) -> bytes:
        data = np.frombuffer(pixels.tobytes(), np.uint8)
        encoding = "16UC1" if pixels.ndim == 2 else "rgb8"
        size = (HEIGHT_PX, WIDTH_PX, encoding, 0, data.size // HEIGHT_PX)
        return self.pack(IMAGE, self.header(stamp_ns, frame), *size, data)

    def file(self, stamp_ns: int, frame: str, pixels: NDArray[Any], color_form: str) -> bytes:
        depth = pixels.ndim == 2
        file = cv2.imencode(".png" if depth else f".{color_form}", pixels if depth else pixels[..., ::-1])[1].tobytes()
        form = "16UC1; compressedDepth png" if depth else f"rgb8; {color_form} compressed bgr8"
        data = (bytes(12) if depth else b"") + file
        return self.pack(COMPRESSED, self.header(stamp_ns, frame), form, np.frombuffer(data, np.uint8))

    def camera_info(self, stamp_ns: int, frame: str) -> bytes:
        k = np.array([FOCAL_PX, 0, WIDTH_PX / 2, 0, FOCAL_PX, HEIGHT_PX / 2, 0, 0, 1.0])
        region = self.make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
        arrays = (np.zeros(5), k, np.eye(3).ravel(), np.zeros(12))
        fields = (HEIGHT_PX, WIDTH_PX, "plumb_bob", *arrays, 0, 0, region)
        return self.pack(INFO, self.header(stamp_ns, frame), *fields)

    def point(self, stamp_ns: int, xyz_m: tuple[float, ...]) -> bytes:
        return self.pack(POINT, self.header(stamp_ns, DEPTH_FRAME), self.make("geometry_msgs/msg/Point", *xyz_m))

    def joints(self, stamp_ns: int) -> bytes:
        values = (["r2_joint_b"], np.array([stamp_ns % 97 / 97]), np.zeros(1), np.zeros(0))
        return self.pack(JOINTS, self.header(stamp_ns, ""), *values)

    def tf(self, stamp_ns: int) -> bytes:
        vector = self.make("geometry_msgs/msg/Vector3", 1.0, 2.0, 3.0)
        turn = self.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
        transform = self.make("geometry_msgs/msg/Transform", vector, turn)
        header = self.header(stamp_ns, "base_link")
        return self.pack(TF, [self.make("geometry_msgs/msg/TransformStamped", header, DEPTH_FRAME, transform)])


def messages(maker: Maker, color_form: str | None) -> Iterator[Message]:
    """Yield topic, type, record stamp and bytes of every message, no two of them alike."""
    image = maker.image if color_form is None else partial(maker.file, color_form=color_form)
    kind, tails = (IMAGE, ("", "")) if color_form is None else (COMPRESSED, ("/compressedDepth", "/compressed"))
    rows, columns = np.indices((HEIGHT_PX, WIDTH_PX))
    for frame in range(FRAMES):
        stamp_ns = START_NS + frame * PERIOD_NS
        at_m = (0.0, -0.28, 1.0 + 0.01 * frame)
        on_sheet = (abs(columns - WIDTH_PX // 2) < 3) & (rows > 3) & (rows < 20)
        depth = np.where(on_sheet, round(1000 * at_m[2]), 2000 + rows).astype(np.uint16)
        color = np.stack([rows + frame, columns, rows * columns], axis=-1).astype(np.uint8)
        for topic, message_type, data in (
            (DEPTH + tails[0], kind, image(stamp_ns, DEPTH_FRAME, depth)),
            ("/xtion1/depth/camera_info", INFO, maker.camera_info(stamp_ns, DEPTH_FRAME)),
            (COLOR + tails[1], kind, image(stamp_ns + 1, COLOR_FRAME, color)),
            ("/xtion1/rgb/camera_info", INFO, maker.camera_info(stamp_ns + 1, COLOR_FRAME)),
            ("/r2_ee_to_depth", POINT, maker.point(stamp_ns + 2, at_m)),
            ("/joint_states", JOINTS, maker.joints(stamp_ns + 3)),
            ("/tf", TF, maker.tf(stamp_ns + 4)),
        ):
            yield topic, message_type, stamp_ns + 20_000_000, data


def make_sample(kind: str, folder: Path) -> Sample:
    """Write a recording of a kind of ``ROS1`` or ``ROS2`` and read its bytes."""
    ros = 1 if kind in ROS1 else 2
    maker = Maker(ros)
    entries = list(messages(maker, kind if kind in FORMS else None))
    path = folder / ("some.bag" if ros == 1 else "some")
    (write_ros1 if ros == 1 else write_ros2)(path, kind, maker, entries)
    paths = [path] if ros == 1 else sorted(path.iterdir())
    files = {str(each.relative_to(folder)): each.read_bytes() for each in paths}
    if kind.endswith("with checksums"):
        files = {name: with_checksums(data) if name.endswith(".mcap") else data for name, data in files.items()}
    uncovered = {name: list(uncovered_ranges(kind, data, entries)) for name, data in files.items()}
    return Sample(kind, files, path.name, uncovered)


def write_ros1(path: Path, kind: str, maker: Maker, entries: list[Message]) -> None:
    writer = rosbag1.Writer(path)
    writer.chunk_threshold = 4000
    if kind not in {"none", *FORMS}:
        writer.set_compression(rosbag1.Writer.CompressionFormat[kind[:3].upper()])
    if kind == "lz4":  # as ROS's own recorder writes it
        writer.compressor = lambda data: bytes(lz4.frame.compress(data, content_checksum=True))
    with writer:
        _write(writer, maker, entries)


def write_ros2(path: Path, kind: str, maker: Maker, entries: list[Message]) -> None:
    writer = rosbag2.Writer(path, version=8, storage_plugin=rosbag2.StoragePlugin[kind.partition(" ")[0].upper()])
    if kind.startswith("mcap zstd"):
        writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
    with writer:
        _write(writer, maker, entries)


def _write(writer: Any, maker: Maker, entries: list[Message]) -> None:
    connections: dict[str, Any] = {}
    for topic, message_type, stamp_ns, data in entries:
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, message_type, typestore=maker.store)
        writer.write(connections[topic], stamp_ns, data)


def with_checksums(data: bytes) -> bytes:
    """Fill in the checksums of an mcap file that rosbags leaves out."""
    content = bytearray(data)
    position = 8
    while position < len(content) - 8:
        op, size = struct.unpack_from("<BQ", content, position)
        body = position + 9
        if op == 6:
            stored = bytes(content[body + 40 + struct.unpack_from("<I", content, body + 28)[0] : body + size])
            plain = zstd.decompress(stored) if b"zstd" in content[body + 28 : body + 40] else stored
            struct.pack_into("<I", content, body + 24, zlib.crc32(plain))
        elif op == 15:
            struct.pack_into("<I", content, body, zlib.crc32(content[:position]))
        elif op == 2:
            start = struct.unpack_from("<Q", content, body)[0]
            struct.pack_into("<I", content, body + 16, zlib.crc32(content[start : body + 16]))
        position = body + size
    return bytes(content)


def uncovered_ranges(kind: str, data: bytes, entries: list[Message]) -> Iterator[tuple[int, int]]:
    """Yield where the bytes of messages lie that nothing covers, and what else has no second copy."""
    if kind in {"lz4 of rosbags", "mcap zstd"}:
        magic, size = (b"\x04\x22\x4d\x18", "<I") if kind in ROS1 else (b"\x28\xb5\x2f\xfd", "<Q")
        position = data.find(magic)
        while position >= 0:
            yield position, position + struct.unpack_from(size, data, position - struct.calcsize(size))[0]
            position = data.find(magic, position + 1)
    if kind in {"none", *FORMS, "sqlite3", "mcap"}:
        for *_, payload in entries:
            start = data.find(payload)
            if start >= 0:
                file = payload.find(b"\x89PNG")
                yield start, start + (len(payload) if file < 0 else file)
    if kind == "sqlite3":  # definitions are there once, and their hash is none of the text
        for text in set(_definitions(data)):
            start = data.find(text)
            while start >= 0:
                yield start, start + len(text)
                start = data.find(text, start + 1)


def _definitions(data: bytes) -> Iterator[bytes]:
    """Yield the pages of a database on which message definitions lie."""
    page = struct.unpack_from(">H", data, 16)[0]
    for start in range(0, len(data), page):
        content = data[start : start + page]
        if b"ros2msg" in content or b"MSG: " in content:
            yield content
