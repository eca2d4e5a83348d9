"""The catalog: the thesis' tables as printed, joined with a folder of bags, queried, and refused where it is wrong."""

from __future__ import annotations

import math
import os
import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.catalog import ROW_KEYS, ROW_UNITS, Catalog, CatalogRow
from garment_dataset.catalog.names import parse_bag_name
from garment_dataset.catalog.rows import join_rows
from garment_dataset.catalog.tables import Tables
from garment_dataset.errors import CatalogError, DataWarning, FilterError, RecordingNameError, WorkspaceError
from garment_dataset.layout import nearest_catalog, packaged_workspace
from garment_dataset.stages.stage import IDENTITY

if TYPE_CHECKING:
    from collections.abc import Callable

PRINTED = [
    [cell.strip() for cell in line.strip().strip("|").split("|")]
    for line in (Path(__file__).parent / "data" / "tables_b2_b3.txt").read_text("utf-8").splitlines()[1:]
]
THESIS = packaged_workspace() / "catalog"
TABLE_4_1 = """
| t-shirt | blue | 47×58 | 72 | a |
| t-shirt | gray | 60×54 | 105 | b |
| skirt | red | 44×62 | 108 | c |
| towel | green | 60×36 | 45 | d |
| shorts | black | 50×60 | 173 | e |
| shirt | black&white | 69×120 | 137 | f |
| pullover | red | 65×120 | 446 | g |
| pullover | white | 54×76 | 184 | h |
"""
UNPAIRED = {"FelShirt_Ruler_pi16_0.5_R1", *(f"GreenTowel_Ruler_0{number}_pi16_0.5_R1" for number in range(1, 6))}


@pytest.fixture
def thesis() -> Catalog:
    return Catalog.load(THESIS)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of the thesis' tables."""
    return Path(shutil.copytree(THESIS, tmp_path / "catalog"))


@pytest.fixture
def put(tmp_path: Path) -> Callable[..., Path]:
    """Make empty bags under one folder, and return it."""

    def make(*names: str) -> Path:
        bags = tmp_path / "bags"
        bags.mkdir(exist_ok=True)
        for name in names:
            path = bags / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
        return bags

    return make


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), "utf-8")


def states(catalog: Catalog) -> dict[str, str | None]:
    return {row.recording: row.state for row in catalog.rows}


# The thesis' own tables


def test_the_recordings_are_those_of_tables_b2_and_b3_as_printed(thesis: Catalog) -> None:
    assert [
        [str(row.number), row.recording, row.garment, row.holding, "yes" if row.dvd else "no"]
        for row in thesis.tables.recordings
    ] == [[n, printed.replace("pi16.", "pi16_"), *rest] for n, printed, *rest in PRINTED]
    tables = [row.table for row in thesis.tables.recordings]
    assert tables == ["B.2"] * 26 + ["B.3"] * 20


def test_the_garments_are_those_of_table_4_1(thesis: Catalog) -> None:
    printed = [[cell.strip() for cell in line.strip("|").split("|")] for line in TABLE_4_1.strip().splitlines()]
    assert [
        [row.kind, row.color, f"{row.width_cm:g}×{row.height_cm:g}", f"{row.weight_g:g}", row.letter]
        for row in thesis.tables.garments
    ] == printed


def test_the_files_hold_names_as_they_are_written() -> None:
    lines = (THESIS / "recordings.csv").read_text("utf-8").splitlines()[1:]
    assert all(str(parse_bag_name(name := line.split(",")[0])) == name for line in lines)


def test_topics_file_1_is_that_of_section_4_1(thesis: Catalog) -> None:
    topics = thesis.topics(1)
    assert topics is not None
    assert len(topics) == 10
    assert topics[0] == "/joint_states"
    assert topics[5:7] == ("/xtion1/depth/image_raw", "/xtion1/rgb/image_raw")
    assert topics[-1] == "/r2_ee_to_rgb"
    assert thesis.topics(2) is None


