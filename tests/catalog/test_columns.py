"""Columns of one's own: kept, typed, shown and asked for; and refused where they would be taken for something else."""

from __future__ import annotations

import json
import math
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from garment_dataset.catalog import ROW_KEYS, Catalog
from garment_dataset.catalog.columns import RESERVED, CellError, Column, name_complaint, parse_cell
from garment_dataset.catalog.tables import Background, Garment, Holding, Recording
from garment_dataset.cli import application
from garment_dataset.errors import CatalogError, FilterError
from garment_dataset.features.quality import QUALITY_KEYS
from garment_dataset.workspace import Workspace
from garment_dataset.workspace.session import Session

GARMENTS = "letter,garment,kind,fabric,stiffness_n_m\na,Scarf,scarf,wool,0.25\nb,Towel,towel,cotton,\n"
HOLDINGS = "letter,holding,clamp_mm\na,Corner,12\nb,Edge,\n"
RECORDINGS = """recording,garment,holding,operator,day,washed
Scarf_Corner_0.5_R1,a,a,anna,2026-11-25,yes
Scarf_Edge_0.5_R1,a,b,Jose\u0301,2026-11-27,no
towel7_0.5_R1,b,,,,
"""
BACKGROUNDS = "topics_file,source,lamp\n1,camera_default_0,left\n"
SIDECAR = """
[stiffness_n_m]
type = "number"
unit = "N m"
description = "bending stiffness"
[clamp_mm]
type = "integer"
unit = "mm"
[day]
type = "date"
[washed]
type = "boolean"
"""


@pytest.fixture
def place(tmp_path: Path) -> Workspace:
    """A workspace with columns of its own in every table, and no bag."""
    made = Workspace.create(tmp_path / "ws", empty=True)
    tables = {"garments": GARMENTS, "holdings": HOLDINGS, "recordings": RECORDINGS, "backgrounds": BACKGROUNDS}
    for name, text in tables.items():
        (made.catalog_dir / f"{name}.csv").write_text(text, "utf-8")
    (made.catalog_dir / "columns.toml").write_text(SIDECAR, "utf-8")
    return made


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), "utf-8")


def run(place: Workspace, *arguments: str) -> Any:
    return CliRunner(env={"NO_COLOR": "1"}).invoke(application(), [*arguments, "-w", str(place.root)])


def names(place: Workspace, *terms: str) -> list[str]:
    return [row.recording for row in place.catalog().select(terms)]


def test_a_recording_has_the_values_of_its_garment_holding_and_camera_position(place: Workspace) -> None:
    scarf, edge, towel = place.catalog().rows
    assert dict(scarf.own) == {
        "fabric": "wool",
        "stiffness_n_m": 0.25,
        "clamp_mm": 12,
        "operator": "anna",
        "day": date(2026, 11, 25),
        "washed": True,
        "lamp": "left",
    }
    assert (edge["operator"], edge["washed"], edge["clamp_mm"]) == ("José", False, None)
    assert dict(towel.own) == dict.fromkeys(scarf.own) | {"fabric": "cotton", "lamp": "left"}


@pytest.mark.parametrize(
    ("terms", "found"),
    [
        (["operator=anna"], [0]),
        (["operator=Jos*"], [1]),
        (["operator=José"], [1]),
        (["operator=Jose\u0301"], [1]),
        (["operator="], [2]),
        (["fabric=wool", "washed=no"], [1]),
        (["stiffness_n_m>0.2"], [0, 1]),
        (["clamp_mm=12.0"], [0]),
        (["day=2026-11-25"], [0]),
        (["day>2026-11-25"], [1]),
        (["day<=2026-11-26"], [0]),
        (["day="], [2]),
        (["day!=2026-11-25"], [1, 2]),
    ],
)
def test_filters_ask_for_them(place: Workspace, terms: list[str], found: list[int]) -> None:
    rows = place.catalog().rows
    assert names(place, *terms) == [rows[index].recording for index in found]


