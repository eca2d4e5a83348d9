"""A recording as MCAP of standard ROS 2 messages, for Foxglove and viewers like it. Needs the extra ``mcap``."""

from __future__ import annotations

import heapq
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.bags.camera import camera_info_beside, image_base
from garment_dataset.errors import require_extra
from garment_dataset.files import whole_file
from garment_dataset.viewers import colors
from garment_dataset.viewers.encoding import color_jpeg
from garment_dataset.viewers.frames import ColorFrame, DepthFrame, Frames
from garment_dataset.viewers.level import LEVEL, level_quaternion_xyzw
from garment_dataset.viewers.ros2 import CUBE, LINE_STRIP, SPHERE, Ros2
from garment_dataset.vision.depth.garment_pixels import back_project

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from typing import IO

    import pandas as pd

    from garment_dataset.viewers.content import Content, Stream
    from garment_dataset.viewers.frames import Points, Pose
    from garment_dataset.viewers.ros2 import Message

_POINT_M, _CHAIN_M, _TRACK_M, _GRIPPER_M = 0.012, 0.003, 0.008, 0.01
_TWO_STDS_ACROSS = 4.0
"""Diameter of an ellipsoid of two standard uncertainties to each side."""
_PALE = 0.35


def import_mcap() -> None:
    """Say so if the library that writes MCAP is not installed.

    Raises
    ------
    MissingExtraError
        If it is not.
    """
    require_extra("mcap.writer", "MCAP files need mcap", "mcap")


def save_mcap(content: Content, path: Path) -> None:
    """Write a recording to an MCAP file, whole or not at all; the same results give the same bytes.

    Parameters
    ----------
    content : Content
        Of the recording.
    path : Path
        The ``.mcap`` file; one that is there is replaced.

    Raises
    ------
    MissingExtraError
        If the library that writes it is not installed.
    BagError
        If the bag cannot be read.
    """
    import_mcap()
    with whole_file(path) as part, part.open("wb") as file:
        _Export(file, content).all()


