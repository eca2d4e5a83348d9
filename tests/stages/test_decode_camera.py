"""What ``decode`` says of cameras, depths and topics that contradict their images."""

from __future__ import annotations

import struct
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from garment_dataset.bags import open_bag
from garment_dataset.bags.images import AS_SAID
from garment_dataset.errors import BagError, DataWarning
from garment_dataset.stages.cameras import CAMERA, depth_reading
from garment_dataset.stages.decode import DecodeParams, decode

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    Change = Callable[[Any], Any]

DEPTH, INFO = "/xtion1/depth/image_raw", "/xtion1/depth/camera_info"
COLOR, COLOR_INFO = "/xtion1/rgb/image_raw", "/xtion1/rgb/camera_info"
OPTICAL, COLOR_OPTICAL = "xtion1_depth_optical_frame", "xtion1_rgb_optical_frame"
JOINT, EE = "/joint_states", "/r2_ee_to_depth"
START = 1_391_700_000_000_000_000
STAMPS = [START + frame * 33_333_333 for frame in range(12)]
SIZE = (24, 16)


def depth_mm(frame: int, size: tuple[int, int] = SIZE) -> NDArray[np.uint16]:
    """A slanted wall at 2 m, with noise."""
    noise = np.random.default_rng(frame).normal(0, 2, size[::-1])
    return np.rint(2000 + 5 * np.arange(size[0]) + noise).astype(np.uint16)


def record(
    recorder: Any,
    ros: Any,
    *,
    topic: str = DEPTH,
    size: tuple[int, int] = SIZE,
    store: Change = lambda pixels: pixels,
    calibrate: Change = lambda info: info,
    **image: Any,
) -> None:
    """Record depth with its camera, its gripper and the joints: all that is wanted but colour."""
    for frame, stamp_ns in enumerate(STAMPS):
        pixels = store(depth_mm(frame, size))
        encoding = "32FC1" if pixels.dtype.kind == "f" else "16UC1"
        recorder.add(topic, ros.image(stamp_ns, OPTICAL, pixels, encoding, **image))
        recorder.add(INFO, calibrate(ros.camera_info(stamp_ns, OPTICAL, SIZE, 570.0)))
        recorder.add(EE, ros.point(stamp_ns, OPTICAL, (0.0, 0.0, 1.0)))
    recorder.add(JOINT, ros.joints(START, ["a"], [0.0]))


def decoded(path: Path, **params: Any) -> tuple[dict[str, Any], list[str]]:
    """Return the row of the depth camera, and the notes without the bag's name and without those on colour or tf."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", DataWarning)
        outputs = decode(path, DecodeParams(**params))
    notes = [str(each.message).removeprefix(f"{path.name}: ") for each in caught]
    notes = [note for note in notes if note.startswith(("/xtion1", "no depth", "no joints"))]
    return outputs["camera"].to_pylist()[0], notes


def with_p(info: Any, *, k: bool = True) -> Any:
    """Fill P, with another focal length than K's."""
    info.P[:] = [500.0, 0, 11.0, 0, 0, 501.0, 7.0, 0, 0, 0, 1, 0]
    info.K[:] = info.K if k else np.zeros(9)
    return info


def test_an_ordinary_recording_has_nothing_to_say(recorder: Any, ros: Any) -> None:
    record(recorder, ros)
    camera, notes = decoded(recorder.write())
    assert notes == []
    assert (camera["matrix"], camera["depth_unit_mm"], camera["bytes_swapped"]) == ("K", 1.0, False)


@pytest.mark.parametrize("topic", ["/xtion1/depth/image_rect", "/xtion1/depth/image_rect_raw"])
def test_rectified_images_are_measured_with_p(recorder: Any, ros: Any, topic: str) -> None:
    record(recorder, ros, topic=topic, calibrate=with_p)
    camera, notes = decoded(recorder.write(), depth_topic=topic)
    assert notes == []
    found = {name: camera[name] for name in ("fx_px", "fy_px", "cx_px", "cy_px", "matrix", "distortion")}
    assert found == {"fx_px": 500.0, "fy_px": 501.0, "cx_px": 11.0, "cy_px": 7.0, "matrix": "P", "distortion": []}


