"""Results are plain Parquet: every reader finds the same rows and types, and ours adds the units."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import duckdb
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest

from garment_dataset import load_features, open_features
from garment_dataset.catalog import Catalog
from garment_dataset.errors import DataWarning, FilterError, StoreError, UsageError
from garment_dataset.features.reading import result_params, table_description
from garment_dataset.workspace import Workspace
from tests.conftest import RECORDINGS

TABLES = ["frames", "camera", "gripper", "joints", "chains", "points", "kinematics"]


@pytest.fixture(scope="module")
def features(tmp_path_factory: pytest.TempPathFactory, sample_bags: dict[str, Path]) -> Path:
    made = Workspace.create(tmp_path_factory.mktemp("features") / "ws")
    for name, path in sample_bags.items():
        (made.recordings_dir / f"{name}.bag").symlink_to(path)
    made.build(jobs=0)
    return made.features_dir


def by_arrow(folder: Path) -> pa.Table:
    return ds.dataset(folder, partitioning="hive").to_table()


def sorted_rows(table: pa.Table) -> list[dict[str, object]]:
    names = sorted(table.column_names)
    rows = table.select(names).to_pylist()
    return sorted(rows, key=repr)


@pytest.mark.parametrize("table", TABLES)
def test_four_readers_find_the_same_rows(features: Path, table: str) -> None:
    expected = sorted_rows(by_arrow(features / table))
    assert len(expected) > 0
    pattern = str(features / table / "**" / "*.parquet")
    duck = duckdb.sql(f"SELECT * FROM read_parquet('{pattern}', hive_partitioning = true)")
    assert duck is not None
    assert sorted_rows(duck.to_arrow_table()) == expected
    assert sorted_rows(pl.read_parquet(pattern, hive_partitioning=True).to_arrow()) == expected
    frame = pd.read_parquet(features / table)
    assert len(frame) == len(expected)
    assert set(frame.columns) == set(expected[0])
    assert set(frame["recording"]) == set(RECORDINGS)


def test_nothing_but_data_is_in_the_folder_of_a_table(features: Path) -> None:
    for table in TABLES:
        files = [path for path in (features / table).rglob("*") if path.is_file()]
        assert {path.suffix for path in files} == {".parquet"}
        assert len(pl.scan_parquet(features / table).collect()) == len(by_arrow(features / table))


def test_what_describes_tables_follows_them(features: Path) -> None:
    """Of an older layout nothing is left; what no pipeline makes is described as long as its files are there."""
    workspace = Workspace.at(features.parent)
    path = features / "schemas.json"
    before = path.read_text()
    (features / "points" / "_schema.json").write_text("{}")
    (features / "foreign").mkdir()
    described = json.loads(before) | {"foreign": {"table": "foreign"}, "gone": {"table": "gone"}}
    path.write_text(json.dumps(described))
    workspace.build(jobs=0)
    assert json.loads(path.read_text()) == json.loads(before) | {"foreign": {"table": "foreign"}}
    assert not (features / "points" / "_schema.json").exists()
    (features / "foreign").rmdir()
    workspace.build(jobs=0)
    assert path.read_text() == before


@pytest.mark.parametrize("text", ["{", "[]", '{"points": 1}', "\udcff"])
def test_a_damaged_description_is_one_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "schemas.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(
        StoreError, match=r"schemas.json: schemas cannot be read: found [^\n]*\. `garment build` writes it anew\.$"
    ):
        table_description(tmp_path, "points")


@pytest.mark.parametrize("table", TABLES)
def test_types_are_the_same_for_every_reader(features: Path, table: str) -> None:
    declared = {
        column["name"]: column for column in json.loads((features / "schemas.json").read_text())[table]["columns"]
    }
    pattern = str(features / table / "**" / "*.parquet")
    polars = pl.read_parquet(pattern, hive_partitioning=True).to_arrow().schema
    arrow = by_arrow(features / table).schema
    for path in sorted((features / table).rglob("*.parquet")):
        schema = pq.read_schema(path)
        assert schema.names == list(declared)
        for field in schema:
            assert field.metadata is not None
            assert field.metadata[b"unit"].decode() == declared[field.name]["unit"]
            assert arrow.field(field.name).type == field.type
            if pa.types.is_primitive(field.type):
                assert polars.field(field.name).type == field.type
    for key in ("garment", "holding"):
        assert key not in declared
        assert pa.types.is_large_string(polars.field(key).type) or pa.types.is_string_view(polars.field(key).type)


def test_a_frame_knows_its_units(features: Path) -> None:
    frame = load_features("kinematics", folder=features)
    units = frame.attrs["units"]
    assert (units["z_m"], units["vz_m_s"], units["stamp_ns"]) == ("m", "m/s", "ns")
    assert "forward" in frame.attrs["descriptions"]["z_m"]
    assert set(frame["point"]) == set(range(6))


def test_stamps_that_may_be_missing_stay_whole(features: Path) -> None:
    frame = load_features("kinematics", folder=features)
    assert frame["velocity_stamp_ns"].dtype == "Int64"
    assert frame["repeat"].dtype == "Int32"
    assert frame["stamp_ns"].dtype == "int64"
    table = open_features("kinematics", folder=features).to_table()
    assert frame["velocity_stamp_ns"].to_list() == table["velocity_stamp_ns"].to_pylist()


def test_filters_choose_rows(features: Path) -> None:
    scarf = load_features("points", folder=features, garment="MyScarf", point=[1, 5])
    assert set(scarf["recording"]) == {"MyScarf_Corner_pi16_0.5_R1"}
    assert set(scarf["point"]) == {1, 5}
    assert len(load_features("points", folder=features, recording=list(RECORDINGS[:2]))) == 2 * 24 * 5
    assert load_features("points", folder=features, garment=["Nobody", "MyScarf"])["garment"].unique() == ["MyScarf"]
    assert open_features("points", folder=features).count_rows() == 3 * 24 * 5


def test_what_is_not_there_is_named(features: Path, tmp_path: Path) -> None:
    with pytest.raises(FilterError, match="expected one of"):
        load_features("points", folder=features, colour="red")
    with pytest.raises(StoreError, match=r"no files of table 'pionts'.*points"):
        load_features("pionts", folder=features)
    with pytest.raises(StoreError, match="garment build"):
        load_features("points", folder=tmp_path)


@pytest.mark.parametrize(
    ("table", "filters", "message"),
    [
        ("points", {"garment": "MyScraf"}, r"no such garment: expected one of GreenTowel, MyScarf.*mean MyScarf\?"),
        ("points", {"garment": ["Nobody", "None"]}, r"no such garment: .* found \['Nobody', 'None'\]\. `garment list`"),
        ("points", {"recording": "MyScarf_Corner_pi16_0.5_B1"}, r"Did you mean MyScarf_Corner_pi16_0\.5_R1\?"),
        ("points", {"axis": "Q", "point": 1}, "no such axis: expected one of B, R, found 'Q'"),
        ("gripper", {"stream": "colour"}, r"Did you mean color\?"),
        ("points", {"garmet": "MyScarf"}, r"'garmet' is no column.*Did you mean garment\?"),
    ],
)
def test_words_that_are_not_there_are_no_empty_table(
    features: Path, table: str, filters: dict[str, Any], message: str
) -> None:
    with pytest.raises(FilterError, match=message) as caught:
        load_features(table, folder=features, **filters)
    assert "\n" not in str(caught.value)


def test_what_might_be_there_and_is_not_is_an_empty_table(features: Path) -> None:
    asked: list[dict[str, Any]] = [{"axis": "B"}, {"garment": "MyScarf", "repeat": 1}, {"reason": "x"}, {"garment": []}]
    for filters in asked:
        found = load_features("points", folder=features, **filters)
        assert found.empty
        assert "z_m" in found


def test_parameters_of_a_result_are_asked_for_by_its_name(features: Path) -> None:
    assert result_params("points", RECORDINGS[0], folder=features)["method"] == "profile"
    for table, name, message in (
        ("points", "*", "garment build"),
        ("points", RECORDINGS[0].replace("Towel", "Towl"), f"Did you mean {RECORDINGS[0]}"),
        ("pionts", RECORDINGS[0], "Did you mean points"),
    ):
        with pytest.raises(StoreError, match=message):
            result_params(table, name, folder=features)


def test_a_hanging_sheet_is_found_where_it_is(features: Path) -> None:
    """The whole road, from bag to DataFrame: a sheet of 50 cm, five points in the middles of its fifths."""
    points = load_features("points", folder=features, recording=RECORDINGS[0])
    gripper = load_features("gripper", folder=features, recording=RECORDINGS[0])
    at_rest = points[points["frame"] == 0].sort_values("point")
    below = at_rest["y_m"].to_numpy() - gripper["y_m"].iloc[0]
    pitch_m = 1.065 / 142.5  # one pixel of these small images
    assert below == pytest.approx([0.05, 0.15, 0.25, 0.35, 0.45], abs=pitch_m + 0.0025)
    assert at_rest["z_m"].to_numpy() == pytest.approx(1.065, abs=0.0006)  # whole millimetres
    assert points["reason"].isna().all()


def test_paths_may_be_text_and_else_are_refused_in_one_line(features: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root = features.parent
    expected = len(load_features("points", folder=features))
    assert len(load_features("points", folder=str(features))) == expected
    monkeypatch.chdir(root)
    assert len(load_features("points", folder="features")) == expected
    assert Workspace.find(".").root == Workspace.find(root).root == Workspace.find(str(root)).root
    rows = Catalog.load("catalog").with_folder("recordings").rows
    assert [row.state for row in rows] == [row.state for row in Workspace.at(root).catalog().rows]
    for ask in (
        lambda: load_features("points", folder=3),  # type: ignore[arg-type]
        lambda: Workspace.find(3),  # type: ignore[arg-type]
        lambda: Workspace.at([root]),  # type: ignore[arg-type]
        lambda: Catalog.load(b"catalog"),  # type: ignore[arg-type]
    ):
        with pytest.raises(UsageError, match=r"^not a path: expected a path, or text, found "):
            ask()
    with pytest.raises(StoreError, match="nowhere: no such folder: expected a features folder, or a snapshot"):
        load_features("points", folder="nowhere")


@pytest.fixture
def older(features: Path, tmp_path: Path) -> Path:
    """Results of which one file is of an older version: without a column, with one that is no more."""
    folder = Path(shutil.copytree(features, tmp_path / "features"))
    path = next((folder / "points").rglob(f"{RECORDINGS[0]}.parquet"))
    table = pq.read_table(path, partitioning=None)
    metadata = {**(table.schema.metadata or {}), b"version": b"1"}
    table = table.drop_columns(["z_std_m"]).append_column("old", pa.array(range(len(table))))
    path.unlink()
    pq.write_table(table.replace_schema_metadata(metadata), path)
    return folder


def test_files_of_several_versions_are_read_as_one_and_named(older: Path) -> None:
    with pytest.warns(
        DataWarning, match=rf"points has results of several versions: 1 of version 1 \({RECORDINGS[0]}\); 2 of"
    ):
        frame = load_features("points", folder=older)
    is_old = frame["recording"] == RECORDINGS[0]
    assert len(frame) == 3 * 24 * 5
    assert frame.loc[is_old, "z_std_m"].isna().all()
    assert frame.loc[~is_old, "z_std_m"].notna().any()
    assert frame.loc[is_old, "old"].tolist() == list(range(24 * 5))
    assert frame.loc[~is_old, "old"].isna().all()
    assert frame.attrs["units"]["z_std_m"] == "m"


def test_a_column_of_two_types_is_one_line(older: Path) -> None:
    path = next((older / "points").rglob(f"{RECORDINGS[0]}.parquet"))
    table = pq.read_table(path, partitioning=None)
    position = table.column_names.index("point")
    path.unlink()
    pq.write_table(table.set_column(position, "point", table["point"].cast(pa.string())), path)
    with pytest.raises(StoreError, match=r"column point: a column of another type: expected int32, as in other files"):
        load_features("points", folder=older)


def test_a_file_that_is_none_is_one_line(older: Path) -> None:
    path = next((older / "points").rglob(f"{RECORDINGS[1]}.parquet"))
    path.chmod(0o644)
    path.write_bytes(b"PAR1")
    with pytest.raises(StoreError, match=rf"{RECORDINGS[1]}.parquet: cannot be read: .*`garment verify` finds more"):
        load_features("points", folder=older)
