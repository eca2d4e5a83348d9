"""Measure how fast a bag is read, all ways side by side in one run: ``python benchmarks/read_bag.py [--frames N]``.

Writes a recording like the thesis' into a temporary folder: N pairs of a colour and a depth frame, 640x480, and ten
joint states a pair; 240 pairs make 370 MB. The ways of reading take turns, and the table gives for each the median
time by the clock and of the processor, their ratios to reading the file through one buffer, and the most memory of its
own that a fresh process took for it (pages of the mapped file are the system's: it takes them back when it likes).
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from garment_dataset.bags import open_bag

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

DEPTH, COLOR, JOINTS = "/xtion1/depth/image_raw", "/xtion1/rgb/image_raw", "/joint_states"
PERIOD_NS = 33_400_000
BUFFER_BYTES = 2**20


def write_recording(path: Path, frames: int, compression: str) -> None:
    """Write ``frames`` pairs of images that compress about as badly as real ones."""
    store, random = get_typestore(Stores.ROS1_NOETIC), np.random.default_rng(0)
    image, joint_state = store.types["sensor_msgs/msg/Image"], store.types["sensor_msgs/msg/JointState"]
    header, time_ = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    depth = random.integers(800, 1300, (480, 640), np.uint16)
    color = random.integers(0, 255, (480, 80, 3), np.uint8).repeat(8, axis=1)
    names, zeros = [f"r{arm}_joint_{joint}" for arm in (1, 2) for joint in range(7)], np.zeros(14)
    writer = Writer(path)
    if compression != "none":
        writer.set_compression(Writer.CompressionFormat[compression.upper()])
    with writer:
        types = {DEPTH: image.__msgtype__, COLOR: image.__msgtype__, JOINTS: joint_state.__msgtype__}
        on = {topic: writer.add_connection(topic, each, typestore=store) for topic, each in types.items()}

        def write(topic: str, stamp_ns: int, *fields: Any) -> None:  # noqa: ANN401 - the fields of any message
            stamp = header(0, time_(*divmod(stamp_ns, 10**9)), "optical")
            message = store.types[types[topic]](stamp, *fields)
            writer.write(on[topic], stamp_ns, store.serialize_ros1(message, types[topic]))

        for index in range(frames):
            stamp_ns = 10**18 + index * PERIOD_NS
            rows = np.roll(depth, index, axis=0).view(np.uint8).reshape(-1)
            write(DEPTH, stamp_ns, 480, 640, "16UC1", 0, 1280, rows)
            write(COLOR, stamp_ns, 480, 640, "rgb8", 0, 1920, np.roll(color, index, axis=0).reshape(-1))
            for sample in range(10):
                write(JOINTS, stamp_ns + sample * PERIOD_NS // 10, names, zeros, zeros, zeros)


def read_file(path: Path) -> int:
    """Read the file through one buffer: the floor."""
    buffer, total = bytearray(BUFFER_BYTES), 0
    with path.open("rb", buffering=0) as file:
        while size := file.readinto(buffer):
            total += size
    return total


def open_only(path: Path) -> int:
    """Open the bag: its index."""
    with open_bag(path) as bag:
        return len(bag.topics)


def contradictions(path: Path) -> int:
    """Compare the index with what the chunks hold."""
    with open_bag(path) as bag:
        return len(bag.contradictions())


def every_header(path: Path) -> int:
    """See every image message, no pixel."""
    with open_bag(path) as bag:
        return sum(message.fault is None for topic in (DEPTH, COLOR) for message in bag.images(topic, kind(topic)))


def every_pixel(path: Path) -> int:
    """Touch every pixel of both streams."""
    with open_bag(path) as bag:
        return sum(touched(message.pixels()) for topic in (DEPTH, COLOR) for message in bag.images(topic, kind(topic)))


def depth_strip(path: Path) -> int:
    """Touch the part of each depth frame that the points are made of."""
    with open_bag(path) as bag:
        return sum(touched(message.pixels()[100:380, 300:340].copy()) for message in bag.images(DEPTH, "depth"))


def small_messages(path: Path) -> int:
    """Deserialise what is no image."""
    with open_bag(path) as bag:
        return sum(len(message.data.name) for message in bag.messages(JOINTS))


def any_reader_pixels(path: Path) -> int:
    """Touch every pixel through the deserialised messages of rosbags."""
    with AnyReader([path]) as reader:
        connections = [each for each in reader.connections if each.topic != JOINTS]
        images: Iterator[Any] = (
            reader.deserialize(data, each.msgtype) for each, _, data in reader.messages(connections)
        )
        return sum(touched(image.data) for image in images)


def any_reader_all(path: Path) -> int:
    """Deserialise every message with rosbags."""
    with AnyReader([path]) as reader:
        messages = (reader.deserialize(data, connection.msgtype) for connection, _, data in reader.messages())
        return sum(message is not None for message in messages)


WAYS: dict[str, Callable[[Path], int]] = {
    "file, one buffer": read_file,
    "open_bag": open_only,
    "contradictions": contradictions,
    "every image header": every_header,
    "every pixel": every_pixel,
    "depth strip": depth_strip,
    "small messages": small_messages,
    "AnyReader, every pixel": any_reader_pixels,
    "AnyReader, all deserialised": any_reader_all,
}


def kind(topic: str) -> Any:  # noqa: ANN401 - a literal
    """Return the kind of a stream."""
    return "depth" if topic == DEPTH else "color"


def touched(pixels: NDArray[Any]) -> int:
    """Xor all bytes of an image."""
    return int(np.bitwise_xor.reduce(pixels.reshape(-1).view(np.uint8)))


def milliseconds(way: Callable[[Path], int], path: Path) -> tuple[float, float]:
    """Time one reading: by the clock, and of the processor."""
    start, start_processor = time.perf_counter(), time.process_time()
    way(path)
    return (time.perf_counter() - start) * 1e3, (time.process_time() - start_processor) * 1e3


def medians(times: list[tuple[float, float]]) -> tuple[float, float]:
    """Return the median of either time."""
    wall, processor = map(statistics.median, zip(*times, strict=True))
    return wall, processor


def own_memory_mib() -> float:
    """Return the anonymous memory of this process."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("RssAnon:")[1].split()[0]) / 1024


