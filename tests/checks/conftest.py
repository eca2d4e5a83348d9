"""A good recording, small and made by hand, and what can be planted in it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from rosbags import rosbag1
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from garment_dataset.checks.contract import Contract, read_contract
from garment_dataset.layout import packaged_workspace
from tests.bags.conftest import Wire

START_NS = 1_391_700_000_000_000_000
DEPTH, COLOR = "/xtion1/depth/image_raw", "/xtion1/rgb/image_raw"
DEPTH_INFO, COLOR_INFO = "/xtion1/depth/camera_info", "/xtion1/rgb/camera_info"
GRIPPER, GRIPPER_COLOR = "/r2_ee_to_depth", "/r2_ee_to_rgb"
WIDTH_PX, HEIGHT_PX, FOCAL_PX = 64, 48, 52.5
K = (FOCAL_PX, 0.0, 31.5, 0.0, FOCAL_PX, 23.5, 0.0, 0.0, 1.0)
TYPES = {
    DEPTH: "sensor_msgs/msg/Image",
    COLOR: "sensor_msgs/msg/Image",
    DEPTH_INFO: "sensor_msgs/msg/CameraInfo",
    COLOR_INFO: "sensor_msgs/msg/CameraInfo",
    GRIPPER: "geometry_msgs/msg/PointStamped",
    GRIPPER_COLOR: "geometry_msgs/msg/PointStamped",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/joint_states": "sensor_msgs/msg/JointState",
}


@dataclass
class Entry:
    """One message of a recording that is still to be written."""

    topic: str
    time_s: float
    """Header stamp, after the recording begins; it is recorded 20 ms later."""
    make: Callable[[int], bytes]
    """Takes the header stamp."""
    stamp_shift_s: float = 0.0
    """How wrong the header stamp is."""


@lru_cache(maxsize=1)
def wire() -> Wire:
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    return Wire(store, cdr=False)


def image(
    topic: str, seed: int, level: int | None = None, size_px: tuple[int, int] = (WIDTH_PX, HEIGHT_PX)
) -> Callable[[int], bytes]:
    """Return what makes an image: of noise, or of one level everywhere."""
    shape = (size_px[1], size_px[0]) if topic == DEPTH else (size_px[1], size_px[0], 3)
    dtype, encoding = (np.uint16, "16UC1") if topic == DEPTH else (np.uint8, "rgb8")
    pixels = np.random.default_rng(seed).integers(1, 250, shape).astype(dtype)
    if level is not None:
        pixels[:] = level
    step = pixels[0].nbytes

    def make(stamp_ns: int) -> bytes:
        return wire().image(
            pixels.tobytes(),
            encoding=encoding,
            width_px=size_px[0],
            height_px=size_px[1],
            step_bytes=step,
            stamp_ns=stamp_ns,
        )

    return make


def info(k: tuple[float, ...] = K, size_px: tuple[int, int] = (WIDTH_PX, HEIGHT_PX)) -> Callable[[int], bytes]:
    return lambda stamp_ns: wire().camera_info(k, size_px=size_px, stamp_ns=stamp_ns)


def point(x_m: float, y_m: float = 0.0, z_m: float = 1.0) -> Callable[[int], bytes]:
    def make(stamp_ns: int) -> bytes:
        place = wire().store.types["geometry_msgs/msg/Point"](x_m, y_m, z_m)
        return wire().serialise("geometry_msgs/msg/PointStamped", wire().header(stamp_ns), place)

    return make


def joints(angle_rad: float) -> Callable[[int], bytes]:
    def make(stamp_ns: int) -> bytes:
        values = (np.array([0.1, angle_rad]), np.zeros(2), np.zeros(0))
        names = ["r2_joint_s", "r2_joint_b"]
        return wire().serialise("sensor_msgs/msg/JointState", wire().header(stamp_ns), names, *values)

    return make


def good_entries(duration_s: float = 4.0) -> list[Entry]:
    """Return the messages of a recording that keeps the contract: the gripper swings by 0.1 m to either side."""
    entries: list[Entry] = []
    for number in range(round(duration_s * 30)):
        time_s = number / 30
        x_m = 0.1 * math.sin(time_s)
        makes = {
            DEPTH: image(DEPTH, number),
            COLOR: image(COLOR, number),
            DEPTH_INFO: info(),
            COLOR_INFO: info(),
            GRIPPER: point(x_m),
            GRIPPER_COLOR: point(x_m),
            "/joint_states": joints(0.2 * math.sin(time_s)),
            "/tf": lambda stamp_ns: wire().transforms("link", stamp_ns=stamp_ns),
        }
        entries += [Entry(topic, time_s, make) for topic, make in makes.items()]
    return entries


def write(path: Path, entries: list[Entry], types: dict[str, str] | None = None) -> Path:
    """Write messages to a bag, in the order of their record times; ``types`` adds topics that may have none."""
    path.unlink(missing_ok=True)
    connections = {}
    with rosbag1.Writer(path) as writer:
        writer.chunk_threshold = 1 << 20
        kinds = {topic: TYPES[topic] for topic in dict.fromkeys(each.topic for each in entries) if topic in TYPES}
        for topic, kind in {**kinds, **(types or {})}.items():
            connections[topic] = writer.add_connection(topic, kind, typestore=wire().store)
        for each in sorted(entries, key=lambda each: each.time_s):
            stamp_ns = START_NS + round(each.time_s * 1e9)
            raw = each.make(stamp_ns + round(each.stamp_shift_s * 1e9))
            writer.write(connections[each.topic], stamp_ns + 20_000_000, raw)
    return path


@pytest.fixture(scope="session")
def contract() -> Contract:
    """Return the packaged contract, for images of the size that these tests have."""
    packaged = read_contract(packaged_workspace() / "catalog" / "contract.toml")
    assert packaged.images.depth is not None
    assert packaged.images.color is not None
    assert packaged.gripper is not None
    size = {"sizes_px": ((WIDTH_PX, HEIGHT_PX),)}
    images = packaged.images.model_copy(
        update={
            "depth": packaged.images.depth.model_copy(update=size),
            "color": packaged.images.color.model_copy(update=size),
        }
    )
    gripper = packaged.gripper.model_copy(update={"camera_frame": ""})
    return packaged.model_copy(update={"images": images, "gripper": gripper})
