"""Recordings: the one place that knows ROS bags.

:func:`open_bag` opens a ROS 1 bag or a rosbag2 recording; a :class:`Bag` streams its images as arrays and its other
messages as objects.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.bags.bag import Bag
from garment_dataset.bags.camera import Camera, read_camera
from garment_dataset.bags.gripper import GripperTrack, read_gripper
from garment_dataset.bags.images import AS_SAID, DepthReading, Kind
from garment_dataset.bags.messages import Glance, ImageMessage, Message, Topic
from garment_dataset.bags.poses import Transform
from garment_dataset.bags.rosbag1 import Rosbag1
from garment_dataset.bags.transforms import LookupFailedError, TransformTree
from garment_dataset.errors import BagError

if TYPE_CHECKING:
    from pathlib import Path

__all__ = [
    "AS_SAID",
    "Bag",
    "Camera",
    "DepthReading",
    "Glance",
    "GripperTrack",
    "ImageMessage",
    "Kind",
    "LookupFailedError",
    "Message",
    "Topic",
    "Transform",
    "TransformTree",
    "open_bag",
    "read_camera",
    "read_gripper",
]


def open_bag(path: Path) -> Bag:
    """Open a recording for reading; a context manager.

    Parameters
    ----------
    path : pathlib.Path
        A ROS 1 ``.bag`` file, a rosbag2 folder, or a ``.db3`` or ``.mcap`` file of one.

    Raises
    ------
    BagError
        If there is nothing at ``path``, or no recording that can be read; with a hint where one helps.
    """
    if not path.exists():
        raise BagError("no such recording", where=path)
    if path.is_dir() or path.suffix in {".db3", ".mcap"}:
        # sqlite, yaml and zstd are not loaded for the sake of a ROS 1 bag
        from garment_dataset.bags.rosbag2 import Rosbag2

        return Rosbag2(path)
    return Rosbag1(path)
