"""What ``rosbag record`` appends to names: understood as that, mended where one bag is meant, never two made one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from garment_dataset.catalog.names import BackgroundName, RecordingName, parse_bag_name, repair_name
from garment_dataset.catalog.suffixes import appended_to
from garment_dataset.cli import application
from garment_dataset.errors import RecordingNameError
from garment_dataset.workspace import Workspace

DATE = "2026-11-25-10-30-00"
given_names = st.sampled_from(
    ["towel_0.5_R1", "GreenTowel_Corner_01_pi16_0.5_B2", "towel16_0.1_0006_R2", "camera_default_0"]
)
dates = st.datetimes().map(lambda time: f"{time:%Y-%m-%d-%H-%M-%S}".rjust(19, "0"))


@pytest.fixture
def place(tmp_path: Path) -> Workspace:
    return Workspace.create(tmp_path / "ws", empty=True)


def put(place: Workspace, *names: str) -> None:
    for name in names:
        (path := place.recordings_dir / name).parent.mkdir(parents=True, exist_ok=True)
        path.touch()


def run(place: Workspace, *arguments: str) -> Any:
    return CliRunner(env={"NO_COLOR": "1"}).invoke(application(), [*arguments, "-w", str(place.root)])


@given(given_names, dates, st.none() | st.integers(0, 99))
def test_what_was_appended_is_taken_off_again(name: str, date: str, part: int | None) -> None:
    stem = f"{name}_{date}" + ("" if part is None else f"_{part}")
    assert appended_to(stem) == (name, date, part)
    assert repair_name(f"{stem}.bag") == (None if part else name)
    with pytest.raises(RecordingNameError, match="rosbag record") as caught:
        parse_bag_name(stem)
    assert (caught.value.hint == f"Did you mean {name}.bag?") == (not part)


@given(given_names)
def test_what_was_not_appended_to_is_left_alone(name: str) -> None:
    assert isinstance(parse_bag_name(name), RecordingName | BackgroundName)
    assert repair_name(name) == name


def test_a_number_alone_is_a_part_where_a_name_is_before_it() -> None:
    assert repair_name("towel_0.5_R1_0.bag") == "towel_0.5_R1"
    assert repair_name("towel_0.5_R1_1.bag") is None
    assert repair_name("towel_0.5_R_1.bag") == "towel_0.5_R1"  # a separator too many, and no part
    assert repair_name(f"{DATE}.bag") is None


def test_a_dated_bag_is_renamed(place: Workspace) -> None:
    put(place, f"towel_0.5_R1_{DATE}.bag", f"towel_0.5_B1_{DATE}_0.bag", f"shawl_0.5_R1_{DATE}/metadata.yaml")
    found = run(place, "lint", "code=misnamed").stdout
    assert (
        "the date that `rosbag record -o` appends: should be towel_0.5_R1.bag. Rename it to towel_0.5_R1.bag." in found
    )
    assert run(place, "lint", "--rename", "--apply").exit_code == 0
    names = sorted(path.name for path in place.recordings_dir.iterdir())
    assert names == ["shawl_0.5_R1", "towel_0.5_B1.bag", "towel_0.5_R1.bag"]


@pytest.mark.parametrize(
    "names",
    [
        (f"towel_0.5_R1_{DATE}.bag", f"b/towel_0.5_R1_{DATE[:-1]}7.bag"),
        ("towel_0.5_R1.BAG", "Towel 0.5 R1.bag"),
        (f"towel_0.5_R1_{DATE}.bag", "towel_0.5_R1.bag"),
        (f"towel_0.5_R1_{DATE}.bag", f"towel_0.5_R1_{DATE[:-1]}7/metadata.yaml"),
        ("TOWEL_0.5_R1.bag", "Tow-el_0.5_R1.bag"),
        (f"shawl_0.5_R1_{DATE}.bag", "Shawl 0.5 R1.bag"),
    ],
)
def test_two_bags_of_one_recording_are_a_conflict_and_keep_their_names(
    place: Workspace, names: tuple[str, ...]
) -> None:
    put(place, *names)
    if names[1].startswith("Tow"):
        (place.catalog_dir / "recordings.csv").write_text("recording\ntowel_0.5_R1\n")
    found = run(place, "lint", "code=misnamed").stdout
    assert "2 bags would get that name: keep one" in found or "has that name already: keep one of the two" in found
    planned = run(place, "lint", "--rename", "--apply")
    assert planned.exit_code == 1
    assert "0 renamed" in planned.stdout
    assert all((place.recordings_dir / name).exists() for name in names)


def test_parts_of_one_recording_are_no_recording(place: Workspace) -> None:
    put(place, *(f"towel_0.5_R1_{DATE}_{part}.bag" for part in range(3)), "shawl_0.5_R1_1.bag")
    found = run(place, "lint", "code=misnamed").stdout
    assert found.count("A recording is one bag: ") == 2
    assert "--dst towel_0.5_R1.bag" in found
    assert "4 misnamed" in found
    assert run(place, "lint", "--rename").stdout == "nothing to rename\n"
    assert "0 recordings" in run(place, "list").stderr


def test_a_dated_bag_that_was_not_closed_is_called_by_its_recording(place: Workspace) -> None:
    put(place, f"towel_0.5_R1_{DATE}.bag.active")
    assert run(place, "lint", "code=unfinished", "towel_0.5_R1").exit_code == 1
