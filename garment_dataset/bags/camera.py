"""The camera of an image stream: what ``sensor_msgs/CameraInfo`` says of its optics."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from garment_dataset.errors import BagError, DataWarning

if TYPE_CHECKING:
    from garment_dataset.bags.bag import Bag

_CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
_TRANSPORTS = {"compressed", "compressedDepth", "theora"}

Matrix = Literal["K", "P"]
"""The matrix of a CameraInfo that pixels are measured with: K those of raw images, P those of rectified ones."""


@dataclass(frozen=True, slots=True)
class Camera:
    """A pinhole camera with a distortion model, as calibrated, for images of one size.

    Parameters
    ----------
    frame_id : str
        Optical frame: x right, y down, z forward.
    width_px, height_px : int
        Size of the images it belongs to.
    fx_px, fy_px, cx_px, cy_px : float
        Focal lengths and principal point in images of that size; the centre of the first pixel is (0, 0).
    distortion_model : str
        ``plumb_bob``, ``rational_polynomial`` … or empty, as it is for rectified images.
    distortion : tuple of float
        Its coefficients; none for rectified images.
    matrix : {"K", "P"}
        Where focal lengths and principal point were taken from.
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
    matrix: Matrix = "K"


class _Use(NamedTuple):
    """How a camera is used: for rectified images or not, and of which size if that is known."""

    rectified: bool
    size_px: tuple[int, int] | None


class _Answer(NamedTuple):
    """A camera, and what its owner should know of how it came about."""

    camera: Camera
    notes: tuple[str, ...]


def image_base(topic: str) -> str:
    """Return the topic that a compressed form belongs to: without its last word, the name of the transport."""
    base, _, last = topic.rpartition("/")
    return base if last in _TRANSPORTS else topic


def is_rectified(topic: str) -> bool:
    """Return whether images are rectified, by the names that image_proc gives, such as ``image_rect_color``."""
    return image_base(topic).rpartition("/")[2].startswith("image_rect")


def camera_info_beside(topic: str) -> str:
    """Return the ``camera_info`` topic that belongs to an image topic, by the rule of image_transport."""
    base, slash, _ = image_base(topic).rpartition("/")
    return f"{base}{slash}camera_info"


def read_camera(
    bag: Bag, topic: str, *, rectified: bool = False, image_size_px: tuple[int, int] | None = None
) -> Camera:
    """Read the camera of one stream from its ``camera_info`` topic.

    Parameters
    ----------
    bag : Bag
        An open recording.
    topic : str
        The ``camera_info`` of the very stream: registered depth has another than raw depth.
    rectified : bool
        Whether the images are rectified: they are measured with P, raw ones with K.
    image_size_px : (int, int), optional
        Width and height of the images, where they are known.

    Returns
    -------
    Camera
        That of the first message. Where others contradict it, a DataWarning says how many; where another matrix had to
        be used, or it was scaled or moved, one says so.

    Raises
    ------
    BagError
        If the topic is missing, has no readable message or another type, or if the camera is not calibrated.

    Notes
    -----
    A window of the sensor (``roi``) moves the principal point by its offset, and then binning by n divides focal length
    and principal point by n, as ``image_geometry::PinholeCameraModel`` does. That is exact where every n-th pixel was
    kept, as image_proc's ``crop_decimate`` does; where n x n pixels were averaged, the principal point is
    (n - 1) / 2n pixels less. Images of exactly 1/n of the calibrated size are taken to be binned, stated or not, and
    images of the full size not to be.
    """
    where = f"{bag.path}: {topic}"
    if topic not in bag.topics:
        raise BagError("no such topic", where=bag.path, expected=topic, found=", ".join(bag.topics))
    if bag.topics[topic].types != (_CAMERA_INFO,):
        found = ", ".join(bag.topics[topic].types)
        raise BagError("topic of another type", where=where, expected=_CAMERA_INFO, found=found)
    use = _Use(rectified, image_size_px)
    answers = [(_camera(message.data, use), count) for message, count in bag.distinct(topic)]
    if not answers:
        what = "no readable message" if bag.topics[topic].count else "no message on it"
        raise BagError(what, where=where)
    first, notes = answers[0][0]
    _check_calibrated(first, where)
    if others := sum(count for answer, count in answers if answer.camera != first):
        notes += (f"{others} of {sum(count for _, count in answers)} messages contradict the first, which is used",)
    for note in notes:
        warnings.warn(f"{bag.path.name}: {topic}: {note}", DataWarning, stacklevel=2)
    return first


