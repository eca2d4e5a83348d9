from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import cv2
import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from garment_dataset.engine.table import Label
from garment_dataset.stages import stage
from garment_dataset.stages.cameras import CAMERA
from garment_dataset.stages.decode_tables import FRAMES, GRIPPER

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

STORE = get_typestore(Stores.ROS1_NOETIC)
STORE.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
T: dict[str, Any] = STORE.types
IDENTITY = (0.0, 0.0, 0.0, 1.0)


@dataclass
class Recorder:
    """Messages for a small ROS 1 bag; the recorder receives each 5 ms after its stamp unless told otherwise."""

    path: Path
    rows: list[tuple[int, str, Any]] = field(default_factory=list)

    def add(self, topic: str, message: Any, *, delay_ns: int = 5_000_000) -> Recorder:
        stamped = message.transforms[0] if hasattr(message, "transforms") else message
        stamp = stamped.header.stamp
        self.rows.append((stamp.sec * 10**9 + stamp.nanosec + delay_ns, topic, message))
        return self

    def write(self, compression: Literal["lz4", "bz2"] | None = None) -> Path:
        self.path.unlink(missing_ok=True)
        writer = Writer(self.path)
        if compression:
            writer.set_compression(Writer.CompressionFormat[compression.upper()])
        with writer:
            connections: dict[tuple[str, str], Any] = {}
            for record_stamp_ns, topic, message in sorted(self.rows, key=lambda row: row[0]):
                name = message.__msgtype__
                if (topic, name) not in connections:
                    connections[topic, name] = writer.add_connection(topic, name, typestore=STORE)
                raw = STORE.serialize_ros1(message, name)
                writer.write(connections[topic, name], record_stamp_ns, raw)
        return self.path


@pytest.fixture
def recorder(tmp_path: Path) -> Recorder:
    return Recorder(tmp_path / "Test_Free_pi16_0.5_R1.bag")


