from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from garment_dataset.bags import open_bag
from garment_dataset.bags.gripper import GripperTrack, read_gripper
from garment_dataset.errors import DataWarning
from garment_dataset.simulate.motion import Swing
from garment_dataset.simulate.robot import Robot

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

STORE = get_typestore(Stores.ROS1_NOETIC)
for _name in ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"):
    STORE.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", _name))
T: dict[str, Any] = STORE.types

TOPIC, TF, TF_STATIC = "/r2_ee_to_depth", "/tf", "/tf_static"
CAMERA = "xtion1_depth_optical_frame"
IDENTITY = (0.0, 0.0, 0.0, 1.0)
QUARTER_Z = (0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4))
START = 1_391_700_000_000_000_000
MS = 1_000_000

Vector = tuple[float, float, float]


def header(stamp_ns: int, frame: str) -> Any:
    stamp = T["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return T["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id=frame)


def vector(position_m: Sequence[float]) -> Any:
    return T["geometry_msgs/msg/Vector3"](*position_m)


def transform(stamp_ns: int, parent: str, child: str, move: Sequence[float], turn: Sequence[float] = IDENTITY) -> Any:
    motion = T["geometry_msgs/msg/Transform"](
        translation=vector(move), rotation=T["geometry_msgs/msg/Quaternion"](*turn)
    )
    return T["geometry_msgs/msg/TransformStamped"](
        header=header(stamp_ns, parent), child_frame_id=child, transform=motion
    )


def tf(*transforms: Any, name: str = "tf2_msgs/msg/TFMessage") -> Any:
    return T[name](transforms=list(transforms))


def point(stamp_ns: int, position_m: Sequence[float], frame: str = CAMERA) -> Any:
    position = T["geometry_msgs/msg/Point"](*position_m)
    return T["geometry_msgs/msg/PointStamped"](header=header(stamp_ns, frame), point=position)


def pose(stamp_ns: int, position_m: Sequence[float]) -> Any:
    inner = T["geometry_msgs/msg/Pose"](
        position=T["geometry_msgs/msg/Point"](*position_m), orientation=T["geometry_msgs/msg/Quaternion"](*QUARTER_Z)
    )
    return T["geometry_msgs/msg/PoseStamped"](header=header(stamp_ns, CAMERA), pose=inner)


def stamped_vector(stamp_ns: int, position_m: Sequence[float]) -> Any:
    return T["geometry_msgs/msg/Vector3Stamped"](header=header(stamp_ns, CAMERA), vector=vector(position_m))


def of_gripper(stamp_ns: int, position_m: Sequence[float], turn: Sequence[float] = QUARTER_Z) -> Any:
    return transform(stamp_ns, CAMERA, "r2_ee", position_m, turn)


def of_camera(stamp_ns: int, position_m: Sequence[float]) -> Any:
    """The same, told the other way: R^T, -R^T t, with R a quarter turn about z."""
    x, y, z = position_m
    back = (-QUARTER_Z[0], -QUARTER_Z[1], -QUARTER_Z[2], QUARTER_Z[3])
    return transform(stamp_ns, "/r2_ee", f"/{CAMERA}", (-y, x, -z), back)


def track(path: Path, messages: Sequence[tuple[str, Any]], stamps_ns: Sequence[int], **options: Any) -> GripperTrack:
    """Write the messages to a bag and read the gripper from it."""
    path.unlink(missing_ok=True)
    with Writer(path) as writer:
        connections: dict[tuple[str, str], Any] = {}
        for number, (topic, message) in enumerate(messages):
            name = message.__msgtype__
            if (topic, name) not in connections:
                connections[topic, name] = writer.add_connection(topic, name, typestore=STORE)
            writer.write(connections[topic, name], START + number, STORE.serialize_ros1(message, name))
    with open_bag(path) as bag:
        return read_gripper(bag, stamps_ns, camera_frame=CAMERA, **options)


def positions(found: GripperTrack) -> list[list[float]]:
    return [[float(c) for c in row] for row in np.stack([found.x_m, found.y_m, found.z_m], axis=1)]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "gripper.bag"


SAMPLES: list[tuple[int, Vector]] = [
    (START, (0.0, -0.2, 1.06)),
    (START + 30 * MS, (0.3, -0.2, 1.0)),
    (START + 60 * MS, (0.0, -0.1, 1.0)),
]


