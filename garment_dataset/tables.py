"""The tables that the product hands over: one specification per output, with a unit and a description per column."""

from __future__ import annotations

from garment_dataset.table_spec import Column, TableSpec

_STAMP = Column("stamp_ns", "int64", "ns", "header stamp: when the camera saw it, since the Unix epoch")
_RECORD_STAMP = Column("record_stamp_ns", "int64", "ns", "when the recorder received it, since the Unix epoch")
_FRAME = Column("frame", "int32", "1", "index of the image in its stream, from 0, faulty messages counted")

FRAMES = TableSpec(
    "frames",
    1,
    "one image message",
    (
        Column("stream", "string", "", "depth or color"),
        _FRAME,
        Column("stamp_ns", "int64", "ns", "header stamp: when the camera saw it; null when unreadable", nullable=True),
        _RECORD_STAMP,
        Column("encoding", "string", "", "as the message says: 16UC1, rgb8 …", nullable=True),
        Column("width_px", "int32", "px", "image width", nullable=True),
        Column("height_px", "int32", "px", "image height", nullable=True),
        Column("step_bytes", "int32", "byte", "length of a row, padding included", nullable=True),
        Column("offset_bytes", "int64", "byte", "first pixel in the bag; null when compressed", nullable=True),
        Column("size_bytes", "int64", "byte", "length of the pixel data as stored", nullable=True),
        Column("fault", "string", "", "why the message is not used; null when it is", nullable=True),
    ),
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
)

GRIPPER = TableSpec(
    "gripper",
    2,
    "one usable image of either stream",
    (
        Column("stream", "string", "", "depth or color: whose image, and in whose optical frame the point is"),
        _FRAME,
        _STAMP,
        Column("x_m", "float64", "m", "end point of the gripper, optical frame of the stream, right", nullable=True),
        Column("y_m", "float64", "m", "end point of the gripper, optical frame of the stream, down", nullable=True),
        Column("z_m", "float64", "m", "end point of the gripper, optical frame of the stream, forward", nullable=True),
        Column("source", "string", "", "topic, or tf when computed from the recorded transforms", nullable=True),
        Column("gap_ns", "int64", "ns", "distance in time to the nearest sample the point rests on", nullable=True),
        Column("reason", "string", "", "why there is no point; null when there is one", nullable=True),
    ),
)

JOINTS = TableSpec(
    "joints",
    1,
    "one sample of one joint",
    (
        _STAMP,
        _RECORD_STAMP,
        Column("joint", "string", "", "name of the joint"),
        Column("position_rad", "float64", "rad", "joint position", nullable=True),
        Column("velocity_rad_s", "float64", "rad/s", "joint velocity", nullable=True),
    ),
)

CHAINS = TableSpec(
    "chains",
    1,
    "one sample of one depth frame, from the gripper down",
    (
        _FRAME,
        _STAMP,
        Column("sample", "int32", "1", "number of the sample, from 0 at the gripper"),
        Column("x_m", "float64", "m", "mean of the window, depth optical frame, right"),
        Column("y_m", "float64", "m", "middle of the window, depth optical frame, down"),
        Column("z_m", "float64", "m", "mean of the window, depth optical frame, forward"),
        Column("arc_length_m", "float64", "m", "along the chain, from the gripper's end point"),
        Column("pixels", "int32", "1", "number of pixels in the window; 0 where a gap was bridged"),
        Column("z_spread_m", "float64", "m", "standard deviation of z in the window", nullable=True),
    ),
)

POINTS = TableSpec(
    "points",
    2,
    "one point of one depth frame",
    (
        _FRAME,
        _STAMP,
        Column("point", "int32", "1", "number of the point, 1 next to the gripper"),
        Column("x_m", "float64", "m", "depth optical frame, right", nullable=True),
        Column("y_m", "float64", "m", "depth optical frame, down", nullable=True),
        Column("z_m", "float64", "m", "depth optical frame, forward", nullable=True),
        Column("x_std_m", "float64", "m", "standard uncertainty of x", nullable=True),
        Column("y_std_m", "float64", "m", "standard uncertainty of y", nullable=True),
        Column("z_std_m", "float64", "m", "standard uncertainty of z", nullable=True),
        *(
            Column(
                f"material_{axis}_m",
                "float64",
                "m",
                f"the point on the material line, estimated as the middle of the sheet, {side}; null: cannot be had",
                nullable=True,
            )
            for axis, side in (("x", "right"), ("y", "down"), ("z", "forward"))
        ),
        Column("arc_length_m", "float64", "m", "along the garment, from the gripper's end point", nullable=True),
        Column("garment_length_m", "float64", "m", "length of the garment the points divide", nullable=True),
        Column("pixels", "int32", "1", "number of pixels the point rests on"),
        Column("reason", "string", "", "why there is no point; null when there is one", nullable=True),
    ),
)