def test_every_recording_is_joined_with_its_garment(thesis: Catalog) -> None:
    towel = thesis.row("GreenTowel_Corner_03_pi16_0.5_R1")
    assert towel.record() == {
        "recording": "GreenTowel_Corner_03_pi16_0.5_R1",
        "garment": "GreenTowel",
        "holding": "Corner",
        "repeat": 3,
        "swing_rad": math.pi / 16,
        "speed": 0.5,
        "axis": "R",
        "topics_file": 1,
        "dvd": False,
        "table": "B.2",
        "partner": "GreenTowel_Corner_03_pi16_0.5_B1",
        "garment_kind": "towel",
        "color": "green",
        "width_m": 0.6,
        "height_m": 0.36,
        "weight_kg": 0.045,
        "in_tables": True,
        "state": None,
        "path": None,
    }
    assert all(None not in (row.garment, row.holding, row.garment_kind, row.weight_kg) for row in thesis.rows)


def test_all_but_six_recordings_are_paired_and_the_pairs_agree(thesis: Catalog) -> None:
    rows = {row.recording: row for row in thesis.rows}
    assert {row.recording for row in thesis.rows if row.partner is None} == UNPAIRED
    for row in thesis.rows:
        if row.partner is not None:
            other = rows[row.partner]
            assert other.partner == row.recording
            assert {row.axis, other.axis} == {"R", "B"}
            assert (row.garment, row.holding, row.repeat) == (other.garment, other.holding, other.repeat)


recording_names = st.builds(
    lambda name, speed, counter, axis: f"{name}_{speed}{counter}_{axis}",
    st.sampled_from(["A_Free", "A_Free_01", "A_Free_pi16", "odd", "odd_pi16"]),
    st.sampled_from(["0.5", "0.50", "1"]),
    st.sampled_from(["", "_0001"]),
    st.sampled_from(["R1", "R2", "B1", "B2"]),
)


@given(st.lists(recording_names, unique=True, max_size=12))
def test_pairs_are_mutual_and_alike_and_as_many_as_there_can_be(recordings: list[str]) -> None:
    rows = {row.recording: row for row in join_rows(Tables((), (), (), ()), {name: Path(name) for name in recordings})}

    def movement(row: CatalogRow) -> tuple[object, ...]:
        name = row.recording.split("_0.5")[0].split("_1_")[0]
        return (row.garment or name, row.holding, row.repeat, row.swing_rad, row.speed)

    groups: dict[tuple[object, ...], list[str]] = {}
    for row in rows.values():
        groups.setdefault(movement(row), []).append(row.axis)
        if row.partner is not None:
            other = rows[row.partner]
            assert other.partner == row.recording
            assert movement(other) == movement(row)
            assert other.axis != row.axis
    pairs = sum(row.partner is not None for row in rows.values()) // 2
    assert pairs == sum(min(axes.count("R"), axes.count("B")) for axes in groups.values())


def test_the_same_topics_file_is_preferred_in_a_pair() -> None:
    names = ["A_Free_1_R2", "A_Free_1_R1", "A_Free_1_B1"]
    rows = join_rows(Tables((), (), (), ()), {name: Path(name) for name in names})
    assert [row.partner for row in rows] == [None, "A_Free_1_B1", "A_Free_1_R1"]


# A folder of bags


def test_without_a_folder_nothing_is_said_about_state(thesis: Catalog) -> None:
    assert set(states(thesis).values()) == {None}
    assert [(number, found.source, found.path) for number, found in thesis.backgrounds.items()] == [
        (1, "camera_default_0", None)
    ]


def test_a_folder_that_does_not_exist_holds_nothing(thesis: Catalog, tmp_path: Path) -> None:
    assert set(states(thesis.with_folder(tmp_path / "none")).values()) == {"missing"}


