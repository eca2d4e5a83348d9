"""Read what a bag holds besides pixels: where its images lie, its cameras, the gripper and the joints."""

from __future__ import annotations

import warnings
from dataclasses import asdict
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

from pydantic import PositiveFloat

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.errors import BagError, DataWarning, MessageError
from garment_dataset.stages.columns import FRAME, RECORD_STAMP, STAMP
from garment_dataset.stages.stage import Stage, StageParams

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    import pyarrow as pa

    from garment_dataset.bags import Bag, ImageMessage
    from garment_dataset.bags.gripper import RecordedTransforms

    Row = dict[str, Any]
    Columns = dict[str, list[Any]]

Stream = Literal["depth", "color"]

_JOINT_STATE = "sensor_msgs/msg/JointState"


FRAMES = TableSpec(
    "frames",
    2,
    "one image message",
    (
        Column("stream", "string", "", "depth or color"),
        FRAME,
        Column("stamp_ns", "int64", "ns", "header stamp: when the camera saw it; null when unreadable", nullable=True),
        RECORD_STAMP,
        Column("encoding", "string", "", "as the message says: 16UC1, rgb8 …", nullable=True),
        Column("width_px", "int32", "px", "image width", nullable=True),
        Column("height_px", "int32", "px", "image height", nullable=True),
        Column("step_bytes", "int32", "byte", "length of a row, padding included", nullable=True),
        Column("offset_bytes", "int64", "byte", "first pixel in the bag; null when compressed", nullable=True),
        Column("size_bytes", "int64", "byte", "length of the pixel data as stored", nullable=True),
        Column("topic", "string", "", "topic that the stream was read from: every stage reads its images there"),
        Column("fault", "string", "", "why the message is not used; null when it is", nullable=True),
    ),
    keys=("stream", "frame"),
)

CAMERA = TableSpec(
    "camera",
    1,
    "one image stream",
    (
        Column("stream", "string", "", "depth or color"),
        Column("frame_id", "string", "", "optical frame: x right, y down, z forward"),
        Column("width_px", "int32", "px", "image width"),
        Column("height_px", "int32", "px", "image height"),
        Column("fx_px", "float64", "px", "focal length along u: K[0, 0]"),
        Column("fy_px", "float64", "px", "focal length along v: K[1, 1]"),
        Column("cx_px", "float64", "px", "principal point, u: K[0, 2]; the centre of the first pixel is 0"),
        Column("cy_px", "float64", "px", "principal point, v: K[1, 2]; the centre of the first pixel is 0"),
        Column("distortion_model", "string", "", "as in sensor_msgs/CameraInfo"),
        Column("distortion", "list<float64>", "1", "coefficients of that model"),
    ),
    keys=("stream",),
)

GRIPPER = TableSpec(
    "gripper",
    2,
    "one usable image of either stream",
    (
        Column("stream", "string", "", "depth or color: whose image, and in whose optical frame the point is"),
        FRAME,
        STAMP,
        Column("x_m", "float64", "m", "end point of the gripper, optical frame of the stream, right", nullable=True),
        Column("y_m", "float64", "m", "end point of the gripper, optical frame of the stream, down", nullable=True),
        Column("z_m", "float64", "m", "end point of the gripper, optical frame of the stream, forward", nullable=True),
        Column("source", "string", "", "topic, or tf when computed from the recorded transforms", nullable=True),
        Column("gap_ns", "int64", "ns", "distance in time to the nearest sample the point rests on", nullable=True),
        Column("reason", "string", "", "why there is no point; null when there is one", nullable=True),
    ),
    keys=("stream", "frame"),
)

JOINTS = TableSpec(
    "joints",
    1,
    "one sample of one joint",
    (
        STAMP,
        RECORD_STAMP,
        Column("joint", "string", "", "name of the joint"),
        Column("position_rad", "float64", "rad", "joint position", nullable=True),
        Column("velocity_rad_s", "float64", "rad/s", "joint velocity", nullable=True),
    ),
)


class DecodeParams(StageParams):
    """Names in the bag, and how the gripper is found."""

    depth_topic: str = "/xtion1/depth/image_raw"  # or its compressed variant, below this name
    color_topic: str = "/xtion1/rgb/image_raw"
    depth_camera_info_topic: str = ""  # empty: camera_info beside the images
    color_camera_info_topic: str = ""
    joint_topic: str = "/joint_states"
    gripper_topic: str = "/r2_ee_to_depth"  # end point of the gripper in the depth camera
    gripper_color_topic: str = "/r2_ee_to_rgb"  # the same in the colour camera
    tf_topic: str = "/tf"
    tf_static_topic: str = "/tf_static"
    gripper_source: Literal["auto", "topic", "tf"] = "auto"  # auto: the topic, and tf where it has no answer
    camera_frame: str = "xtion1_depth_optical_frame"  # empty: the frame_id of the depth images
    color_camera_frame: str = "xtion1_rgb_optical_frame"  # empty: the frame_id of the colour images
    gripper_frame: str = "r2_ee"  # its origin is the end point of the gripper
    gripper_max_gap_s: PositiveFloat = 0.1  # longest time between two samples that is interpolated across