def _camera(info: Any, use: _Use) -> _Answer:  # noqa: ANN401 - a class that rosbags generates
    matrix, notes = _matrix(info, rectified=use.rectified)
    numbers = _numbers(info, matrix)
    distortion = info.D if hasattr(info, "D") else info.d  # ROS 2 names them in lower case
    camera = Camera(
        frame_id=info.header.frame_id,
        width_px=info.width,
        height_px=info.height,
        fx_px=numbers[0],
        fy_px=numbers[1],
        cx_px=numbers[2],
        cy_px=numbers[3],
        distortion_model="" if use.rectified else info.distortion_model,
        distortion=() if use.rectified else tuple(float(each) for each in distortion),
        matrix=matrix,
    )
    fitted = _fitted(camera, info, use.size_px)
    return _Answer(fitted.camera, notes + fitted.notes)


def _numbers(info: Any, matrix: Matrix) -> tuple[float, ...]:  # noqa: ANN401
    """Return fx, fy, cx and cy of one of the matrices."""
    values = getattr(info, matrix) if hasattr(info, matrix) else getattr(info, matrix.lower())
    places = (0, 4, 2, 5) if matrix == "K" else (0, 5, 2, 6)
    return tuple(float(values[place]) for place in places)


def _matrix(info: Any, *, rectified: bool) -> tuple[Matrix, tuple[str, ...]]:  # noqa: ANN401
    """Return the matrix that images are measured with: the other one where theirs was never filled."""
    own: Matrix = "P" if rectified else "K"
    other: Matrix = "K" if rectified else "P"
    if any(_numbers(info, own)) or not _valid(_numbers(info, other)):
        return own, ()
    images = "rectified images" if rectified else "raw images"
    return other, (f"{own} is all zero, {other} is used for {images}",)


def _fitted(camera: Camera, info: Any, size_px: tuple[int, int] | None) -> _Answer:  # noqa: ANN401
    """Return the camera for images of that size, as binning and window of the sensor explain it."""
    full = (camera.width_px, camera.height_px)
    roi = info.roi
    window = (roi.width, roi.height) if roi.width and roi.height else full
    binning = (max(1, info.binning_x), max(1, info.binning_y))
    offset = (roi.x_offset, roi.y_offset)
    if (offset, window, binning) == ((0, 0), full, (1, 1)):
        return _reduced(camera, size_px)
    stated = f"a window of {_text(window)} pixels at {offset}, binned {_text(binning)}, is stated"
    if size_px == full:
        return _Answer(camera, (f"{stated}, but images have the full size of {_text(full)}: no correction",))
    moved = replace(camera, cx_px=camera.cx_px - offset[0], cy_px=camera.cy_px - offset[1])
    scaled = _scaled(moved, window, binning)
    return _Answer(scaled, (f"{stated}: {camera.matrix} is corrected for images of {_text(_size(scaled))} pixels",))


def _reduced(camera: Camera, size_px: tuple[int, int] | None) -> _Answer:
    """Return the camera for images that are exactly 1/n of the calibrated size, though nothing says why."""
    full = _size(camera)
    times = full[0] // max(1, size_px[0]) if size_px else 1
    if size_px is None or times < 2 or full != (times * size_px[0], times * size_px[1]):
        return _Answer(camera, ())
    text = f"images of {_text(size_px)} pixels are 1/{times} of the calibrated {_text(full)}: {camera.matrix} is scaled"
    return _Answer(_scaled(camera, full, (times, times)), (text,))


def _scaled(camera: Camera, window: tuple[int, int], binning: tuple[int, int]) -> Camera:
    return replace(
        camera,
        width_px=window[0] // binning[0],
        height_px=window[1] // binning[1],
        fx_px=camera.fx_px / binning[0],
        fy_px=camera.fy_px / binning[1],
        cx_px=camera.cx_px / binning[0],
        cy_px=camera.cy_px / binning[1],
    )


def _size(camera: Camera) -> tuple[int, int]:
    return camera.width_px, camera.height_px


def _text(pair: tuple[int, int]) -> str:
    return f"{pair[0]} x {pair[1]}"


def _valid(numbers: tuple[float, ...]) -> bool:
    return all(map(math.isfinite, numbers)) and min(numbers[:2]) > 0


def _check_calibrated(camera: Camera, where: str) -> None:
    numbers = {"fx": camera.fx_px, "fy": camera.fy_px, "cx": camera.cx_px, "cy": camera.cy_px}
    if not any(numbers.values()):
        hint = "Calibrate the camera, or name the camera_info topic of a stream that is."
        found = f"{camera.matrix} that is all zero, and no other matrix"
        raise BagError("camera is not calibrated", where=where, found=found, hint=hint)
    if not _valid(tuple(numbers.values())):
        what = f"{camera.matrix} is no camera matrix"
        raise BagError(what, where=where, expected="finite, positive fx and fy", found=numbers)