def test_bags_are_found_at_any_depth_and_the_rest_is_missing_or_unexpected(
    thesis: Catalog, put: Callable[..., Path]
) -> None:
    bags = put(
        "GreenTowel_Free_pi16_0.5_R1.bag",
        "a/b/c/FelShirt_Free_pi16.0.5_B1.bag",
        "BlueShirt_Free_pi16_0.5_R1/metadata.yaml",
        "BlueShirt_Free_pi16_0.5_R1/BlueShirt_Free_pi16_0.5_R1_0.mcap",
        "GreenTowel_Free_pi16_1_R1.bag",
        "MyTowel_Free_0.5_R1.bag",
        "towel16_0.1_0006_R2.bag",
        "camera_default_0.bag",
        "a/camera_default_3.bag",
        "notes.txt",
        ".hidden/RedSkirt_Free_pi16_0.5_R1.bag",
        ".RedSkirt_Free_pi16_0.5_R1.bag",
    )
    catalog = thesis.with_folder(bags)
    found = states(catalog)
    assert {name for name, state in found.items() if state == "present"} == {
        "GreenTowel_Free_pi16_0.5_R1",
        "FelShirt_Free_pi16_0.5_B1",
        "BlueShirt_Free_pi16_0.5_R1",
    }
    unexpected = ["GreenTowel_Free_pi16_1_R1", "MyTowel_Free_0.5_R1", "towel16_0.1_0006_R2"]
    assert [name for name, state in found.items() if state == "unexpected"] == unexpected
    assert len(found) == 46 + 3
    assert catalog.row("FelShirt_Free_pi16_0.5_B1").path == bags / "a/b/c/FelShirt_Free_pi16.0.5_B1.bag"
    assert catalog.row("BlueShirt_Free_pi16_0.5_R1").path == bags / "BlueShirt_Free_pi16_0.5_R1"
    assert {number: found.path for number, found in catalog.backgrounds.items()} == {
        1: bags / "camera_default_0.bag",
        2: None,
        4: bags / "a/camera_default_3.bag",
    }
    wanted = "bags/camera_default_1.bag, or a row for topics file 2 in catalog/backgrounds.csv"
    assert catalog.background(2).missing == wanted


def test_an_unexpected_bag_says_what_its_name_says_and_no_more(thesis: Catalog, put: Callable[..., Path]) -> None:
    names = ("GreenTowel_Free_pi16_1_R1", "MyTowel_Free_0.5_R1", "towel16_0.1_0006_R2")
    catalog = thesis.with_folder(put(*(f"{name}.bag" for name in names)))
    known, unknown, free = (catalog.row(name) for name in names)
    assert (known.garment, known.weight_kg, known.dvd, known.table, known.in_tables) == (
        "GreenTowel",
        0.045,
        None,
        None,
        False,
    )
    assert (unknown.garment, unknown.holding, unknown.weight_kg) == ("MyTowel", "Free", None)
    assert (free.garment, free.holding, free.repeat, free.topics_file) == (None, None, 6, 2)


def test_links_are_followed_and_loops_end(thesis: Catalog, put: Callable[..., Path], tmp_path: Path) -> None:
    elsewhere = tmp_path / "server" / "GreenTowel_Free_pi16_0.5_R1.bag"
    elsewhere.parent.mkdir()
    elsewhere.touch()
    bags = put("FelShirt_Free_pi16_0.5_R1.bag", "real/RedSkirt_Free_pi16_0.5_R1.bag")
    (bags / "linked").symlink_to(elsewhere.parent, target_is_directory=True)
    (bags / "linked_again").symlink_to(elsewhere.parent, target_is_directory=True)
    (bags / "a_loop").symlink_to(bags, target_is_directory=True)
    (bags / "a_link").symlink_to(bags / "real", target_is_directory=True)
    (bags / "BlueShirt_Free_pi16_0.5_R1.bag").symlink_to(elsewhere)
    (bags / "real" / "FelShirt_Free_pi16_0.5_R1.bag").symlink_to(bags / "FelShirt_Free_pi16_0.5_R1.bag")
    catalog = thesis.with_folder(bags)
    assert catalog.found is not None
    assert [str(bag.name) for bag in catalog.found.bags] == [
        "BlueShirt_Free_pi16_0.5_R1",
        "FelShirt_Free_pi16_0.5_R1",
        "GreenTowel_Free_pi16_0.5_R1",
        "RedSkirt_Free_pi16_0.5_R1",
    ]
    assert catalog.found.duplicates == ()
    assert catalog.row("RedSkirt_Free_pi16_0.5_R1").path == bags / "real" / "RedSkirt_Free_pi16_0.5_R1.bag"


def test_of_two_bags_of_one_recording_the_well_named_one_is_used(thesis: Catalog, put: Callable[..., Path]) -> None:
    well, other = "z/GreenTowel_Free_pi16_0.5_R1.bag", "a/GreenTowel_Free_pi16.0.5_R1.bag"
    bags = put(well, other)
    catalog = thesis.with_folder(bags)
    assert catalog.row("GreenTowel_Free_pi16_0.5_R1").path == bags / well
    assert catalog.found is not None
    assert [duplicate.bag.path for duplicate in catalog.found.duplicates] == [bags / other]


