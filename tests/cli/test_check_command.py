"""``garment check``: what is checked, what is said, and with which code it ends."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pyarrow.parquet as pq
import pytest

from garment_dataset.checks.table import CHECKS, PASSED
from tests.checks.conftest import COLOR, COLOR_INFO, DEPTH, good_entries, image, info, write

if TYPE_CHECKING:
    from pathlib import Path

    from garment_dataset.workspace import Workspace
    from tests.cli.conftest import Garment

GOOD, DEAD, ACROSS = (f"GreenTowel_Ruler_0{number}_pi16_0.5_{axis}1" for number, axis in ((1, "R"), (2, "R"), (1, "B")))
SIZE = "640, 480"


@pytest.fixture
def place(workspace: Workspace) -> Workspace:
    """A workspace with a good recording, one whose colour is dead, and one across the view; for images of 64 x 48."""
    folder = workspace.recordings_dir
    for path in folder.iterdir():
        path.unlink()
    entries = good_entries()
    write(folder / f"{GOOD}.bag", entries)
    write(folder / f"{ACROSS}.bag", entries)
    for each in entries:
        each.make = image(COLOR, 1, level=7) if each.topic == COLOR else each.make
    write(folder / f"{DEAD}.bag", entries)
    contract = workspace.catalog_dir / "contract.toml"
    text = contract.read_text().replace(SIZE, "64, 48").replace("xtion1_depth_optical_frame", "")
    contract.write_text(text)
    return workspace


def test_what_breaks_the_contract_is_said_and_the_rest_goes_on(place: Workspace, garment: Garment) -> None:
    ran = garment("check", cwd=place.root, code=1)
    assert f"{DEAD}\n    error dead {COLOR}: nothing is to be seen" in ran.out
    assert f"{ACROSS}\n    error background-missing: no image of the empty scene" in ran.out
    assert f"{GOOD}\n" not in ran.out
    assert ran.out.endswith("1 of 3 bags keep the contract, 1 dead, 1 frozen, 1 background-missing\n")
    assert "44 recordings are not there" in ran.err


def test_filters_choose(place: Workspace, garment: Garment) -> None:
    assert garment("check", GOOD, cwd=place.root).out == "1 of 1 bags keep the contract\n"
    assert "2 bags keep" in garment("check", "axis=R", cwd=place.root, code=1).out
    ran = garment("check", "garment=RedSkirt", cwd=place.root, code=2)
    assert "no bag to check: found 4 recordings, none of which is in" in ran.err


def test_bags_are_checked_without_a_workspace(place: Workspace, garment: Garment, tmp_path: Path) -> None:
    rules = place.catalog_dir / "contract.toml"
    bags = [place.recordings_dir / f"{name}.bag" for name in (GOOD, ACROSS)]
    empty = write(
        tmp_path / "camera_default_0.bag", [each for each in good_entries() if each.topic.startswith(COLOR[:11])]
    )
    ran = garment("check", *map(str, [*bags, empty]), "--contract", str(rules), cwd=tmp_path)
    assert ran.out == "3 of 3 bags keep the contract\n"
    ran = garment("check", str(bags[0]), cwd=tmp_path, code=1)  # by the packaged contract: images of 640 x 480
    assert "image-size" in ran.out


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("axis=R", "some.bag"), "bags and filters do not go together"),
        (("nothere.bag",), "nothere.bag: no such bag"),
        (("axis=Q",), "no such axis"),
        (("--out", "x.toml"), "Add --init"),
        (("--contract", "x.toml"), "x.toml: cannot be read"),
        (("--init", GOOD), "already there"),
        (("--save", "no/folder.parquet"), "no/folder.parquet"),
    ],
)
def test_what_cannot_be_done_is_said(arguments: tuple[str, ...], told: str, place: Workspace, garment: Garment) -> None:
    ran = garment("check", *arguments, cwd=place.root, code=2)
    assert told in ran.err
    assert ran.err.count("\n") == 1 or "not there" in ran.err


def test_findings_are_json_and_a_table(place: Workspace, garment: Garment, tmp_path: Path) -> None:
    saved = tmp_path / "checks.parquet"
    records = json.loads(garment("check", "--json", "--save", str(saved), cwd=place.root, code=1).out)
    assert {each["recording"]: each["passes"] for each in records} == {GOOD: True, DEAD: False, ACROSS: False}
    dead = next(each for each in records if each["recording"] == DEAD)
    assert [each["code"] for each in dead["findings"]] == ["dead", "frozen"]
    table = pq.read_table(saved)
    assert table.schema.names == [column.name for column in CHECKS.columns]
    assert (table.schema.field("time_s").metadata or {})[b"unit"] == b"s"
    rows = {(row["recording"], row["code"]) for row in table.to_pylist()}
    assert rows == {(GOOD, PASSED), (DEAD, "dead"), (DEAD, "frozen"), (ACROSS, "background-missing")}


def test_a_contract_is_learnt_and_then_kept(place: Workspace, garment: Garment) -> None:
    rules = place.catalog_dir / "contract.toml"
    before = rules.read_text()
    ran = garment("check", "--init", DEAD, "--overwrite", cwd=place.root, code=2)
    assert "not a good recording" in ran.err
    assert rules.read_text() == before
    garment("check", "--init", GOOD, "--overwrite", cwd=place.root)
    assert "# Learnt" in rules.read_text()
    assert garment("check", GOOD, cwd=place.root).out == "1 of 1 bags keep the contract\n"
    entries = [each for each in good_entries() if each.topic != DEPTH]
    for each in entries:
        each.make = info(size_px=(60, 48)) if each.topic == COLOR_INFO else each.make
    write(place.recordings_dir / f"{GOOD}.bag", entries)
    ran = garment("check", GOOD, cwd=place.root, code=1)
    assert "topic-missing" in ran.out
    assert "camera-size" in ran.out


def test_a_workspace_without_a_contract_has_the_packaged_one(place: Workspace, garment: Garment) -> None:
    (place.catalog_dir / "contract.toml").unlink()
    assert "expected 640 x 480 pixels, found 64 x 48" in garment("check", GOOD, cwd=place.root, code=1).out
