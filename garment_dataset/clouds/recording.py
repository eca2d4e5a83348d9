"""One recording as arrays: the garment's points of every depth frame, and the gripper that moves them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.errors import StoreError
from garment_dataset.viewers.frames import DepthFrame, Frames
from garment_dataset.vision.depth.garment_pixels import back_project

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.arrays import BoolArray, FloatArray, IntArray
    from garment_dataset.viewers.content import Content
    from garment_dataset.viewers.frames import Pose


@dataclass(frozen=True, slots=True, eq=False)
class CloudFrame:
    """The garment in one depth image; positions in the optical frame of the depth camera.

    Parameters
    ----------
    frame : int
        Index of the image.
    stamp_ns : int
        When the camera saw it.
    mask : (H, W) bool
        The garment's pixels.
    points_m : (n, 3) float32
        Where they are, row by row.
    gripper : Pose or None
        End point and orientation of the gripper; None where they are not known.
    """

    frame: int
    stamp_ns: int
    mask: BoolArray
    points_m: FloatArray
    gripper: Pose | None


def cloud_frames(content: Content, every: int = 1) -> Iterator[CloudFrame]:
    """Yield the garment's points of a recording, frame by frame; of a frame without gripper, none.

    Parameters
    ----------
    content : Content
        The recording.
    every : int
        Of how many usable depth frames one is taken, the first among them.

    Raises
    ------
    StoreError
        If the recording has no bag or no depth images.
    BagError
        If the bag cannot be read, or is not the one that the results are of.
    """
    if content.bag is None or "depth" not in content.cameras:
        found = "no bag" if content.bag is None else "no usable depth images"
        raise StoreError("no clouds", where=content.recording, expected="a bag with depth images", found=found)
    camera = content.cameras["depth"]
    depths = (each for each in Frames(content) if isinstance(each, DepthFrame))
    for number, each in enumerate(depths):
        if number % every:
            continue
        mask = np.zeros((camera.height_px, camera.width_px), np.bool_) if each.mask is None else each.mask
        points_m = np.empty((0, 3))
        if each.mask is not None and each.depth_mm is not None:
            points_m = back_project(each.depth_mm, mask, camera.intrinsics)
        yield CloudFrame(each.frame, each.stamp_ns, mask, points_m.astype(np.float32), each.gripper)


class Collected:
    """The frames of a recording put together, for one file of arrays."""

    def __init__(self) -> None:
        self._points_m: list[FloatArray] = []
        self._pixels: list[IntArray] = []
        self._frames: list[tuple[int, int]] = []
        self._poses: list[tuple[FloatArray, FloatArray]] = []

    def add(self, frame: CloudFrame) -> None:
        """Add the next frame."""
        v, u = np.nonzero(frame.mask)
        self._points_m.append(frame.points_m)
        self._pixels.append(np.stack([u, v], axis=1).astype(np.uint16))
        self._frames.append((frame.frame, frame.stamp_ns))
        unknown, pose = (np.full(3, np.nan), np.full(4, np.nan)), frame.gripper
        known = unknown if pose is None else (pose.position_m, pose.quaternion_xyzw)
        self._poses.append((known[0], unknown[1] if known[1] is None else known[1]))

    def arrays(self, start_ns: int) -> dict[str, FloatArray | IntArray]:
        """Return all frames as arrays; those of frame k are ``[offsets[k] : offsets[k + 1]]`` of what is by point."""
        frames = np.array(self._frames, np.int64).reshape(-1, 2)
        counts = [len(each) for each in self._points_m]
        return {
            "points_m": np.concatenate([np.empty((0, 3), np.float32), *self._points_m]),
            "pixels_uv": np.concatenate([np.empty((0, 2), np.uint16), *self._pixels]),
            "offsets": np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
            "frame": frames[:, 0],
            "stamp_ns": frames[:, 1],
            "time_s": (frames[:, 1] - start_ns) / 1e9,
            "controller_points": np.array([each[0] for each in self._poses]).reshape(-1, 1, 3),
            "controller_quaternions_xyzw": np.array([each[1] for each in self._poses]).reshape(-1, 1, 4),
        }
