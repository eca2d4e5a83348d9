from __future__ import annotations

import csv
import math
from typing import TYPE_CHECKING, Literal

import numpy as np
import pytest

from garment_dataset.bags import open_bag
from garment_dataset.bags.gripper import read_gripper
from garment_dataset.bags.poses import Transform
from garment_dataset.bags.transforms import LookupFailedError, TransformTree

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.real

RECORDINGS = ("RealGarments_Floor_01_pi16_0.1_R1", "RealGrabber_Desk_01_pi16_0.1_R1")


def through_double(stamp_ns: int) -> int:
    """Round a stamp as tf2's Python binding does, which hands every stamp to tf2 as a double of seconds (to 238 ns)."""
    seconds = stamp_ns // 10**9 + 1e-9 * (stamp_ns % 10**9)
    whole = math.floor(seconds)
    return whole * 10**9 + round((seconds - whole) * 1e9)


def read_tree(path: Path, *, rounded: bool = False) -> TransformTree:
    tree = TransformTree(path.name)
    with open_bag(path) as bag:
        for message in bag.messages("/tf", "/tf_static"):
            for stamped in message.data.transforms:
                stamp_ns = stamped.header.stamp.sec * 10**9 + stamped.header.stamp.nanosec
                move, turn = stamped.transform.translation, stamped.transform.rotation
                tree.add(
                    stamped.header.frame_id,
                    stamped.child_frame_id,
                    through_double(stamp_ns) if rounded else stamp_ns,
                    (move.x, move.y, move.z),
                    (turn.x, turn.y, turn.z, turn.w),
                    static=message.topic == "/tf_static",
                )
    return tree


def ask(tree: TransformTree, target: str, source: str, stamp_ns: int) -> Transform | str:
    try:
        return tree.lookup(target, source, stamp_ns)
    except LookupFailedError as error:
        return error.kind


@pytest.mark.parametrize(
    ("rounded", "tolerance"),
    [(True, 1e-9), (False, 1e-7)],
    ids=["stamps as the binding rounds them", "stamps as recorded"],
)
def test_a_real_robot_gives_what_tf2_gives(real_data: Path, *, rounded: bool, tolerance: float) -> None:
    tree = read_tree(real_data / "tf/real_jaxon_tf.bag", rounded=rounded)
    counts = {"past": 0, "ok": 0, "future": 0}
    with (real_data / "tf/real_jaxon_tf.head_root-spindle.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            counts[row["status"]] += 1
            stamp_ns = int(row["stamp_ns"])
            found = ask(tree, "head_root", "spindle", through_double(stamp_ns) if rounded else stamp_ns)
            if row["status"] != "ok":
                assert found == row["status"], row["i"]
                continue
            assert isinstance(found, Transform), row["i"]
            np.testing.assert_allclose(found.translation, [float(row[name]) for name in "xyz"], rtol=0, atol=1e-9)
            quaternion = np.array([float(row[name]) for name in ("qx", "qy", "qz", "qw")])
            quaternion *= np.copysign(1.0, quaternion @ found.quaternion_xyzw)
            np.testing.assert_allclose(found.quaternion_xyzw, quaternion, rtol=0, atol=tolerance)
            assert found.nearest_sample_gap_ns <= found.bracket_ns < 60_000_000
    assert counts == {"past": 19, "ok": 183, "future": 16}
    assert tree.refused == 0


def test_a_real_recording_gives_the_same_tree_in_both_compressions(real_data: Path) -> None:
    lz4, bz2 = (read_tree(real_data / f"tf/real_turtle_{name}.bag") for name in ("lz4", "bz2"))
    answered = 0
    for second in range(22):
        stamp_ns = (1_396_293_888 + second) * 10**9
        one, other = ask(lz4, "turtle1", "turtle2", stamp_ns), ask(bz2, "turtle1", "turtle2", stamp_ns)
        if isinstance(one, Transform) and isinstance(other, Transform):
            answered += 1
            np.testing.assert_array_equal(one.translation, other.translation)
            np.testing.assert_array_equal(one.quaternion_xyzw, other.quaternion_xyzw)
            assert one.translation[2] == 0, "turtles stay on the ground"
        else:
            assert one == other
    assert answered == 21


@pytest.mark.parametrize("source", ["topic", "tf"])
@pytest.mark.parametrize("recording", RECORDINGS)
def test_the_gripper_is_where_it_truly_was(real_data: Path, recording: str, source: Literal["topic", "tf"]) -> None:
    with (real_data / f"recordings/{recording}.ee.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    with open_bag(real_data / f"recordings/{recording}.bag") as bag:
        stamps_ns = [int(row["stamp_ns"]) for row in rows]
        found = read_gripper(bag, stamps_ns, camera_frame="xtion1_depth_optical_frame", source=source)
    truth_m = np.array([[float(row[name]) for name in "xyz"] for row in rows])
    np.testing.assert_allclose(np.stack([found.x_m, found.y_m, found.z_m], axis=1), truth_m, rtol=0, atol=1e-4)
    assert found.source == (source,) * len(rows)