@dataclass(frozen=True)
class Messages:
    """Makers of ROS messages."""

    def header(self, stamp_ns: int, frame_id: str = "") -> Any:
        stamp = T["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        return T["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id=frame_id)

    def image(self, stamp_ns: int, frame_id: str, pixels: NDArray[Any], encoding: str, **changes: Any) -> Any:
        data = np.frombuffer(pixels.tobytes(), np.uint8)
        fields = {
            "header": self.header(stamp_ns, frame_id),
            "height": pixels.shape[0],
            "width": pixels.shape[1],
            "encoding": encoding,
            "is_bigendian": 0,
            "step": data.size // pixels.shape[0],
            "data": data,
        }
        return T["sensor_msgs/msg/Image"](**(fields | changes))

    def png(self, stamp_ns: int, frame_id: str, pixels: NDArray[Any], form: str, *, keep: float = 1.0) -> Any:
        """A compressed image, of which only the share ``keep`` arrived."""
        data = cv2.imencode(".png", pixels)[1]
        data = data[: int(keep * data.size)]
        return T["sensor_msgs/msg/CompressedImage"](header=self.header(stamp_ns, frame_id), format=form, data=data)

    def camera_info(self, stamp_ns: int, frame_id: str, size: tuple[int, int], f_px: float = 500.0) -> Any:
        width, height = size
        c = (0.0, 0.0) if f_px == 0 else ((width - 1) / 2, (height - 1) / 2)
        roi = T["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
        return T["sensor_msgs/msg/CameraInfo"](
            header=self.header(stamp_ns, frame_id),
            height=height,
            width=width,
            distortion_model="plumb_bob",
            D=np.array([0.1, -0.2, 0.0, 0.0, 0.0]),
            K=np.array([f_px, 0, c[0], 0, f_px, c[1], 0, 0, float(f_px != 0)]),
            R=np.eye(3).ravel(),
            P=np.zeros(12),
            binning_x=0,
            binning_y=0,
            roi=roi,
        )

    def point(self, stamp_ns: int, frame_id: str, position_m: Sequence[float]) -> Any:
        point = T["geometry_msgs/msg/Point"](*position_m)
        return T["geometry_msgs/msg/PointStamped"](header=self.header(stamp_ns, frame_id), point=point)

    def tf(
        self, stamp_ns: int, *links: tuple[str, str, Sequence[float]], quaternion_xyzw: Sequence[float] = IDENTITY
    ) -> Any:
        """Transforms of one stamp and one rotation: (parent, child, translation) each."""
        transforms = [
            T["geometry_msgs/msg/TransformStamped"](
                header=self.header(stamp_ns, parent),
                child_frame_id=child,
                transform=T["geometry_msgs/msg/Transform"](
                    translation=T["geometry_msgs/msg/Vector3"](*translation_m),
                    rotation=T["geometry_msgs/msg/Quaternion"](*quaternion_xyzw),
                ),
            )
            for parent, child, translation_m in links
        ]
        return T["tf2_msgs/msg/TFMessage"](transforms=transforms)

    def joints(
        self, stamp_ns: int, names: Sequence[str], position: Sequence[float], velocity: Sequence[float] = ()
    ) -> Any:
        return T["sensor_msgs/msg/JointState"](
            header=self.header(stamp_ns),
            name=list(names),
            position=np.array(position, np.float64),
            velocity=np.array(velocity, np.float64),
            effort=np.zeros(0),
        )


@pytest.fixture
def ros() -> Messages:
    return Messages()


@dataclass(frozen=True)
class ColorTables:
    """What ``decode`` would have said of colour images of a made recording, as the engine hands it on."""

    def of(self, spec: Any, rows: Sequence[dict[str, Any]]) -> Any:
        """Return a table with the identity columns in front; columns not given are null."""
        columns = {column.name: [row.get(column.name) for row in rows] for column in spec.columns}
        values = ("Made_Free_pi16_0.5_B1", "B", 0.5, None, None)
        labels = [Label(column, value) for column, value in zip(stage.IDENTITY, values, strict=True)]
        return spec.labelled(spec.table(columns), labels)

    def frames(self, stamps_ns: Sequence[int], faulty: Sequence[int] = ()) -> Any:
        rows = [
            {
                "stream": stream,
                "frame": frame,
                "stamp_ns": stamp_ns,
                "record_stamp_ns": 0,
                "topic": "/xtion1/rgb/image_raw",
                "fault": "torn" if frame in faulty and stream == "color" else None,
            }
            for stream in ("depth", "color")
            for frame, stamp_ns in enumerate(stamps_ns)
        ]
        return self.of(FRAMES, rows)

    def camera(self, size: tuple[int, int], f_px: float, c_px: tuple[float, float]) -> Any:
        k = {"fx_px": f_px, "fy_px": f_px, "cx_px": c_px[0], "cy_px": c_px[1]}
        row = {"frame_id": "camera", "width_px": size[0], "height_px": size[1], **k}
        row |= {"distortion_model": "plumb_bob", "distortion": [0.0] * 5, "matrix": "K"}
        return self.of(CAMERA, [{**row, "stream": "depth", "fx_px": 1.0, "fy_px": 1.0}, {**row, "stream": "color"}])

    def gripper(self, stamps_ns: Sequence[int], positions_m: Sequence[Sequence[float] | None]) -> Any:
        rows = []
        for frame, (stamp_ns, position_m) in enumerate(zip(stamps_ns, positions_m, strict=True)):
            known = (
                {"reason": "past"} if position_m is None else dict(zip(("x_m", "y_m", "z_m"), position_m, strict=True))
            )
            row = {"frame": frame, "stamp_ns": stamp_ns}
            rows += [
                {**row, "stream": "depth", "x_m": 9.0, "y_m": 9.0, "z_m": 9.0},
                {**row, "stream": "color", **known},
            ]
        return self.of(GRIPPER, rows)


@pytest.fixture
def color_tables() -> ColorTables:
    return ColorTables()
