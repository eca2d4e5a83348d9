"""Read what a bag holds besides pixels: where its images lie, its cameras, the gripper and the joints."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, Literal

from pydantic import PositiveFloat

from garment_dataset.errors import BagError, DataWarning, MessageError
from garment_dataset.stages.cameras import CAMERA, read_cameras
from garment_dataset.stages.decode_tables import FRAMES, GRIPPER, JOINTS, WORLD
from garment_dataset.stages.stage import Stage, StageParams

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    import pyarrow as pa

    from garment_dataset.bags import Bag, ImageMessage
    from garment_dataset.bags.recorded_transforms import RecordedTransforms

    Row = dict[str, Any]
    Columns = dict[str, list[Any]]

Stream = Literal["depth", "color"]


class DecodeParams(StageParams):
    """Names in the bag, and how the gripper is found."""

    depth_topic: str = "/xtion1/depth/image_raw"  # or its compressed variant, below this name
    color_topic: str = "/xtion1/rgb/image_raw"
    depth_camera_info_topic: str = ""  # empty: camera_info beside the images
    color_camera_info_topic: str = ""
    joint_topic: str = "/joint_states"
    depth_unit_mm: PositiveFloat = 1.0  # how many millimetres a depth value is; depths in metres are multiplied by it
    gripper_topic: str = "/r2_ee_to_depth"  # end point of the gripper in the depth camera
    gripper_color_topic: str = "/r2_ee_to_rgb"  # the same in the colour camera
    tf_topic: str = "/tf"
    tf_static_topic: str = "/tf_static"
    gripper_source: Literal["auto", "topic", "tf"] = "auto"  # auto: the surer one first, then the other
    camera_frame: str = "xtion1_depth_optical_frame"  # empty: the frame_id of the depth images
    color_camera_frame: str = "xtion1_rgb_optical_frame"  # empty: the frame_id of the colour images
    gripper_frame: str = "r2_ee"  # its origin is the end point of the gripper
    gripper_max_gap_s: PositiveFloat = 0.1  # longest time between two samples that is interpolated across
    gripper_std_floor_m: PositiveFloat = 0.0001  # standard uncertainty of a sample: such an arm repeats to 0.08 mm
    gripper_max_disagreement_m: PositiveFloat = 0.005  # median distance of topic and tf from which a note says so
    level_frame: str = "base_link"  # its z axis points up; empty: no frame does
    max_stamp_offset_s: PositiveFloat = 10.0  # farthest header stamp less record time may be from its median


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
        ``gripper``: one row per usable image of either stream; ``joints``: one row per joint and message; ``world``:
        which way is down, one row per stream.

    Raises
    ------
    BagError
        If the bag cannot be read, holds neither stream, or has no usable K for its depth images.

    Warns
    -----
    DataWarning
        For all that is missing or left out, and where the bag does not hold what its index says.
    """
    from garment_dataset.bags import open_bag
    from garment_dataset.bags.recorded_transforms import RecordedTransforms

    with open_bag(bag) as opened:
        for text in opened.contradictions():
            warnings.warn(f"{bag.name}: {text}", DataWarning, stacklevel=2)
        topics = _image_topics(opened, params)
        images = {name: list(opened.images(topic, name)) for name, topic in topics.items()}
        streams = {name: [_frame_row(name, topics[name], image) for image in seen] for name, seen in images.items()}
        for name, rows in streams.items():
            _check_stamps(f"{bag.name}: {topics[name]}", rows, params.max_stamp_offset_s)
        camera = CAMERA.table(_read_cameras(opened, streams, images.get("depth", []), params))
        transforms = RecordedTransforms(opened, params.tf_topic, params.tf_static_topic, params.max_stamp_offset_s)
        gripper = GRIPPER.table(_read_grippers(transforms, streams, params))
        joints = JOINTS.table(_read_joints(opened, params))
        world = WORLD.table(_read_world(transforms, streams, params))
    rows = [row for stream in streams.values() for row in stream]
    frames = FRAMES.table({column.name: [row[column.name] for row in rows] for column in FRAMES.columns})
    return {"frames": frames, "camera": camera, "gripper": gripper, "joints": joints, "world": world}


