"""Differences of planted tables: known answers, and what must hold whatever the tables."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.features.comparison import ColumnDifference, TableDifference, compare_tables, compare_variants

if TYPE_CHECKING:
    from pathlib import Path

THINGS = TableSpec(
    "things",
    1,
    "one thing",
    (
        Column("frame", "int32", "1", "which"),
        Column("x_m", "float64", "m", "where", True, "x_std_m"),
        Column("x_std_m", "float64", "m", "how well", True),
        Column("word", "string", "", "a word", True),
    ),
    keys=("frame",),
)
ORDERED = dataclasses.replace(THINGS, keys=())
A = pd.DataFrame({"frame": [0, 1, 2, 3], "x_m": [1.0, 2.0, np.nan, 4.0], "x_std_m": 3.0, "word": list("abcd")})
B = pd.DataFrame({"frame": [9, 3, 2, 1], "x_m": [5.0, 4.0, 3.0, 7.0], "x_std_m": 4.0, "word": ["z", "d", None, "x"]})


def compared(a: pd.DataFrame, b: pd.DataFrame, spec: TableSpec = THINGS) -> TableDifference:
    return compare_tables(spec, spec, [(a, b)])


def of(found: TableDifference, name: str) -> ColumnDifference:
    return next(column for column in found.columns if column.column == name)


def one_column(kind: str, a: Any, b: Any, unit: str = "1") -> ColumnDifference:
    """Compare a column of files, as they are read back."""
    column = Column("value", kind, unit, "", nullable=True)
    spec = TableSpec("values", 1, "one", (column,))
    left, right = (pd.DataFrame({"value": values}) for values in (a, b))
    return compare_tables(spec, spec, [(left, right)]).columns[0]


def test_rows_are_matched_by_their_keys() -> None:
    found = compared(A, B)
    assert (found.results, found.rows, found.rows_only_a, found.rows_only_b) == (1, 3, 1, 1)
    assert [column.column for column in found.columns] == ["x_m", "x_std_m", "word"]
    x = of(found, "x_m")
    assert (x.unit, x.differing, x.only_a, x.only_b, x.largest) == ("m", 2, 0, 1, 5.0)
    assert [x.rms, x.rms_in_std] == pytest.approx([5 / np.sqrt(2), 1 / np.sqrt(2)])
    assert of(found, "x_std_m") == ColumnDifference("x_std_m", "m", 3, 0, 0, 1.0, 1.0, None)
    assert of(found, "word") == ColumnDifference("word", "", 2, 1, 0, None, None, None)


def test_rows_without_keys_are_matched_by_their_order() -> None:
    found = compared(A, B[:3], ORDERED)
    assert (found.rows, found.rows_only_a, found.rows_only_b) == (3, 1, 0)
    assert of(found, "frame").largest == 9
    assert [of(found, "x_m").rms] == pytest.approx([np.sqrt((4**2 + 2**2) / 2)])


def test_rows_of_equal_keys_are_matched_by_their_order() -> None:
    twice = pd.concat([A, A.assign(x_m=A["x_m"] + 1)])
    assert compared(twice, twice).is_none
    found = compared(twice, A)
    assert (found.rows, found.rows_only_a, found.rows_only_b) == (4, 4, 0)
    assert found.differing == ()


def test_files_are_summed_up() -> None:
    more = A.assign(x_m=A["x_m"] + 2.0)
    found = compare_tables(THINGS, THINGS, [(A, A), (A, more), (A, B)])
    assert (found.results, found.rows, found.rows_only_a, found.rows_only_b) == (3, 11, 1, 1)
    x = of(found, "x_m")
    assert (x.differing, x.only_b, x.largest) == (3 + 2, 1, 5.0)
    assert [x.rms] == pytest.approx([np.sqrt((3 * 2**2 + 5**2) / (3 + 3 + 2))])


def test_no_file_in_common_says_nothing() -> None:
    found = compare_tables(THINGS, THINGS, [])
    assert (found.results, found.rows, of(found, "x_m").rms, of(found, "x_m").rms_in_std) == (0, 0, None, None)


def test_an_uncertainty_of_nothing_is_none() -> None:
    nothing = A.assign(x_std_m=0.0)
    assert of(compared(nothing, nothing.assign(x_m=7.0)), "x_m").rms_in_std is None
    assert of(compared(A, A.assign(x_std_m=None, x_m=7.0)), "x_m").rms_in_std is None


def test_stamps_are_subtracted_to_the_nanosecond() -> None:
    stamps = np.array([1_400_000_000_000_000_001, 1_400_000_000_000_000_003])
    some, all_of_them = (pd.array(values, dtype="Int64") for values in ([stamps[0], None], stamps + 7))
    assert one_column("int64", stamps, stamps - 2, "ns").largest == 2.0
    found = one_column("int64", some, all_of_them, "ns")
    assert (found.differing, found.only_b, found.largest) == (2, 1, 7.0)


def test_unsigned_numbers_do_not_wrap() -> None:
    low, high = (np.array([value], dtype=np.uint8) for value in (3, 5))
    assert one_column("uint8", low, high).largest == one_column("uint8", high, low).largest == 2.0


def test_infinite_numbers_differ_without_a_size() -> None:
    found = one_column("float64", [np.inf, np.inf, 1.0], [np.inf, 0.0, 1.5])
    assert (found.differing, found.largest) == (2, 0.5)


@pytest.mark.parametrize(
    ("kind", "a", "b", "differing"),
    [
        ("bool", [True, False, None], [True, True, None], 1),
        ("binary", [b"a", b"b"], [b"a", b"c"], 1),
        ("list<float64>", [np.array([1.0, np.nan]), np.array([1.0])], [np.array([1.0, np.nan]), np.zeros(2)], 1),
        ("list<string>", [np.array(["a"], object), np.array([], object)], [np.array(["b"], object)] * 2, 2),
        ("string", [None, "a", "b"], ["a", None, "b"], 2),
    ],
)
def test_of_what_is_no_number_it_is_counted_how_many_differ(kind: str, a: Any, b: Any, differing: int) -> None:
    found = one_column(kind, a, b)
    assert (found.differing, found.rms, found.largest) == (differing, None, None)
    assert one_column(kind, a, a).differing == 0


def test_a_column_that_a_file_lacks_has_no_value_there() -> None:
    found = compared(A, A.drop(columns="x_std_m"))
    std = of(found, "x_std_m")
    assert (std.differing, std.only_a, std.rms) == (4, 4, None)
    assert of(found, "x_m").differing == 0
    assert of(found, "x_m").rms_in_std is None


def test_tables_of_different_stages_are_compared_in_what_both_say() -> None:
    """One measures in millimetres what the other does in metres, and neither calls its uncertainty alike."""
    other = TableSpec(
        "things",
        1,
        "one thing",
        (
            Column("x_m", "float64", "mm", "where, in the wrong unit", True),
            Column("frame", "int64", "1", "which"),
            Column("x_std_m", "float64", "m", "how well", True),
            Column("new", "string", "", "another"),
        ),
        keys=("frame", "new"),
    )
    found = compare_tables(THINGS, other, [(A, B.rename(columns={"word": "new"}))])
    assert (found.columns_only_a, found.columns_only_b) == (("x_m", "word"), ("x_m", "new"))
    assert [column.column for column in found.columns] == ["x_std_m"]
    assert (found.rows, found.is_none) == (3, False)
    same_name = dataclasses.replace(other.columns[0], unit="m")
    renamed = dataclasses.replace(other, columns=(same_name, *other.columns[1:]))
    assert of(compare_tables(THINGS, renamed, [(A, B)]), "x_m").rms_in_std is None


def write(folder: Path, tables: dict[str, pd.DataFrame]) -> Path:
    for name, rows in tables.items():
        path = folder / "things" / "garment=G" / f"{name}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(pa.Table.from_pandas(rows, preserve_index=False), path)
    return folder


def test_files_that_one_variant_has_alone_are_named(tmp_path: Path) -> None:
    folders = (
        write(tmp_path / "a", {"first": A, "second": A, "third": A}),
        write(tmp_path / "b", {"second": B, "other": B, "third": A}),
    )
    specs = {"things": (THINGS, THINGS), "nothing": (ORDERED, ORDERED)}
    (found,) = compare_variants(folders, specs)
    assert (found.results, found.results_only_a, found.results_only_b) == (2, ("first",), ("other",))
    assert (found.rows, found.rows_only_a, found.rows_only_b) == (7, 1, 1), "of common files alone"
    (chosen,) = compare_variants(folders, specs, {"third", "nowhere"})
    assert chosen.is_none
    assert (chosen.results, chosen.rows) == (1, 4)
    (alone,) = compare_variants(folders, specs, {"other"})
    assert (alone.results, alone.results_only_b, alone.is_none) == (0, ("other",), False)
    assert list(compare_variants(folders, specs, set())) == []


values = st.one_of(st.none(), st.floats(-1e6, 1e6))
words = st.sampled_from(["a", "b", None])
rows = st.lists(
    st.tuples(st.integers(0, 5), values, st.one_of(st.none(), st.just(0.0), st.floats(1e-6, 1e3)), words),
    max_size=8,
)


def frame(found: list[tuple[Any, ...]]) -> pd.DataFrame:
    kinds = {"frame": "int32", "x_m": "float64", "x_std_m": "float64", "word": "object"}
    return pd.DataFrame(found, columns=list(kinds)).astype(kinds)


@pytest.mark.parametrize("spec", [THINGS, ORDERED], ids=["keys", "order"])
@given(first=rows, second=rows)
def test_a_difference_has_two_sides(
    spec: TableSpec, first: list[tuple[Any, ...]], second: list[tuple[Any, ...]]
) -> None:
    a, b = frame(first), frame(second)
    assert compared(a, a, spec).is_none
    there, back = compared(a, b, spec), compared(b, a, spec)
    assert there.rows + there.rows_only_a == len(a)
    assert there.rows + there.rows_only_b == len(b)
    assert (there.rows, there.rows_only_a, there.rows_only_b) == (back.rows, back.rows_only_b, back.rows_only_a)
    for one, other in zip(there.columns, back.columns, strict=True):
        assert dataclasses.replace(one, only_a=one.only_b, only_b=one.only_a) == other