def test_what_cannot_be_looked_at_is_announced(thesis: Catalog, put: Callable[..., Path]) -> None:
    bags = put("FelShirt_Free_pi16_0.5_R1.bag")
    (bags / "GreenTowel_Free_pi16_0.5_R1.bag").symlink_to("nowhere")
    with pytest.warns(DataWarning, match=r"GreenTowel_Free_pi16_0\.5_R1\.bag: a link to nothing"):
        found = states(thesis.with_folder(bags))
    assert found["GreenTowel_Free_pi16_0.5_R1"] == "missing"
    assert found["FelShirt_Free_pi16_0.5_R1"] == "present"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may look everywhere")
def test_a_folder_without_permission_is_announced(thesis: Catalog, put: Callable[..., Path]) -> None:
    bags = put("locked/FelShirt_Free_pi16_0.5_R1.bag")
    (bags / "locked").chmod(0)
    try:
        with pytest.warns(DataWarning, match="locked: cannot be looked at"):
            thesis.with_folder(bags)
    finally:
        (bags / "locked").chmod(0o700)


def test_a_file_is_no_folder_of_bags(thesis: Catalog, put: Callable[..., Path]) -> None:
    with pytest.raises(CatalogError, match="not a folder"):
        thesis.with_folder(put("x.bag") / "x.bag")


# A user's own data set


def test_rows_of_ones_own_are_welcome(folder: Path, put: Callable[..., Path]) -> None:
    with (folder / "garments.csv").open("a") as file:
        file.write("i,MyTowel,towel,,50,,\n")
    with (folder / "recordings.csv").open("a") as file:
        file.write("MyTowel_Free_01_0.5_B1.bag,,,i,a,\ntowel16_0.1_0006_R2,,,i,b,no\n")
    catalog = Catalog.load(folder).with_folder(put("MyTowel_Free_01_0.5_B1.bag"))
    mine = catalog.row("MyTowel_Free_01_0.5_B1")
    assert (mine.state, mine.garment_kind, mine.color, mine.width_m, mine.height_m) == (
        "present",
        "towel",
        None,
        0.5,
        None,
    )
    free = catalog.row("towel16_0.1_0006_R2")
    assert (free.garment, free.holding, free.dvd) == ("MyTowel", "Corner", False)
    assert free.partition == {"garment": "MyTowel", "holding": "Corner"}


def test_a_table_of_nothing_but_a_header_is_a_catalog(folder: Path, put: Callable[..., Path]) -> None:
    (folder / "recordings.csv").write_text("recording\n")
    catalog = Catalog.load(folder)
    assert catalog.rows == ()
    assert len(catalog.query()) == 0
    assert states(catalog.with_folder(put("MyTowel_Free_0.5_R1.bag"))) == {"MyTowel_Free_0.5_R1": "unexpected"}


def test_what_a_spreadsheet_writes_is_read(folder: Path) -> None:
    path = folder / "garments.csv"
    text = path.read_text("utf-8").replace("green", '" green, dark "').replace("\n", "\r\n") + ",,,,,,\r\n"
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert Catalog.load(folder).tables.garments[3].color == "green, dark"


@pytest.mark.parametrize(("old", "new"), [(",", ", "), ("letter", "\n\nletter"), ("letter", '"letter"')])
def test_what_people_write_is_read(folder: Path, old: str, new: str) -> None:
    path = folder / "garments.csv"
    path.write_text(path.read_text("utf-8").replace(old, new), "utf-8")
    assert Catalog.load(folder).tables.garments == Catalog.load(THESIS).tables.garments


def test_a_letter_composed_in_another_way_is_the_same(folder: Path) -> None:
    edit(folder / "garments.csv", "blue", "Türkis".replace("ü", "u\u0308"))
    assert len(Catalog.load(folder).query(color="Türkis")) == len(Catalog.load(folder).query(garment="BlueShirt")) > 0


