from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pytest

from garment_dataset.bags.rosbag1 import Rosbag1
from garment_dataset.errors import BagError, DataWarning
from garment_dataset.stages.cameras import CAMERA
from garment_dataset.stages.decode import STAGE, DecodeParams, decode
from garment_dataset.stages.decode_tables import FRAMES, GRIPPER, JOINTS, WORLD

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

DEPTH, COLOR, EE, JOINT = "/xtion1/depth/image_raw", "/xtion1/rgb/image_raw", "/r2_ee_to_depth", "/joint_states"
DEPTH_INFO, COLOR_INFO = "/xtion1/depth/camera_info", "/xtion1/rgb/camera_info"
OPTICAL, COLOR_OPTICAL = "xtion1_depth_optical_frame", "xtion1_rgb_optical_frame"
START = 1_391_700_000_000_000_000
PERIOD = 33_333_333
STAMPS = [START + frame * PERIOD for frame in range(6)]
SIZE = (8, 6)


def depth_mm(frame: int) -> NDArray[np.uint16]:
    return (1000 + frame + np.arange(48, dtype=np.uint16)).reshape(6, 8)


def rgb(frame: int) -> NDArray[np.uint8]:
    return (frame + np.arange(144, dtype=np.uint8)).reshape(6, 8, 3)


def position_m(stamp_ns: int) -> tuple[float, float, float]:
    """A straight and even motion, which linear interpolation meets exactly."""
    time_s = (stamp_ns - START) / 1e9
    return 0.1 + 0.5 * time_s, -0.2, 1.065 - 0.25 * time_s


def add_depth(recorder: Any, ros: Any) -> None:
    for frame, stamp_ns in enumerate(STAMPS):
        recorder.add(DEPTH, ros.image(stamp_ns, OPTICAL, depth_mm(frame), "16UC1"))
        recorder.add(DEPTH_INFO, ros.camera_info(stamp_ns, OPTICAL, SIZE, 570.0))


def add_color(recorder: Any, ros: Any) -> None:
    for frame, stamp_ns in enumerate(STAMPS[:4]):
        recorder.add(COLOR, ros.image(stamp_ns + 2_000_000, COLOR_OPTICAL, rgb(frame), "rgb8"))
        recorder.add(COLOR_INFO, ros.camera_info(stamp_ns + 2_000_000, COLOR_OPTICAL, SIZE, 525.0))


def add_rest(recorder: Any, ros: Any) -> None:
    for step in range(-1, 8):
        stamp_ns = START + step * 30_000_000
        recorder.add(EE, ros.point(stamp_ns, OPTICAL, position_m(stamp_ns)))
        recorder.add(JOINT, ros.joints(stamp_ns, ["r2_joint_b", "r2_joint_r"], [0.1 * step, -0.2], [3.0, 0.0]))


@pytest.fixture
def whole(recorder: Any, ros: Any) -> Any:
    add_depth(recorder, ros)
    add_color(recorder, ros)
    add_rest(recorder, ros)
    return recorder


def rows(table: Any, **where: object) -> list[dict[str, Any]]:
    return [row for row in table.to_pylist() if all(row[name] == value for name, value in where.items())]


def test_the_stage_declares_what_it_returns(whole: Any) -> None:
    outputs = STAGE.run({"bag": whole.write()}, DecodeParams())
    assert STAGE.outputs == (FRAMES, CAMERA, GRIPPER, JOINTS, WORLD)
    assert list(outputs) == [spec.name for spec in STAGE.outputs]
    assert (STAGE.name, STAGE.inputs) == ("decode", ())


def test_frames_say_where_the_pixels_lie(whole: Any) -> None:
    path = whole.write()
    frames = decode(path, DecodeParams())["frames"]
    content = path.read_bytes()
    for stream, picture, count in (("depth", depth_mm, 6), ("color", rgb, 4)):
        found = rows(frames, stream=stream)
        assert [row["frame"] for row in found] == list(range(count))
        for row in found:
            pixels = content[row["offset_bytes"] :][: row["size_bytes"]]
            assert pixels == picture(row["frame"]).tobytes()
            assert (row["width_px"], row["height_px"], row["fault"]) == (8, 6, None)
            assert row["record_stamp_ns"] - row["stamp_ns"] == 5_000_000
    depth = rows(frames, stream="depth")
    assert [row["stamp_ns"] for row in depth] == STAMPS
    assert {(row["encoding"], row["step_bytes"]) for row in depth} == {("16UC1", 16)}