def test_a_compressed_rectified_topic_is_rectified_too(recorder: Any, ros: Any) -> None:
    record(recorder, ros, topic="/unused", calibrate=with_p)
    for frame, stamp_ns in enumerate(STAMPS):
        image = ros.png(stamp_ns, OPTICAL, depth_mm(frame), "16UC1; compressedDepth")
        recorder.add("/xtion1/depth/image_rect/compressedDepth", image)
    path = recorder.write()
    for topic in ("/xtion1/depth/image_rect", "/xtion1/depth/image_rect/compressedDepth"):
        assert decoded(path, depth_topic=topic)[0]["matrix"] == "P"


def test_an_empty_k_is_replaced_by_p_with_a_note(recorder: Any, ros: Any) -> None:
    record(recorder, ros, calibrate=lambda info: with_p(info, k=False))
    camera, notes = decoded(recorder.write())
    assert (camera["matrix"], camera["fx_px"], camera["distortion_model"]) == ("P", 500.0, "plumb_bob")
    assert notes == [f"{INFO}: K is all zero, P is used for raw images"]


def test_colour_has_no_depth_unit(recorder: Any, ros: Any) -> None:
    for stamp_ns in STAMPS:
        recorder.add(COLOR, ros.image(stamp_ns, COLOR_OPTICAL, np.zeros((16, 24, 3), np.uint8), "8UC3"))
        recorder.add(COLOR_INFO, ros.camera_info(stamp_ns, COLOR_OPTICAL, SIZE, 525.0))
    camera, _ = decoded(recorder.write())
    assert (camera["stream"], camera["matrix"]) == ("color", "K")
    assert (camera["depth_unit_mm"], camera["bytes_swapped"]) == (None, None)


def test_stated_binning_is_corrected(recorder: Any, ros: Any) -> None:
    def binned(info: Any) -> Any:
        info.binning_x = info.binning_y = 2
        return info

    record(recorder, ros, size=(12, 8), calibrate=binned)
    camera, notes = decoded(recorder.write())
    found = [camera[name] for name in ("width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px")]
    assert found == [12, 8, 285.0, 285.0, 5.75, 3.75]
    assert len(notes) == 1
    assert notes[0].startswith(f"{INFO}: a window of 24 x 16 pixels at (0, 0), binned 2 x 2, is stated: K is corrected")


def test_binning_that_nothing_states_is_seen_by_the_size(recorder: Any, ros: Any) -> None:
    record(recorder, ros, size=(12, 8))
    camera, notes = decoded(recorder.write())
    assert (camera["width_px"], camera["fx_px"]) == (12, 285.0)
    assert notes == [f"{INFO}: images of 12 x 8 pixels are 1/2 of the calibrated 24 x 16: K is scaled"]


def test_a_single_image_of_another_size_does_not_decide(recorder: Any, ros: Any) -> None:
    record(recorder, ros)
    recorder.add(DEPTH, ros.image(STAMPS[-1] + 33_333_333, OPTICAL, depth_mm(0, (12, 8)), "16UC1"))
    camera, notes = decoded(recorder.write())
    assert (camera["width_px"], camera["fx_px"]) == (24, 570.0)
    assert notes == [f"{INFO} is for 24 x 16 pixels, depth images have 12 x 8"]


SWAPPED = f"{DEPTH}: depths make sense only in the byte order opposite to is_bigendian, so they are read in that"


@pytest.mark.parametrize("flag", [0, 1])
@pytest.mark.parametrize("kind", ["u2", "f4"])
def test_a_wrong_is_bigendian_is_refuted_by_the_depths(recorder: Any, ros: Any, flag: int, kind: str) -> None:
    def stored(pixels: Any) -> Any:
        values = pixels if kind == "u2" else pixels / 1000
        return values.astype(("<" if flag else ">") + kind)

    record(recorder, ros, store=stored, is_bigendian=flag)
    camera, notes = decoded(recorder.write())
    assert camera["bytes_swapped"] is True
    assert notes == [SWAPPED]


@pytest.mark.parametrize("flag", [0, 1])
def test_a_right_is_bigendian_is_believed(recorder: Any, ros: Any, flag: int) -> None:
    record(recorder, ros, store=lambda pixels: pixels.astype(">u2" if flag else "<u2"), is_bigendian=flag)
    camera, notes = decoded(recorder.write())
    assert (camera["bytes_swapped"], notes) == (False, [])