# Tables that are wrong


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda text: text.replace(",", ";"),
            "line 1: .*semicolons.*Save it with commas.*points in numbers",
        ),
        (lambda text: text.replace(",", "\t"), "line 1: .*separated by tabs.*Save it with commas"),
        (lambda text: f"sep=,\n{text}", "line 1: .*a line for Excel alone.*Remove the first line"),
        (
            lambda text: "\n".join(f'"{line}"' for line in text.splitlines()),
            "line 1: .*one cell in quotes",
        ),
        (lambda text: text.replace(",47,", ',"47,5",'), "line 2, column width_cm.*The decimal mark is a point: 47.5"),
        (lambda text: text.replace("\n", ",\n"), "line 1: a column without a name.*Give it one, or delete it"),
        (lambda _: "", "line 1: no column 'letter'"),
        (lambda text: text.replace("t-shirt", "t\0shirt"), "a zero byte in line 2"),
    ],
)
def test_what_a_program_has_written_is_named_with_what_to_do(
    folder: Path, change: Callable[[str], str], message: str
) -> None:
    path = folder / "garments.csv"
    path.write_text(change(path.read_text("utf-8")), "utf-8")
    with pytest.raises(CatalogError, match=message) as caught:
        Catalog.load(folder)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("recordings.csv", "1,e,d,no", "1,e,d,nope", "line 2, column dvd.*expected yes, no or nothing, found 'nope'"),
        ("recordings.csv", "B.2,2,", "B.2,two,", "line 3, column number.*expected a whole number.*found 'two'"),
        ("recordings.csv", "1,e,d,no", "1,z,d,no", "line 2, column garment.*not in garments.csv.*a, b, .*found 'z'"),
        ("recordings.csv", "1,e,d,no", "1,e,z,no", "line 2, column holding.*not in holdings.csv.*found 'z'"),
        ("recordings.csv", "1,e,d,no", "1,d,d,no", r"column garment.*disagree.*e \(BlackShorts\).*d \(GreenTowel\)"),
        ("recordings.csv", "1,e,d,no", "1,e,a,no", r"column holding.*disagree.*d \(Belt\).*a \(Free\)"),
        ("recordings.csv", "14,d,f,yes", "14,d,b,yes", r"disagree.*expected e or f \(Ruler\).*found b \(Corner\)"),
        ("recordings.csv", "1,e,d,no", "1,e,d", "line 2: wrong number of cells.*expected 6.*found 5"),
        ("recordings.csv", "1,e,d,no", "1,e,d,no,", "line 2: wrong number of cells.*expected 6.*found 7"),
        ("recordings.csv", "BlackShorts_Free", "BlackShorts_Belt", "line 3.*twice.*BlackShorts_Belt.*also in line 2"),
        ("recordings.csv", "pi16_0.5_R1", "pi16_0,5_R1", "line 2: wrong number of cells"),
        (
            "recordings.csv",
            "pi16_0.5_R1",
            "pi16-0.5_R1",
            r"line 2, column recording.*mean BlackShorts_Belt_.*bag\?",
        ),
        ("recordings.csv", "BlackShorts_Belt_pi16_0.5_R1", "camera_default_0", "needs no row"),
        ("recordings.csv", "BlackShorts_Belt_pi16_0.5_R1", "", "line 2, column recording.*found nothing"),
        ("recordings.csv", "recording,", "name,", "unknown column 'name': expected recording,table,.*found 'name,"),
        ("recordings.csv", "recording,table", "table", "no column 'recording'"),
        ("recordings.csv", "table,number", "number,number", "column given twice"),
        ("garments.csv", ",72", ",heavy", "line 2, column weight_g.*above zero.*found 'heavy'"),
        ("garments.csv", ",72", ",-72", "line 2, column weight_g.*above zero.*found '-72'"),
        ("garments.csv", ",72", ",nan", "line 2, column weight_g.*above zero.*found 'nan'"),
        ("garments.csv", "b,FelShirt", "a,FelShirt", "line 3, column letter.*twice.*a, also in line 2"),
        ("garments.csv", "b,FelShirt", "b,BlueShirt", "line 3, column garment.*twice"),
        ("garments.csv", "b,FelShirt", "b,Fel Shirt", "line 3, column garment.*word.*'Fel Shirt'"),
        ("garments.csv", "blue", '"blue', "garments.csv: not a CSV file"),
        ("garments.csv", ",", ";", "unknown column 'letter;garment'"),
        ("holdings.csv", "b,Corner", ",Corner", "line 3, column letter.*found nothing"),
    ],
)
def test_a_wrong_cell_is_named_with_file_line_and_column(
    folder: Path, file: str, old: str, new: str, message: str
) -> None:
    edit(folder / file, old, new)
    with pytest.raises(CatalogError, match=message) as caught:
        Catalog.load(folder)
    assert caught.value.where is not None
    assert str(folder / file) in caught.value.where


