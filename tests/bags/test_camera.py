"""The camera of a stream, from its camera_info."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pytest

from garment_dataset.bags import Camera, open_bag, read_camera
from garment_dataset.errors import BagError, DataWarning

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    WriteBag = Callable[..., Path]

TOPIC, CAMERA_INFO = "/depth/camera_info", "sensor_msgs/msg/CameraInfo"
START_NS = 1_391_700_000_000_000_000
K = (567.5, 0.0, 312.25, 0.0, 568.5, 242.75, 0.0, 0.0, 1.0)
D = (0.5, -0.25, 0.0, 0.125, 1.0)
EXPECTED = Camera("optical", 640, 480, 567.5, 568.5, 312.25, 242.75, "plumb_bob", D)


def recorded(messages: list[bytes]) -> list[tuple[str, str, int, bytes]]:
    return [(TOPIC, CAMERA_INFO, START_NS + n, message) for n, message in enumerate(messages)]


def camera_of(path: Path, topic: str = TOPIC) -> Camera:
    with open_bag(path) as bag:
        return read_camera(bag, topic)


def test_a_ros1_camera_is_read_whole(ros1: Any, write_bag: WriteBag) -> None:
    messages = [ros1.camera_info(K, D, stamp_ns=START_NS + n) for n in range(3)]
    assert camera_of(write_bag(recorded(messages))) == EXPECTED


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_ros2_camera_is_the_same(ros2: Any, write_rosbag2: WriteBag, storage: str) -> None:
    assert camera_of(write_rosbag2(recorded([ros2.camera_info(K, D)]), storage)) == EXPECTED


def test_a_camera_without_distortion_has_none(ros1: Any, write_bag: WriteBag) -> None:
    assert camera_of(write_bag(recorded([ros1.camera_info(K)]))).distortion == ()


def test_an_all_zero_k_is_an_error_that_says_so(ros1: Any, write_bag: WriteBag) -> None:
    path = write_bag(recorded([ros1.camera_info([0.0] * 9)]))
    with pytest.raises(BagError, match=rf"{TOPIC}: camera is not calibrated: found K that is all zero\. Calibrate"):
        camera_of(path)


@pytest.mark.parametrize(("place", "value"), [(0, 0.0), (4, -568.5), (0, math.nan), (2, math.inf)])
def test_a_k_that_is_no_camera_matrix_is_an_error(ros1: Any, write_bag: WriteBag, place: int, value: float) -> None:
    path = write_bag(recorded([ros1.camera_info([*K[:place], value, *K[place + 1 :]])]))
    with pytest.raises(BagError, match="K is no camera matrix: expected finite, positive fx and fy"):
        camera_of(path)


def test_a_missing_topic_is_an_error_that_names_those_there_are(ros1: Any, write_bag: WriteBag) -> None:
    path = write_bag(recorded([ros1.camera_info(K)]))
    with pytest.raises(BagError, match=f"no such topic: expected /rgb/camera_info, found {TOPIC}"):
        camera_of(path, "/rgb/camera_info")


def test_a_topic_of_another_type_is_an_error(ros1: Any, write_bag: WriteBag) -> None:
    path = write_bag([("/tf", "tf2_msgs/msg/TFMessage", START_NS, ros1.transforms("a"))])
    with pytest.raises(BagError, match=f"expected {CAMERA_INFO}, found tf2_msgs/msg/TFMessage"):
        camera_of(path, "/tf")


def test_a_topic_without_a_readable_message_is_an_error(write_bag: WriteBag) -> None:
    path = write_bag(recorded([b"short"]))
    with pytest.raises(BagError, match="no readable message"), pytest.warns(DataWarning, match="left out 1 of 1"):
        camera_of(path)


def test_of_contradicting_cameras_the_first_is_used_with_a_warning(ros1: Any, write_bag: WriteBag) -> None:
    others = [ros1.camera_info((500.0, *K[1:]), D), ros1.camera_info(K, D, size_px=(320, 240))]
    path = write_bag(recorded([ros1.camera_info(K, D), *others, ros1.camera_info(K, D)]))
    with pytest.warns(DataWarning, match="2 of 4 messages contradict the first, which is used"):
        assert camera_of(path) == EXPECTED
