from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pyarrow.parquet as pq
import pytest
from rosbags.rosbag1 import Reader

from garment_dataset.errors import GarmentError, RecordingNameError
from garment_dataset.simulate.messages import typestore
from garment_dataset.simulate.recording import SCALES, Scale, random_streams, simulate_recording
from garment_dataset.simulate.sensor import openni_table

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from typing import Any, Literal

    from numpy.typing import NDArray

pytest.importorskip("mujoco")

NAME = "GreenTowel_Ruler_01_pi16_0.5_R1"
FRAMES = 3

TOPICS = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/xtion1/depth/camera_info": "sensor_msgs/msg/CameraInfo",
    "/xtion1/depth_registered/camera_info": "sensor_msgs/msg/CameraInfo",
    "/xtion1/rgb/camera_info": "sensor_msgs/msg/CameraInfo",
    "/xtion1/depth/image_raw": "sensor_msgs/msg/Image",
    "/xtion1/rgb/image_raw": "sensor_msgs/msg/Image",
    "/feedback_states": "control_msgs/msg/FollowJointTrajectoryFeedback",
    "/r2_ee_to_depth": "geometry_msgs/msg/PointStamped",
    "/r2_ee_to_rgb": "geometry_msgs/msg/PointStamped",
}


def read(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Return record time and message by topic, as the reference reader reads them."""
    found: dict[str, list[tuple[int, Any]]] = {}
    with Reader(path) as reader:
        for connection, record_ns, data in reader.messages():
            message = typestore().deserialize_ros1(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((record_ns, message))
    return found


def stamp_ns(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def depth_mm(message: Any) -> NDArray[np.uint16]:
    pixels: NDArray[np.uint16] = message.data.view("<u2").reshape(message.height, message.width)
    return pixels


@pytest.fixture(scope="module", autouse=True)
def coarse() -> Iterator[None]:
    """Make the small scale smaller: these tests look at what is written, not at how the cloth moves."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(SCALES, "small", Scale(60, 0.004, 1, 3.5, 0.5))
        yield


@pytest.fixture(scope="module")
def exact(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exact")
    return simulate_recording(NAME, folder, seed=3, noise="none", frames=FRAMES, scale="small")


@pytest.fixture(scope="module")
def noisy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulate_recording(NAME, tmp_path_factory.mktemp("noisy"), seed=3, frames=FRAMES, scale="small")


@pytest.fixture(scope="module")
def points(exact: Path) -> dict[str, NDArray[Any]]:
    """Return the truth's columns, each of shape (frames, 5)."""
    table = pq.read_table(exact.with_suffix(".truth") / "points.parquet")
    return {name: table[name].to_numpy().reshape(-1, 5) for name in table.column_names}


def test_all_ten_topics_in_the_recorder_s_types(noisy: Path) -> None:
    with Reader(noisy) as reader:
        assert {topic: info.msgtype for topic, info in reader.topics.items()} == TOPICS
        assert {info.msgcount for topic, info in reader.topics.items() if "image" in topic} == {FRAMES}


def test_images_are_the_sensor_s(noisy: Path) -> None:
    found = read(noisy)
    _, depth = found["/xtion1/depth/image_raw"][0]
    _, color = found["/xtion1/rgb/image_raw"][0]
    assert (depth.width, depth.height, depth.encoding, depth.step) == (640, 480, "16UC1", 1280)
    assert (color.width, color.height, color.encoding, color.step) == (640, 480, "rgb8", 1920)
    assert depth.header.frame_id == "xtion1_depth_optical_frame"
    assert color.header.frame_id == "xtion1_rgb_optical_frame"
    assert set(np.unique(depth_mm(depth))) <= {0, *openni_table().tolist()}


def test_clocks(noisy: Path) -> None:
    found = read(noisy)
    for topic in ("/xtion1/depth/image_raw", "/xtion1/rgb/image_raw", "/joint_states", "/r2_ee_to_depth"):
        for record_ns, message in found[topic]:
            assert 0 < record_ns - stamp_ns(message) < 60e6
    pairs = zip(found["/xtion1/depth/image_raw"], found["/xtion1/rgb/image_raw"], strict=True)
    for (_, depth), (_, color) in pairs:
        assert 1.65e6 <= stamp_ns(color) - stamp_ns(depth) <= 3.61e6
    records = [record for messages in found.values() for record, _ in messages]
    with Reader(noisy) as reader:
        assert [record for _, record, _ in reader.messages()] == sorted(records)


def test_fixed_links_come_in_messages_of_their_own_dated_ahead(noisy: Path) -> None:
    fixed: list[tuple[set[str], int]] = []
    moving: list[tuple[set[str], int]] = []
    for record_ns, message in read(noisy)["/tf"]:
        children = {transform.child_frame_id for transform in message.transforms}
        ahead = stamp_ns(message.transforms[0]) - record_ns
        (fixed if "xtion1_link" in children else moving).append((children, ahead))
    assert all("r2_ee" not in children for children, _ in fixed)
    assert all(0.4e9 < ahead <= 0.5e9 for _, ahead in fixed)
    assert all(ahead < 0 for _, ahead in moving)
    assert len(moving) > 2 * len(fixed)


def test_gripper_topics_say_where_the_gripper_is(noisy: Path, points: dict[str, NDArray[Any]]) -> None:
    found = read(noisy)
    place = [points[f"gripper_{axis}_m"][0, 0] for axis in "xyz"]
    for topic, shift in (("/r2_ee_to_depth", 0.0), ("/r2_ee_to_rgb", -0.025)):
        _, message = found[topic][0]
        assert [message.point.x - shift, message.point.y, message.point.z] == pytest.approx(place)


def test_truth_has_a_row_per_frame_and_point_on_the_bag_s_stamps(exact: Path, points: dict[str, NDArray[Any]]) -> None:
    stamps = [stamp_ns(message) for _, message in read(exact)["/xtion1/depth/image_raw"]]
    assert points["stamp_ns"].ravel().tolist() == np.repeat(stamps, 5).tolist()
    assert points["point"].tolist() == [[1, 2, 3, 4, 5]] * FRAMES
    assert all(np.isfinite(values).all() for values in points.values())
    assert points["surface_in_image"].all()


def test_exact_depth_shows_the_true_points(exact: Path, points: dict[str, NDArray[Any]]) -> None:
    depths = [depth_mm(message) for _, message in read(exact)["/xtion1/depth/image_raw"]]
    x, y, z = (points[f"surface_{axis}_m"].ravel() for axis in "xyz")
    for frame, u, v, z_m in zip(
        points["frame"].ravel(), 570.3422 * x / z + 319.5, 570.3422 * y / z + 239.5, z, strict=True
    ):
        left, top = int(u), int(v)
        patch = depths[frame][top : top + 2, left : left + 2].astype(float)
        found = np.array([1 - (v - top), v - top]) @ patch @ np.array([1 - (u - left), u - left])
        assert found == pytest.approx(1000 * z_m, abs=0.6)


def test_towel_hangs_64_cm(points: dict[str, NDArray[Any]]) -> None:
    assert points["surface_length_m"] == pytest.approx(0.64, rel=0.01)
    assert points["material_length_m"] == pytest.approx(0.64, rel=0.01)
    below = points["surface_y_m"] - points["gripper_y_m"]
    assert below[0] == pytest.approx([0.064, 0.192, 0.320, 0.448, 0.576], abs=0.004)


def test_color_truth_matches_the_exact_image(exact: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    truth = pq.read_table(exact.with_suffix(".truth") / "color.parquet").to_pylist()
    for (_, message), row in zip(read(exact)["/xtion1/rgb/image_raw"], truth, strict=True):
        assert stamp_ns(message) == row["stamp_ns"]
        pixels = message.data.reshape(480, 640, 3).astype(int)
        mask = cv2.imdecode(np.frombuffer(row["garment_mask"], np.uint8), cv2.IMREAD_UNCHANGED) > 0
        gripper = cv2.imdecode(np.frombuffer(row["gripper_mask"], np.uint8), cv2.IMREAD_UNCHANGED) > 0
        green = pixels[..., 1] - pixels[..., [0, 2]].max(axis=-1) > 12
        assert (green & mask).sum() / (green | mask).sum() > 0.97
        assert not (mask & gripper).any()
        assert gripper.sum() > 500
        assert row["area_px"] == pytest.approx(mask.sum(), rel=0.02)
        assert row["major_px"] > row["minor_px"] > 100
        v, u = np.nonzero(mask)
        assert (row["centroid_u_px"], row["centroid_v_px"]) == pytest.approx((u.mean(), v.mean()), abs=1.0)
        assert abs(abs(row["orientation_rad"]) - np.pi / 2) < 0.15
        assert len(row["line_u_px"]) == len(row["line_v_px"]) == 65
        assert (np.diff(row["line_v_px"]) > 0).all()


def test_every_truth_column_has_unit_and_description(exact: Path) -> None:
    for name in ("points", "color"):
        for field in pq.read_schema(exact.with_suffix(".truth") / f"{name}.parquet"):
            assert set(field.metadata or {}) == {b"unit", b"description"}


def test_scene_says_what_was_simulated(exact: Path) -> None:
    scene = json.loads((exact.with_suffix(".truth") / "scene.json").read_text())
    assert scene["recording"] == NAME
    assert scene["cloth"]["mass_kg"] == pytest.approx(0.045)
    assert scene["flat_length_m"] == pytest.approx(0.64)
    assert scene["swing"]["swing_rad"] == pytest.approx(np.pi / 16)


def test_equal_seeds_give_equal_bytes_and_other_seeds_do_not(noisy: Path, tmp_path: Path) -> None:
    again = simulate_recording(NAME, tmp_path, seed=3, frames=FRAMES, scale="small")
    assert again.read_bytes() == noisy.read_bytes()
    for path in sorted(noisy.with_suffix(".truth").iterdir()):
        assert (again.with_suffix(".truth") / path.name).read_bytes() == path.read_bytes()
    streams = [random_streams(name, seed) for name, seed in ((NAME, 3), (NAME, 4), ("GreenTowel_Ruler_02_x_R1", 3))]
    assert len({stream["hanging"].random() for stream in streams}) == 3


@pytest.mark.parametrize("compression", ["lz4", "bz2"])
def test_empty_scene_needs_no_gripper_and_can_be_compressed(tmp_path: Path, compression: Literal["lz4", "bz2"]) -> None:
    plain = simulate_recording("camera_default_0", tmp_path, seed=1, frames=2)
    packed = simulate_recording("camera_default_0", tmp_path / "packed", seed=1, frames=2, compression=compression)
    assert packed.stat().st_size < plain.stat().st_size
    first, second = read(plain), read(packed)
    assert set(first) == set(TOPICS) - {"/r2_ee_to_depth", "/r2_ee_to_rgb"}
    for topic, messages in first.items():
        assert [record for record, _ in messages] == [record for record, _ in second[topic]]
    for (_, one), (_, other) in zip(first["/xtion1/rgb/image_raw"], second["/xtion1/rgb/image_raw"], strict=True):
        assert (one.data == other.data).all()
    if compression == "lz4":
        flags = [frame[0] for frame in packed.read_bytes().split(b"\x04\x22\x4d\x18")[1:]]
        assert flags
        assert all(flag & 0b100 for flag in flags), "no checksum of the content"
    assert not plain.with_suffix(".truth").exists()
    middle = depth_mm(first["/xtion1/depth/image_raw"][0][1])[100:400, 200:450]
    assert np.median(middle) == pytest.approx(1800, abs=10)


def test_a_new_run_replaces_the_old_one(tmp_path: Path) -> None:
    first = simulate_recording("camera_default_0", tmp_path, seed=1, frames=1).read_bytes()
    second = simulate_recording("camera_default_0", tmp_path, seed=2, frames=1).read_bytes()
    assert first != second
    assert [path.name for path in tmp_path.iterdir()] == ["camera_default_0.bag"]


@pytest.mark.parametrize(
    ("name", "match"),
    [
        ("towel16_0.1_0006_R2", "no garment and holding"),
        ("GreenTowel_Corner_01_pi16_0_R1", "speed"),
        ("Tent_Corner_01_pi16_0.5_R1", "no size and weight"),
        ("GreenTowel_Sleeve_01_pi16_0.5_R1", "no such holding"),
    ],
)
def test_names_that_say_nothing_to_simulate(tmp_path: Path, name: str, match: str) -> None:
    with pytest.raises(GarmentError, match=match):
        simulate_recording(name, tmp_path)
    assert not list(tmp_path.iterdir())


def test_not_a_name(tmp_path: Path) -> None:
    with pytest.raises(RecordingNameError):
        simulate_recording("what is this", tmp_path)


def test_unknown_options(tmp_path: Path) -> None:
    with pytest.raises(GarmentError, match="no such option"):
        simulate_recording("camera_default_0", tmp_path, scale="huge")
