"""An MCAP file says what the tables say, to readers that are not ours: that of MCAP, of ROS 2, and rosbags."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest

from garment_dataset.bags import open_bag
from garment_dataset.features.reading import load_features
from garment_dataset.viewers import mcap_file
from garment_dataset.viewers.frames import Frames
from garment_dataset.viewers.mcap_file import save_mcap
from garment_dataset.vision.depth.cloud import Intrinsics, select_pixels
from tests.conftest import FOCAL_PX, HEIGHT_PX, WIDTH_PX
from tests.viewers.conftest import COLOR_NAME, DEPTH_NAME, FRAMES

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from garment_dataset.viewers.content import Content
    from garment_dataset.workspace import Workspace

pytest.importorskip("mcap", reason="MCAP files need the extra mcap")
pytest.importorskip("mcap_ros2", reason="to read them as ROS 2 does needs mcap-ros2-support")

DEPTH, COLOR = "xtion1_depth_optical_frame", "xtion1_rgb_optical_frame"
K = Intrinsics(FOCAL_PX, FOCAL_PX, WIDTH_PX / 2, HEIGHT_PX / 2)


class Read:
    """The messages of a file by topic, each with its stamp in ns."""

    def __init__(self, path: Path) -> None:
        from mcap.reader import make_reader
        from mcap_ros2.decoder import DecoderFactory

        self.schemas: dict[str, str] = {}
        self.messages: dict[str, list[tuple[int, Any]]] = {}
        self.in_file: list[int] = []
        with path.open("rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            for schema, channel, message, said in reader.iter_decoded_messages(log_time_order=False):
                assert schema is not None
                self.schemas[channel.topic] = f"{schema.name} {schema.encoding} {channel.message_encoding}"
                self.messages.setdefault(channel.topic, []).append((message.log_time, said))
                self.in_file.append(message.log_time)

    def of(self, topic: str) -> list[Any]:
        return [message for _, message in self.messages[topic]]

    def markers(self, topic: str, frame: int, name: str) -> list[Any]:
        return [each for each in self.of(topic)[frame].markers if each.ns == name and each.action == 0]


@pytest.fixture(scope="module")
def depth_path(depth_content: Content, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mcap") / "depth.mcap"
    save_mcap(depth_content, path)
    assert [each.name for each in path.parent.iterdir()] == ["depth.mcap"]
    return path


@pytest.fixture(scope="module")
def depth_read(depth_path: Path) -> Read:
    return Read(depth_path)


@pytest.fixture(scope="module")
def color_read(color_content: Content, tmp_path_factory: pytest.TempPathFactory) -> Read:
    path = tmp_path_factory.mktemp("mcap") / "color.mcap"
    save_mcap(color_content, path)
    return Read(path)


def xyz(point: Any) -> tuple[float, float, float]:
    return point.x, point.y, point.z


def cloud_m(message: Any) -> Any:
    assert [(field.name, field.offset, field.datatype) for field in message.fields] == [
        ("x", 0, 7),
        ("y", 4, 7),
        ("z", 8, 7),
    ]
    assert message.row_step == message.width * message.point_step == len(message.data)
    return np.frombuffer(bytes(message.data), "<f4").reshape(-1, 3)


def test_topics_have_the_standard_schemas_and_every_frame(depth_read: Read) -> None:
    assert {name: kind.removesuffix(" ros2msg cdr") for name, kind in depth_read.schemas.items()} == {
        "/xtion1/depth/image_raw": "sensor_msgs/msg/Image",
        "/xtion1/depth/camera_info": "sensor_msgs/msg/CameraInfo",
        "/xtion1/rgb/image_raw/compressed": "sensor_msgs/msg/CompressedImage",
        "/xtion1/rgb/camera_info": "sensor_msgs/msg/CameraInfo",
        "/joint_states": "sensor_msgs/msg/JointState",
        "/garment/cloud": "sensor_msgs/msg/PointCloud2",
        "/garment/chain": "visualization_msgs/msg/MarkerArray",
        "/garment/points": "visualization_msgs/msg/MarkerArray",
        "/garment/gripper": "visualization_msgs/msg/MarkerArray",
    }
    counts = {name: len(messages) for name, messages in depth_read.messages.items()}
    assert counts == dict.fromkeys(counts, FRAMES) | {"/garment/gripper": counts["/garment/gripper"]}
    assert counts["/garment/gripper"] == 2 * FRAMES


def test_stamps_are_those_of_the_images_and_in_order(depth_read: Read, shown: Workspace) -> None:
    assert depth_read.in_file == sorted(depth_read.in_file)
    frames = load_features("frames", folder=shown.features_dir, recording=DEPTH_NAME)
    for stream, topic in {"depth": "/garment/points", "color": "/xtion1/rgb/image_raw/compressed"}.items():
        stamps_ns = frames.loc[frames["stream"] == stream, "stamp_ns"].tolist()
        assert [stamp_ns for stamp_ns, _ in depth_read.messages[topic]] == stamps_ns
    for stamp_ns, message in depth_read.messages["/garment/cloud"]:
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp_ns
        assert message.header.frame_id == DEPTH


def test_rosbags_and_our_own_reader_get_the_same_depth(depth_path: Path, sample_bags: dict[str, Path]) -> None:
    def images(path: Path) -> Iterator[Any]:
        with open_bag(path) as bag:
            yield from (
                (image.stamp_ns, image.pixels().copy()) for image in bag.images("/xtion1/depth/image_raw", "depth")
            )

    for (stamp_ns, pixels), (other_ns, others) in zip(images(depth_path), images(sample_bags[DEPTH_NAME]), strict=True):
        assert stamp_ns == other_ns
        np.testing.assert_array_equal(pixels, others)


def test_a_cloud_is_the_products_own_back_projection(
    depth_read: Read, shown: Workspace, sample_bags: dict[str, Path]
) -> None:
    """The sheet is all that there is in the band, and narrower than the strip that is compared."""
    grippers = load_features("gripper", folder=shown.features_dir, recording=DEPTH_NAME, stream="depth")
    with open_bag(sample_bags[DEPTH_NAME]) as bag:
        for image, message in zip(
            bag.images("/xtion1/depth/image_raw", "depth"), depth_read.of("/garment/cloud"), strict=True
        ):
            x_m, y_m, z_m = grippers.loc[grippers["frame"] == image.index, ["x_m", "y_m", "z_m"]].to_numpy()[0].tolist()
            own = select_pixels(image.pixels(), K, (x_m, y_m, z_m), band_half_width_m=0.27, strip_half_width_m=0.2)
            expected = np.stack([own.x_m, own.y_m, own.z_mm / 1000], axis=1)
            found = cloud_m(message)
            assert len(found) > 500
            np.testing.assert_allclose(_sorted(found), _sorted(expected.astype(np.float32)), atol=1e-6)


def test_markers_are_where_the_tables_say(depth_read: Read, shown: Workspace) -> None:
    points = load_features("points", folder=shown.features_dir, recording=DEPTH_NAME)
    chains = load_features("chains", folder=shown.features_dir, recording=DEPTH_NAME)
    for frame in (0, 11, FRAMES - 1):
        rows = points.query("frame == @frame").sort_values("point")
        marks = depth_read.markers("/garment/points", frame, "points")
        assert [mark.id for mark in marks] == rows["point"].tolist()
        np.testing.assert_array_equal([xyz(mark.pose.position) for mark in marks], rows[["x_m", "y_m", "z_m"]])
        around = depth_read.markers("/garment/points", frame, "points_2_std")
        np.testing.assert_allclose(
            [xyz(mark.scale) for mark in around], 4 * rows[["x_std_m", "y_std_m", "z_std_m"]], rtol=1e-12
        )
        (chain,) = depth_read.markers("/garment/chain", frame, "chain")
        np.testing.assert_array_equal(
            [xyz(point) for point in chain.points], chains.query("frame == @frame")[["x_m", "y_m", "z_m"]]
        )


def test_a_point_that_is_gone_is_taken_away(depth_content: Content, tmp_path: Path) -> None:
    points = depth_content.tables["points"].copy()
    points.loc[(points["frame"] == 5) & (points["point"] == 4), ["x_m", "y_m", "z_m"]] = np.nan
    content = dataclasses.replace(depth_content, tables={**depth_content.tables, "points": points})
    save_mcap(content, tmp_path / "gone.mcap")
    read = Read(tmp_path / "gone.mcap")
    assert [(each.ns, each.id) for each in read.of("/garment/points")[5].markers if each.action == 2] == [
        ("points", 4),
        ("points_2_std", 4),
    ]
    assert not [each for each in read.of("/garment/points")[6].markers if each.action == 2]


def test_a_silhouette_its_outline_and_curve_are_in_the_colour_camera(color_read: Read, shown: Workspace) -> None:
    assert color_read.schemas["/garment/mask/compressed"].startswith("sensor_msgs/msg/CompressedImage")
    masks = load_features("silhouettes", folder=shown.features_dir, recording=COLOR_NAME)
    curve = load_features("central_curves", folder=shown.features_dir, recording=COLOR_NAME, frame=3)
    mask = color_read.of("/garment/mask/compressed")[3]
    assert (bytes(mask.data), mask.format, mask.header.frame_id) == (masks["mask"][3], "png", COLOR)
    line = color_read.of("/garment/central_curve")[3]
    np.testing.assert_array_equal([(point.x, point.y) for point in line.points], curve[["u_px", "v_px"]])
    outline = color_read.of("/garment/outline")[3]
    assert len(outline.points) == len(masks["outline_u_px"][3]) + 1
    image = color_read.of("/xtion1/rgb/image_raw/compressed")[3]
    pixels = cv2.imdecode(np.frombuffer(bytes(image.data), np.uint8), cv2.IMREAD_COLOR)
    assert pixels is not None
    b, g, r = pixels[50, 75].astype(int)  # on the green sheet: the channels are not swapped
    assert g > b > r


def test_transforms_lead_from_level_to_both_cameras_and_the_gripper(turning_content: Content, tmp_path: Path) -> None:
    save_mcap(turning_content, tmp_path / "turning.mcap")
    read = Read(tmp_path / "turning.mcap")
    assert read.in_file == sorted(read.in_file)
    level, beside = (message.transforms[0] for message in read.of("/tf_static"))
    assert (level.header.frame_id, level.child_frame_id) == ("level", DEPTH)
    assert (beside.header.frame_id, beside.child_frame_id) == (DEPTH, COLOR)
    assert xyz(beside.transform.translation) == (0.025, 0, 0)
    gripper = turning_content.tables["gripper"].query("stream == 'depth'").dropna(subset=["qw"])
    assert len(gripper) == FRAMES - 1  # none is made up for the frame without
    moved = [message.transforms[0] for message in read.of("/tf")]
    assert {(each.header.frame_id, each.child_frame_id) for each in moved} == {(DEPTH, "r2_ee")}
    np.testing.assert_array_equal([xyz(each.transform.translation) for each in moved], gripper[["x_m", "y_m", "z_m"]])
    turns = [each.transform.rotation for each in moved]
    np.testing.assert_array_equal([(q.x, q.y, q.z, q.w) for q in turns], gripper[["qx", "qy", "qz", "qw"]])


def test_a_frame_is_not_its_own_parent(odd_content: Content, tmp_path: Path) -> None:
    save_mcap(odd_content, tmp_path / "odd.mcap")
    links = [each for message in Read(tmp_path / "odd.mcap").of("/tf_static") for each in message.transforms]
    assert [(each.header.frame_id, each.child_frame_id) for each in links] == [("level", "rig/cam (1) optical")]


def test_the_camera_is_that_of_the_images(depth_read: Read) -> None:
    info = depth_read.of("/xtion1/depth/camera_info")[0]
    assert list(info.k) == [FOCAL_PX, 0, WIDTH_PX / 2, 0, FOCAL_PX, HEIGHT_PX / 2, 0, 0, 1]
    assert (info.width, info.height, info.header.frame_id) == (WIDTH_PX, HEIGHT_PX, DEPTH)


def test_the_same_results_give_the_same_bytes(depth_content: Content, depth_path: Path, tmp_path: Path) -> None:
    save_mcap(depth_content, tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == depth_path.read_bytes()


def test_a_file_is_written_whole_or_not_at_all(
    depth_content: Content, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def cut(content: Content) -> Iterator[Any]:
        for number, frame in enumerate(Frames(content)):
            if number == 7:
                raise KeyboardInterrupt
            yield frame

    monkeypatch.setattr(mcap_file, "Frames", cut)
    path = tmp_path / "cut.mcap"
    for before in (None, b"what was there"):
        if before is not None:
            path.write_bytes(before)
        with pytest.raises(KeyboardInterrupt):
            save_mcap(depth_content, path)
        assert [each.read_bytes() for each in tmp_path.iterdir()] == ([] if before is None else [before])


def _sorted(points_m: Any) -> Any:
    return points_m[np.lexsort(np.round(points_m.T, 5))]