def test_a_missing_or_foreign_file_is_named(folder: Path) -> None:
    (folder / "garments.csv").write_bytes(b"letter,garment\na,\xff\n")
    with pytest.raises(CatalogError, match="UTF-8"):
        Catalog.load(folder)
    (folder / "garments.csv").unlink()
    with pytest.raises(CatalogError, match=r"garments\.csv: table missing"):
        Catalog.load(folder)
    assert len(Catalog.load(folder, strict=False).tables.problems) == 1, "no row contradicts a table that is not there"


def test_all_problems_are_counted_and_as_much_as_possible_is_kept(folder: Path) -> None:
    edit(folder / "garments.csv", ",72", ",heavy")
    edit(folder / "recordings.csv", "1,e,d,no", "one,e,d,nope")
    edit(folder / "recordings.csv", "BlackShorts_Free_pi16_0.5_R1", "BlackShorts_Free_R1")
    with pytest.raises(CatalogError, match="3 more problems: `garment lint` lists them all"):
        Catalog.load(folder)
    catalog = Catalog.load(folder, strict=False)
    assert [(problem.line, problem.column) for problem in catalog.tables.problems] == [
        (2, "weight_g"),
        (2, "number"),
        (2, "dvd"),
        (3, "recording"),
    ]
    assert len(catalog.rows) == 45
    assert catalog.row("BlackShorts_Belt_pi16_0.5_R1").dvd is None
    blue = catalog.row("BlueShirt_Free_pi16_0.5_R1")
    assert (blue.weight_kg, blue.width_m) == (None, 0.47)


# Where the tables come from


def test_the_nearest_workspace_is_used_else_the_packaged_tables(
    tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "recordings.csv").write_text("recording\n")
    deep = tmp_path / "a" / "b"
    deep.mkdir(parents=True)
    monkeypatch.chdir(deep)
    assert len(Catalog.load().rows) == 46, "a folder with a catalog but no pipelines is no workspace"
    (tmp_path / "pipelines").mkdir()
    assert Catalog.load().folder == folder
    assert Catalog.load().rows == ()


def test_a_moved_catalog_is_found(tmp_path: Path, folder: Path) -> None:
    moved = folder.rename(tmp_path / "tables")
    settings = tmp_path / "garment.toml"
    settings.write_text('[paths]\ncatalog = "tables"\n')
    assert nearest_catalog(tmp_path) == moved
    settings.write_text("")
    assert nearest_catalog(tmp_path) == tmp_path / "catalog"
    for text in ("[paths", "[paths]\ncatalog = 1\n", "paths = 1\n"):
        settings.write_text(text)
        with pytest.raises(WorkspaceError, match=re.escape(str(settings))):
            nearest_catalog(tmp_path)


# Questions


def test_a_query_is_a_table_with_types_and_units(thesis: Catalog, put: Callable[..., Path]) -> None:
    import pandas as pd

    catalog = thesis.with_folder(put("MyTowel_Free_0.5_R1.bag", "towel16_0.1_0006_R2.bag"))
    table = catalog.query()
    assert list(table.columns) == [*ROW_KEYS, "path"]
    assert {name: str(kind) for name, kind in table.dtypes.items()} == {
        "recording": "string",
        "garment": "category",
        "holding": "category",
        "repeat": "Int64",
        "swing_rad": "float64",
        "speed": "float64",
        "axis": "category",
        "topics_file": "Int64",
        "dvd": "boolean",
        "table": "category",
        "partner": "string",
        "garment_kind": "category",
        "color": "category",
        "width_m": "float64",
        "height_m": "float64",
        "weight_kg": "float64",
        "in_tables": "boolean",
        "state": "category",
        "path": "string",
    }
    assert table.attrs["units"] == ROW_UNITS
    for row, record in zip(catalog.rows, table.to_dict("records"), strict=True):
        plain = row.record()
        assert {name: None if pd.isna(value) else value for name, value in record.items()} == plain
    assert table.query("axis == 'R' and dvd").shape[0] == 10