def test_each_stream_has_its_own_camera(whole: Any) -> None:
    camera = decode(whole.write(), DecodeParams())["camera"]
    assert rows(camera, stream="depth") == [
        {
            "stream": "depth",
            "frame_id": OPTICAL,
            "width_px": 8,
            "height_px": 6,
            "fx_px": 570.0,
            "fy_px": 570.0,
            "cx_px": 3.5,
            "cy_px": 2.5,
            "distortion_model": "plumb_bob",
            "distortion": [0.1, -0.2, 0.0, 0.0, 0.0],
            "matrix": "K",
            "depth_unit_mm": 1.0,
            "bytes_swapped": False,
        }
    ]
    assert [row["fx_px"] for row in rows(camera, stream="color")] == [525.0]


def test_the_gripper_is_interpolated_to_the_depth_stamps(whole: Any) -> None:
    gripper = rows(decode(whole.write(), DecodeParams())["gripper"], stream="depth")
    assert [(row["frame"], row["stamp_ns"]) for row in gripper] == list(enumerate(STAMPS))
    found = [(row["x_m"], row["y_m"], row["z_m"]) for row in gripper]
    np.testing.assert_allclose(found, [position_m(stamp_ns) for stamp_ns in STAMPS], rtol=0, atol=1e-12)
    assert {(row["source"], row["reason"]) for row in gripper} == {("topic", None)}
    assert [row["gap_ns"] for row in gripper[:2]] == [0, 3_333_333]


def test_without_the_topic_the_gripper_comes_from_tf(recorder: Any, ros: Any) -> None:
    add_depth(recorder, ros)
    add_color(recorder, ros)
    recorder.add(JOINT, ros.joints(START, ["a"], [0.0]))
    recorder.add("/tf_static", ros.tf(START, ("camera_arm", OPTICAL, (0.0, 0.0, 1.0))))
    for step in range(-1, 8):
        stamp_ns = START + step * 30_000_000
        recorder.add("/tf", ros.tf(stamp_ns, ("/base", "/gripper_end", position_m(stamp_ns))))
        recorder.add("/tf", ros.tf(stamp_ns + 1, ("/base", "/camera_arm", (0.0, 0.0, 0.0))))
    with pytest.warns(DataWarning, match="no gripper position at 4 of 4 color frames, first at 0: .*tf: "):
        table = decode(recorder.write(), DecodeParams(gripper_frame="gripper_end"))["gripper"]
    gripper = rows(table, stream="depth")
    found = [(row["x_m"], row["y_m"], row["z_m"] + 1) for row in gripper]
    np.testing.assert_allclose(found, [position_m(stamp_ns) for stamp_ns in STAMPS], rtol=0, atol=1e-12)
    assert {(row["source"], row["reason"]) for row in gripper} == {("tf", None)}


def test_no_gripper_is_null_with_its_reason(recorder: Any, ros: Any) -> None:
    add_depth(recorder, ros)
    add_color(recorder, ros)
    recorder.add(JOINT, ros.joints(START, ["a"], [0.0]))
    with pytest.warns(DataWarning, match="no gripper position at 6 of 6 depth frames, first at 0: topic: no usable"):
        gripper = rows(decode(recorder.write(), DecodeParams())["gripper"])
    assert {(row["stream"], row["reason"]) for row in gripper} == {
        ("depth", "topic: no samples; tf: unknown frame"),
        ("color", "not recorded"),
    }
    assert {row[name] for row in gripper for name in ("x_m", "y_m", "z_m", "source", "gap_ns")} == {None}


