"""The camera of an image stream: what ``sensor_msgs/CameraInfo`` says of its optics."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from garment_dataset.errors import BagError, DataWarning

if TYPE_CHECKING:
    from garment_dataset.bags.bag import Bag

_CAMERA_INFO = "sensor_msgs/msg/CameraInfo"


@dataclass(frozen=True, slots=True)
class Camera:
    """A pinhole camera with a distortion model, as calibrated.

    Parameters
    ----------
    frame_id : str
        Optical frame: x right, y down, z forward.
    width_px, height_px : int
        Size of the images it belongs to.
    fx_px, fy_px, cx_px, cy_px : float
        Focal lengths and principal point, K[0, 0], K[1, 1], K[0, 2], K[1, 2]; the centre of the first pixel is (0, 0).
    distortion_model : str
        ``plumb_bob``, ``rational_polynomial`` … or empty.
    distortion : tuple of float
        Its coefficients.
    """

    frame_id: str
    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion_model: str
    distortion: tuple[float, ...]


def read_camera(bag: Bag, topic: str) -> Camera:
    """Read the camera of one stream from its ``camera_info`` topic.

    Parameters
    ----------
    bag : Bag
        An open recording.
    topic : str
        The ``camera_info`` of the very stream: registered depth has another than raw depth.

    Returns
    -------
    Camera
        That of the first message. Where others contradict it, a DataWarning says how many.

    Raises
    ------
    BagError
        If the topic is missing, has no readable message or another type, or if the camera is not calibrated.
    """
    if topic not in bag.topics:
        raise BagError("no such topic", where=bag.path, expected=topic, found=", ".join(bag.topics))
    if bag.topics[topic].types != (_CAMERA_INFO,):
        found = ", ".join(bag.topics[topic].types)
        raise BagError("topic of another type", where=f"{bag.path}: {topic}", expected=_CAMERA_INFO, found=found)
    cameras = [_camera(message.data) for message in bag.messages(topic)]
    if not cameras:
        raise BagError("no readable message", where=f"{bag.path}: {topic}")
    first = cameras[0]
    _check_calibrated(first, f"{bag.path}: {topic}")
    if others := sum(camera != first for camera in cameras):
        text = f"{others} of {len(cameras)} messages contradict the first, which is used"
        warnings.warn(f"{bag.path.name}: {topic}: {text}", DataWarning, stacklevel=2)
    return first


def _camera(info: Any) -> Camera:  # noqa: ANN401 - a class that rosbags generates
    matrix = info.K if hasattr(info, "K") else info.k  # ROS 2 names them in lower case
    distortion = info.D if hasattr(info, "D") else info.d
    return Camera(
        frame_id=info.header.frame_id,
        width_px=info.width,
        height_px=info.height,
        fx_px=float(matrix[0]),
        fy_px=float(matrix[4]),
        cx_px=float(matrix[2]),
        cy_px=float(matrix[5]),
        distortion_model=info.distortion_model,
        distortion=tuple(float(each) for each in distortion),
    )


def _check_calibrated(camera: Camera, where: str) -> None:
    numbers = {"fx": camera.fx_px, "fy": camera.fy_px, "cx": camera.cx_px, "cy": camera.cy_px}
    if not any(numbers.values()):
        hint = "Calibrate the camera, or name the camera_info topic of a stream that is."
        raise BagError("camera is not calibrated", where=where, found="K that is all zero", hint=hint)
    if not all(map(math.isfinite, numbers.values())) or min(camera.fx_px, camera.fy_px) <= 0:
        raise BagError("K is no camera matrix", where=where, expected="finite, positive fx and fy", found=numbers)