def _image_topics(bag: Bag, params: DecodeParams) -> dict[Stream, str]:
    """Return the topic of each stream that the bag holds."""
    bases: dict[Stream, str] = {"depth": params.depth_topic, "color": params.color_topic}
    topics = {name: topic for name, base in bases.items() if (topic := bag.image_topic(base)) is not None}
    if not topics:
        silent = _silent(bag, *bases.values())
        raise BagError(
            "no images",
            where=bag.path.name,
            expected=" or ".join(bases.values()),
            found=", ".join(silent or bag.topics) or "no topics",
            hint="Its camera sent nothing" if silent else "Name its topics in the pipeline file",
        )
    for name, base in bases.items():
        if name not in topics:
            why = ", ".join(_silent(bag, base)) or f"{base} is missing"
            warnings.warn(f"{bag.path.name}: no {name} images, {why}", DataWarning, stacklevel=3)
    return topics


def _silent(bag: Bag, *bases: str) -> list[str]:
    """Name the image topics of these bases that were announced, but on which nothing came."""
    from garment_dataset.bags.camera import image_base

    silent = (topic for topic in bag.topics.values() if image_base(topic.name) in bases and not topic.count)
    return [f"no message on {topic.name}" for topic in silent]


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


def _check_stamps(where: str, rows: list[Row], max_offset_s: float) -> None:
    """Mark the messages whose header stamps cannot be used as faulty; tell of all that are, and of two clocks."""
    from garment_dataset.bags.stamps import Stamped, check_stamps, clock_note, summarise

    times = [Stamped(row["frame"], row["stamp_ns"], row["record_stamp_ns"]) for row in _usable(rows)]
    faults = check_stamps(times, max_offset_s=max_offset_s)
    for row in rows:
        if row["frame"] in faults:
            row["fault"] = faults[row["frame"]].text
    if faulty := [row for row in rows if row["fault"] is not None]:
        text = f"{where}: {len(faulty)} of {len(rows)} messages skipped"
        stamps = f"; {summarise(faults)}" if faults else ""
        first = f"first message {faulty[0]['frame']}: {faulty[0]['fault']}"
        warnings.warn(f"{text}, {first}{stamps}", DataWarning, stacklevel=3)
    if note := clock_note(times):
        warnings.warn(f"{where}: {note}", DataWarning, stacklevel=3)


def _read_cameras(
    bag: Bag, frames: Mapping[Stream, list[Row]], depth_images: Sequence[ImageMessage], params: DecodeParams
) -> Columns:
    """Return the camera of each stream, for its usable images."""
    from garment_dataset.bags.camera import camera_info_beside

    usable = {name: _usable(rows) for name, rows in frames.items()}
    topics: dict[Stream, str] = {
        "depth": params.depth_camera_info_topic or camera_info_beside(params.depth_topic),
        "color": params.color_camera_info_topic or camera_info_beside(params.color_topic),
    }
    return read_cameras(bag, usable, topics, depth_images, depth_unit_mm=params.depth_unit_mm)


def _read_grippers(
    transforms: RecordedTransforms, streams: Mapping[Stream, list[Row]], params: DecodeParams
) -> Columns:
    """Return the end point at each usable image, in the optical frame of its own camera."""
    columns: Columns = {column.name: [] for column in GRIPPER.columns}
    for stream, rows in streams.items():
        for name, values in _read_gripper(stream, _usable(rows), transforms, params).items():
            columns[name] += values
    return columns


