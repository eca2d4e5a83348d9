"""Variants side by side: each reads like the only one, by whatever reader."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import duckdb
import pandas as pd
import polars as pl
import pytest

from garment_dataset import load_features, open_features
from garment_dataset.errors import PipelineError, StoreError
from garment_dataset.features.reading import result_params, tables_in, variants_of
from garment_dataset.workspace.session import Session
from tests.conftest import RECORDINGS, make_workspace
from tests.features.conftest import PAGE

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from garment_dataset.workspace import Workspace

VARIANTS = ["", "thesis", "wide"]
KEYS = ["recording", "frame", "point"]
ROWS = len(RECORDINGS) * 24 * 6


def place(workspace: Workspace, variant: str) -> Path:
    return workspace.features_dir / (f"variant={variant}" if variant else "")


def duck(query: str) -> pd.DataFrame:
    found = duckdb.sql(query)
    assert found is not None
    frame: pd.DataFrame = found.to_arrow_table().to_pandas()
    return frame


# as README writes them
READERS: dict[str, Callable[[Path], pd.DataFrame]] = {
    "pandas": lambda folder: pd.read_parquet(folder / "kinematics"),
    "polars by folder": lambda folder: pl.scan_parquet(folder / "kinematics").collect().to_pandas(),
    "polars": lambda folder: pl.read_parquet(f"{folder}/kinematics/**/*.parquet", hive_partitioning=True).to_pandas(),
    "duckdb": lambda folder: duck(f"FROM read_parquet('{folder}/kinematics/**/*.parquet', hive_partitioning = true)"),
    "duckdb without partitions": lambda folder: duck(
        f"FROM read_parquet('{folder}/kinematics/**/*.parquet', hive_partitioning = false)"
    ),
}


def values_of(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows in one order and one kind of types, without what stands in paths."""
    left_out = rows.columns.intersection(["garment", "holding", "variant"])
    rows = rows.drop(columns=left_out).sort_values(KEYS, ignore_index=True)
    texts = ["recording", "axis", "source"]
    return rows.astype({name: "str" if name in texts else "float64" for name in rows.columns})


def of_variant(workspace: Workspace, variant: str) -> pd.DataFrame:
    """Read the files of a variant one by one: the truth that readers are held to."""
    files = sorted((place(workspace, variant) / "kinematics").rglob("*.parquet"))
    assert [path.stem for path in files] == sorted(RECORDINGS)
    return pd.concat([pd.read_parquet(path, partitioning=None) for path in files])


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("reader", READERS)
def test_every_reader_finds_the_rows_of_one_variant(varied: Workspace, reader: str, variant: str) -> None:
    found = values_of(READERS[reader](place(varied, variant)))
    assert len(found) == ROWS
    pd.testing.assert_frame_equal(found, values_of(of_variant(varied, variant)), check_exact=True)


@pytest.mark.parametrize("variant", VARIANTS)
def test_ours_finds_the_rows_of_one_variant(varied: Workspace, variant: str) -> None:
    found = load_features("kinematics", folder=varied.features_dir, variant=variant)
    pd.testing.assert_frame_equal(values_of(found), values_of(of_variant(varied, variant)), check_exact=True)
    assert found.attrs["units"]["vz_m_s"] == "m/s"
    assert "variant" not in found
    assert open_features("kinematics", folder=varied.features_dir, variant=variant).count_rows() == ROWS


def test_the_variants_are_not_the_same(varied: Workspace) -> None:
    usual, thesis = (values_of(of_variant(varied, variant)) for variant in ("", "thesis"))
    assert (usual["z_m"] - thesis["z_m"]).abs().max() > 1e-6


def test_all_variants_with_a_name_are_read_at_once(varied: Workspace) -> None:
    glob = f"{varied.features_dir}/variant=*/kinematics/**/*.parquet"
    found = duck(f"FROM read_parquet('{glob}', hive_partitioning = true)")
    assert len(found) == 2 * ROWS
    for variant, rows in found.groupby("variant"):
        pd.testing.assert_frame_equal(values_of(rows), values_of(of_variant(varied, str(variant))), check_exact=True)
    assert set(found["variant"]) == {"thesis", "wide"}
    assert set(found["garment"]) == {"GreenTowel", "MyScarf"}


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_table_of_a_variant_is_described(varied: Workspace, variant: str) -> None:
    folder = place(varied, variant)
    tables = tables_in(folder)
    assert {"frames", "points", "kinematics"} < set(tables)
    assert tables == tables_in(varied.features_dir), "all have the same stages, and a variant is no table"
    for table in tables:
        described = json.loads((folder / "schemas.json").read_text("utf-8"))[table]
        assert described["table"] == table


def test_what_is_equal_lies_there_once(varied: Workspace) -> None:
    for table, is_shared in (("frames", True), ("points", False)):
        inodes = {
            path.stat().st_ino
            for variant in VARIANTS
            for path in (place(varied, variant) / table).rglob(f"{RECORDINGS[0]}.parquet")
        }
        # a disk that shares blocks shows three files for one content
        assert len(inodes) in ({1, 3} if is_shared else {3})
    with Session(varied) as session:
        keys = {one.key for one in session.plan() if one.node[:2] == ("decode", RECORDINGS[0])}
    assert len(keys) == 1


def test_the_parameters_are_those_of_the_variant(varied: Workspace) -> None:
    methods = [
        result_params("points", RECORDINGS[0], folder=varied.features_dir, variant=variant)["method"]
        for variant in VARIANTS
    ]
    assert methods == ["profile", "thesis", "profile"]


def test_an_unknown_variant_is_refused_with_those_there_are(varied: Workspace, tmp_path: Path) -> None:
    assert variants_of(varied.features_dir) == ["thesis", "wide"]
    with pytest.raises(StoreError, match=r"no variant 'theses': expected one of thesis, wide. Did you mean thesis"):
        load_features("points", folder=varied.features_dir, variant="theses")
    with pytest.raises(StoreError, match="there is only the usual one"):
        open_features("points", folder=tmp_path, variant="wide")


@pytest.mark.parametrize("variant", VARIANTS)
def test_an_unknown_table_is_refused_with_those_there_are(varied: Workspace, variant: str) -> None:
    with pytest.raises(
        StoreError, match=r"no files of table 'pints': expected one of camera, [^=]*points[^=]*Did you mean points\?$"
    ):
        load_features("pints", folder=varied.features_dir, variant=variant)


def test_a_folder_without_results_is_no_table(tmp_path: Path) -> None:
    (tmp_path / "points").mkdir()
    (tmp_path / "points" / "notes.txt").write_text("{}")
    assert tables_in(tmp_path) == []
    with pytest.raises(StoreError, match="expected some results"):
        load_features("points", folder=tmp_path)


def test_the_snippets_of_the_page_run(varied: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    snippets = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    assert len(snippets) == 1
    monkeypatch.chdir(varied.root)
    names: dict[str, Any] = {}
    exec(compile(snippets[0], str(PAGE), "exec"), names)
    assert names["load_features"] is load_features


@pytest.mark.parametrize("name", ["default", "a/b", "-x", "a b"])
def test_names_that_cannot_be_are_refused(tmp_path: Path, name: str) -> None:
    made = make_workspace(tmp_path / "ws")
    (made.pipelines_dir / "depth.toml").write_text(f'variant = "{name}"\nstages = ["decode"]\n')
    with pytest.raises(PipelineError, match="variant"):
        Session(made)
