"""Standard ROS 2 messages of what is shown, and their bytes and schemas; the distribution is Humble."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from rosbags.typesys import Stores, get_typestore

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.arrays import DepthImage, FloatArray
    from garment_dataset.viewers.content import ShownCamera

    Color = tuple[int, int, int]

Message: TypeAlias = Any
"""A message: its class is made by rosbags when the program runs."""

SPHERE, CUBE, LINE_STRIP = 2, 1, 4
"""Kinds of ``visualization_msgs/Marker``."""

_ADD, _DELETE = 0, 2
_IMAGE_LINE_STRIP, _IMAGE_REMOVE = 1, 1
_FLOAT32 = 7
_UNTURNED = (0.0, 0.0, 0.0, 1.0)


class Ros2:
    """Makes messages, and knows how they are written."""

    def __init__(self) -> None:
        self._store = get_typestore(Stores.ROS2_HUMBLE)

    def schema(self, name: str) -> bytes:
        """Return the definition of a message type, with those that it is made of, as ``ros2msg``."""
        return self._store.generate_msgdef(name, ros_version=2)[0].encode()

    def cdr(self, name: str, message: object) -> bytes:
        """Return a message as bytes."""
        return bytes(self._store.serialize_cdr(message, name))

    def _new(self, name: str, /, **fields: Any) -> Message:  # noqa: ANN401 - a message has fields of any type
        return self._store.types[name](**fields)

    def header(self, stamp_ns: int, frame_id: str) -> Message:
        """Return a header: when, and in which frame."""
        stamp = self._new("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        return self._new("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)

    def depth_image(self, stamp_ns: int, frame_id: str, depth_mm: DepthImage) -> Message:
        """Return ``sensor_msgs/Image`` of millimetres."""
        height, width = depth_mm.shape
        return self._new(
            "sensor_msgs/msg/Image",
            header=self.header(stamp_ns, frame_id),
            height=height,
            width=width,
            encoding="16UC1",
            is_bigendian=0,
            step=2 * width,
            data=np.frombuffer(depth_mm.astype("<u2").tobytes(), np.uint8),
        )

    def compressed(self, stamp_ns: int, frame_id: str, kind: str, data: bytes) -> Message:
        """Return ``sensor_msgs/CompressedImage`` of a file of that kind."""
        return self._new(
            "sensor_msgs/msg/CompressedImage",
            header=self.header(stamp_ns, frame_id),
            format=kind,
            data=np.frombuffer(data, np.uint8),
        )

    def camera_info(self, stamp_ns: int, camera: ShownCamera) -> Message:
        """Return ``sensor_msgs/CameraInfo``."""
        k = camera.intrinsics
        whole = self._new(
            "sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        )
        return self._new(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(stamp_ns, camera.frame_id),
            height=camera.height_px,
            width=camera.width_px,
            distortion_model=camera.distortion_model,
            d=np.array(camera.distortion, np.float64),
            k=np.array([k.fx_px, 0, k.cx_px, 0, k.fy_px, k.cy_px, 0, 0, 1], np.float64),
            r=np.eye(3).ravel(),
            p=np.array([k.fx_px, 0, k.cx_px, 0, 0, k.fy_px, k.cy_px, 0, 0, 0, 1, 0], np.float64),
            binning_x=0,
            binning_y=0,
            roi=whole,
        )

    def cloud(self, stamp_ns: int, frame_id: str, points_m: FloatArray) -> Message:
        """Return ``sensor_msgs/PointCloud2`` of points (n, 3), as float32."""
        fields = [
            self._new("sensor_msgs/msg/PointField", name=axis, offset=4 * place, datatype=_FLOAT32, count=1)
            for place, axis in enumerate("xyz")
        ]
        return self._new(
            "sensor_msgs/msg/PointCloud2",
            header=self.header(stamp_ns, frame_id),
            height=1,
            width=len(points_m),
            fields=fields,
            is_bigendian=False,
            point_step=12,
            row_step=12 * len(points_m),
            data=np.frombuffer(points_m.astype("<f4").tobytes(), np.uint8),
            is_dense=True,
        )

    def transform(
        self, stamp_ns: int, parent: str, child: str, place_m: Sequence[float], quaternion_xyzw: Sequence[float]
    ) -> Message:
        """Return ``tf2_msgs/TFMessage`` of one transform, which takes coordinates in ``child`` to the parent's."""
        moved = self._new(
            "geometry_msgs/msg/Transform", translation=self._vector(place_m), rotation=self._turn(quaternion_xyzw)
        )
        stamped = self._new(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(stamp_ns, parent),
            child_frame_id=child,
            transform=moved,
        )
        return self._new("tf2_msgs/msg/TFMessage", transforms=[stamped])

    def joint_state(
        self, stamp_ns: int, names: list[str], position_rad: FloatArray, velocity_rad_s: FloatArray
    ) -> Message:
        """Return ``sensor_msgs/JointState``; NaN where a value is not known."""
        return self._new(
            "sensor_msgs/msg/JointState",
            header=self.header(stamp_ns, ""),
            name=names,
            position=position_rad,
            velocity=velocity_rad_s,
            effort=np.empty(0),
        )

    def markers(self, found: list[Message]) -> Message:
        """Return ``visualization_msgs/MarkerArray``."""
        return self._new("visualization_msgs/msg/MarkerArray", markers=found)

    def marker(
        self,
        header: Message,
        kind: int,
        place: tuple[str, int],
        color: Color,
        *,
        scale_m: Sequence[float],
        at_m: Sequence[float] = (0.0, 0.0, 0.0),
        alpha: float = 1.0,
        points_m: FloatArray | None = None,
    ) -> Message:
        """Return ``visualization_msgs/Marker``.

        Parameters
        ----------
        header : Header
            From :meth:`header`.
        kind : int
            :data:`SPHERE`, :data:`CUBE` or :data:`LINE_STRIP`.
        place : (str, int)
            Name space and number: a later marker of the same replaces it.
        color : (red, green, blue)
            Of 255.
        scale_m : (x, y, z)
            Diameters; of lines, x is the width.
        at_m : (x, y, z)
            Where its middle is.
        alpha : float
            1: opaque.
        points_m : (n, 3) float64, optional
            Of a line.
        """
        line = () if points_m is None else points_m.tolist()
        return self._marker(
            header,
            place,
            type=kind,
            scale=self._vector(scale_m),
            color=self._color(color, alpha),
            pose=self._pose(at_m),
            points=[self._point(each) for each in line],
        )

    def no_marker(self, header: Message, place: tuple[str, int]) -> Message:
        """Return what takes a marker away."""
        return self._marker(header, place, action=_DELETE)

    def _marker(self, header: Message, place: tuple[str, int], **given: object) -> Message:
        nothing: dict[str, object] = {
            "type": SPHERE,
            "action": _ADD,
            "pose": self._pose((0.0, 0.0, 0.0)),
            "scale": self._vector((1.0, 1.0, 1.0)),
            "color": self._color((0, 0, 0), 0.0),
            "lifetime": self._new("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
            "frame_locked": False,
            "points": [],
            "colors": [],
            "texture_resource": "",
            "texture": self._new(
                "sensor_msgs/msg/CompressedImage", header=self.header(0, ""), format="", data=np.empty(0, np.uint8)
            ),
            "uv_coordinates": [],
            "text": "",
            "mesh_resource": "",
            "mesh_file": self._new("visualization_msgs/msg/MeshFile", filename="", data=np.empty(0, np.uint8)),
            "mesh_use_embedded_materials": False,
        }
        return self._new(
            "visualization_msgs/msg/Marker", header=header, ns=place[0], id=place[1], **{**nothing, **given}
        )

    def image_line(self, header: Message, name: str, color: Color, line_px: FloatArray) -> Message:
        """Return ``visualization_msgs/ImageMarker``: a line (n, 2) on the image, taken away where it has no points."""
        return self._new(
            "visualization_msgs/msg/ImageMarker",
            header=header,
            ns=name,
            id=0,
            type=_IMAGE_LINE_STRIP,
            action=_ADD if len(line_px) else _IMAGE_REMOVE,
            position=self._point((0.0, 0.0, 0.0)),
            scale=2.0,
            outline_color=self._color(color, 1.0),
            filled=0,
            fill_color=self._color(color, 0.0),
            lifetime=self._new("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
            points=[self._point((u, v, 0.0)) for u, v in line_px.tolist()],
            outline_colors=[],
        )

    def _point(self, values: Sequence[float]) -> Message:
        return self._new("geometry_msgs/msg/Point", **dict(zip("xyz", values, strict=True)))

    def _vector(self, values: Sequence[float]) -> Message:
        return self._new("geometry_msgs/msg/Vector3", **dict(zip("xyz", values, strict=True)))

    def _turn(self, values: Sequence[float]) -> Message:
        return self._new("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", values, strict=True)))

    def _pose(self, at_m: Sequence[float]) -> Message:
        return self._new("geometry_msgs/msg/Pose", position=self._point(at_m), orientation=self._turn(_UNTURNED))

    def _color(self, color: Color, alpha: float) -> Message:
        r, g, b = (value / 255 for value in color)
        return self._new("std_msgs/msg/ColorRGBA", r=r, g=g, b=b, a=alpha)
