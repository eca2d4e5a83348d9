"""The messages of a recording, serialised for ROS 1."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from garment_dataset.simulate.raster import HEIGHT_PX, WIDTH_PX

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from rosbags.typesys.store import Typestore

    from garment_dataset.simulate.raster import Pinhole
    from garment_dataset.simulate.robot import Link

IMAGE = "sensor_msgs/msg/Image"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
POINT = "geometry_msgs/msg/PointStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
JOINT_STATE = "sensor_msgs/msg/JointState"
FEEDBACK = "control_msgs/msg/FollowJointTrajectoryFeedback"

_FEEDBACK_TEXT = """std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint desired
trajectory_msgs/JointTrajectoryPoint actual
trajectory_msgs/JointTrajectoryPoint error
"""


@lru_cache(maxsize=1)
def typestore() -> Typestore:
    """Return ROS 1's message types, with the two that are not among its common ones."""
    store = get_typestore(Stores.ROS1_NOETIC)
    for text, name in (("geometry_msgs/TransformStamped[] transforms\n", TRANSFORMS), (_FEEDBACK_TEXT, FEEDBACK)):
        missing = {key: kind for key, kind in get_types_from_msg(text, name).items() if key not in store.fielddefs}
        store.register(missing)
    return store


def _pack(kind: str, message: object) -> bytes | memoryview:
    return typestore().serialize_ros1(message, kind)


def _make(kind: str, *values: Any) -> Any:  # noqa: ANN401 - rosbags makes its classes at run time
    return typestore().types[kind](*values)


def _header(sequence: int, stamp_ns: int, frame_id: str) -> Any:  # noqa: ANN401
    stamp = _make("builtin_interfaces/msg/Time", *divmod(int(stamp_ns), 10**9))
    return _make("std_msgs/msg/Header", sequence, stamp, frame_id)


def image(
    sequence: int, stamp_ns: int, frame_id: str, pixels: NDArray[np.uint16] | NDArray[np.uint8]
) -> bytes | memoryview:
    """Return an image: 16UC1 of uint16 (H, W), rgb8 of uint8 (H, W, 3)."""
    height, width = pixels.shape[:2]
    encoding = "16UC1" if pixels.ndim == 2 else "rgb8"
    data = np.ascontiguousarray(pixels).view(np.uint8).reshape(-1)
    header = _header(sequence, stamp_ns, frame_id)
    return _pack(IMAGE, _make(IMAGE, header, height, width, encoding, 0, len(data) // height, data))


def camera_info(sequence: int, stamp_ns: int, camera: Pinhole) -> bytes | memoryview:
    """Return the calibration that goes with an image."""
    focal, cx, cy = camera.focal_px, camera.cx_px, camera.cy_px
    k = np.array([focal, 0, cx, 0, focal, cy, 0, 0, 1.0])
    p = np.array([focal, 0, cx, 0, 0, focal, cy, 0, 0, 0, 1.0, 0])
    region = _make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
    header = _header(sequence, stamp_ns, camera.frame_id)
    info = (HEIGHT_PX, WIDTH_PX, "plumb_bob", np.zeros(5), k, np.eye(3).ravel(), p, 0, 0, region)
    return _pack(CAMERA_INFO, _make(CAMERA_INFO, header, *info))


def point(sequence: int, stamp_ns: int, frame_id: str, place_m: NDArray[np.float64]) -> bytes | memoryview:
    """Return a point, metres."""
    place = _make("geometry_msgs/msg/Point", *place_m.tolist())
    return _pack(POINT, _make(POINT, _header(sequence, stamp_ns, frame_id), place))


def transforms(stamp_ns: int, links: Sequence[Link]) -> bytes | memoryview:
    """Return one message of several transforms of one stamp."""
    stamped = [
        _make(
            "geometry_msgs/msg/TransformStamped",
            _header(0, stamp_ns, link.parent),
            link.child,
            _make(
                "geometry_msgs/msg/Transform",
                _make("geometry_msgs/msg/Vector3", *link.translation_m),
                _make("geometry_msgs/msg/Quaternion", *link.quaternion_xyzw),
            ),
        )
        for link in links
    ]
    return _pack(TRANSFORMS, _make(TRANSFORMS, stamped))


def joint_state(
    sequence: int, stamp_ns: int, names: Sequence[str], angles_rad: NDArray[np.float64]
) -> bytes | memoryview:
    """Return joint angles; the drivers fill in neither speed nor effort."""
    nothing = np.zeros(0)
    header = _header(sequence, stamp_ns, "")
    return _pack(JOINT_STATE, _make(JOINT_STATE, header, list(names), angles_rad, nothing, nothing))


def feedback(
    sequence: int, stamp_ns: int, names: Sequence[str], wanted_rad: NDArray[np.float64], found_rad: NDArray[np.float64]
) -> bytes | memoryview:
    """Return what the trajectory controller reports."""
    nothing, now = np.zeros(0), _make("builtin_interfaces/msg/Duration", 0, 0)
    states = [
        _make("trajectory_msgs/msg/JointTrajectoryPoint", angles, nothing, nothing, nothing, now)
        for angles in (wanted_rad, found_rad, wanted_rad - found_rad)
    ]
    return _pack(FEEDBACK, _make(FEEDBACK, _header(sequence, stamp_ns, ""), list(names), *states))
