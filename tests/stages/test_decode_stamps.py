"""Header stamps that cannot be believed: the message is faulty, and no other message notices."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from garment_dataset.errors import DataWarning
from garment_dataset.stages.decode import DecodeParams, decode

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

DEPTH, COLOR = "/xtion1/depth/image_raw", "/xtion1/rgb/image_raw"
EE, JOINT, TF = "/r2_ee_to_depth", "/joint_states", "/tf"
DEPTH_INFO, COLOR_INFO = "/xtion1/depth/camera_info", "/xtion1/rgb/camera_info"
OPTICAL, COLOR_OPTICAL = "xtion1_depth_optical_frame", "xtion1_rgb_optical_frame"
START = 1_391_700_000_000_000_000
PERIOD = 33_333_333
COUNT = 12
SIZE = (8, 6)

WILD: dict[str, Callable[[int], int]] = {
    "zero": lambda _: 0,
    "a day behind": lambda stamp_ns: stamp_ns - 86_400 * 10**9,
    "an hour ahead": lambda stamp_ns: stamp_ns + 3_600 * 10**9,
    "5 s ahead": lambda stamp_ns: stamp_ns + 5 * 10**9,
    "0.2 s behind": lambda stamp_ns: stamp_ns - 2 * 10**8,
    "the same": lambda stamp_ns: stamp_ns,
}
QUIET = {"0.2 s behind", "the same"}


@dataclass
class Scene:
    """Makers of the messages of a recording, by topic, and when each topic has one."""

    ros: Any
    made: dict[str, tuple[int, Callable[[int], Any]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        ros = self.ros
        pixels = 1000 + np.arange(48, dtype=np.uint16).reshape(6, 8)
        rgb = np.zeros((6, 8, 3), np.uint8)
        self.made = {
            DEPTH: (PERIOD, lambda ns: ros.image(ns, OPTICAL, pixels, "16UC1")),
            DEPTH_INFO: (PERIOD, lambda ns: ros.camera_info(ns, OPTICAL, SIZE)),
            COLOR: (PERIOD, lambda ns: ros.image(ns, COLOR_OPTICAL, rgb, "rgb8")),
            COLOR_INFO: (PERIOD, lambda ns: ros.camera_info(ns, COLOR_OPTICAL, SIZE)),
            EE: (30_000_000, lambda ns: ros.point(ns, OPTICAL, (0.1 + ((ns - START) / 1e9) ** 2, -0.2, 1.0))),
            JOINT: (20_000_000, lambda ns: ros.joints(ns, ["r2_joint_b"], [(ns - START) / 1e9])),
            TF: (25_000_000, self._links),
        }

    def _links(self, stamp_ns: int) -> Any:
        cameras = (("base_link", OPTICAL, (0, 0, 1)), (OPTICAL, COLOR_OPTICAL, (0, 0, 0)))
        return self.ros.tf(stamp_ns, *cameras, ("base_link", "r2_ee", (0, 0, 2)))

    def add(self, recorder: Any) -> None:
        """Images are seen from the start on; whatever is interpolated to them begins before and ends after."""
        for topic, (period_ns, make) in self.made.items():
            around = 0 if topic in {DEPTH, COLOR} else 3
            for step in range(-around, COUNT * PERIOD // period_ns + around + 1):
                recorder.add(topic, make(START + step * period_ns))


@pytest.fixture
def scene(recorder: Any, ros: Any) -> Any:
    made = Scene(ros)
    made.add(recorder)
    return made


def rows(table: Any, leave: Iterable[str] = ()) -> list[dict[str, Any]]:
    return [{name: value for name, value in row.items() if name not in leave} for row in table.to_pylist()]


NAMED = {"frame", "offset_bytes", "fault"}  # an inserted message moves the numbers and places of those after it


def said(path: Any, params: DecodeParams | None = None) -> tuple[dict[str, Any], list[str]]:
    with pytest.warns(DataWarning) as caught:
        tables = decode(path, params or DecodeParams(gripper_max_disagreement_m=9.0))
    return tables, [str(each.message) for each in caught]


@pytest.mark.parametrize(
    ("topic", "wild"),
    # links have several publishers, half a second apart, and repeat their stamps: neither is worth a word there
    [(topic, wild) for topic in (DEPTH, COLOR, EE, JOINT, TF) for wild in WILD if topic != TF or wild not in QUIET],
)
def test_a_message_with_a_wrong_stamp_changes_nothing_else(recorder: Any, scene: Scene, topic: str, wild: str) -> None:
    params = DecodeParams(gripper_max_disagreement_m=9.0)
    clean = decode(recorder.write(), params)
    period_ns, make = scene.made[topic]
    stamp_ns = START + 8 * period_ns
    message = make(WILD[wild](stamp_ns) if wild != "0.2 s behind" else WILD[wild](stamp_ns) + 1)
    recorder.rows.append((stamp_ns + 5_000_001, topic, message))
    found, texts = said(recorder.write())
    for name, table in found.items():
        kept = [row for row in table.to_pylist() if row.get("fault") is None]
        leave = NAMED if topic in {DEPTH, COLOR} else {"offset_bytes"}
        kept = [{key: value for key, value in row.items() if key not in leave} for row in kept]
        assert kept == rows(clean[name], leave), name
    assert len(texts) == 1
    assert topic in texts[0]


@pytest.mark.parametrize("wild", WILD)
def test_the_fault_of_an_image_says_what_is_wrong_with_its_stamp(recorder: Any, scene: Scene, wild: str) -> None:
    stamp_ns = START + 8 * PERIOD
    message = scene.made[DEPTH][1](WILD[wild](stamp_ns))
    recorder.rows.append((stamp_ns + 5_000_001, DEPTH, message))
    tables, texts = said(recorder.write())
    faulty = [row for row in tables["frames"].to_pylist() if row["fault"] is not None]
    expected = {
        "zero": "header stamp is zero",
        "a day behind": "header stamp is 86400.005 s before its record time, in the median 0.005 s before",
        "an hour ahead": "header stamp is 3599.995 s after its record time, in the median 0.005 s before",
        "5 s ahead": "header stamp runs ahead, 4.967 s after that of message 10",
        "0.2 s behind": "header stamp runs backwards, 0.200 s before that of message 8",
        "the same": "header stamp repeats that of message 8",
    }
    assert [(row["frame"], row["fault"]) for row in faulty] == [(9, expected[wild])]
    counted = {
        "zero": "1 header stamps are zero",
        "a day behind": "1 header stamps are far from the record times",
        "an hour ahead": "1 header stamps are far from the record times",
    }
    order = "1 header stamps do not increase, first that of message 9"
    skipped = f"{DEPTH}: 1 of {COUNT + 2} messages skipped, first message 9: {expected[wild]}"
    assert texts == [f"{recorder.path.name}: {skipped}; {counted.get(wild, order)}"]


@pytest.mark.usefixtures("scene")
def test_every_message_twice_gives_the_tables_of_the_recording(recorder: Any) -> None:
    params = DecodeParams(gripper_max_disagreement_m=9.0)
    clean = decode(recorder.write(), params)
    recorder.rows = [row for row in recorder.rows for _ in range(2)]
    found, texts = said(recorder.write())
    for name, table in found.items():
        kept = [row for row in table.to_pylist() if row.get("fault") is None]
        assert [{key: row[key] for key in row if key not in NAMED} for row in kept] == rows(clean[name], NAMED), name
    assert len([text for text in texts if "do not increase" in text]) == 4, "two streams, the gripper, the joints"


@pytest.mark.usefixtures("scene")
def test_two_clocks_are_a_note_and_no_fault(recorder: Any) -> None:
    recorder.rows = [(stamp_ns + 3_600 * 10**9, topic, message) for stamp_ns, topic, message in recorder.rows]
    tables, texts = said(recorder.write())
    assert set(tables["frames"]["fault"].to_pylist()) == {None}
    note = "header stamps are 3600.005 s before the record times in the median: they are of another clock"
    assert texts == [f"{recorder.path.name}: {topic}: {note}" for topic in (DEPTH, COLOR)]


def test_a_driver_that_never_stamps_gives_no_frames_and_no_times(recorder: Any, scene: Scene) -> None:
    recorder.rows = [
        (stamp_ns, topic, scene.made[DEPTH][1](0) if topic == DEPTH else message)
        for stamp_ns, topic, message in recorder.rows
    ]
    tables, _ = said(recorder.write())
    faults = {row["fault"] for row in tables["frames"].to_pylist() if row["stream"] == "depth"}
    assert faults == {"header stamp is zero"}
    assert set(tables["gripper"]["stream"].to_pylist()) == {"color"}


@pytest.mark.usefixtures("scene")
def test_the_gripper_has_its_orientation_uncertainty_and_the_world_its_gravity(recorder: Any) -> None:
    tables = decode(recorder.write(), DecodeParams(gripper_max_disagreement_m=9.0))
    depth = [row for row in tables["gripper"].to_pylist() if row["stream"] == "depth"]
    assert {(row["qx"], row["qy"], row["qz"], row["qw"]) for row in depth} == {(0.0, 0.0, 0.0, 1.0)}
    assert {row["source"] for row in depth} == {"topic"}
    assert all(row[f"{axis}_std_m"] == pytest.approx(1e-4) for row in depth for axis in "xyz")
    world = {row["stream"]: row for row in tables["world"].to_pylist()}
    assert world["depth"] == {
        "stream": "depth",
        "gravity_x": 0.0,
        "gravity_y": 0.0,
        "gravity_z": -1.0,
        "gravity_source": "tf: base_link",
        "reason": None,
    }
    assert world["color"] == {**world["depth"], "stream": "color"}
    level = decode(recorder.write(), DecodeParams(gripper_max_disagreement_m=9.0, level_frame=""))["world"]
    assert [(row["gravity_z"], row["reason"]) for row in level.to_pylist()] == [(None, "no level frame")] * 2