@pytest.mark.parametrize(
    ("term", "message"),
    [
        ("operator=ana", "no such operator.*Did you mean operator=anna"),
        ("oprator=anna", "no such key.*Did you mean operator=anna"),
        ("operator>3", "compares numbers, and operator is none: expected one of .*stiffness_n_m"),
        ("washed=maybe", "not a flag"),
        ("day=25.11.2026", "not a date: expected a date such as 2026-11-25"),
        ("clamp_mm=wide", "not a number"),
    ],
)
def test_what_cannot_be_asked_is_refused_as_for_any_key(place: Workspace, term: str, message: str) -> None:
    with pytest.raises(FilterError, match=message):
        names(place, term)


def test_an_empty_answer_says_between_which_days(place: Workspace) -> None:
    assert place.catalog().why_nothing(["day>2027-01-01"]) == (
        "'day>2027-01-01' holds of none: day is 2026-11-25 to 2026-11-27"
    )


def test_every_verb_shows_them(place: Workspace) -> None:
    header, first, *_ = run(place, "list").stdout.splitlines()
    assert header.split("  ")[-1] == "lamp"
    assert "stiffness_n_m [N m]" in header
    assert first.split()[-7:] == ["wool", "0.25", "12", "anna", "2026-11-25", "yes", "left"]
    (record,) = json.loads(run(place, "list", "--json", "operator=anna").stdout)
    assert (record["stiffness_n_m"], record["day"], record["washed"]) == (0.25, "2026-11-25", True)
    columns, cells = run(place, "list", "--csv", "operator=anna").stdout.splitlines()
    values = dict(zip(columns.split(","), cells.split(","), strict=True))
    assert (values["operator"], values["path"], values["quality"]) == ("anna", "", "")
    shown = run(place, "show", "Scarf_Corner_0.5_R1").stdout
    assert "stiffness_n_m  0.25 N m (bending stiffness)" in shown
    assert json.loads(run(place, "show", "--json", "Scarf_Corner_0.5_R1").stdout)["clamp_mm"] == 12


def test_a_query_has_them_with_types_and_units(place: Workspace) -> None:
    table = place.catalog().query()
    dtypes = {name: str(table[name].dtype) for name in ("fabric", "stiffness_n_m", "clamp_mm", "day", "washed")}
    assert dtypes == {
        "fabric": "string",
        "stiffness_n_m": "float64",
        "clamp_mm": "Int64",
        "day": "datetime64[s]",
        "washed": "boolean",
    }
    assert table.attrs["units"]["stiffness_n_m"] == "N m"
    assert table["day"].isna().tolist() == [False, False, True]


def test_a_pipeline_may_choose_by_them(place: Workspace) -> None:
    (place.pipelines_dir / "depth.toml").write_text('recordings = ["operator=anna"]\nstages = ["decode"]\n')
    (place.pipelines_dir / "colour.toml").unlink()
    for row in place.catalog().rows:
        (place.recordings_dir / f"{row.recording}.bag").touch()
    with Session(place) as session:
        assert [node.subject for node in session.graph] == ["Scarf_Corner_0.5_R1"]
    assert run(place, "dag").exit_code == 0


# What is refused


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        (
            "garments.csv",
            "0.25",
            "soft",
            "garments.csv, line 2, column stiffness_n_m.*a number or nothing, found 'soft'",
        ),
        ("garments.csv", "0.25", '"0,25"', "line 2, column stiffness_n_m.*The decimal mark is a point: 0.25"),
        ("garments.csv", "0.25", "1e999", "line 2, column stiffness_n_m.*a number"),
        ("holdings.csv", "12", "12.5", "line 2, column clamp_mm.*a whole number or nothing, found '12.5'"),
        ("recordings.csv", "yes", "perhaps", "line 2, column washed.*yes or no or nothing, found 'perhaps'"),
        ("recordings.csv", "2026-11-25", "25.11.2026", "line 2, column day.*Dates are written 2026-11-25"),
        ("recordings.csv", "2026-11-25", "2026-02-30", "line 2, column day.*a date or nothing"),
        ("garments.csv", "fabric", "colour", "unknown column 'colour'.*Did you mean color"),
        ("garments.csv", "fabric", "speed", "'speed' says something else already"),
        ("garments.csv", "fabric", "", "a column without a name"),
        ("garments.csv", "fabric", "Fabric (main)", "cannot be asked for in filters.*'fabric_main'"),
        ("garments.csv", "fabric", "operator", "column 'operator' is in garments.csv, too"),
        ("columns.toml", "[day]", "[dya]", "columns.toml: no table has a column 'dya'.*Did you mean day"),
        ("columns.toml", "[day]", "[phase_of_moon]", "no table has a column 'phase_of_moon'.*Add it to the header"),
        ("columns.toml", "[day]", "[weight_g]", "'weight_g' is no column of your own.*remove the entry"),
        ("columns.toml", '"date"', '"dates"', r"entry 'day\.type' is not understood.*Did you mean date"),
        ("columns.toml", "unit =", "units =", r"entry 'stiffness_n_m\.units' is not understood.*Did you mean unit"),
        ("columns.toml", '[day]\ntype = "date"', "[day]", r"entry 'day\.type' is not understood.*found nothing"),
        ("columns.toml", "[stiffness", 'day = "date"\n[stiffness', "columns.toml: not TOML"),
        ("columns.toml", "[stiffness", "[[stiffness", "columns.toml: not TOML"),
    ],
)
def test_a_fault_is_one_line_with_file_and_line(place: Workspace, file: str, old: str, new: str, message: str) -> None:
    edit(place.catalog_dir / file, old, new)
    with pytest.raises(CatalogError, match=message):
        place.catalog()
    linted = run(place, "lint", "code=table-error")
    assert linted.exit_code == 1
    assert f"catalog/{'recordings.csv' if new == 'operator' else file}" in linted.stdout