@pytest.mark.parametrize(
    ("terms", "count"),
    [
        ([], 46),
        (["axis=R"], 26),
        (["axis=B"], 20),
        (["garment=GreenTowel", "axis=R"], 11),
        (["GreenTowel_Ruler_*"], 5),
        (["dvd=yes"], 15),
        (["partner="], 6),
        (["swing_rad=pi16"], 46),
        (["speed=0.50", "color=red", "holding=Belt,Collar"], 4),
        (["weight_kg=0.045"], 17),
        (["in_tables=no"], 0),
    ],
)
def test_what_terms_select_and_what_keywords_select_is_the_same(thesis: Catalog, terms: list[str], count: int) -> None:
    rows = thesis.select(terms)
    assert len(rows) == count
    table = thesis.query(*terms)
    assert list(table["recording"]) == [row.recording for row in rows]
    assert list(table.dtypes) == list(thesis.query().dtypes), "whatever is asked for, the types are the same"


def test_keywords_and_terms_go_together(thesis: Catalog) -> None:
    assert len(thesis.query("GreenTowel_*", axis="R", repeat=[1, 2], dvd=True)) == 3
    with pytest.raises(FilterError, match="axis"):
        thesis.query(axes="R")


@pytest.mark.parametrize(
    ("filters", "message"),
    [
        ({"garment": "GreenTowl"}, r"garment=GreenTowl: no such garment: .*Did you mean garment=GreenTowel\?"),
        ({"garment": ["GreenTowel", "RedSkrt"]}, r"found 'RedSkrt'\. Did you mean garment=RedSkirt\?"),
        ({"holding": "ruler"}, r"Did you mean holding=Ruler\?"),
        ({"axis": "Q"}, "no such axis: expected one of R, B, found 'Q'"),
        ({"color": "gren"}, r"Did you mean color=green\?"),
        (
            {"recording": "GreenTowl_Free_pi16_0.5_R1"},
            r"expected one of the 46 that there are, .*mean recording=GreenTo",
        ),
        ({"state": "present"}, r"state=present: no folder of recordings was looked at\. `catalog\.with_folder"),
        ({"axes": "R"}, r"no such key: .*Did you mean axis=R\?"),
    ],
)
def test_a_typing_error_is_no_empty_table(thesis: Catalog, filters: dict[str, Any], message: str) -> None:
    with pytest.raises(FilterError, match=message) as caught:
        thesis.query(**filters)
    assert "\n" not in str(caught.value)


def test_states_are_known_once_a_folder_was_looked_at(thesis: Catalog, put: Callable[..., Path]) -> None:
    catalog = thesis.with_folder(put("GreenTowel_Free_pi16_0.5_R1.bag", "MyTowel_Free_0.5_R1.bag"))
    assert list(catalog.query(state="present")["recording"]) == ["GreenTowel_Free_pi16_0.5_R1"]
    assert list(catalog.query(garment="MyTowel")["recording"]) == ["MyTowel_Free_0.5_R1"], "no table has this garment"
    with pytest.raises(
        FilterError, match=r"expected one of present, missing, unexpected.*Did you mean state=present\?"
    ):
        catalog.query(state="presnt")
    assert catalog.query(in_tables=False, state="missing").empty, "words that are known, and nothing that has them all"


def test_a_glob_that_looks_like_nothing_is_said_beside_what_is_found(thesis: Catalog) -> None:
    assert thesis.select(["GreenTowl_*"]) == ()
    with pytest.warns(DataWarning, match=r"no recording looks like 'RedSkrt_\*'; the nearest is RedSkirt_"):
        assert len(thesis.select(["GreenTowel_*", "RedSkrt_*"])) == 17


@pytest.mark.parametrize(
    ("term", "reason"),
    [
        ("weight_kg>100", "'weight_kg>100' holds of none: weight_kg is 0.045 kg to 0.446 kg"),
        ("swing_rad<0.1", "'swing_rad<0.1' holds of none: swing_rad is 0.19635 rad"),
        ("speed>1", "'speed>1' holds of none: speed is 0.5"),
        ("axis=R", None),
    ],
)
def test_numbers_that_nothing_has_are_answered_with_those_there_are(
    thesis: Catalog, term: str, reason: str | None
) -> None:
    assert thesis.why_nothing([term]) == reason


