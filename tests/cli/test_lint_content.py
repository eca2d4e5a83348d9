"""``garment lint --content``: bags under wrong names are found, and renamed to what they show."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from tests.checks.conftest import GRIPPER, GRIPPER_COLOR, Entry, good_entries, image, joints, point, write

if TYPE_CHECKING:
    from pathlib import Path

    from garment_dataset.workspace import Workspace
    from tests.cli.conftest import Garment


def recorded(
    axis: str, seed: int, swing_rad: float = math.pi / 16, rate: float = 2.0, begin_s: float = 0.0
) -> list[Entry]:
    """Return a recording of a swing; each has images of its own."""
    entries: list[Entry] = []
    for each in good_entries():
        angle_rad = swing_rad * math.sin(rate * each.time_s)
        way_m = 0.5 * angle_rad
        make = each.make
        if each.topic in {GRIPPER, GRIPPER_COLOR}:
            make = point(way_m, 0.0, 1.0) if axis == "B" else point(0.0, 0.0, 1.0 + way_m)
        elif each.topic == "/joint_states":
            make = joints(angle_rad)
        elif each.topic.endswith("image_raw"):
            make = image(each.topic, seed * 1000 + round(each.time_s * 30))
        entries.append(replace(each, make=make, time_s=each.time_s + begin_s))
    return entries


@pytest.fixture
def place(workspace: Workspace) -> Workspace:
    for path in workspace.recordings_dir.iterdir():
        path.unlink()
    contract = workspace.catalog_dir / "contract.toml"
    contract.write_text(contract.read_text().replace("xtion1_depth_optical_frame", ""))
    return workspace


def fill(folder: Path, **changes: list[Entry]) -> None:
    """Write five repeats along the optical axis, the parameter named r3 instead of the third."""
    for number in range(1, 6):
        entries = changes.get(f"r{number}", recorded("R", number, begin_s=100.0 * number))
        write(folder / f"GreenTowel_Corner_0{number}_pi16_0.5_R1.bag", entries)


def contradictions(garment: Garment, place: Workspace) -> dict[str, tuple[str, str | None]]:
    ran = garment("lint", "--content", "severity=error,warning", "--json", cwd=place.root, code=1)
    found = json.loads(ran.out)["findings"]
    kinds = ("contradicted", "reversed", "copied", "repeats")
    return {each["subject"]: (each["code"], each["target"]) for each in found if each["code"].endswith(kinds)}


NAMED = "GreenTowel_Corner_0{}_pi16_0.5_R1"


@pytest.mark.parametrize(
    ("what", "code", "right"),
    [
        ({"axis": "B"}, "axis-contradicted", "GreenTowel_Corner_03_pi16_0.5_B1"),
        ({"axis": "R", "swing_rad": math.pi / 8, "rate": 1.6}, "swing-contradicted", "GreenTowel_Corner_03_pi8_0.5_R1"),
        ({"axis": "R", "rate": 1.0}, "speed-contradicted", "GreenTowel_Corner_03_pi16_0.25_R1"),
    ],
)
def test_a_bag_under_a_wrong_name_is_renamed(
    what: dict[str, float | str], code: str, right: str, place: Workspace, garment: Garment
) -> None:
    fill(place.recordings_dir, r3=recorded(seed=3, begin_s=300.0, **what))  # type: ignore[arg-type]
    assert contradictions(garment, place) == {NAMED.format(3): (code, f"{right}.bag")}
    ran = garment("lint", "--content", "--rename", "--apply", cwd=place.root)
    assert f"renamed recordings/{NAMED.format(3)}.bag -> {right}.bag" in ran.out
    assert contradictions(garment, place) == {}


def test_repeats_that_were_swapped_are_swapped_back(place: Workspace, garment: Garment) -> None:
    early, late = recorded("R", 7, begin_s=200.0), recorded("R", 8, begin_s=400.0)
    fill(place.recordings_dir, r4=early, r2=late)
    wrong = {NAMED.format(2): 4, NAMED.format(4): 2}
    assert contradictions(garment, place) == {
        name: ("repeats-reversed", f"{NAMED.format(number)}.bag") for name, number in wrong.items()
    }
    content = (place.recordings_dir / f"{NAMED.format(2)}.bag").read_bytes()
    garment("lint", "--content", "--rename", "--apply", cwd=place.root)
    assert (place.recordings_dir / f"{NAMED.format(4)}.bag").read_bytes() == content
    assert contradictions(garment, place) == {}


def test_a_copy_is_found_whatever_it_is_called(place: Workspace, garment: Garment) -> None:
    fill(place.recordings_dir)
    copy = place.recordings_dir / "GreenTowel_Free_pi16_0.5_R1.bag"
    copy.write_bytes((place.recordings_dir / f"{NAMED.format(2)}.bag").read_bytes())
    found = contradictions(garment, place)
    assert {name: code for name, (code, _) in found.items()} == {copy.stem: "copied", NAMED.format(2): "copied"}


def test_what_cannot_be_read_is_said_and_the_rest_goes_on(place: Workspace, garment: Garment) -> None:
    fill(place.recordings_dir, r3=recorded("B", 3, begin_s=300.0))
    broken = place.recordings_dir / f"{NAMED.format(2)}.bag"
    broken.write_bytes(broken.read_bytes()[:100_000])
    ran = garment("lint", "--content", cwd=place.root, code=1)
    assert "axis-contradicted" in ran.out
    assert "unmeasured: not held against its content: it cannot be read" in ran.out


def test_without_the_option_no_bag_is_read(place: Workspace, garment: Garment) -> None:
    fill(place.recordings_dir, r3=recorded("B", 3))
    assert "contradicted" not in garment("lint", cwd=place.root, code=1).out