def test_without_an_entry_a_column_is_text_whatever_it_looks_like(place: Workspace) -> None:
    (place.catalog_dir / "columns.toml").unlink()
    assert [row["day"] for row in place.catalog().rows] == ["2026-11-25", "2026-11-27", None]
    assert names(place, "clamp_mm=12") == ["Scarf_Corner_0.5_R1"]


def test_an_entry_that_is_no_table_is_told_the_form(place: Workspace) -> None:
    (place.catalog_dir / "columns.toml").write_text('day = "date"\n')
    with pytest.raises(CatalogError, match=r"entry 'day' is not understood.*Write \[day\] and below it type = 'date'"):
        place.catalog()


def test_a_typing_error_of_a_builtin_column_is_ones_own_only_where_it_is_said(place: Workspace) -> None:
    edit(place.catalog_dir / "garments.csv", "fabric", "colour")
    edit(place.catalog_dir / "columns.toml", "[day]", '[colour]\ntype = "text"\n[day]')
    assert place.catalog().rows[0]["colour"] == "wool"


def test_a_table_that_cannot_be_read_takes_no_blame_from_the_sidecar(place: Workspace) -> None:
    (place.catalog_dir / "holdings.csv").unlink()
    problems = Catalog.load(place.catalog_dir, strict=False).tables.problems
    assert {problem.path.name for problem in problems} == {"holdings.csv"}


def test_every_name_that_means_something_is_reserved() -> None:
    fields = {name for model in (Garment, Holding, Recording, Background) for name in model.model_fields}
    assert {*ROW_KEYS, *QUALITY_KEYS, *fields, "path", "why", "damage"} <= RESERVED


# Cells

numbers = st.floats(allow_nan=False, allow_infinity=False).map(repr)


@given(numbers)
def test_a_number_is_read_as_it_is_written(cell: str) -> None:
    assert parse_cell(Column("x", "t.csv", "number"), cell) == float(cell)


@given(st.integers(-(10**17), 10**17))
def test_a_whole_number_is_read_exactly(value: int) -> None:
    assert parse_cell(Column("x", "t.csv", "integer"), str(value)) == value


@given(st.dates())
def test_a_date_is_read_as_it_is_written(day: date) -> None:
    assert parse_cell(Column("x", "t.csv", "date"), day.isoformat()) == day


@given(st.sampled_from(["text", "integer", "number", "boolean", "date"]), st.text(min_size=1, max_size=12))
def test_any_cell_is_read_or_refused(kind: Any, cell: str) -> None:
    try:
        value = parse_cell(Column("x", "t.csv", kind), cell)
    except CellError as error:
        assert error.expected.endswith("or nothing")  # noqa: PT017 - most cells raise none
        return
    assert not isinstance(value, float) or math.isfinite(value)


@given(st.text(max_size=15))
def test_any_name_can_be_asked_for_or_is_refused(name: str) -> None:
    if name_complaint(name) is None:
        assert not set(name) & set("=!<>,*?[ ")
