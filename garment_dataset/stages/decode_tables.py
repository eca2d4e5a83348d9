"""The tables that ``decode`` fills, besides ``camera``: images, gripper, joints, and which way is down."""

from __future__ import annotations

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.stages.columns import FRAME, RECORD_STAMP, STAMP

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
        Column("fault", "string", "", "why the message or its stamp is not used; null when it is", nullable=True),
    ),
    keys=("stream", "frame"),
)

_END_POINT = "end point of the gripper, optical frame of the stream"
_TURN = "unit quaternion from the gripper's frame to the stream's optical frame"

GRIPPER = TableSpec(
    "gripper",
    4,
    "one usable image of either stream",
    (
        Column("stream", "string", "", "depth or color: whose image, and in whose optical frame the point is"),
        FRAME,
        STAMP,
        Column("x_m", "float64", "m", f"{_END_POINT}, right", nullable=True, uncertainty="x_std_m"),
        Column("y_m", "float64", "m", f"{_END_POINT}, down", nullable=True, uncertainty="y_std_m"),
        Column("z_m", "float64", "m", f"{_END_POINT}, forward", nullable=True, uncertainty="z_std_m"),
        Column("x_std_m", "float64", "m", "standard uncertainty of x: interpolation and floor", nullable=True),
        Column("y_std_m", "float64", "m", "standard uncertainty of y: interpolation and floor", nullable=True),
        Column("z_std_m", "float64", "m", "standard uncertainty of z: interpolation and floor", nullable=True),
        *(
            Column(f"apart_{axis}_m", "float64", "m", f"{axis} by the source not used, less {axis}", nullable=True)
            for axis in "xyz"
        ),
        Column("qx", "float64", "1", f"{_TURN}, x; it never flips its sign", nullable=True),
        Column("qy", "float64", "1", f"{_TURN}, y", nullable=True),
        Column("qz", "float64", "1", f"{_TURN}, z", nullable=True),
        Column("qw", "float64", "1", f"{_TURN}, w", nullable=True),
        Column("source", "string", "", "topic, or tf when computed from the recorded transforms", nullable=True),
        Column("gap_ns", "int64", "ns", "distance in time to the nearest sample the point rests on", nullable=True),
        Column("reason", "string", "", "why there is no point; null when there is one", nullable=True),
    ),
    keys=("stream", "frame"),
)

WORLD = TableSpec(
    "world",
    1,
    "one image stream",
    (
        Column("stream", "string", "", "depth or color: in whose optical frame the direction is"),
        Column("gravity_x", "float64", "1", "unit vector of gravity, right", nullable=True),
        Column("gravity_y", "float64", "1", "unit vector of gravity, down", nullable=True),
        Column("gravity_z", "float64", "1", "unit vector of gravity, forward", nullable=True),
        Column("gravity_source", "string", "", "whence it is known: tf, and the level frame", nullable=True),
        Column("reason", "string", "", "why it is not known; null when it is", nullable=True),
    ),
    keys=("stream",),
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
