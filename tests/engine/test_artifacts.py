"""Laws of result files: what the content digest sees, and what a file says of itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from garment_dataset.engine.artifacts import content_digest, read_artifact, read_provenance, write_artifact
from garment_dataset.engine.errors import ResultDamagedError, StoreError

if TYPE_CHECKING:
    from pathlib import Path

ROWS = st.lists(
    st.fixed_dictionaries(
        {
            "number": st.none() | st.integers(-(2**31), 2**31 - 1),
            "length_m": st.none() | st.floats(allow_nan=False, allow_infinity=False),
            "text": st.none() | st.text(max_size=5),
            "flag": st.none() | st.booleans(),
            "parts": st.none() | st.lists(st.integers(0, 9), max_size=3),
            "blob": st.none() | st.binary(max_size=4),
        }
    ),
    max_size=8,
)
TYPES: dict[str, pa.DataType] = {
    "number": pa.int64(),
    "length_m": pa.float64(),
    "text": pa.string(),
    "flag": pa.bool_(),
    "parts": pa.list_(pa.int32()),
    "blob": pa.binary(),
}
SCHEMA = pa.schema(TYPES)


def table_of(rows: list[dict[str, object]]) -> pa.Table:
    return pa.Table.from_pylist(rows, schema=SCHEMA)


@settings(deadline=None)  # the first example also pays for loading Arrow's functions
@given(ROWS, st.data())
def test_chunks_slices_and_metadata_make_no_difference(rows: list[dict[str, object]], data: st.DataObject) -> None:
    table = table_of(rows)
    cut = data.draw(st.integers(0, len(rows)))
    padded = table_of([dict.fromkeys(SCHEMA.names), *rows, *rows[:1]])
    pieces = pa.concat_tables([table.slice(0, cut), table.slice(cut)]).replace_schema_metadata({"a": "b"})
    assert content_digest(pieces) == content_digest(table)
    assert content_digest(padded.slice(1, len(rows))) == content_digest(table)


@given(ROWS, ROWS)
def test_equal_digests_mean_equal_rows(first: list[dict[str, object]], second: list[dict[str, object]]) -> None:
    one, two = table_of(first), table_of(second)
    # -0.0 equals 0.0 for Python, but not for a digest of values
    same = repr(one.to_pylist()) == repr(two.to_pylist())
    assert (content_digest(one) == content_digest(two)) == same


@pytest.mark.parametrize(
    ("one", "two"),
    [
        ({"x": pa.array([1, 2], pa.int32())}, {"x": pa.array([1, 2], pa.int64())}),
        ({"x": pa.array([1.0])}, {"y": pa.array([1.0])}),
        ({"x": pa.array(["ab", "c"])}, {"x": pa.array(["a", "bc"])}),
        ({"x": pa.array([[1, 2], [3]])}, {"x": pa.array([[1], [2, 3]])}),
        ({"x": pa.array([[], None], pa.list_(pa.int8()))}, {"x": pa.array([None, []], pa.list_(pa.int8()))}),
        ({"x": pa.array([None], pa.string())}, {"x": pa.array([""], pa.string())}),
        ({"x": pa.array([0.0])}, {"x": pa.array([-0.0])}),
    ],
)
def test_what_differs_has_another_digest(one: dict[str, pa.Array], two: dict[str, pa.Array]) -> None:  # type: ignore[type-arg]
    assert content_digest(pa.table(one)) != content_digest(pa.table(two))


def test_what_stands_under_a_null_makes_no_difference() -> None:
    values = pa.array([1, 7, 3], pa.int32())
    masked = pa.Array.from_buffers(pa.int32(), 3, [pa.py_buffer(b"\x05"), values.buffers()[1]])
    assert content_digest(pa.table({"x": masked})) == content_digest(
        pa.table({"x": pa.array([1, None, 3], pa.int32())})
    )


def test_a_digest_is_the_same_next_year() -> None:
    table = table_of([{"number": 1, "length_m": 0.5, "text": "a", "flag": True, "parts": [1], "blob": b"x"}])
    assert content_digest(table) == "e5fdd6a74d3da597fd76031cbaede5e26cf105d804bb65554d3460851d2e09d6"


@given(rows=ROWS)
def test_a_file_reads_back_as_written(tmp_path_factory: pytest.TempPathFactory, rows: list[dict[str, object]]) -> None:
    path = tmp_path_factory.mktemp("artifact") / "a.parquet"
    table = table_of(rows)
    write_artifact(table, path, {"key": "k", "facts": {"params": {"alpha": 0.5}}})
    assert content_digest(read_artifact(path)) == content_digest(table)
    assert read_provenance(path) == {"key": "k", "facts": {"params": {"alpha": 0.5}}}


def test_equal_tables_make_equal_bytes(tmp_path: Path) -> None:
    rows: list[dict[str, object]] = [{"number": i, "length_m": i / 7, "text": "abc"} for i in range(1000)]
    whole = table_of(rows)
    pieces = pa.concat_tables([whole.slice(0, 10), whole.slice(10)])
    write_artifact(whole, tmp_path / "one", {"b": 1, "a": 2})
    write_artifact(pieces, tmp_path / "two", {"a": 2, "b": 1})
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_files_of_others_are_refused(tmp_path: Path) -> None:
    foreign, broken = tmp_path / "foreign.parquet", tmp_path / "broken.parquet"
    pq.write_table(pa.table({"x": [1]}), foreign)
    broken.write_bytes(b"PAR1 and then nothing")
    for path in (foreign, broken, tmp_path / "absent.parquet"):
        with pytest.raises(StoreError, match=path.name):
            read_provenance(path)
    with pytest.raises(ResultDamagedError, match="broken"):
        read_artifact(broken)
    with pytest.raises(ResultDamagedError, match="not what was stored"):
        read_artifact(foreign, "0" * 64)
