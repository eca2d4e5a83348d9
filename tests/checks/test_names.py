"""Names held against content: the thesis' recordings as they should be, and with one name wrong."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.catalog import Catalog, CatalogRow
from garment_dataset.catalog.names import RecordingName, parse_bag_name
from garment_dataset.checks.appearance import Color
from garment_dataset.checks.content import Content
from garment_dataset.checks.motion import Turn
from garment_dataset.checks.names import compare
from garment_dataset.checks.naming import Change, Measured, changed
from garment_dataset.layout import packaged_workspace

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.catalog.lint import Finding

CATALOG = Catalog.load(packaged_workspace() / "catalog")
COLORS = {
    "blue": Color(30, 11, -37, 25, 35),
    "gray": Color(42, 1, -2, 38, 46),
    "red": Color(29, 43, 23, 25, 33),
    "green": Color(44, -33, 23, 40, 48),
    "black": Color(15, 1, -2, 12, 20),
    "white": Color(75, 0, 6, 70, 80),
    "black&white": Color(40, 0, 0, 15, 85),
}
REPEAT_NS = 90 * 10**9


def row_of(name: str) -> CatalogRow:
    """Return a row of the catalog as it is with a bag of that name."""
    row = CATALOG.row(name)
    return dataclasses.replace(row, path=Path(f"recordings/{name}.bag"), state="present")


def content_of(row: CatalogRow, **other: Any) -> Content:
    """Return what a recording shows that is what its name says."""
    extent_m = np.array([0.18, 0.02, 0.01]) if row.axis == "B" else np.array([0.01, 0.02, 0.18])
    shown = Content(
        start_ns=1_391_700_000 * 10**9 + (row.repeat or 0) * REPEAT_NS,
        messages={"depth": frozenset(f"{row.recording}{number}".encode() for number in range(9))},
        pixels={"depth": frozenset(f"{row.recording}{number}".encode() for number in range(9))},
        axis=row.axis,
        extent_m=extent_m,
        turn=Turn("r2_joint_r", math.pi / 16, 0.5),
        length_m=0.8 * (row.height_m or 0.5),
        is_cut=False,
        color=COLORS[str(row.color)],
    )
    return dataclasses.replace(shown, **other)


ROWS = [row_of(row.recording) for row in CATALOG.rows]


def found_in(measured: Sequence[Measured]) -> list[Finding]:
    return list(compare(measured, CATALOG.tables.garments))


def found_with(name: str, **other: Any) -> list[Finding]:
    """Have one recording show something else."""
    measured = [Measured(row, content_of(row, **(other if row.recording == name else {}))) for row in ROWS]
    return found_in(measured)


def test_the_thesis_recordings_are_what_their_names_say() -> None:
    assert found_in([Measured(row, content_of(row)) for row in ROWS]) == []


NAME = "GreenTowel_Corner_03_pi16_0.5_R1"
TURN = Turn("r2_joint_r", math.pi / 16, 0.5)
PLANTED: dict[str, tuple[dict[str, Any], list[str], str | None]] = {
    # what it shows instead: the codes, and the name that is right
    "another axis": ({"axis": "B"}, ["axis-contradicted"], "GreenTowel_Corner_03_pi16_0.5_B1"),
    "another swing": (
        {"turn": TURN._replace(swing_rad=math.pi / 8)},
        ["swing-contradicted"],
        "GreenTowel_Corner_03_pi8_0.5_R1",
    ),
    "half the speed": (
        {"turn": TURN._replace(speed_rad_s=0.25)},
        ["speed-contradicted"],
        "GreenTowel_Corner_03_pi16_0.25_R1",
    ),
    "a higher speed": ({"turn": TURN._replace(speed_rad_s=0.65)}, ["speed-contradicted"], None),
    "another garment": (
        {"color": COLORS["blue"], "length_m": 0.46},
        ["colour-contradicted"],
        "BlueShirt_Corner_03_pi16_0.5_R1",
    ),
    "a longer garment": ({"length_m": 0.95}, ["length-contradicted"], None),
    "a shorter garment": ({"length_m": 0.1}, ["length-contradicted"], None),
    "a garment that hangs less far": ({"length_m": 0.55}, ["differs-from-repeats"], None),
    "a green of another kind": ({"color": Color(60, -60, 50, 55, 65)}, ["differs-from-repeats"], None),
    "no gripper, no joints": ({"axis": None, "turn": None}, ["unmeasured"], None),
    "axis and swing": (
        {"axis": "B", "turn": TURN._replace(swing_rad=math.pi / 32)},
        ["axis-contradicted", "swing-contradicted"],
        "GreenTowel_Corner_03_pi32_0.5_B1",
    ),
}


@pytest.mark.parametrize("what", PLANTED)
def test_a_name_that_is_wrong_is_found_and_the_right_one_proposed(what: str) -> None:
    other, codes, right = PLANTED[what]
    found = found_with(NAME, **other)
    assert [(each.code, each.subject) for each in found] == [(code, NAME) for code in codes]
    assert {each.target for each in found} == {None if right is None else f"{right}.bag"}
    assert all(each.where == f"recordings/{NAME}.bag" for each in found)


def test_a_speed_that_others_have_is_proposed() -> None:
    fast = [dataclasses.replace(row_of(NAME), recording=f"x{number}", speed=1.0, repeat=None) for number in range(2)]
    measured = [Measured(row, content_of(row, turn=TURN._replace(speed_rad_s=0.9))) for row in fast]
    measured += [Measured(row, content_of(row)) for row in ROWS if row.recording != NAME]
    measured.append(Measured(row_of(NAME), content_of(row_of(NAME), turn=TURN._replace(speed_rad_s=0.9))))
    (found,) = found_in(measured)
    assert (found.code, found.target) == ("speed-contradicted", "GreenTowel_Corner_03_pi16_1_R1.bag")


def test_swapped_repeats_are_found_and_swapped_back() -> None:
    times_ns = {f"GreenTowel_Corner_0{number}_pi16_0.5_B1": (3 - number) * REPEAT_NS for number in (1, 2)}
    measured = [
        Measured(row, content_of(row, **({"start_ns": times_ns[row.recording]} if row.recording in times_ns else {})))
        for row in ROWS
    ]
    found = found_in(measured)
    assert {each.subject: each.target for each in found} == {
        "GreenTowel_Corner_01_pi16_0.5_B1": "GreenTowel_Corner_02_pi16_0.5_B1.bag",
        "GreenTowel_Corner_02_pi16_0.5_B1": "GreenTowel_Corner_01_pi16_0.5_B1.bag",
    }
    assert {each.code for each in found} == {"repeats-reversed"}


@given(order=st.permutations(range(1, 6)))
def test_whatever_the_order_the_proposed_numbers_are_that_of_time(order: list[int]) -> None:
    rows = [row_of(f"GreenTowel_Corner_0{number}_pi16_0.5_R1") for number in range(1, 6)]
    measured = [
        Measured(row, content_of(row, start_ns=place * REPEAT_NS)) for row, place in zip(rows, order, strict=True)
    ]
    targets = {each.subject: each.target for each in found_in(measured)}
    for row, place in zip(rows, order, strict=True):
        right = f"GreenTowel_Corner_0{place}_pi16_0.5_R1"
        assert targets.get(row.recording, f"{row.recording}.bag") == f"{right}.bag"


@pytest.mark.parametrize("kind", ["messages", "pixels"])
@pytest.mark.parametrize("share", [1.0, 0.6])
def test_a_copy_is_found_by_its_images(kind: str, share: float) -> None:
    other = "RedSkirt_Free_pi16_0.5_R1"
    original = list(getattr(content_of(row_of(other)), kind)["depth"])
    found = found_with(NAME, **{kind: {"depth": frozenset(original[: math.ceil(share * len(original))])}})
    assert [(each.code, each.subject) for each in found] == [("copied", NAME), ("copied", other)]
    assert NAME in found[1].message
    assert found[0].target is None


def test_a_data_set_whose_swing_is_the_whole_way_contradicts_nothing() -> None:
    turn = TURN._replace(swing_rad=math.pi / 32)
    assert found_in([Measured(row, content_of(row, turn=turn)) for row in ROWS]) == []
    (found,) = found_in([Measured(row, content_of(row, turn=TURN if row.recording == NAME else turn)) for row in ROWS])
    assert (found.code, found.target) == ("swing-contradicted", "GreenTowel_Corner_03_pi8_0.5_R1.bag")


def test_few_recordings_are_not_compared_with_each_other() -> None:
    rows = [row_of(f"GreenTowel_Corner_0{number}_pi16_0.5_R1") for number in (1, 2)]
    contents = [content_of(row, turn=TURN._replace(speed_rad_s=0.3 * number)) for number, row in enumerate(rows, 1)]
    assert found_in([Measured(*each) for each in zip(rows, contents, strict=True)]) == []
    assert found_in([]) == []


def name(text: str) -> RecordingName:
    found = parse_bag_name(text)
    assert isinstance(found, RecordingName)
    return found


@pytest.mark.parametrize(
    ("text", "change", "right"),
    [
        ("GreenTowel_Corner_01_pi16_0.5_R1", Change(axis="B", repeat=2), "GreenTowel_Corner_02_pi16_0.5_B1"),
        ("GreenTowel_Free_pi16_0.5_R1", Change(garment="RedSkirt", swing_divisor=8), "RedSkirt_Free_pi8_0.5_R1"),
        ("towel16_0.1_0006_R2", Change(repeat=7, speed="0.2"), "towel16_0.2_0007_R2"),
        ("towel16_0.1_R2", Change(garment="RedSkirt"), None),
        ("GreenTowel_Free_pi16_0.5_R1", Change(), None),
        ("GreenTowel_Free_pi16_0.5_R1", Change(axis="R"), None),
    ],
)
def test_changes_give_a_name(text: str, change: Change, right: str | None) -> None:
    found = changed(name(text), change)
    assert (None if found is None else str(found)) == right
