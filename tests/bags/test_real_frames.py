"""Real recordings, written by the ROS project's own rosbag, give exactly the pixels they are known to hold."""

from __future__ import annotations

import csv
import hashlib
from typing import TYPE_CHECKING

import pytest

from garment_dataset.bags import ImageMessage, Kind, open_bag, read_camera

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.real

KINDS: dict[str, Kind] = {"/xtion1/depth/image_raw": "depth", "/xtion1/rgb/image_raw": "color"}


def facts(topic: str, message: ImageMessage) -> dict[str, str]:
    """Return one row of ``*.frames.csv``."""
    values = {
        "topic": topic,
        "i": message.index,
        "stamp_ns": message.stamp_ns,
        "bag_ns": message.record_stamp_ns,
        "encoding": message.encoding,
        "height": message.height_px,
        "width": message.width_px,
        "step": message.step_bytes,
        "sha256": hashlib.sha256(message.pixels().tobytes()).hexdigest(),
        "fault": message.fault or "",
    }
    return {name: str(value) for name, value in values.items()}


def test_every_frame_is_reproduced(real_data: Path) -> None:
    bags = sorted((real_data / "recordings").glob("*.bag"))
    assert bags
    for path in bags:
        with path.with_suffix(".frames.csv").open(newline="") as file:
            expected = sorted(csv.DictReader(file), key=lambda row: (row["topic"], row["i"]))
        with open_bag(path) as bag:
            found = [facts(topic, message) for topic, kind in KINDS.items() for message in bag.images(topic, kind)]
        assert found == expected


def test_every_camera_is_calibrated_for_its_images(real_data: Path) -> None:
    for path in sorted((real_data / "recordings").glob("*.bag")):
        with open_bag(path) as bag:
            for topic, kind in KINDS.items():
                camera = read_camera(bag, topic.replace("image_raw", "camera_info"))
                image = next(bag.images(topic, kind))
                assert (camera.width_px, camera.height_px) == (image.width_px, image.height_px)
                assert camera.frame_id == image.frame_id


def test_both_compressions_of_a_recording_hold_the_same_messages(real_data: Path) -> None:
    found = []
    for compression in ("lz4", "bz2"):
        with open_bag(real_data / "tf" / f"real_turtle_{compression}.bag") as bag:
            messages = bag.messages(*bag.topics)
            found.append([(each.topic, each.type, each.index, each.record_stamp_ns, each.data) for each in messages])
    assert len(found[0]) == 8647
    assert list(map(repr, found[0])) == list(map(repr, found[1]))


def test_mixed_types_and_several_publishers_on_one_topic(real_data: Path) -> None:
    with open_bag(real_data / "tf" / "real_jaxon_tf.bag") as bag:
        assert bag.topics["/tf"].types == ("tf/msg/tfMessage", "tf2_msgs/msg/TFMessage")
        messages = list(bag.messages("/tf"))
    assert len(messages) == bag.topics["/tf"].count == 3532
    children = {link.child_frame_id.lstrip("/") for each in messages for link in each.data.transforms}
    assert len(children) == 83
    stamps = [each.record_stamp_ns for each in messages]
    assert stamps == sorted(stamps)