@pytest.mark.parametrize("make", [point, pose, stamped_vector, of_gripper, of_camera])
def test_every_message_type_says_the_same(path: Path, make: Any) -> None:
    stamps_ns = [START, START + 10 * MS, START + 45 * MS]
    found = track(path, [(TOPIC, make(*sample)) for sample in SAMPLES], stamps_ns)
    expected = [(0.0, -0.2, 1.06), (0.1, -0.2, 1.04), (0.15, -0.15, 1.0)]
    np.testing.assert_allclose(positions(found), expected, rtol=0, atol=1e-15)
    assert found.source == ("topic",) * 3
    assert found.gap_ns == (0, 10 * MS, 15 * MS)
    assert found.reason == (None,) * 3


@given(order=st.permutations(SAMPLES))
@settings(max_examples=6, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_the_order_of_arrival_does_not_matter(path: Path, order: list[tuple[int, Vector]]) -> None:
    found = track(path, [(TOPIC, point(*sample)) for sample in order], [START + 10 * MS])
    np.testing.assert_allclose(positions(found), [(0.1, -0.2, 1.04)], rtol=0, atol=1e-15)


def test_a_message_of_that_very_stamp_is_taken_as_it_is(path: Path) -> None:
    far = [(START - 10**9, (9.0, 9.0, 9.0)), (START, (0.1, 0.2, 0.3)), (START + 10**9, (9.0, 9.0, 9.0))]
    repeated = (START, (7.0, 7.0, 7.0))
    with pytest.warns(DataWarning, match=f"1 messages left out: {TOPIC}, 1 header stamps do not increase, first .* 3"):
        found = track(path, [(TOPIC, point(*sample)) for sample in [*far, repeated]], [START])
    assert positions(found) == [[0.1, 0.2, 0.3]], "and of several the first"
    assert found.gap_ns == (0,)


def test_nothing_is_extrapolated_nor_carried_across_a_gap(path: Path) -> None:
    times_ms = [0, 30, 131]
    messages = [(TOPIC, point(START + ms * MS, (ms / 1000, 0, 1))) for ms in times_ms]
    stamps_ns = [START - 1, START + 15 * MS, START + 50 * MS, START + 131 * MS + 1]
    with pytest.warns(DataWarning, match=r"no gripper position at 3 of 4 depth frames, first at 0: topic: .* before"):
        found = track(path, messages, stamps_ns, source="topic", max_gap_s=0.1)
    assert found.reason == ("topic: past", None, "topic: gap", "topic: future")
    assert np.isnan(positions(found)).all(axis=1).tolist() == [True, False, True, True]
    assert (found.source, found.gap_ns) == ((None, "topic", None, None), (None, 15 * MS, None, None))
    wider = track(path, messages, [START + 50 * MS], source="topic", max_gap_s=0.101)
    assert wider.x_m.tolist() == pytest.approx([0.05])


def arm(stamp_ns: int, gripper_m: Sequence[float]) -> Any:
    """The gripper in the base; the camera stands 2 m before it, looking back at it (x right, y down, z forward)."""
    return transform(stamp_ns, "/base_link", "r2_ee", gripper_m)


LOOK_BACK = (0.5, 0.5, -0.5, -0.5)  # camera z = -x, camera x = y, camera y = -z of the base


def test_the_transforms_give_the_point_where_the_topic_is_missing(path: Path) -> None:
    messages = [(TF_STATIC, tf(transform(0, "base_link", CAMERA, (2, 0, 1), LOOK_BACK)))]
    messages += [(TF, tf(arm(START + ms * MS, (1 - ms / 1000, 0.1, 0.8)), name="tf/msg/tfMessage")) for ms in (0, 20)]
    found = track(path, messages, [START + 5 * MS])
    np.testing.assert_allclose(positions(found), [(0.1, 0.2, 1.005)], rtol=0, atol=1e-12)
    assert (found.source, found.gap_ns) == (("tf",), (5 * MS,))


def test_each_frame_takes_the_source_that_answers(path: Path) -> None:
    messages = [(TF_STATIC, tf(transform(0, "base_link", CAMERA, (0, 0, 0))))]
    messages += [(TF, tf(arm(START + ms * MS, (ms, 0, 0)))) for ms in (0, 20, 40, 60)]
    messages += [(TOPIC, point(START + ms * MS, (1000 + ms, 0, 0))) for ms in (20, 40)]
    stamps_ns = [START + ms * MS for ms in (10, 30, 50)]
    with pytest.warns(DataWarning, match=r"disagree on the gripper by 1000000.0 mm, median of 1; topic is asked first"):
        both = track(path, messages, stamps_ns)
    assert (both.x_m.tolist(), both.source) == (pytest.approx([10, 1030, 50]), ("tf", "topic", "tf"))
    alone = track(path, messages, stamps_ns, source="tf")
    assert (alone.x_m.tolist(), alone.source) == (pytest.approx([10, 30, 50]), ("tf",) * 3)
    with pytest.warns(DataWarning, match="2 of 3 depth frames"):
        assert track(path, messages, stamps_ns, source="topic").source == (None, "topic", None)


def test_both_sources_silent_name_both_reasons(path: Path) -> None:
    messages = [(TF, tf(arm(START, (0, 0, 0)))), (TF, tf(transform(START, "x", CAMERA, (0, 0, 0))))]
    with pytest.warns(DataWarning, match="topic: no usable message; tf: no transform from 'r2_ee' to 'xtion1_depth"):
        found = track(path, messages, [START])
    assert found.reason == ("topic: no samples; tf: not connected",)
    with pytest.warns(DataWarning, match="Known frames: base_link, r2_ee, x, xtion1_depth_optical_frame"):
        assert track(path, messages, [START], gripper_frame="ee").reason == ("topic: no samples; tf: unknown frame",)


def test_a_fixed_link_may_come_slowly_and_a_moving_one_may_not(path: Path) -> None:
    fixed = [(TF, tf(transform(START + s * 10**9, "base_link", CAMERA, (0, 0, 1)))) for s in (-1, 1)]
    moving = [(TF, tf(arm(START + ms * MS, (ms / 1000, 0, 2)))) for ms in (0, 50, 300)]
    with pytest.warns(DataWarning, match=r"1 of 2 depth frames, first at 1: tf: .* 0\.250 s apart"):
        found = track(path, fixed + moving, [START + 40 * MS, START + 60 * MS], source="tf")
    assert found.reason == (None, "tf: gap")
    assert positions(found)[0] == pytest.approx([0.04, 0, 1])
    assert found.gap_ns == (960 * MS, None), "the fixed link is the farther one in time, and it is said"


def test_a_topic_in_another_frame_is_taken_to_the_camera(path: Path) -> None:
    messages = [(TF_STATIC, tf(transform(0, "base_link", CAMERA, (2, 0, 1), LOOK_BACK)))]
    messages += [(TOPIC, point(START + ms * MS, (1, 0.1, 0.8), "/base_link")) for ms in (0, 20)]
    found = track(path, messages, [START + 5 * MS])
    np.testing.assert_allclose(positions(found), [(0.1, 0.2, 1.0)], rtol=0, atol=1e-12)
    assert found.source == ("topic",)


def test_the_gap_counts_the_transforms_that_led_to_the_camera(path: Path) -> None:
    messages = [(TF, tf(transform(START + ms * MS, "base_link", CAMERA, (ms / 1000, 0, 0)))) for ms in (-20, 40)]
    messages += [(TOPIC, point(START + ms * MS, (1, 0, 0), "base_link")) for ms in (0, 10)]
    found = track(path, messages, [START + 5 * MS])
    assert found.x_m.tolist() == pytest.approx([0.995])
    assert found.gap_ns == (30 * MS,), "at the second message: its own 5 ms, the transform's 30 ms"


def test_a_topic_in_a_frame_without_a_way_is_left_out(path: Path) -> None:
    messages = [(TOPIC, point(START + ms * MS, (1, 0.1, 0.8), "elsewhere")) for ms in (0, 20)]
    with pytest.warns(DataWarning) as caught:
        found = track(path, messages, [START + 5 * MS], source="topic")
    assert "2 messages left out: /r2_ee_to_depth, in frame 'elsewhere' with no way to" in str(caught[0].message)
    assert found.reason == ("topic: no samples",)


def test_a_topic_without_a_frame_is_in_the_camera(path: Path) -> None:
    assert positions(track(path, [(TOPIC, point(START, (1, 2, 3), ""))], [START])) == [[1, 2, 3]]


@pytest.mark.parametrize(
    ("bad", "why"),
    [
        (point(START + 5 * MS, (math.nan, 0, 0)), "not finite"),
        (transform(START + 5 * MS, "r2_ee", CAMERA, (0, 0, 0), (0, 0, 0, 0)), "with a rotation that is none"),
        (T["std_msgs/msg/Header"](0, header(START, "").stamp, "x"), "of type std_msgs/msg/Header instead of"),
    ],
)
def test_an_unusable_message_is_left_out_and_counted(path: Path, bad: Any, why: str) -> None:
    messages = [(TOPIC, point(START, (0, 0, 1))), (TOPIC, bad), (TOPIC, point(START + 10 * MS, (1, 0, 1)))]
    with pytest.warns(DataWarning, match=f"1 messages left out: {TOPIC}, .*{why}"):
        found = track(path, messages, [START + 5 * MS])
    assert positions(found) == [[0.5, 0, 1]]


def test_malformed_transforms_are_counted(path: Path) -> None:
    messages = [(TF, tf(transform(START, "base_link", CAMERA, (0, 0, 0)), arm(START, (0, 0, 1))))]
    messages += [(TF, tf(transform(START, CAMERA, "r2_ee", (0, 0, 0), (0, 0, 0, 2)))), (TF, point(START, (0, 0, 0)))]
    with pytest.warns(DataWarning) as caught:
        found = track(path, messages, [START])
    assert positions(found) == [[0, 0, 1]]
    assert [str(warning.message).partition(": ")[2].partition(" instead")[0] for warning in caught] == [
        "1 malformed transforms left out",
        "1 messages left out: /tf, of type geometry_msgs/msg/PointStamped",
    ]


def test_no_frames_no_rows(path: Path) -> None:
    found = track(path, [(TOPIC, point(START, (0, 0, 1)))], [])
    assert (found.x_m.shape, found.source, found.gap_ns, found.reason) == ((0,), (), (), ())


def test_the_orientation_is_told_by_poses_and_transforms_and_not_by_points(path: Path) -> None:
    for make in (pose, of_gripper, of_camera):
        found = track(path, [(TOPIC, make(*sample)) for sample in SAMPLES], [START, START + 10 * MS])
        np.testing.assert_allclose(found.quaternion_xyzw, [QUARTER_Z] * 2, atol=1e-15)
    found = track(path, [(TOPIC, point(*sample)) for sample in SAMPLES], [START])
    assert np.isnan(found.quaternion_xyzw).all()
    static = (TF_STATIC, tf(transform(0, CAMERA, "r2_ee", (0.0, -0.2, 1.06), QUARTER_Z)))
    found = track(path, [static, *((TOPIC, point(*sample)) for sample in SAMPLES)], [START])
    np.testing.assert_allclose(found.quaternion_xyzw, [QUARTER_Z], err_msg="from the other source")
    assert found.source == ("topic",)


def test_the_orientation_never_flips_its_sign(path: Path) -> None:
    turns = [(0.0, 0.0, math.sin(step / 2), math.cos(step / 2)) for step in range(8)]
    signed = [tuple((-1) ** step * component for component in turn) for step, turn in enumerate(turns)]
    messages = [of_gripper(START + step * MS, (0, 0, 1), turn) for step, turn in enumerate(signed)]
    found = track(path, [(TOPIC, each) for each in messages], [START + step * MS for step in range(8)])
    np.testing.assert_allclose(found.quaternion_xyzw, turns, atol=1e-12)


def test_samples_with_wrong_stamps_are_not_used(path: Path) -> None:
    clean = [(TOPIC, point(START + step * 30 * MS, (0.01 * step**2, 0, 1))) for step in range(12)]
    clean += [(TF, tf(arm(START + step * 20 * MS, (0.01 * step, 0, 1)))) for step in range(18)]
    clean += [(TF_STATIC, tf(transform(0, "base_link", CAMERA, (0, 0, 0))))]
    wild = [0, START - 10**9 * 10**9, START + 5 * 10**9, START + 60 * MS]  # the last one repeats a sample
    stamps_ns = [START + ms * MS for ms in (45, 100, 150)]
    for source in ("topic", "tf"):
        expected = track(path, clean, stamps_ns, source=source)
        messages = list(clean)
        for stamp_ns in wild:
            messages.insert(6, (TOPIC, point(stamp_ns, (9, 9, 9))))
            messages.insert(-6, (TF, tf(arm(stamp_ns, (9, 9, 9)))))
        with pytest.warns(DataWarning, match="left out") as caught:
            found = track(path, messages, stamps_ns, source=source)
        assert positions(found) == positions(expected)
        assert len(caught) == 1
        text = str(caught[0].message)
        assert ("3 of 22 transforms on /tf left out" if source == "tf" else f"4 messages left out: {TOPIC}, ") in text


def simulated(rates_hz: tuple[float, float], offset_m: float = 0.0) -> tuple[Swing, list[tuple[str, Any]]]:
    """The gripper of a simulated recording at full speed, by topic and by the robot's transforms."""
    swing = Swing("R", math.pi / 16, 0.5, 0.5)
    robot, messages = Robot(swing), list[tuple[str, Any]]()
    fixed = [transform(0, link.parent, link.child, link.translation_m, link.quaternion_xyzw) for link in robot.fixed]
    messages.append((TF_STATIC, tf(*fixed)))
    topic_hz, tf_hz = rates_hz
    for time_s in np.arange(0.0, 3.0, 1 / topic_hz).tolist():
        place = swing.gripper_m(time_s) + np.array([offset_m, 0.0, 0.0])
        messages.append((TOPIC, point(START + round(time_s * 1e9), place.tolist())))
    for time_s in np.arange(0.0, 3.0, 1 / tf_hz).tolist():
        stamp_ns = START + round(time_s * 1e9)
        links = [
            transform(stamp_ns, link.parent, link.child, link.translation_m, link.quaternion_xyzw)
            for link in robot.links(time_s)
        ]
        messages.append((TF, tf(*links)))
    return swing, messages


@pytest.mark.parametrize(
    ("rates_hz", "source", "chosen", "most_mm"),
    [
        ((30.0, 50.0), "topic", "topic", 0.004),
        ((30.0, 50.0), "tf", "tf", 0.001),
        ((30.0, 50.0), "auto", "topic", 0.004),
        ((11.0, 50.0), "auto", "tf", 0.001),
        ((30.0, 11.0), "auto", "topic", 0.004),
    ],
)
def test_simulated_truth_is_met_by_the_surer_source(
    path: Path, rates_hz: tuple[float, float], source: str, chosen: str, most_mm: float
) -> None:
    swing, messages = simulated(rates_hz)
    times_s = np.arange(0.1, 2.8, 0.0337)
    stamps_ns = [START + round(time_s * 1e9) for time_s in times_s.tolist()]
    found = track(path, messages, stamps_ns, source=source)
    assert set(found.source) == {chosen}
    errors_m = np.abs(positions(found) - swing.gripper_m(times_s))
    assert errors_m.max() * 1e3 < most_mm
    assert (errors_m <= found.std_m).all()
    assert (found.std_m >= 1e-4).all()
    assert found.std_m.max() < 1.2e-4


def test_the_uncertainty_grows_with_the_gap_between_samples(path: Path) -> None:
    swing, messages = simulated((11.0, 50.0))
    times_s = np.arange(0.1, 2.8, 0.0337)
    found = track(path, messages, [START + round(time_s * 1e9) for time_s in times_s.tolist()], source="topic")
    errors_m = np.abs(positions(found) - swing.gripper_m(times_s))
    assert found.std_m.max() > 1.2e-4
    assert (errors_m <= 2 * found.std_m).all()
    assert track(path, messages, [START], source="topic", std_floor_m=0.001).std_m.tolist() == [[0.001] * 3]


def test_sources_that_disagree_are_announced_with_the_number(path: Path) -> None:
    _, messages = simulated((30.0, 50.0), offset_m=0.0074)
    stamps_ns = [START + ms * MS for ms in range(500, 1500, 33)]
    with pytest.warns(
        DataWarning, match=r"depth frames: topic and tf disagree on the gripper by 7\.4 mm, median of 31"
    ):
        found = track(path, messages, stamps_ns)
    assert set(found.source) == {"topic"}, "one source for all: a disagreement is no motion"
    assert set(track(path, messages, stamps_ns, max_disagreement_m=0.008).source) == {"topic"}


def test_two_samples_alone_give_a_point_without_uncertainty(path: Path) -> None:
    found = track(path, [(TOPIC, point(*sample)) for sample in SAMPLES[:2]], [START, START + 10 * MS], source="topic")
    assert np.isnan(found.std_m).all(axis=1).tolist() == [False, True]
    assert not np.isnan(positions(found)).any()