def test_one_recording_is_found_in_any_form_of_its_name(thesis: Catalog) -> None:
    for text in ("FelShirt_Free_pi16.0.5_B1.bag", "FelShirt_Free_pi16_0.5_B1"):
        assert thesis.row(text).recording == "FelShirt_Free_pi16_0.5_B1"
    with pytest.raises(CatalogError, match=r"Did you mean FelShirt_Free_pi16_0\.5_B1\?"):
        thesis.row("FeltShirt_Free_pi16_0.5_B1")
    with pytest.raises(CatalogError, match="garment list"):
        thesis.row("Entirely_Else_3_B1")
    with pytest.raises(RecordingNameError, match=r"Did you mean FelShirt_Free_pi16_0\.5_B1"):
        thesis.row("FelShirt Free pi16 0.5 B1")


@pytest.mark.parametrize(
    ("recording", "garment", "holding"),
    [
        ("GreenTowel_Corner_01_pi16_0.5_R1", "GreenTowel", "Corner"),
        ("MyTowel_Free_0.5_R1", "MyTowel", "Free"),
        ("towel16_0.1_0006_R2", "towel16", "unspecified"),
    ],
)
def test_results_are_partitioned_by_words_that_are_never_null(
    thesis: Catalog, tmp_path: Path, recording: str, garment: str, holding: str
) -> None:
    (tmp_path / f"{recording}.bag").touch()
    row = thesis.with_folder(tmp_path).row(recording)
    assert row.partition == {"garment": garment, "holding": holding}
    assert list(row.labels) == [column.name for column in IDENTITY]


def test_labels_fill_the_identity_columns(thesis: Catalog) -> None:
    labels = thesis.row("GreenTowel_Corner_01_pi16.0.5_R1.bag").labels
    assert list(labels.values()) == ["GreenTowel_Corner_01_pi16_0.5_R1", "R", 0.5, 1, math.pi / 16]


def test_an_empty_scene_has_labels_and_a_partition_of_its_own(thesis: Catalog) -> None:
    scene = thesis.background(1)
    assert list(scene.labels) == [column.name for column in IDENTITY]
    assert list(scene.labels.values()) == ["camera_default_0", None, None, None, None]
    assert scene.partition == {"garment": "camera_default", "holding": "unspecified"}


# Backgrounds


def test_an_interval_of_a_recording_may_be_the_background(folder: Path, put: Callable[..., Path]) -> None:
    rows = ["1,camera_default_7,,", "2,My_Towel_0.5_B2.bag,0.5,2", "3,camera_default_2,1,"]
    (folder / "backgrounds.csv").write_text("\n".join(["topics_file,source,from_s,to_s", *rows]), "utf-8")
    bags = put("My_Towel_0.5_B2.bag", "camera_default_7.bag")
    backgrounds = Catalog.load(folder).with_folder(bags).backgrounds
    assert {number: str(found) for number, found in backgrounds.items()} == {
        1: "camera_default_7",
        2: "My_Towel_0.5_B2, 0.5 s to 2 s",
        3: "camera_default_2, 1 s to its end",
        8: "camera_default_7",
    }
    assert [found.path is None for found in backgrounds.values()] == [False, False, True, False]
    assert (backgrounds[2].from_s, backgrounds[2].to_s) == (0.5, 2.0)


def test_without_the_table_the_bag_of_the_position_is_the_background(folder: Path) -> None:
    (folder / "backgrounds.csv").unlink()
    assert {number: found.source for number, found in Catalog.load(folder).backgrounds.items()} == {
        1: "camera_default_0"
    }


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("0,camera_default_0,,", "line 2, column topics_file: .*number of a topics file.*'0'"),
        ("1,nonsense,,", "line 2, column source: .*the name of a bag.*nonsense"),
        ("1,My_Towel_0.5_B2,,", "line 2, column to_s: a recording without an interval"),
        ("1,My_Towel_0.5_B2,2,1.5", "line 2, column to_s: an interval that holds nothing: expected more than 2"),
        ("1,camera_default_0,-1,", "line 2, column from_s: .*seconds after its first image"),
        ("1,camera_default_0,,\n1,camera_default_1,,", "line 3, column topics_file: row given twice"),
    ],
)
def test_a_background_that_makes_no_sense_is_refused(folder: Path, row: str, message: str) -> None:
    (folder / "backgrounds.csv").write_text(f"topics_file,source,from_s,to_s\n{row}\n", "utf-8")
    with pytest.raises(CatalogError, match=message):
        Catalog.load(folder)
    assert len(Catalog.load(folder, strict=False).tables.backgrounds) <= 1
