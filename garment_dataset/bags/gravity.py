"""Which way is down in a camera's optical frame, from a frame of the robot that stands level."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.bags.gripper_sources import CameraFrame, NoAnswer
from garment_dataset.errors import DataWarning

if TYPE_CHECKING:
    from collections.abc import Iterable

    from garment_dataset.bags.recorded_transforms import RecordedTransforms

_STILL_RAD = math.radians(0.5)  # by more than this a camera does not turn that stands still


@dataclass(frozen=True, slots=True)
class Gravity:
    """The direction of gravity.

    Parameters
    ----------
    direction : tuple of float or None
        Unit vector, x right, y down, z forward; None where it is not known.
    source : str or None
        ``tf: base_link``: the frame whose z axis was taken to point up.
    reason : str or None
        Why there is none: ``no level frame``, ``not recorded``, or the reason of the first look-up.
    """

    direction: tuple[float, float, float] | None
    source: str | None
    reason: str | None


def read_gravity(
    transforms: RecordedTransforms,
    stamps_ns: Iterable[int],
    *,
    camera_frame: str,
    level_frame: str = "base_link",
    max_gap_s: float = 0.1,
    stream: str = "depth",
) -> Gravity:
    """Read the direction of gravity in a camera's optical frame.

    Parameters
    ----------
    transforms : RecordedTransforms
        Of the recording.
    stamps_ns : iterable of int
        Header stamps of the images.
    camera_frame : str
        Optical frame of the camera.
    level_frame : str
        A frame whose z axis points up; empty: none is known.
    max_gap_s : float
        Longest time between two samples of a moving link, in seconds, that is interpolated across.
    stream : str
        What the images are called in the warning.

    Returns
    -------
    Gravity
        The mean over the images at which the transforms reach the level frame.

    Warns
    -----
    DataWarning
        If the direction of an image is off the mean by more than half a degree: the camera turned.
    """
    if not level_frame:
        return Gravity(None, None, "no level frame")
    if not transforms.recorded:
        return Gravity(None, None, "not recorded")
    camera = CameraFrame(transforms, camera_frame.lstrip("/"), round(max_gap_s * 1e9))
    seen = camera.see_all(level_frame.lstrip("/"), list(stamps_ns))
    down = [-each.apply(np.eye(3)[2]) + each.translation for each in seen if not isinstance(each, NoAnswer)]
    if not down:
        return Gravity(None, None, next((each.reason for each in seen if isinstance(each, NoAnswer)), "no images"))
    mean = np.mean(down, axis=0)
    mean /= np.linalg.norm(mean)
    farthest_rad = math.acos(min(1.0, float(np.min(down @ mean))))
    if farthest_rad > _STILL_RAD:
        text = f"gravity is up to {math.degrees(farthest_rad):.1f} degrees off its mean in the {stream} images"
        warnings.warn(f"{transforms.bag.path.name}: {text}: the camera moved", DataWarning, stacklevel=2)
    x, y, z = (mean + 0.0).tolist()  # no negative zeros
    return Gravity((x, y, z), f"tf: {level_frame.lstrip('/')}", None)