@pytest.mark.parametrize("source", ["topic", "tf"])
def test_the_gripper_of_colour_images_is_in_their_own_camera(whole: Any, ros: Any, source: str) -> None:
    """The colour camera is 25 mm to the right of the depth camera, and its images are 2 ms later."""
    offset = np.array([0.025, 0.0, 0.0])
    for step in range(-1, 8):
        stamp_ns = START + step * 30_000_000
        if source == "topic":
            whole.add("/r2_ee_to_rgb", ros.point(stamp_ns, COLOR_OPTICAL, position_m(stamp_ns) - offset))
        else:
            whole.add(
                "/tf", ros.tf(stamp_ns, (OPTICAL, "r2_ee", position_m(stamp_ns)), (OPTICAL, COLOR_OPTICAL, offset))
            )
    gripper = rows(decode(whole.write(), DecodeParams())["gripper"], stream="color")
    stamps_ns = [stamp_ns + 2_000_000 for stamp_ns in STAMPS[:4]]
    assert [(row["frame"], row["stamp_ns"]) for row in gripper] == list(enumerate(stamps_ns))
    found = [(row["x_m"], row["y_m"], row["z_m"]) for row in gripper]
    np.testing.assert_allclose(found, [position_m(stamp_ns) - offset for stamp_ns in stamps_ns], rtol=0, atol=1e-12)
    assert {(row["source"], row["reason"]) for row in gripper} == {(source, None)}