class _Export:
    """One recording on its way into a file."""

    def __init__(self, file: IO[bytes], content: Content) -> None:
        from mcap.writer import CompressionType, Writer

        self._ros, self._content = Ros2(), content
        # raw depth becomes as small within compressed chunks as PNG files are, and every viewer reads it
        self._writer = Writer(file, compression=CompressionType.ZSTD)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._sequence: dict[str, int] = {}
        self._numbers: dict[str, list[int]] = {
            name: sorted({int(number) for number in content.tables[name]["point"]})
            for name in ("points", "tracks")
            if name in content.tables
        }

    def all(self) -> None:
        """Write everything, in the order of time."""
        self._writer.start(profile="ros2", library="garment-dataset")
        about = {"recording": self._content.recording, "left_out": "\n".join(self._content.left_out)}
        self._writer.add_metadata("garment", about)
        self._write_cameras()
        frames = ((frame.stamp_ns, frame) for frame in Frames(self._content))
        for stamp_ns, what in heapq.merge(frames, self._joints(), key=itemgetter(0)):
            if isinstance(what, DepthFrame):
                self._write_depth(what)
            elif isinstance(what, ColorFrame):
                self._write_color(what)
            else:
                self._write("/joint_states", "sensor_msgs/msg/JointState", stamp_ns, what)
        self._writer.finish()

    def _write(self, topic: str, kind: str, stamp_ns: int, message: Message) -> None:
        if topic not in self._channels:
            if kind not in self._schemas:
                self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", self._ros.schema(kind))
            self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[kind])
            self._sequence[topic] = 0
        data = self._ros.cdr(kind, message)
        self._writer.add_message(self._channels[topic], stamp_ns, data, stamp_ns, self._sequence[topic])
        self._sequence[topic] += 1

    def _joints(self) -> Iterator[tuple[int, Message]]:
        """Yield the state of all joints at a time."""
        if "joints" not in self._content.tables:
            return
        for stamp, rows in self._content.tables["joints"].groupby("stamp_ns"):
            stamp_ns = int(str(stamp))
            position, velocity = (_values(rows, name) for name in ("position_rad", "velocity_rad_s"))
            yield stamp_ns, self._ros.joint_state(stamp_ns, rows["joint"].tolist(), position, velocity)

    def _write_cameras(self) -> None:
        """Write how the cameras stand, before all else, as it holds all along."""
        content, stamp_ns = self._content, self._content.start_ns
        if "joints" in content.tables and len(joints := content.tables["joints"]):
            stamp_ns = min(stamp_ns, int(joints["stamp_ns"].min()))
        links, frame = [], content.cameras[content.main].frame_id
        if content.gravity is not None:
            links.append((LEVEL, frame, np.zeros(3), level_quaternion_xyzw(content.gravity)))
        if (between := content.other_in_main) is not None:
            others = {camera.frame_id for camera in content.cameras.values()} - {frame}
            links += [(frame, other, between.translation, between.quaternion_xyzw) for other in others]
        for parent, child, place_m, turn in links:
            message = self._ros.transform(stamp_ns, parent, child, place_m.tolist(), turn.tolist())
            self._write("/tf_static", "tf2_msgs/msg/TFMessage", stamp_ns, message)

    def _write_camera(self, stream: Stream, stamp_ns: int) -> str:
        """Write the camera of an image; return the topic that images are below."""
        camera = self._content.cameras[stream]
        base = image_base(camera.topic)
        info = self._ros.camera_info(stamp_ns, camera)
        self._write(camera_info_beside(base), "sensor_msgs/msg/CameraInfo", stamp_ns, info)
        return base

    def _write_depth(self, frame: DepthFrame) -> None:
        camera, stamp_ns = self._content.cameras["depth"], frame.stamp_ns
        self._write_gripper("depth", frame.gripper, stamp_ns)
        base = self._write_camera("depth", stamp_ns)
        if frame.depth_mm is not None:
            image = self._ros.depth_image(stamp_ns, camera.frame_id, frame.depth_mm)
            self._write(base, "sensor_msgs/msg/Image", stamp_ns, image)
            points_m = np.empty((0, 3))
            if frame.mask is not None:
                points_m = back_project(frame.depth_mm, frame.mask, camera.intrinsics)
            cloud = self._ros.cloud(stamp_ns, camera.frame_id, points_m)
            self._write("/garment/cloud", "sensor_msgs/msg/PointCloud2", stamp_ns, cloud)
        header = self._ros.header(stamp_ns, camera.frame_id)
        if "chains" in self._content.tables:
            chain = self._ros.no_marker(header, ("chain", 0))
            if len(frame.chain_m):
                width_m = (_CHAIN_M, 0.0, 0.0)
                chain = self._ros.marker(
                    header, LINE_STRIP, ("chain", 0), colors.CHAIN, scale_m=width_m, points_m=frame.chain_m
                )
            self._write_markers("/garment/chain", stamp_ns, [chain])
        for name, points, shape in (("points", frame.points, SPHERE), ("tracks", frame.tracks, CUBE)):
            if name in self._numbers:
                self._write_markers(f"/garment/{name}", stamp_ns, self._point_markers(header, name, points, shape))

    def _write_markers(self, topic: str, stamp_ns: int, markers: list[Message]) -> None:
        self._write(topic, "visualization_msgs/msg/MarkerArray", stamp_ns, self._ros.markers(markers))

    def _point_markers(self, header: Message, name: str, points: Points, shape: int) -> list[Message]:
        """Return for every point a mark, and an ellipsoid of two standard uncertainties; or that they are gone."""
        found = {int(number): row for row, number in enumerate(points.number)}
        size_m = _POINT_M if shape == SPHERE else _TRACK_M
        markers = []
        for number in self._numbers[name]:
            row, shade = found.get(number), colors.point_color(number)
            mark, around = (name, number), (f"{name}_2_std", number)
            if row is None:
                markers += [self._ros.no_marker(header, mark), self._ros.no_marker(header, around)]
                continue
            at_m, std_m = points.position_m[row].tolist(), points.std_m[row]
            markers.append(self._ros.marker(header, shape, mark, shade, scale_m=(size_m,) * 3, at_m=at_m))
            if np.isfinite(std_m).all():
                size = (_TWO_STDS_ACROSS * std_m).tolist()
                markers.append(self._ros.marker(header, SPHERE, around, shade, scale_m=size, at_m=at_m, alpha=_PALE))
            else:
                markers.append(self._ros.no_marker(header, around))
        return markers

    def _write_gripper(self, stream: Stream, gripper: Pose | None, stamp_ns: int) -> None:
        """Write the end point in each stream's frame, and where its frame is in that of the main stream."""
        camera = self._content.cameras[stream]
        header, place = self._ros.header(stamp_ns, camera.frame_id), (f"gripper_{stream}", 0)
        marker = self._ros.no_marker(header, place)
        if gripper is not None:
            at_m = gripper.position_m.tolist()
            marker = self._ros.marker(header, SPHERE, place, colors.GRIPPER, scale_m=(_GRIPPER_M,) * 3, at_m=at_m)
            if stream == self._content.main and gripper.quaternion_xyzw is not None:
                turn = gripper.quaternion_xyzw.tolist()
                pose = self._ros.transform(stamp_ns, camera.frame_id, self._content.gripper_frame, at_m, turn)
                self._write("/tf", "tf2_msgs/msg/TFMessage", stamp_ns, pose)
        self._write_markers("/garment/gripper", stamp_ns, [marker])

    def _write_color(self, frame: ColorFrame) -> None:
        camera, stamp_ns = self._content.cameras["color"], frame.stamp_ns
        self._write_gripper("color", frame.gripper, stamp_ns)
        base = self._write_camera("color", stamp_ns)
        if frame.rgb is not None:
            image = self._ros.compressed(stamp_ns, camera.frame_id, "jpeg", color_jpeg(frame.rgb))
            self._write(f"{base}/compressed", "sensor_msgs/msg/CompressedImage", stamp_ns, image)
        if frame.mask_png is not None:
            mask = self._ros.compressed(stamp_ns, camera.frame_id, "png", frame.mask_png)
            self._write("/garment/mask/compressed", "sensor_msgs/msg/CompressedImage", stamp_ns, mask)
        header = self._ros.header(stamp_ns, camera.frame_id)
        for table, name, line_px, shade in (
            ("silhouettes", "outline", frame.outline_px, colors.OUTLINE),
            ("central_curves", "central_curve", frame.curve_px, colors.CURVE),
        ):
            if table in self._content.tables:
                line = self._ros.image_line(header, name, shade, line_px)
                self._write(f"/garment/{name}", "visualization_msgs/msg/ImageMarker", stamp_ns, line)


def _values(rows: pd.DataFrame, column: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return rows[column].to_numpy(np.float64, na_value=np.nan)