KINEMATICS = TableSpec(
    "kinematics",
    1,
    "one point of one depth frame, the gripper among them",
    (
        _FRAME,
        _STAMP,
        Column("point", "int32", "1", "number of the point; 0 is the gripper, 1 next to it"),
        Column("time_s", "float64", "s", "since the gripper began to move; null when it never did", nullable=True),
        *(
            Column(f"{axis}_m", "float64", "m", f"depth optical frame, {side}", nullable=True)
            for axis, side in (("x", "right"), ("y", "down"), ("z", "forward"))
        ),
        *(
            Column(f"d{axis}_m", "float64", "m", f"displacement from rest along {axis}", nullable=True)
            for axis in "xyz"
        ),
        *(
            Column(f"d{axis}_std_m", "float64", "m", f"standard uncertainty of d{axis}", nullable=True)
            for axis in "xyz"
        ),
        Column("velocity_stamp_ns", "int64", "ns", "when the velocity holds: middle of its interval", nullable=True),
        *(Column(f"v{axis}_m_s", "float64", "m/s", f"velocity along {axis}", nullable=True) for axis in "xyz"),
        *(
            Column(f"v{axis}_std_m_s", "float64", "m/s", f"standard uncertainty of v{axis}", nullable=True)
            for axis in "xyz"
        ),
        Column("reason", "string", "", "why there is no position; null when there is one", nullable=True),
    ),
)

BACKGROUND = TableSpec(
    "background",
    1,
    "one row of the image of the empty scene, from the top",
    (
        Column("v_px", "int32", "px", "number of the row of the image, from 0"),
        Column("frame_count", "int32", "1", "number of frames that mean and std are of"),
        Column("mean", "list<float64>", "level", "mean by pixel and channel, thesis eq. (5.1): r, g, b, r, g, b, …"),
        Column("std", "list<float64>", "level", "sample standard deviation, thesis eq. (5.2), in the order of mean"),
    ),
    partitions=(),
)
"""One file per camera position. ``np.stack(frame["mean"]).reshape(len(frame), -1, 3)`` is the image, (H, W, 3)."""

SILHOUETTES = TableSpec(
    "silhouettes",
    1,
    "one usable colour frame",
    (
        _FRAME,
        _STAMP,
        Column("mask", "binary", "", "PNG of one bit per pixel, of the size of the image: white is garment", True),
        Column("area_px2", "int32", "px2", "number of pixels of the mask", nullable=True),
        Column("centroid_u_px", "float64", "px", "mean u of the mask; the centre of the first pixel is 0", True),
        Column("centroid_v_px", "float64", "px", "mean v of the mask; the centre of the first pixel is 0", True),
        Column("major_px", "float64", "px", "length of the major axis, as MATLAB's regionprops", nullable=True),
        Column("minor_px", "float64", "px", "length of the minor axis, as MATLAB's regionprops", nullable=True),
        Column("orientation_rad", "float64", "rad", "of the major axis, counter-clockwise from the u axis", True),
        Column("box_u_px", "int32", "px", "first column of the mask", nullable=True),
        Column("box_v_px", "int32", "px", "first row of the mask", nullable=True),
        Column("box_width_px", "int32", "px", "number of columns from the first to the last of the mask", True),
        Column("box_height_px", "int32", "px", "number of rows from the first to the last of the mask", True),
        Column("outline_u_px", "list<int32>", "px", "u of the outer border's pixels, counter-clockwise", True),
        Column("outline_v_px", "list<int32>", "px", "v of the same pixels", nullable=True),
        Column("gripper_u_px", "float64", "px", "u of the gripper's end point in the image", nullable=True),
        Column("gripper_v_px", "float64", "px", "v of the gripper's end point in the image", nullable=True),
        *(
            Column(f"drift_{channel}", "float64", "level", f"brightness against the background, {name}", nullable=True)
            for channel, name in (("r", "red"), ("g", "green"), ("b", "blue"))
        ),
        Column("reason", "string", "", "why there is no mask; null when there is one", nullable=True),
    ),
)
"""``decode_mask(row.mask)`` of :mod:`garment_dataset.vision.masks` is the mask, (H, W) bool."""

CENTRAL_CURVES = TableSpec(
    "central_curves",
    1,
    "one cut across the silhouette of one colour frame, from its upper end down",
    (
        _FRAME,
        _STAMP,
        Column("cut", "int32", "1", "number of the cut, from 0 at the upper end"),
        Column("u_px", "float64", "px", "u of the midpoint between the outermost crossings of cut and outline"),
        Column("v_px", "float64", "px", "v of the same midpoint"),
        Column("width_px", "float64", "px", "distance between the outermost crossings"),
        Column("position_px", "float64", "px", "of the cut along the major axis, from the upper end"),
        Column("arc_length_px", "float64", "px", "along the curve, from its first midpoint"),
        Column("parts", "int32", "1", "how many separate parts the cut meets: more than 1 at folds, sleeves and holes"),
    ),
)
