"""Every planted error is found by its name, and nothing else is; a good recording keeps the contract."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from garment_dataset.checks.finding import SEVERITIES
from garment_dataset.checks.runner import check_bag
from tests.checks.conftest import (
    COLOR,
    COLOR_INFO,
    DEPTH,
    DEPTH_INFO,
    GRIPPER,
    GRIPPER_COLOR,
    K,
    good_entries,
    image,
    info,
    point,
    wire,
    write,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from garment_dataset.checks.contract import Contract
    from garment_dataset.checks.finding import CheckFinding
    from tests.checks.conftest import Entry

    Plant = Callable[[list[Entry]], list[Entry]]


def without(*topics: str) -> Plant:
    return lambda entries: [each for each in entries if each.topic not in topics]


def remade(topic: str, make: Callable[[int], bytes], begin_s: float = 0.0, end_s: float = 100.0) -> Plant:
    """Have another message on a topic, between two times."""
    return lambda entries: [
        replace(each, make=make) if each.topic == topic and begin_s <= each.time_s < end_s else each for each in entries
    ]


def silent(topic: str, begin_s: float, end_s: float) -> Plant:
    return lambda entries: [each for each in entries if each.topic != topic or not begin_s <= each.time_s < end_s]


def shifted(topic: str, by_s: float, begin_s: float, end_s: float) -> Plant:
    return lambda entries: [
        replace(each, stamp_shift_s=by_s) if each.topic == topic and begin_s <= each.time_s < end_s else each
        for each in entries
    ]


def paused(entries: list[Entry]) -> list[Entry]:
    """Let everything stop for 10 s."""
    return [replace(each, time_s=each.time_s + (10 if each.time_s >= 2 else 0)) for each in entries]


def doubled(entries: list[Entry]) -> list[Entry]:
    return [*entries, *(each for each in entries if each.topic == COLOR and each.time_s >= 2)]


def thinned(entries: list[Entry]) -> list[Entry]:
    """Let every second message of the transforms' topic be lost."""
    kept = {each.time_s for each in entries[::16]}
    return [each for each in entries if each.topic != GRIPPER_COLOR or each.time_s in kept]


