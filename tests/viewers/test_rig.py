"""How the cameras stand is what the recorded transforms say of a rig that stays as it is; of others it is not known."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from garment_dataset.bags import open_bag
from garment_dataset.viewers.rig import camera_in_camera

if TYPE_CHECKING:
    from pathlib import Path

STAMPS_NS = [1_400_000_000_000_000_000 + number * 100_000_000 for number in range(5)]
TF = "tf2_msgs/msg/TFMessage"
TURN = (0.0, 0.0, float(np.sin(0.1)), float(np.cos(0.1)))


def write_transforms(path: Path, moved_m: float) -> Path:
    """Write a link -> depth that is fixed, and link -> color that moves along x in all."""
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))
    types: dict[str, Any] = store.types

    def transform(stamp_ns: int, child: str, x_m: float, turn: tuple[float, ...]) -> Any:
        stamp = types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        motion = types["geometry_msgs/msg/Transform"](
            translation=types["geometry_msgs/msg/Vector3"](x=x_m, y=0.0, z=0.0),
            rotation=types["geometry_msgs/msg/Quaternion"](*turn),
        )
        header = types["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id="link")
        return types["geometry_msgs/msg/TransformStamped"](header=header, child_frame_id=child, transform=motion)

    with Writer(path) as writer:
        connection = writer.add_connection("/tf", TF, typestore=store)
        for number, stamp_ns in enumerate(STAMPS_NS):
            share = number / (len(STAMPS_NS) - 1)
            links = [
                transform(stamp_ns, "depth", -0.01, (0.0, 0.0, 0.0, 1.0)),
                transform(stamp_ns, "color", 0.02 + share * moved_m, TURN),
            ]
            message = types[TF](transforms=links)
            writer.write(connection, stamp_ns, store.serialize_ros1(message, TF))
    return path


def asked(path: Path, source: str = "color") -> Any:
    with open_bag(path) as bag:
        return camera_in_camera(bag, "depth", source, STAMPS_NS, topics=("/tf", "/tf_static"), max_stamp_offset_s=10.0)


def test_a_rig_that_stays_is_known(tmp_path: Path) -> None:
    found = asked(write_transforms(tmp_path / "a.bag", moved_m=0.0))
    np.testing.assert_allclose(found.translation, [0.03, 0, 0], atol=1e-12)
    np.testing.assert_allclose(found.quaternion_xyzw, TURN, atol=1e-12)


def test_one_that_moves_or_is_not_connected_is_not(tmp_path: Path) -> None:
    assert asked(write_transforms(tmp_path / "a.bag", moved_m=0.01)) is None
    assert asked(tmp_path / "a.bag", "elsewhere") is None


def test_one_that_shakes_by_less_than_calibration_tells_is_still(tmp_path: Path) -> None:
    assert asked(write_transforms(tmp_path / "a.bag", moved_m=0.0005)).translation[0] == pytest.approx(0.03)