def test_depths_of_another_unit_are_named_until_the_unit_is_said(recorder: Any, ros: Any) -> None:
    record(recorder, ros, store=lambda pixels: pixels * np.uint16(4))
    path = recorder.write()
    camera, notes = decoded(path)
    assert camera["depth_unit_mm"] == 1.0
    assert len(notes) == 1
    assert "quarter millimetres (depth_unit_mm = 0.25, median 2.06 m); as read: nearest 8." in notes[0]
    camera, notes = decoded(path, depth_unit_mm=0.25)
    assert (camera["depth_unit_mm"], notes) == (0.25, [])


@pytest.mark.parametrize(
    ("store", "unit_mm"),
    [
        (lambda pixels: pixels.astype(">u2"), 1.0),
        (lambda pixels: pixels * np.uint16(4), 0.25),
        (lambda pixels: (pixels * np.uint16(4)).astype(">u2"), 0.25),
        (lambda pixels: pixels.astype("<f4"), 0.001),
    ],
)
def test_what_the_table_says_of_depths_gives_millimetres(
    recorder: Any, ros: Any, store: Change, unit_mm: float
) -> None:
    record(recorder, ros, store=store)
    path = recorder.write()
    with pytest.warns(DataWarning):
        camera = decode(path, DecodeParams(depth_unit_mm=unit_mm))["camera"]
    with open_bag(path) as bag:
        for image in bag.images(DEPTH, "depth"):
            np.testing.assert_array_equal(image.pixels(depth_reading(camera)), depth_mm(image.index))


def test_without_a_depth_camera_depths_are_as_said() -> None:
    assert depth_reading(CAMERA.table({column.name: [] for column in CAMERA.columns})) == AS_SAID


def test_damaged_rvl_is_a_fault_in_words(recorder: Any, ros: Any) -> None:
    record(recorder, ros, topic="/unused")
    head = struct.pack("<iffII", 0, 0, 0, *SIZE)
    for frame, stamp_ns in enumerate(STAMPS):
        image = ros.png(stamp_ns, OPTICAL, depth_mm(frame), "16UC1; compressedDepth rvl")
        # an empty image: 384 zeros (octal 600) and nothing else; the third one is torn
        stream = bytes(400) if frame == 3 else struct.pack("<I", 0x8860_0000)
        image.data = np.frombuffer(head + stream, np.uint8)
        recorder.add(f"{DEPTH}/compressedDepth", image)
    _, notes = decoded(recorder.write())
    where = f"{DEPTH}/compressedDepth: 1 of 12 messages skipped, first message 3"
    assert notes == [f"{where}: rvl data: expected 384 pixels, found 0 pixels"]


def silent(recorder: Any, *topics: str, kind: str = "sensor_msgs/msg/Image") -> Path:
    """Write the recording, in which these topics were announced though nothing came on them."""
    store = get_typestore(Stores.ROS1_NOETIC)
    path: Path = recorder.path
    connections: dict[str, Any] = {}
    with Writer(path) as writer:
        for topic in topics:
            writer.add_connection(topic, kind, typestore=store)
        for stamp_ns, topic, message in sorted(recorder.rows, key=lambda row: (row[0], row[1])):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=store)
            writer.write(connections[topic], stamp_ns, store.serialize_ros1(message, message.__msgtype__))
    return path


def without(recorder: Any, topic: str) -> Any:
    recorder.rows = [row for row in recorder.rows if row[1] != topic]
    return recorder


def test_a_bag_whose_image_topics_are_silent_is_refused_in_words(recorder: Any, ros: Any) -> None:
    record(recorder, ros)
    path = silent(without(recorder, DEPTH), DEPTH, f"{COLOR}/compressed", kind="sensor_msgs/msg/Image")
    found = f"found no message on {DEPTH}, no message on {COLOR}/compressed. Its camera sent nothing"
    with pytest.raises(BagError, match=f"no images: expected {DEPTH} or {COLOR}, {found}"):
        decode(path, DecodeParams())


def test_a_silent_stream_beside_another_is_announced(recorder: Any, ros: Any) -> None:
    record(recorder, ros)
    with pytest.warns(DataWarning, match=f"no color images, no message on {COLOR}$"):
        decode(silent(recorder, COLOR), DecodeParams())


def test_a_silent_camera_info_is_an_error_in_words(recorder: Any, ros: Any) -> None:
    record(recorder, ros)
    path = silent(without(recorder, INFO), INFO, kind="sensor_msgs/msg/CameraInfo")
    with pytest.raises(BagError, match=f"{INFO}: no message on it"), pytest.warns(DataWarning, match="no color images"):
        decode(path, DecodeParams())