SMALL, SMALL_K = (32, 24), (26.25, 0.0, 15.5, 0.0, 26.25, 11.5, 0.0, 0.0, 1.0)
PLANTED: dict[str, tuple[Plant, dict[str, str | None], float | None]] = {
    # what is done: (how, codes and their topics, instant of the first)
    "nothing": (lambda entries: entries, {}, None),
    "no depth image": (without(DEPTH), {"topic-missing": DEPTH}, None),
    "no joints": (without("/joint_states"), {"topic-missing": "/joint_states"}, None),
    "no calibration": (without(COLOR_INFO), {"topic-missing": COLOR_INFO, "camera-missing": COLOR_INFO}, None),
    "short": (lambda entries: [each for each in entries if each.time_s < 1], {"duration": None}, None),
    "10 s gap": (paused, {"gap": DEPTH}, 1.98),
    "joints stop": (silent("/joint_states", 1, 2.5), {"gap": "/joint_states"}, 0.98),
    "starts late": (silent(COLOR_INFO, 0, 2), {"begins-late": COLOR_INFO}, 2.0),
    "stops early": (silent(GRIPPER_COLOR, 2, 5), {"ends-early": GRIPPER_COLOR}, 1.98),
    "every second lost": (thinned, {"rate": GRIPPER_COLOR}, None),
    "doubled": (doubled, {"doubled": COLOR}, 2.02),
    "stamp jump": (shifted(COLOR, 30.0, 2, 2.5), {"stamps": COLOR}, 2.0),
    "stamps run back": (shifted(DEPTH, -0.5, 2, 2.1), {"stamps": DEPTH}, 2.0),
    "other clock": (shifted("/joint_states", 5.0, 0, 9), {"clock": "/joint_states"}, None),
    "dead depth": (remade(DEPTH, image(DEPTH, 1, level=0)), {"dead": DEPTH, "frozen": DEPTH}, None),
    "dead colour": (remade(COLOR, image(COLOR, 1, level=7)), {"dead": COLOR, "frozen": COLOR}, None),
    "dark for a second": (remade(COLOR, image(COLOR, 1, level=7), 1, 2), {"dark": COLOR}, 1.0),
    "frozen": (remade(DEPTH, image(DEPTH, 1), 1, 3.7), {"frozen": DEPTH}, 1.0),
    "another size": (
        lambda entries: remade(COLOR_INFO, info(SMALL_K, SMALL))(
            remade(COLOR, image(COLOR, 1, size_px=SMALL), 0, 0.1)(entries)
        ),
        {"image-size": COLOR, "camera-size": COLOR_INFO},
        None,
    ),
    "images of two kinds": (remade(COLOR, image(DEPTH, 1), 1, 1.2), {"image-faulty": COLOR}, 1.02),
    "not calibrated": (remade(DEPTH_INFO, info((0.0,) * 9)), {"camera-uncalibrated": DEPTH_INFO}, None),
    "calibration of another camera": (
        remade(COLOR_INFO, info((525.0, *K[1:]))),
        {"camera-odd": COLOR_INFO},
        None,
    ),
    "calibration of another size": (
        remade(
            DEPTH_INFO,
            info(
                (
                    40.0,
                    *K[1:],
                ),
                (60, 48),
            ),
        ),
        {"camera-size": DEPTH_INFO, "camera-odd": DEPTH_INFO},
        None,
    ),
    "stopped gripper": (remade(GRIPPER, point(0.01)), {"gripper-still": GRIPPER}, None),
    "gripper stops being told": (
        silent(GRIPPER, 2, 3),
        {"gripper-partial": GRIPPER, "gap": GRIPPER, "reading": None},
        2.02,
    ),
    "gripper not in view": (
        remade(GRIPPER, point(2.0), 1, 3),
        {"gripper-outside": GRIPPER, "gripper-jump": GRIPPER},
        1.02,
    ),
    "gripper jumps": (remade(GRIPPER, point(-0.3), 2, 2.03), {"gripper-jump": GRIPPER}, None),
}


def text(stamp_ns: int) -> bytes:
    return wire().serialise("std_msgs/msg/String", str(stamp_ns))


def run(folder: Path, contract: Contract, entries: list[Entry], **known: str | None) -> list[CheckFinding]:
    return check_bag(write(folder / "some.bag", entries), contract, recording="some", **known)


@pytest.mark.parametrize("name", PLANTED)
def test_what_is_planted_is_found(name: str, tmp_path: Path, contract: Contract) -> None:
    plant, expected, time_s = PLANTED[name]
    entries = plant(good_entries())
    found = run(tmp_path, contract, entries, axis="R")
    assert {each.code for each in found} == set(expected), found
    for code, topic in expected.items():
        topics = [each.topic for each in found if each.code == code]
        assert topic in topics, found
        if name != "10 s gap":
            assert len(topics) == 1, found
    if time_s is not None:
        first = next(each for each in found if each.code == next(iter(expected)))
        assert first.time_s == pytest.approx(time_s, abs=0.2)


def test_a_gap_of_everything_is_found_on_every_topic(tmp_path: Path, contract: Contract) -> None:
    found = run(tmp_path, contract, paused(good_entries()))
    assert {each.topic for each in found} == {each.topic for each in good_entries(0.05)}
    assert all("10.03" in each.message for each in found)


def test_a_topic_without_messages_is_silent(tmp_path: Path, contract: Contract) -> None:
    entries = without("/joint_states")(good_entries())
    path = write(tmp_path / "some.bag", entries, {"/joint_states": "sensor_msgs/msg/JointState"})
    (found,) = check_bag(path, contract, recording="some")
    assert (found.code, found.topic) == ("topic-silent", "/joint_states")


def test_a_missing_topic_is_named_beside_the_one_that_may_be_meant(tmp_path: Path, contract: Contract) -> None:
    entries = [
        replace(each, topic="/joint_state") if each.topic == "/joint_states" else each for each in good_entries()
    ]
    path = write(tmp_path / "some.bag", entries, {"/joint_state": "sensor_msgs/msg/JointState"})
    (found,) = check_bag(path, contract, recording="some")
    assert found.code == "topic-missing"
    assert "/joint_state is there" in str(found.hint)