def peak_memory_mib(name: str, path: Path) -> float:
    """Read once and return by how much this process grew at most."""
    before, peak, done = own_memory_mib(), 0.0, threading.Event()

    def watch() -> None:
        nonlocal peak
        while not done.wait(0.002):
            peak = max(peak, own_memory_mib())

    watcher = threading.Thread(target=watch)
    watcher.start()
    WAYS[name](path)
    done.set()
    watcher.join()
    return max(peak, own_memory_mib()) - before


def main() -> None:
    """Write the recording, measure, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--frames", type=int, default=240)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--compression", choices=("none", "lz4", "bz2"), default="none")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "recording.bag")
        write_recording(path, options.frames, options.compression)
        for way in WAYS.values():  # warms the cache, generates code
            way(path)
        times = {name: list[tuple[float, float]]() for name in WAYS}
        for _ in range(options.rounds):
            for name, way in WAYS.items():
                times[name].append(milliseconds(way, path))
        with ProcessPoolExecutor(1, get_context("spawn"), max_tasks_per_child=1) as pool:
            memory = {name: pool.submit(peak_memory_mib, name, path).result() for name in WAYS}
        floor, floor_processor = medians(times["file, one buffer"])
        print(f"{path.stat().st_size / 1e6:.1f} MB, compression {options.compression}, {options.rounds} rounds")
        print(f"{'':30}{'median ms':>10}{'x file':>8}{'processor':>10}{'x file':>8}{'peak MiB':>10}")
        for name, each in times.items():
            wall, processor = medians(each)
            ratios = wall / floor, processor / floor_processor
            print(f"{name:30}{wall:10.1f}{ratios[0]:8.2f}{processor:10.1f}{ratios[1]:8.2f}{memory[name]:10.1f}")


if __name__ == "__main__":
    main()
