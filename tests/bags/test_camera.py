"""The camera of a stream, from its camera_info."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from garment_dataset.bags import Camera, open_bag, read_camera
from garment_dataset.bags.camera import camera_info_beside, image_base, is_rectified
from garment_dataset.errors import BagError, DataWarning

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    WriteBag = Callable[..., Path]

TOPIC, CAMERA_INFO = "/depth/camera_info", "sensor_msgs/msg/CameraInfo"
START_NS = 1_391_700_000_000_000_000
K = (567.5, 0.0, 312.25, 0.0, 568.5, 242.75, 0.0, 0.0, 1.0)
D = (0.5, -0.25, 0.0, 0.125, 1.0)
EXPECTED = Camera("optical", 640, 480, 567.5, 568.5, 312.25, 242.75, "plumb_bob", D)


def recorded(messages: list[bytes]) -> list[tuple[str, str, int, bytes]]:
    return [(TOPIC, CAMERA_INFO, START_NS + n, message) for n, message in enumerate(messages)]


def camera_of(path: Path, topic: str = TOPIC, **use: Any) -> Camera:
    with open_bag(path) as bag:
        return read_camera(bag, topic, **use)


P = (500.0, 0.0, 320.5, -20.0, 0.0, 501.0, 240.25, 0.0, 0.0, 0.0, 1.0, 0.0)
NONE = (0.0,) * 12


def info(
    ros: Any, k: Sequence[float] = K, p: Sequence[float] = P, binning: tuple[int, int] = (0, 0), roi: Any = (0, 0, 0, 0)
) -> bytes:
    """A CameraInfo of 640 x 480 pixels; ``roi`` is x, y, height and width."""
    arrays = (D, k, (1, 0, 0, 0, 1, 0, 0, 0, 1), p)
    region = ros.store.types["sensor_msgs/msg/RegionOfInterest"](*roi, False)
    numbers = [np.array(each, float) for each in arrays]
    return bytes(ros.serialise(CAMERA_INFO, ros.header(), 480, 640, "plumb_bob", *numbers, *binning, region))


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
    with pytest.raises(
        BagError, match=rf"{TOPIC}: camera is not calibrated: found K that is all zero, and no other matrix\. Calibrate"
    ):
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


@pytest.fixture(params=["ros1", "ros2"])
def write(request: pytest.FixtureRequest, ros1: Any, ros2: Any, write_bag: WriteBag, write_rosbag2: WriteBag) -> Any:
    """Return a writer of one CameraInfo, by either system."""
    if request.param == "ros1":
        return lambda **changes: write_bag(recorded([info(ros1, **changes)]))
    return lambda **changes: write_rosbag2(recorded([info(ros2, **changes)]), "sqlite3")


def without_a_note(path: Path, **use: Any) -> Camera:
    with warnings.catch_warnings():
        warnings.simplefilter("error", DataWarning)
        return camera_of(path, **use)


def with_note(path: Path, note: str, **use: Any) -> Camera:
    with pytest.warns(DataWarning) as caught:
        camera = camera_of(path, **use)
    assert [str(each.message) for each in caught] == [f"{path.name}: {TOPIC}: {note}"]
    return camera


RECTIFIED = Camera("optical", 640, 480, 500.0, 501.0, 320.5, 240.25, "", (), "P")


def test_raw_images_are_measured_with_k_and_rectified_ones_with_p(write: Any) -> None:
    assert without_a_note(write()) == EXPECTED
    assert without_a_note(write(), rectified=True) == RECTIFIED


def test_where_one_matrix_was_never_filled_the_other_is_used(write: Any) -> None:
    raw = with_note(write(k=NONE[:9]), "K is all zero, P is used for raw images")
    assert raw == replace(RECTIFIED, distortion_model="plumb_bob", distortion=D)
    rectified = with_note(write(p=NONE), "P is all zero, K is used for rectified images", rectified=True)
    assert rectified == replace(EXPECTED, distortion_model="", distortion=())


@pytest.mark.parametrize(("rectified", "name"), [(False, "K"), (True, "P")])
def test_two_empty_matrices_are_an_error(write: Any, rectified: bool, name: str) -> None:
    with pytest.raises(BagError, match=f"camera is not calibrated: found {name} that is all zero, and no other matrix"):
        camera_of(write(k=NONE[:9], p=NONE), rectified=rectified)


def test_a_broken_p_does_not_stand_in(write: Any) -> None:
    with pytest.raises(BagError, match="found K that is all zero"):
        camera_of(write(k=NONE[:9], p=(-1.0, *P[1:])))
    with pytest.raises(BagError, match="P is no camera matrix"):
        camera_of(write(p=(-1.0, *P[1:])), rectified=True)


def test_binning_divides_focal_length_and_principal_point(write: Any) -> None:
    note = (
        "a window of 640 x 480 pixels at (0, 0), binned 2 x 4, is stated: K is corrected for images of 320 x 120 pixels"
    )
    expected = replace(EXPECTED, width_px=320, height_px=120, fx_px=283.75, fy_px=142.125, cx_px=156.125, cy_px=60.6875)
    path = write(binning=(2, 4))
    assert with_note(path, note, image_size_px=(320, 120)) == expected
    assert with_note(path, note) == expected


def test_a_window_moves_the_principal_point_before_binning(write: Any) -> None:
    path = write(binning=(2, 2), roi=(100, 40, 240, 320))
    note = (
        "a window of 320 x 240 pixels at (100, 40), binned 2 x 2, is stated: "
        "P is corrected for images of 160 x 120 pixels"
    )
    found = with_note(path, note, rectified=True, image_size_px=(160, 120))
    assert found == Camera("optical", 160, 120, 250.0, 250.5, 110.25, 100.125, "", (), "P")


def test_a_point_of_every_second_pixel_is_where_it_was(write: Any) -> None:
    """Known answer: of a pixel (u, v) that is kept, the ray stays the same."""
    with pytest.warns(DataWarning):
        half = camera_of(write(binning=(2, 2)), image_size_px=(320, 240))
    u, v = 100, 60
    assert (u - half.cx_px) / half.fx_px == pytest.approx((2 * u - EXPECTED.cx_px) / EXPECTED.fx_px)
    assert (v - half.cy_px) / half.fy_px == pytest.approx((2 * v - EXPECTED.cy_px) / EXPECTED.fy_px)


def test_a_whole_window_stated_in_full_is_none(write: Any) -> None:
    assert without_a_note(write(binning=(1, 1), roi=(0, 0, 480, 640)), image_size_px=(640, 480)) == EXPECTED


def test_binning_that_images_of_full_size_refute(write: Any) -> None:
    note = (
        "a window of 640 x 480 pixels at (0, 0), binned 2 x 2, is stated, "
        "but images have the full size of 640 x 480: no correction"
    )
    assert with_note(write(binning=(2, 2)), note, image_size_px=(640, 480)) == EXPECTED


@pytest.mark.parametrize("times", [2, 4])
def test_images_of_a_whole_fraction_are_binned_though_nothing_says_so(write: Any, times: int) -> None:
    size = (640 // times, 480 // times)
    note = f"images of {size[0]} x {size[1]} pixels are 1/{times} of the calibrated 640 x 480: K is scaled"
    found = with_note(write(), note, image_size_px=size)
    assert (found.width_px, found.height_px) == size
    assert (found.fx_px, found.cy_px) == (567.5 / times, 242.75 / times)


@pytest.mark.parametrize("size", [(320, 200), (640, 240), (1280, 960), (427, 320)])
def test_images_of_any_other_size_change_nothing(write: Any, size: tuple[int, int]) -> None:
    assert without_a_note(write(), image_size_px=size) == EXPECTED


def test_a_contradiction_in_the_matrix_not_used_does_not_count(ros1: Any, write_bag: WriteBag) -> None:
    path = write_bag(recorded([info(ros1), info(ros1, p=NONE)]))
    assert without_a_note(path) == EXPECTED


@pytest.mark.parametrize(
    ("topic", "base", "rectified", "beside"),
    [
        ("/xtion1/depth/image_raw", "/xtion1/depth/image_raw", False, "/xtion1/depth/camera_info"),
        ("/a/image_rect", "/a/image_rect", True, "/a/camera_info"),
        ("/a/image_rect_color/compressed", "/a/image_rect_color", True, "/a/camera_info"),
        ("/a/image_rect_raw/compressedDepth", "/a/image_rect_raw", True, "/a/camera_info"),
        ("/image_rect/image", "/image_rect/image", False, "/image_rect/camera_info"),
        ("image_rect", "image_rect", True, "camera_info"),
    ],
)
def test_what_the_name_of_a_topic_says(topic: str, base: str, rectified: bool, beside: str) -> None:
    assert (image_base(topic), is_rectified(topic), camera_info_beside(topic)) == (base, rectified, beside)