def test_a_topic_of_another_type_is_found(tmp_path: Path, contract: Contract) -> None:
    entries = [replace(each, make=text) if each.topic == "/joint_states" else each for each in good_entries()]
    path = write(tmp_path / "some.bag", entries, {"/joint_states": "std_msgs/msg/String"})
    (found,) = check_bag(path, contract, recording="some")
    assert (found.code, found.topic) == ("topic-type", "/joint_states")
    assert "std_msgs/msg/String" in found.message


@pytest.mark.parametrize(("axis", "codes"), [("B", ["background-missing"]), ("R", []), (None, [])])
def test_a_recording_across_the_view_needs_its_empty_scene(
    axis: str | None, codes: list[str], tmp_path: Path, contract: Contract
) -> None:
    entries = good_entries()
    found = run(tmp_path, contract, entries, axis=axis, background="recordings/camera_default_0.bag")
    assert [each.code for each in found] == codes
    assert run(tmp_path, contract, entries, axis=axis) == []


def test_an_empty_scene_needs_its_colour_images_alone(tmp_path: Path, contract: Contract) -> None:
    entries = [each for each in good_entries() if each.topic in {COLOR, COLOR_INFO}]
    assert run(tmp_path, contract.of_empty_scene(), entries) == []
    found = run(tmp_path, contract.of_empty_scene(), without(COLOR_INFO)(entries))
    assert [each.code for each in found] == ["topic-missing", "camera-missing"]


def test_a_bag_that_cannot_be_read_is_a_finding(tmp_path: Path, contract: Contract) -> None:
    path = write(tmp_path / "some.bag", good_entries())
    cut = tmp_path / "cut.bag"
    cut.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    (found,) = check_bag(cut, contract, recording="cut")
    assert (found.code, found.severity) == ("unreadable", "error")
    assert "garment salvage" in str(found.hint)
    (tmp_path / "empty.bag").touch()
    (found,) = check_bag(tmp_path / "empty.bag", contract, recording="empty")
    assert (found.code, found.message) == ("unreadable", "the file is empty")


def test_a_gripper_that_nothing_tells_is_missing(tmp_path: Path, contract: Contract) -> None:
    found = run(tmp_path, contract, without(GRIPPER)(good_entries()))
    assert [each.code for each in found if each.severity == "error"] == ["topic-missing", "gripper-missing"]


def test_another_encoding_is_found(tmp_path: Path, contract: Contract) -> None:
    assert contract.images.color is not None
    color = contract.images.color.model_copy(update={"encodings": ("bgr8",)})
    other = contract.model_copy(update={"images": contract.images.model_copy(update={"color": color})})
    (found,) = run(tmp_path, other, good_entries())
    assert (found.code, found.topic) == ("image-encoding", COLOR)
    assert found.message == "expected bgr8, found rgb8"


def test_lost_messages_and_an_index_that_is_wrong_are_found(tmp_path: Path, contract: Contract) -> None:
    """Overwrite the header of one record: what the index names there is not there."""
    path = write(tmp_path / "some.bag", good_entries())
    content = bytearray(path.read_bytes())
    at = content.index(b"r2_joint_b", len(content) // 2)
    start = content.rindex(b"op=\x02", 0, at)
    content[start : start + 4] = b"op=\x0f"
    path.write_bytes(content)
    found = check_bag(path, contract, recording="some")
    lost = next(each for each in found if each.code == "lost")
    assert lost.topic == "/joint_states"
    assert {each.code for each in found} <= {"lost", "index", "reading"}


def test_every_code_is_planted_somewhere() -> None:
    planted = {code for _, codes, _ in PLANTED.values() for code in codes}
    elsewhere = {"unreadable", "topic-silent", "topic-type", "background-missing", "image-encoding", "gripper-missing"}
    assert planted | elsewhere | {"index", "lost"} == set(SEVERITIES)