def test_transforms_are_read_once_for_both_cameras(recorder: Any, ros: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    add_depth(recorder, ros)
    add_color(recorder, ros)
    recorder.add(JOINT, ros.joints(START, ["a"], [0.0]))
    for step in range(-1, 8):
        links = ((OPTICAL, "r2_ee", (0.0, 0.0, 1.0)), (OPTICAL, COLOR_OPTICAL, (0.0, 0.0, 0.0)))
        recorder.add("/tf", ros.tf(START + step * 30_000_000, *links))
    asked: list[tuple[str, ...]] = []
    transforms = Rosbag1.transforms

    def counted(bag: Rosbag1, *topics: str) -> Any:
        asked.append(topics)
        return transforms(bag, *topics)

    monkeypatch.setattr(Rosbag1, "transforms", counted)
    gripper = decode(recorder.write(), DecodeParams())["gripper"]
    assert gripper["z_m"].to_pylist() == [1.0] * 10
    assert asked == [("/tf", "/tf_static")]


def test_joints_are_kept_as_recorded(whole: Any) -> None:
    joints = rows(decode(whole.write(), DecodeParams())["joints"])
    assert len(joints) == 18
    assert joints[2] == {
        "stamp_ns": START,
        "record_stamp_ns": START + 5_000_000,
        "joint": "r2_joint_b",
        "position_rad": 0.0,
        "velocity_rad_s": 3.0,
    }


def test_joints_with_parts_missing_and_malformed_ones(whole: Any, ros: Any) -> None:
    whole.rows = [row for row in whole.rows if row[1] != JOINT]
    whole.add(JOINT, ros.joints(START, ["a", "b"], [0.1, np.nan]))
    whole.add(JOINT, ros.joints(START, ["c"], [], [2.0]))
    whole.add(JOINT, ros.joints(START, ["a", "b"], [0.1]))
    with pytest.warns(DataWarning, match="1 messages left out: /joint_states"):
        joints = rows(decode(whole.write(), DecodeParams())["joints"])
    assert [(row["joint"], row["position_rad"], row["velocity_rad_s"]) for row in joints] == [
        ("a", 0.1, None),
        ("b", None, None),
        ("c", None, 2.0),
    ]


def test_missing_joints_are_announced(recorder: Any, ros: Any) -> None:
    add_depth(recorder, ros)
    add_color(recorder, ros)
    add_rest(recorder, ros)
    recorder.rows = [row for row in recorder.rows if row[1] != JOINT]
    with pytest.warns(DataWarning, match="no joints, /joint_states is missing"):
        assert decode(recorder.write(), DecodeParams())["joints"].num_rows == 0


def test_faulty_messages_are_kept_out_counted_and_named(whole: Any, ros: Any) -> None:
    faulty = {
        2: ros.image(STAMPS[2], OPTICAL, depth_mm(2), "16UC1", data=np.zeros(95, np.uint8)),
        4: ros.image(STAMPS[4], OPTICAL, depth_mm(4), "32FC3"),
    }
    for index, row in enumerate(whole.rows):
        stamp_ns = row[0] - 5_000_000
        if row[1] == DEPTH and STAMPS.index(stamp_ns) in faulty:
            whole.rows[index] = (row[0], DEPTH, faulty[STAMPS.index(stamp_ns)])
    with pytest.warns(DataWarning, match=f"{DEPTH}: 2 of 6 messages skipped, first message 2: .*95 bytes") as caught:
        outputs = decode(whole.write(), DecodeParams())
    assert len(caught) == 1
    depth = rows(outputs["frames"], stream="depth")
    assert [row["fault"] is None for row in depth] == [True, True, False, True, False, True]
    assert "32FC3" in depth[4]["fault"]
    gripper = rows(outputs["gripper"], stream="depth")
    assert [row["frame"] for row in gripper] == [0, 1, 3, 5]
    assert [row["stamp_ns"] for row in gripper] == [STAMPS[frame] for frame in (0, 1, 3, 5)]


def test_a_compressed_image_is_decoded_to_see_whether_it_is_whole(recorder: Any, ros: Any) -> None:
    for frame, stamp_ns in enumerate(STAMPS):
        recorder.add(f"{DEPTH}/compressedDepth", ros.png(stamp_ns, OPTICAL, depth_mm(frame), "16UC1; compressedDepth"))
        keep = 0.5 if frame == 3 else 1.0
        message = ros.png(stamp_ns, COLOR_OPTICAL, rgb(frame), "rgb8; png compressed bgr8", keep=keep)
        recorder.add(f"{COLOR}/compressed", message)
        recorder.add(DEPTH_INFO, ros.camera_info(stamp_ns, OPTICAL, SIZE))
        recorder.add(COLOR_INFO, ros.camera_info(stamp_ns, COLOR_OPTICAL, SIZE))
    add_rest(recorder, ros)
    with pytest.warns(DataWarning, match=f"{COLOR}/compressed: 1 of 6 messages skipped, first message 3"):
        outputs = decode(recorder.write(), DecodeParams())
    color = rows(outputs["frames"], stream="color")
    assert [row["fault"] is None for row in color] == [True, True, True, False, True, True]
    assert [row["width_px"] for row in color] == [8, 8, 8, None, 8, 8]
    depth = rows(outputs["frames"], stream="depth", fault=None)
    assert {(row["width_px"], row["height_px"], row["offset_bytes"]) for row in depth} == {(8, 6, None)}
    gripper = rows(outputs["gripper"], stream="depth")
    assert rows(outputs["gripper"], source="topic") == gripper
    assert len(gripper) == 6


@pytest.mark.parametrize(
    ("add", "missing", "streams"),
    [(add_depth, COLOR, {"depth"}), (add_color, DEPTH, {"color"})],
    ids=["no color", "no depth"],
)
def test_one_stream_may_be_missing(recorder: Any, ros: Any, add: Any, missing: str, streams: set[str]) -> None:
    add(recorder, ros)
    add_rest(recorder, ros)
    with pytest.warns(DataWarning, match=f"images, {missing} is missing"):
        outputs = decode(recorder.write(), DecodeParams())
    assert set(outputs["frames"]["stream"].to_pylist()) == set(outputs["camera"]["stream"].to_pylist()) == streams
    assert set(outputs["gripper"]["stream"].to_pylist()) == streams
    assert outputs["gripper"].num_rows == (6 if streams == {"depth"} else 4)


def test_a_bag_without_images_is_refused(recorder: Any, ros: Any) -> None:
    add_rest(recorder, ros)
    with pytest.raises(BagError, match=rf"no images.*{DEPTH} or {COLOR}.*{JOINT}"):
        decode(recorder.write(), DecodeParams())


def test_other_topic_names(whole: Any) -> None:
    names = {DEPTH: "/cam/raw", DEPTH_INFO: "/cam/camera_info", COLOR_INFO: "/calibrated"}
    whole.rows = [(stamp_ns, names.get(topic, topic), message) for stamp_ns, topic, message in whole.rows]
    params = DecodeParams(depth_topic="/cam/raw", color_camera_info_topic="/calibrated")
    assert decode(whole.write(), params)["camera"]["stream"].to_pylist() == ["depth", "color"]


def zero_k(recorder: Any, ros: Any, topic: str) -> None:
    info = ros.camera_info(START, OPTICAL, SIZE, 0.0)
    recorder.rows = [(row[0], topic, info) if row[1] == topic else row for row in recorder.rows]


def test_depth_that_was_never_calibrated_is_an_error(whole: Any, ros: Any) -> None:
    zero_k(whole, ros, DEPTH_INFO)
    with pytest.raises(BagError, match=f"{DEPTH_INFO}: .*not calibrated.* zero"):
        decode(whole.write(), DecodeParams())


def test_colour_that_was_never_calibrated_is_announced(whole: Any, ros: Any) -> None:
    zero_k(whole, ros, COLOR_INFO)
    with pytest.warns(DataWarning, match=f"color images left out: .*{COLOR_INFO}: .*not calibrated"):
        outputs = decode(whole.write(), DecodeParams())
    assert outputs["camera"]["stream"].to_pylist() == ["depth"]
    assert len(rows(outputs["frames"], stream="color")) == 4


def test_a_camera_of_another_size_is_announced(whole: Any, ros: Any) -> None:
    info = ros.camera_info(START, OPTICAL, (16, 11))
    whole.rows = [(row[0], DEPTH_INFO, info) if row[1] == DEPTH_INFO else row for row in whole.rows]
    with pytest.warns(DataWarning, match=f"{DEPTH_INFO} is for 16 x 11 pixels, depth images have 8 x 6"):
        decode(whole.write(), DecodeParams())


def test_the_camera_frame_may_be_that_of_the_images(recorder: Any, ros: Any) -> None:
    for frame, stamp_ns in enumerate(STAMPS):
        recorder.add(DEPTH, ros.image(stamp_ns, "/other_optical", depth_mm(frame), "16UC1"))
        recorder.add(DEPTH_INFO, ros.camera_info(stamp_ns, "other_optical", SIZE))
        recorder.add("/tf", ros.tf(stamp_ns, ("other_optical", "r2_ee", (0.0, 0.0, 1.0)), ("base", OPTICAL, (0, 0, 0))))
    add_color(recorder, ros)
    recorder.add(JOINT, ros.joints(START, ["a"], [0.0]))
    path = recorder.write()
    with pytest.warns(DataWarning, match="4 of 4 color frames"):
        gripper = rows(decode(path, DecodeParams(camera_frame=""))["gripper"], stream="depth")
    assert {(row["z_m"], row["source"]) for row in gripper} == {(1.0, "tf")}
    with pytest.warns(DataWarning) as caught:
        decode(path, DecodeParams())
    text = f"depth images are in frame '/other_optical', the gripper is given in '{OPTICAL}'"
    assert text in str(caught[0].message)


@pytest.mark.parametrize("compression", ["lz4", "bz2"])
def test_compression_changes_nothing_but_the_place(whole: Any, compression: Literal["lz4", "bz2"]) -> None:
    plain = decode(whole.write(), DecodeParams())
    packed = decode(whole.write(compression), DecodeParams())
    assert set(packed["frames"]["offset_bytes"].to_pylist()) == {None}
    for name, table in plain.items():
        kept = [column for column in table.column_names if column != "offset_bytes"]
        assert packed[name].select(kept).equals(table.select(kept))


def test_equal_bags_give_equal_bytes(whole: Any, tmp_path: Path) -> None:
    path = whole.write()
    copy = tmp_path / "elsewhere" / "Copy_Free_pi16_0.5_R1.bag"
    copy.parent.mkdir()
    copy.write_bytes(path.read_bytes())
    one, other = decode(path, DecodeParams()), decode(copy, DecodeParams())
    for name in one:
        assert one[name].equals(other[name], check_metadata=True)
        one_bytes, other_bytes = (
            table.combine_chunks().to_batches()[0].serialize() for table in (one[name], other[name])
        )
        assert one_bytes == other_bytes
