"""Write a recording: all messages in the order of their record times, one image in memory at a time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from rosbags.rosbag1 import Writer

from garment_dataset.simulate import messages, scene
from garment_dataset.simulate.camera_pose import CameraPose
from garment_dataset.simulate.nuisance_depth import USUAL_DEPTH, DepthNuisance
from garment_dataset.simulate.robot import JOINTS, Robot
from garment_dataset.simulate.timing import ticks

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from garment_dataset.simulate.motion import Swing
    from garment_dataset.simulate.timing import FrameTimes

Compression = Literal["none", "lz4", "bz2"]

_FIXED_AHEAD_NS = 500_000_000
_FEEDBACK_LAG_S = 0.012
_TABLE_AND_R1 = 7

_CONNECTIONS = (
    ("/tf", messages.TRANSFORMS, "/xtion1_tf_broadcaster"),
    ("/tf", messages.TRANSFORMS, "/robot_state_publisher"),
    ("/joint_states", messages.JOINT_STATE, "/r1_ext_driver"),
    ("/joint_states", messages.JOINT_STATE, "/r2_driver"),
    ("/feedback_states", messages.FEEDBACK, "/joint_trajectory_action"),
    ("/r2_ee_to_depth", messages.POINT, "/ee_to_camera"),
    ("/r2_ee_to_rgb", messages.POINT, "/ee_to_camera"),
    ("/xtion1/depth/image_raw", messages.IMAGE, "/xtion1/driver"),
    ("/xtion1/depth/camera_info", messages.CAMERA_INFO, "/xtion1/driver"),
    ("/xtion1/rgb/image_raw", messages.IMAGE, "/xtion1/driver"),
    ("/xtion1/rgb/camera_info", messages.CAMERA_INFO, "/xtion1/driver"),
    ("/xtion1/depth_registered/camera_info", messages.CAMERA_INFO, "/xtion1/driver"),
)
_FIXED, _LINKS, _JOINTS_R1, _JOINTS_R2, _FEEDBACK, _EE_DEPTH, _EE_RGB = range(7)
_DEPTH, _DEPTH_INFO, _RGB, _RGB_INFO, _REGISTERED_INFO = range(7, 12)


@dataclass(frozen=True)
class Event:
    """A message to be written.

    Parameters
    ----------
    record_ns : int
        When the recorder receives it.
    connection : int
        Index of its publisher.
    payload : callable
        Makes the serialised message when its turn has come.
    """

    record_ns: int
    connection: int
    payload: Callable[[], bytes | memoryview]


@dataclass(frozen=True)
class Streams:
    """The images of a recording, made one by one.

    Parameters
    ----------
    depth_times, color_times : FrameTimes
        Their stamps.
    depth, color : callable
        Return the pixels of the frame of a given index; called in rising order.
    """

    depth_times: FrameTimes
    color_times: FrameTimes
    depth: Callable[[int], NDArray[np.uint16]]
    color: Callable[[int], NDArray[np.uint8]]


def write_bag(
    path: Path,
    streams: Streams,
    swing: Swing | None,
    begin_ns: int,
    duration_s: float,
    compression: Compression,
    nuisance: DepthNuisance = USUAL_DEPTH,
) -> None:
    """Write all ten topics of a recording.

    Parameters
    ----------
    path : Path
        A file that does not exist yet.
    streams : Streams
        The images.
    swing : Swing, optional
        The gripper's motion; without one, arm r2 stands aside and there is no gripper before the camera.
    begin_ns, duration_s : int, float
        When the recording begins and how long it takes.
    compression : {"none", "lz4", "bz2"}
        Of the chunks.
    nuisance : DepthNuisance
        What is unusual about the camera's pose, and what is known of the gripper.
    """
    pose = CameraPose(nuisance.camera_tilt_rad)
    by_tf_m, by_topic_m = ((0.0,) * 3,) * 2 if nuisance.gripper_error_m is None else nuisance.gripper_error_m
    said = None if swing is None else _Said(swing, pose, np.array(by_topic_m))
    events = [*_image_events(streams), *_robot_events(Robot(swing, pose, by_tf_m), said, begin_ns, duration_s)]
    events.sort(key=lambda event: (event.record_ns, event.connection))
    store = messages.typestore()
    writer = Writer(path)
    if compression != "none":
        writer.set_compression(Writer.CompressionFormat[compression.upper()])
    if compression == "lz4":
        writer.compressor = _lz4
    with writer:
        connections = [
            writer.add_connection(topic, kind, typestore=store, callerid=caller) for topic, kind, caller in _CONNECTIONS
        ]
        for event in events:
            writer.write(connections[event.connection], event.record_ns, event.payload())


def _lz4(chunk: bytes) -> bytes:
    """Compress as ROS's own recorder does, with a checksum of the content; rosbags leaves it out."""
    from lz4.frame import compress  # type: ignore[import-untyped]

    return bytes(compress(chunk, content_checksum=True))


