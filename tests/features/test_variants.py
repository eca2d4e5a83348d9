"""Variants side by side: each reads like the only one, by whatever reader, and two can be compared."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pytest
from typer.testing import CliRunner

from garment_dataset.cli import app
from garment_dataset.engine.events import Ending
from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.errors import FilterError, PipelineError, StoreError, UsageError
from garment_dataset.features.comparison import compare_tables
from garment_dataset.features.reading import load_features, variants_of
from garment_dataset.score.tables import score_table, uncertainty_name
from garment_dataset.workspace.session import Session
from tests.conftest import make_workspace

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace

PAGE = Path(__file__).parents[2] / "docs" / "variants.md"


@pytest.fixture(scope="module")
def varied(tmp_path_factory: pytest.TempPathFactory, sample_bags: dict[str, Path]) -> Workspace:
    """A workspace with the variant of docs/variants.md, built."""
    made = make_workspace(tmp_path_factory.mktemp("varied") / "workspace")
    for name, path in sample_bags.items():
        (made.recordings_dir / f"{name}.bag").symlink_to(path)
    found = re.search(r"```toml\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    assert found is not None
    (made.pipelines_dir / "thesis.toml").write_text(found[1])
    report = made.build(jobs=0)
    assert {str(event.node): event.ending for event in report.events.values() if "decode" in str(event.node)} == {
        f"decode:{name}{variant}": Ending.LINKED if variant else Ending.BUILT
        for name in sample_bags
        for variant in ("", "@thesis")
    }
    return made


def run(workspace: Workspace, *arguments: str) -> str:
    done = CliRunner().invoke(app, [*arguments, "--workspace", str(workspace.root)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


def queried(sql: str) -> pd.DataFrame:
    relation = duckdb.sql(sql)
    assert relation is not None
    frame: pd.DataFrame = relation.df()
    return frame


@pytest.mark.parametrize("variant", ["", "thesis"])
def test_every_reader_sees_one_variant(varied: Workspace, variant: str) -> None:
    folder = varied.features_dir / (f"variant={variant}" if variant else "")
    expected = load_features("kinematics", folder=varied.features_dir, variant=variant)
    assert len(expected) == 3 * 24 * 6
    wanted = expected.sort_values(["recording", "frame", "point"])["z_m"].to_numpy()
    glob = f"{folder}/kinematics/**/*.parquet"
    readings: dict[str, Any] = {
        "pandas": pd.read_parquet(folder / "kinematics"),
        "polars": pl.read_parquet(glob, hive_partitioning=True).to_pandas(),
        "duckdb": queried(f"SELECT * FROM read_parquet('{glob}', hive_partitioning = true)"),
    }
    for name, frame in readings.items():
        found = frame.sort_values(["recording", "frame", "point"])["z_m"].to_numpy(np.float64, na_value=np.nan)
        np.testing.assert_array_equal(found, wanted, err_msg=name)
    assert (folder / "kinematics" / "_schema.json").is_file()


def test_all_variants_can_be_read_at_once(varied: Workspace) -> None:
    glob = f"{varied.features_dir}/variant=*/kinematics/**/*.parquet"
    found = queried(f"SELECT DISTINCT variant FROM read_parquet('{glob}', hive_partitioning = true)")
    assert found["variant"].tolist() == ["thesis"]


def test_the_snippets_of_the_page_run(varied: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    found = re.search(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    assert found is not None
    monkeypatch.chdir(varied.root)
    exec(compile(found[1], str(PAGE), "exec"), {})


def test_an_unknown_variant_is_refused_with_those_there_are(varied: Workspace) -> None:
    assert variants_of(varied.features_dir) == ["thesis"]
    with pytest.raises(StoreError, match=r"no variant 'theses'.*'thesis'"):
        load_features("points", folder=varied.features_dir, variant="theses")
    with pytest.raises(StoreError, match=r"expected one of \[(?!.*variant)"):
        load_features("pints", folder=varied.features_dir)


def test_diff_says_how_much_and_in_units_of_what_is_stated(varied: Workspace) -> None:
    found = json.loads(run(varied, "diff", "default", "thesis", "garment=GreenTowel", "--json"))
    tables = {table["table"]: {column["column"]: column for column in table["columns"]} for table in found}
    z = tables["points"]["z_m"]
    a, b = (
        load_features("points", folder=varied.features_dir, variant=name, garment="GreenTowel")
        for name in ("", "thesis")
    )
    difference = (a["z_m"] - b["z_m"]).to_numpy()
    assert z["rows"] == 2 * 24 * 5
    assert z["rms"] == pytest.approx(np.sqrt(np.nanmean(difference**2)))
    assert z["largest"] == pytest.approx(np.nanmax(np.abs(difference)))
    stated = np.sqrt(a["z_std_m"] ** 2 + b["z_std_m"] ** 2)
    assert z["rms_in_std"] == pytest.approx(np.sqrt(np.nanmean((difference / stated) ** 2)))
    assert all(column["differing"] == 0 for column in tables["frames"].values())
    text = run(varied, "diff", "default", "thesis")
    assert "equal in both: frames, camera, gripper, joints" in text
    assert run(varied, "diff", "thesis", "thesis").startswith("no difference")


@pytest.mark.parametrize("arguments", [("default", "theses"), ("default", "thesis", "--table", "pints")])
def test_diff_refuses_what_is_not_there(varied: Workspace, arguments: tuple[str, ...]) -> None:
    with pytest.raises(UsageError, match=r"no variant 'theses'|no table 'pints'"):
        run(varied, "diff", *arguments)


SPEC = TableSpec(
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


def test_differences_of_planted_tables() -> None:
    a = pd.DataFrame(
        {"recording": "r", "frame": [0, 1, 2, 3], "x_m": [1.0, 2.0, np.nan, 4.0], "x_std_m": 3.0, "word": list("abcd")}
    )
    b = pd.DataFrame(
        {"recording": "r", "frame": [1, 2, 3, 9], "x_m": [7.0, 3.0, 4.0, 5.0], "x_std_m": 4.0, "word": list("bxdz")}
    )
    found = compare_tables(SPEC, a, b, "recording")
    assert (found.rows_only_a, found.rows_only_b) == (1, 1)
    x, _, word = found.columns
    assert (x.rows, x.differing, x.only_a, x.only_b, x.largest) == (3, 2, 0, 1, 5.0)
    assert x.rms == pytest.approx(5 / np.sqrt(2))
    assert x.rms_in_std == pytest.approx(1 / np.sqrt(2))
    assert (word.differing, word.rms) == (1, None)
    back = compare_tables(SPEC, b, a, "recording")
    assert (back.rows_only_a, back.columns[0].only_a, back.columns[0].rms) == (1, 1, x.rms)
    assert compare_tables(SPEC, a, a, "recording").is_none


@pytest.mark.parametrize(
    ("wanted", "rows"),
    [
        (np.array([1, 5]), 2),
        (pd.Series([1, 5]), 2),
        (range(1, 6), 5),
        ([], 0),
        (None, 0),
        (5, 1),
        ((1, 2), 2),
    ],
)
def test_filters_take_what_people_hold(varied: Workspace, wanted: Any, rows: int) -> None:
    found = load_features("points", folder=varied.features_dir, point=wanted)
    assert len(found) == rows * 3 * 24
    assert "z_m" in found.columns


@pytest.mark.parametrize("filters", [{"point": "1"}, {"garment": 3}, {"point": ["a"]}, {"point": [2**40]}])
def test_filters_of_another_type_are_refused(varied: Workspace, filters: dict[str, Any]) -> None:
    with pytest.raises(FilterError, match="values of another type"):
        load_features("points", folder=varied.features_dir, **filters)


def test_nulls_can_be_asked_for(varied: Workspace) -> None:
    points = load_features("points", folder=varied.features_dir)
    assert len(load_features("points", folder=varied.features_dir, reason=None)) == points["reason"].isna().sum()


@pytest.mark.parametrize("name", ["default", "a/b", "-x", "a b"])
def test_names_that_cannot_be_are_refused(tmp_path: Path, name: str) -> None:
    made = make_workspace(tmp_path / "ws")
    (made.pipelines_dir / "depth.toml").write_text(f'variant = "{name}"\nstages = ["decode"]\n')
    with pytest.raises(PipelineError, match="variant"):
        Session(made)


def test_tables_of_ones_own_are_scored_by_their_names() -> None:
    truth = pd.DataFrame({"frame": [0, 1, 2, 3], "length_m": [1.0, 1.0, 1.0, np.nan]})
    features = pd.DataFrame(
        {"recording": "r", "frame": [0, 1, 3], "length_m": [1.3, np.nan, 5.0], "length_std_m": [0.1, 0.1, 0.1]}
    )
    (score,) = score_table("r", "lengths", features, truth)
    assert (score.expected, score.column) == (3, "length_m")
    assert [score.coverage, score.rms, score.variance] == pytest.approx([1 / 3, 0.3, 9.0])
    assert uncertainty_name("vz_m_s") == "vz_std_m_s"
    assert uncertainty_name("share") == "share_std"


def test_the_command_scores_them(varied: Workspace) -> None:
    truth = varied.root / "GreenTowel_Ruler_01_pi16_0.5_R1.truth"
    truth.mkdir(exist_ok=True)
    gripper = load_features("gripper", folder=varied.features_dir, recording=truth.stem)
    gripper[["stream", "frame", "x_m", "z_m"]].assign(z_m=gripper["z_m"] + 0.25).to_parquet(truth / "gripper.parquet")
    columns = CliRunner().invoke(
        app,
        ["score", str(varied.features_dir), str(varied.root), "--variant", "thesis", "--json"],
        catch_exceptions=False,
    )
    found = {row["column"]: row for row in json.loads(columns.stdout)["tables"]}
    assert (found["x_m"]["rms"], found["z_m"]["rms"]) == (0.0, pytest.approx(0.25))