def decode(bag: Path, params: DecodeParams) -> dict[str, pa.Table]:
    """Index the images of a bag and read its small topics.

    Parameters
    ----------
    bag : Path
        The recording.
    params : DecodeParams
        Names of topics and frames.

    Returns
    -------
    dict of str to pyarrow.Table
        ``frames``: every image message of both streams, faulty ones with their fault; ``camera``: one row per stream;
        ``gripper``: one row per usable image of either stream; ``joints``: one row per joint and message.

    Raises
    ------
    BagError
        If the bag cannot be read, holds neither stream, or has no usable K for its depth images.

    Warns
    -----
    DataWarning
        For all that is missing or left out.
    """
    from garment_dataset.bags import open_bag

    with open_bag(bag) as opened:
        topics = _image_topics(opened, params)
        streams = {
            name: [_frame_row(name, topic, image) for image in opened.images(topic, name)]
            for name, topic in topics.items()
        }
        for name, rows in streams.items():
            _warn_of_frames(f"{bag.name}: {topics[name]}", rows)
        camera = CAMERA.table(_read_cameras(opened, streams, params))
        gripper = GRIPPER.table(_read_grippers(opened, streams, params))
        joints = JOINTS.table(_read_joints(opened, params.joint_topic))
    rows = [row for stream in streams.values() for row in stream]
    frames = FRAMES.table({column.name: [row[column.name] for row in rows] for column in FRAMES.columns})
    return {"frames": frames, "camera": camera, "gripper": gripper, "joints": joints}


def _image_topics(bag: Bag, params: DecodeParams) -> dict[Stream, str]:
    """Return the topic of each stream that the bag holds."""
    bases: dict[Stream, str] = {"depth": params.depth_topic, "color": params.color_topic}
    topics = {name: topic for name, base in bases.items() if (topic := bag.image_topic(base)) is not None}
    if not topics:
        raise BagError(
            "no images",
            where=bag.path.name,
            expected=" or ".join(bases.values()),
            found=", ".join(bag.topics) or "no topics",
            hint="Name its topics in the pipeline file",
        )
    for name, base in bases.items():
        if name not in topics:
            warnings.warn(f"{bag.path.name}: no {name} images, {base} is missing", DataWarning, stacklevel=3)
    return topics


def _frame_row(stream: Stream, topic: str, image: ImageMessage) -> Row:
    """Describe one message; only decoding shows whether a compressed image is whole, and how large it is."""
    height_px, width_px, fault = image.height_px, image.width_px, image.fault
    if fault is None and height_px is None:
        try:
            height_px, width_px = image.pixels().shape[:2]
        except MessageError as error:
            fault = str(error)
    return {
        "stream": stream,
        "frame": image.index,
        "stamp_ns": image.stamp_ns,
        "record_stamp_ns": image.record_stamp_ns,
        "frame_id": image.frame_id,
        "encoding": image.encoding,
        "width_px": width_px,
        "height_px": height_px,
        "step_bytes": image.step_bytes,
        "offset_bytes": image.offset_bytes,
        "size_bytes": image.size_bytes,
        "topic": topic,
        "fault": fault,
    }


def _usable(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if row["fault"] is None]


def _warn_of_frames(where: str, rows: list[Row]) -> None:
    if faulty := [row for row in rows if row["fault"] is not None]:
        text = f"{where}: {len(faulty)} of {len(rows)} messages skipped, first message {faulty[0]['frame']}"
        warnings.warn(f"{text}: {faulty[0]['fault']}", DataWarning, stacklevel=3)
    pairs = pairwise(_usable(rows))
    if late := [after["frame"] for before, after in pairs if after["stamp_ns"] <= before["stamp_ns"]]:
        text = f"{where}: {len(late)} header stamps do not increase, first that of message {late[0]}"
        warnings.warn(text, DataWarning, stacklevel=3)