def _image_events(streams: Streams) -> Iterator[Event]:
    depth, color = scene.DEPTH_CAMERA, scene.COLOR_CAMERA
    for index, (stamp, record) in enumerate(_pairs(streams.depth_times)):
        yield Event(record, _DEPTH, _image_payload(index, stamp, depth.frame_id, streams.depth))
        yield Event(record + 100_000, _DEPTH_INFO, _call(messages.camera_info, index, stamp, depth))
    for index, (stamp, record) in enumerate(_pairs(streams.color_times)):
        yield Event(record, _RGB, _image_payload(index, stamp, color.frame_id, streams.color))
        yield Event(record + 100_000, _RGB_INFO, _call(messages.camera_info, index, stamp, color))
        yield Event(record + 200_000, _REGISTERED_INFO, _call(messages.camera_info, index, stamp, color))


@dataclass(frozen=True)
class _Said:
    """What the topics say of the gripper."""

    swing: Swing
    pose: CameraPose
    error_m: NDArray[np.float64]

    def gripper_m(self, time_s: float) -> NDArray[np.float64]:
        return self.pose.see(self.swing.gripper_m(time_s)) + self.error_m


def _robot_events(robot: Robot, said: _Said | None, begin_ns: int, duration_s: float) -> Iterator[Event]:
    """Yield transforms, joints, the controller's feedback and the gripper's point, each at its own rate."""
    for stamp in ticks(begin_ns, duration_s, 10.0, 0.002).tolist():
        yield Event(stamp, _FIXED, _call(messages.transforms, stamp + _FIXED_AHEAD_NS, robot.fixed))
    for index, stamp in enumerate(ticks(begin_ns, duration_s, 50.0, 0.0031).tolist()):
        time_s = (stamp - begin_ns) / 1e9
        angles = robot.joints_rad(time_s)
        yield Event(stamp + 1_500_000, _LINKS, _call(messages.transforms, stamp, robot.links(time_s)))
        for shift, connection, part in (
            (600_000, _JOINTS_R1, slice(None, _TABLE_AND_R1)),
            (900_000, _JOINTS_R2, slice(_TABLE_AND_R1, None)),
        ):
            yield Event(
                stamp + shift, connection, _call(messages.joint_state, index, stamp, JOINTS[part], angles[part])
            )
        if index % 2 == 0:
            found = robot.joints_rad(time_s - _FEEDBACK_LAG_S)
            yield Event(stamp + 1_100_000, _FEEDBACK, _call(messages.feedback, index, stamp, JOINTS, angles, found))
    if said is None:
        return
    for index, stamp in enumerate(ticks(begin_ns, duration_s, 30.0, 0.0112).tolist()):
        place = said.gripper_m((stamp - begin_ns) / 1e9)
        for shift, connection, camera in (
            (3_000_000, _EE_DEPTH, scene.DEPTH_CAMERA),
            (3_200_000, _EE_RGB, scene.COLOR_CAMERA),
        ):
            seen = place - np.array(camera.origin_m)
            yield Event(stamp + shift, connection, _call(messages.point, index, stamp, camera.frame_id, seen))


def _pairs(times: FrameTimes) -> zip[tuple[int, int]]:
    return zip(times.stamp_ns.tolist(), times.record_ns.tolist(), strict=True)


def _call(make: Callable[..., bytes | memoryview], *values: object) -> Callable[[], bytes | memoryview]:
    return lambda: make(*values)


def _image_payload(
    index: int, stamp_ns: int, frame_id: str, pixels: Callable[[int], NDArray[np.uint16] | NDArray[np.uint8]]
) -> Callable[[], bytes | memoryview]:
    return lambda: messages.image(index, stamp_ns, frame_id, pixels(index))
