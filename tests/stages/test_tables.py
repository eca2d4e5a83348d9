"""The tables' specifications: units everywhere, nulls for what is missing, and refusal of what does not fit."""

from __future__ import annotations

import importlib
import re

import numpy as np
import pyarrow as pa
import pytest

from garment_dataset.engine.table import Column, Label, TableSpec, arrow_type
from garment_dataset.errors import TableError
from garment_dataset.stages import STAGES, Stage
from garment_dataset.stages.stage import IDENTITY

SHIPPED: list[Stage] = [importlib.import_module(f"garment_dataset.stages.{name}").STAGE for name in STAGES]
SPECS = [output for stage in SHIPPED for output in stage.outputs]
LABELS = [Label(column, value) for column, value in zip(IDENTITY, ("A_B_0.5_R1", "R", 0.5, None, None), strict=True)]
UNITS = {"m", "mm", "s", "ns", "px", "px2", "rad", "m/s", "m/s2", "rad/s", "kg", "byte", "1", "", "level", "1/m"}
SUFFIXES = {
    **{f"_{unit}": unit for unit in ("ns", "px", "px2", "rad", "mm", "kg")},
    "_m_s": "m/s",
    "_m_s2": "m/s2",
    "_rad_s": "rad/s",
    "_bytes": "byte",
    "_per_m": "1/m",
}

SPEC = TableSpec(
    "things",
    1,
    "one thing",
    (
        Column("frame", "int32", "1", "index of the frame"),
        Column("x_m", "float64", "m", "position", nullable=True),
        Column("parts", "list<float64>", "1", "some numbers", nullable=True),
    ),
)


@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec.name)
def test_every_column_has_a_unit_and_a_description(spec: TableSpec) -> None:
    for field in spec.schema(IDENTITY):
        assert field.metadata is not None
        unit, description = field.metadata[b"unit"].decode(), field.metadata[b"description"].decode()
        assert unit in UNITS, field.name
        assert len(description) > 3, field.name
        assert unit or not pa.types.is_floating(field.type), field.name


@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec.name)
def test_names_agree_with_units(spec: TableSpec) -> None:
    for column in spec.columns:
        suffix = re.search(r"(_per_m|_m_s2|_m_s|_rad_s|_ns|_px|_px2|_rad|_bytes|_mm|_kg|_m|_s)$", column.name)
        if suffix is not None:
            expected = {**SUFFIXES, "_m": "m", "_s": "s"}[suffix[1]]
            assert column.unit == expected, column.name
        else:
            assert column.unit in {"1", "", "level"}, column.name


def test_names_of_tables_are_their_own() -> None:
    assert len({spec.name for spec in SPECS}) == len(SPECS) > 5


def test_nan_and_masked_values_become_null() -> None:
    columns = {
        "frame": np.ma.masked_array([1, 2], [False, False]),
        "x_m": np.array([np.nan, 0.5]),
        "parts": [[1.0], None],
    }
    table = SPEC.table(columns)
    assert table["x_m"].to_pylist() == [None, 0.5]
    assert table["parts"].to_pylist() == [[1.0], None]
    masked = np.ma.masked_array([1.0, 2.0], [True, False])
    assert SPEC.table({**columns, "x_m": masked})["x_m"].to_pylist() == [None, 2.0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x_m": None}, "missing"),
        ({"extra": [1, 2]}, "unknown"),
        ({"frame": [1]}, "unequal length"),
        ({"frame": [1, None]}, "null in a column without nulls"),
        ({"frame": [1, 2**40]}, r"things\.frame"),
        ({"frame": ["a", "b"]}, r"things\.frame"),
    ],
)
def test_what_does_not_fit_is_refused(change: dict[str, object], message: str) -> None:
    columns: dict[str, object] = {"frame": [1, 2], "x_m": [0.1, 0.2], "parts": [[], []]}
    columns |= change
    columns = {name: values for name, values in columns.items() if values is not None}
    with pytest.raises(TableError, match=message):
        SPEC.table(columns)


def test_identity_columns_come_first_and_are_typed() -> None:
    table = SPEC.labelled(SPEC.table({"frame": [1, 2], "x_m": [0.1, 0.2], "parts": [[], []]}), LABELS)
    assert table.schema.equals(SPEC.schema(IDENTITY), check_metadata=True)
    assert table.column_names[: len(IDENTITY)] == [column.name for column in IDENTITY]
    assert table["recording"].to_pylist() == ["A_B_0.5_R1"] * 2
    assert table["repeat"].to_pylist() == [None, None]
    empty = SPEC.labelled(SPEC.table({"frame": [], "x_m": [], "parts": []}), LABELS)
    assert empty.num_rows == 0
    assert empty.schema.equals(SPEC.schema(IDENTITY))


def test_a_table_of_another_schema_is_refused() -> None:
    with pytest.raises(TableError, match="not a table of this schema"):
        SPEC.labelled(pa.table({"frame": [1]}), LABELS)


@pytest.mark.parametrize(
    ("columns", "keys", "message"),
    [
        ((Column("a", "int32", "1", "a"), Column("a", "int32", "1", "a")), (), "given twice"),
        ((Column("a", "int32", "1", "a"),), ("b",), r"no such column.*\['b'\]"),
        ((Column("a_m", "float64", "m", "a", uncertainty="a_std_m"),), (), "a_std_m"),
    ],
)
def test_a_specification_that_contradicts_itself_is_refused(
    columns: tuple[Column, ...], keys: tuple[str, ...], message: str
) -> None:
    with pytest.raises(TableError, match=message):
        TableSpec("things", 1, "one thing", columns, keys)


@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec.name)
def test_a_standard_uncertainty_is_in_the_unit_of_what_it_is_of(spec: TableSpec) -> None:
    units = {column.name: column.unit for column in spec.columns}
    of = {column.uncertainty: column for column in spec.columns if column.uncertainty}
    assert {name for name in units if "_std" in name and name != "std"} == set(of)
    assert all(units[name] == column.unit for name, column in of.items())


def test_types_are_named_as_arrow_names_them() -> None:
    assert arrow_type("float64") == pa.float64()
    assert arrow_type("list<int32>") == pa.list_(pa.field("element", pa.int32(), nullable=False))
    with pytest.raises(TableError, match="furlong"):
        arrow_type("furlong")


def test_the_description_repeats_the_schema() -> None:
    described = SPEC.describe(IDENTITY, ["garment"])
    assert described["partitions"] == ["garment"]
    assert described["table"] == "things"
    columns = described["columns"]
    assert isinstance(columns, list)
    assert [column["name"] for column in columns] == SPEC.schema(IDENTITY).names