def _read_cameras(bag: Bag, frames: Mapping[Stream, list[Row]], params: DecodeParams) -> Columns:
    """Return the camera of each stream; without that of the depth images nothing can be measured in them."""
    from garment_dataset.bags.camera import read_camera

    topics: dict[Stream, str] = {
        "depth": params.depth_camera_info_topic or _beside(params.depth_topic),
        "color": params.color_camera_info_topic or _beside(params.color_topic),
    }
    columns: Columns = {column.name: [] for column in CAMERA.columns}
    for name, rows in frames.items():
        try:
            camera = read_camera(bag, topics[name])
        except BagError as error:
            if name == "depth":
                raise
            warnings.warn(f"camera of the color images left out: {error}", DataWarning, stacklevel=3)
            continue
        for column, value in {"stream": name, **asdict(camera)}.items():
            columns[column].append(value)
        sizes = {(row["width_px"], row["height_px"]) for row in _usable(rows)}
        if others := sorted(sizes - {(camera.width_px, camera.height_px)}):
            text = f"{topics[name]} is for {camera.width_px} x {camera.height_px} pixels"
            found = ", ".join(f"{width} x {height}" for width, height in others)
            warnings.warn(f"{bag.path.name}: {text}, {name} images have {found}", DataWarning, stacklevel=3)
    return columns


def _beside(image_topic: str) -> str:
    return f"{image_topic.rpartition('/')[0]}/camera_info"


def _read_grippers(bag: Bag, streams: Mapping[Stream, list[Row]], params: DecodeParams) -> Columns:
    """Return the end point at each usable image, in the optical frame of its own camera."""
    from garment_dataset.bags.gripper import RecordedTransforms

    transforms = RecordedTransforms(bag, params.tf_topic, params.tf_static_topic)
    columns: Columns = {column.name: [] for column in GRIPPER.columns}
    for stream, rows in streams.items():
        for name, values in _read_gripper(bag, stream, _usable(rows), transforms, params).items():
            columns[name] += values
    return columns


def _read_gripper(
    bag: Bag, stream: Stream, usable: list[Row], transforms: RecordedTransforms, params: DecodeParams
) -> Columns:
    """Return the end point at each image of one stream."""
    from garment_dataset.bags.gripper import read_gripper

    topic, wanted = {
        "depth": (params.gripper_topic, params.camera_frame),
        "color": (params.gripper_color_topic, params.color_camera_frame),
    }[stream]
    stamps_ns = [row["stamp_ns"] for row in usable]
    columns: Columns = {"stream": [stream] * len(usable), "frame": [row["frame"] for row in usable]}
    columns["stamp_ns"] = stamps_ns
    if stream == "color" and topic not in bag.topics and not transforms.recorded:
        # As good as every bag with the depth camera's topic alone: whoever needs the colour camera's says so
        nothing = [None] * len(usable)
        unknown = dict.fromkeys(("x_m", "y_m", "z_m", "source", "gap_ns"), nothing)
        return {**columns, **unknown, "reason": ["not recorded"] * len(usable)}
    of_images = usable[0]["frame_id"] if usable else wanted
    camera_frame = wanted or of_images
    if camera_frame.lstrip("/") != of_images.lstrip("/"):
        text = f"{stream} images are in frame {of_images!r}, the gripper is given in {camera_frame!r}"
        warnings.warn(f"{bag.path.name}: {text}", DataWarning, stacklevel=4)
    track = read_gripper(
        bag,
        stamps_ns,
        camera_frame=camera_frame,
        gripper_frame=params.gripper_frame,
        source=params.gripper_source,
        topic=topic,
        transforms=transforms,
        max_gap_s=params.gripper_max_gap_s,
        stream=stream,
    )
    return {
        **columns,
        "x_m": track.x_m.tolist(),
        "y_m": track.y_m.tolist(),
        "z_m": track.z_m.tolist(),
        "source": list(track.source),
        "gap_ns": list(track.gap_ns),
        "reason": list(track.reason),
    }


def _read_joints(bag: Bag, topic: str) -> Columns:
    """Return a row per joint and message; velocities may be absent, other lengths than that of the names may not."""
    columns: Columns = {column.name: [] for column in JOINTS.columns}
    left_out = 0
    for message in bag.messages(topic):
        state = message.data
        if message.type != _JOINT_STATE or not {len(state.position), len(state.velocity)} <= {0, len(state.name)}:
            left_out += 1
            continue
        count, stamp = len(state.name), state.header.stamp
        columns["stamp_ns"] += [stamp.sec * 1_000_000_000 + stamp.nanosec] * count
        columns["record_stamp_ns"] += [message.record_stamp_ns] * count
        columns["joint"] += state.name
        columns["position_rad"] += state.position.tolist() or [None] * count
        columns["velocity_rad_s"] += state.velocity.tolist() or [None] * count
    if topic not in bag.topics:
        warnings.warn(f"{bag.path.name}: no joints, {topic} is missing", DataWarning, stacklevel=3)
    if left_out:
        text = f"{bag.path.name}: {left_out} messages left out: {topic}, no joint states"
        warnings.warn(text, DataWarning, stacklevel=3)
    return columns


STAGE = Stage(decode, params=DecodeParams, outputs=(FRAMES, CAMERA, GRIPPER, JOINTS))