def _read_gripper(stream: Stream, usable: list[Row], transforms: RecordedTransforms, params: DecodeParams) -> Columns:
    """Return the end point at each image of one stream."""
    from garment_dataset.bags.gripper import read_gripper

    bag = transforms.bag
    topic = {"depth": params.gripper_topic, "color": params.gripper_color_topic}[stream]
    columns: Columns = {column.name: [None] * len(usable) for column in GRIPPER.columns}
    columns |= {"stream": [stream] * len(usable), "frame": [row["frame"] for row in usable]}
    columns["stamp_ns"] = [row["stamp_ns"] for row in usable]
    if stream == "color" and topic not in bag.topics and not transforms.recorded:
        # As good as every bag with the depth camera's topic alone: whoever needs the colour camera's says so
        return {**columns, "reason": ["not recorded"] * len(usable)}
    camera_frame, of_images = _optical_frames(stream, usable, params)
    if camera_frame.lstrip("/") != of_images.lstrip("/"):
        text = f"{stream} images are in frame {of_images!r}, the gripper is given in {camera_frame!r}"
        warnings.warn(f"{bag.path.name}: {text}", DataWarning, stacklevel=4)
    track = read_gripper(
        bag,
        columns["stamp_ns"],
        camera_frame=camera_frame,
        gripper_frame=params.gripper_frame,
        source=params.gripper_source,
        topic=topic,
        transforms=transforms,
        max_gap_s=params.gripper_max_gap_s,
        std_floor_m=params.gripper_std_floor_m,
        max_disagreement_m=params.gripper_max_disagreement_m,
        max_stamp_offset_s=params.max_stamp_offset_s,
        stream=stream,
    )
    columns |= {name: getattr(track, name).tolist() for name in ("x_m", "y_m", "z_m")}
    columns |= {f"{axis}_std_m": track.std_m[:, place].tolist() for place, axis in enumerate("xyz")}
    columns |= {f"apart_{axis}_m": track.apart_m[:, place].tolist() for place, axis in enumerate("xyz")}
    columns |= {f"q{axis}": track.quaternion_xyzw[:, place].tolist() for place, axis in enumerate("xyzw")}
    return columns | {name: list(getattr(track, name)) for name in ("source", "gap_ns", "reason")}


def _optical_frames(stream: Stream, usable: list[Row], params: DecodeParams) -> tuple[str, str]:
    """Return the optical frame that is wanted for a stream, and that which its images name."""
    wanted = {"depth": params.camera_frame, "color": params.color_camera_frame}[stream]
    of_images = usable[0]["frame_id"] if usable else wanted
    return wanted or of_images, of_images


def _read_joints(bag: Bag, params: DecodeParams) -> Columns:
    """Return a row per joint and message."""
    from garment_dataset.bags.joints import read_joints

    samples = read_joints(bag, params.joint_topic, max_stamp_offset_s=params.max_stamp_offset_s)
    return {column.name: [getattr(sample, column.name) for sample in samples] for column in JOINTS.columns}


def _read_world(transforms: RecordedTransforms, streams: Mapping[Stream, list[Row]], params: DecodeParams) -> Columns:
    """Return which way is down in each stream."""
    from garment_dataset.bags.gravity import read_gravity

    columns: Columns = {column.name: [] for column in WORLD.columns}
    for stream, rows in streams.items():
        usable = _usable(rows)
        gravity = read_gravity(
            transforms,
            [row["stamp_ns"] for row in usable],
            camera_frame=_optical_frames(stream, usable, params)[0],
            level_frame=params.level_frame,
            max_gap_s=params.gripper_max_gap_s,
            stream=stream,
        )
        x, y, z = gravity.direction or (None, None, None)
        row = {"stream": stream, "gravity_x": x, "gravity_y": y, "gravity_z": z}
        for name, value in {**row, "gravity_source": gravity.source, "reason": gravity.reason}.items():
            columns[name].append(value)
    return columns


STAGE = Stage(decode, params=DecodeParams, outputs=(FRAMES, CAMERA, GRIPPER, JOINTS, WORLD))
