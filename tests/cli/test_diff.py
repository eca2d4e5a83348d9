"""``garment diff`` as a user meets it: real variants, and changes of their files whose size is known."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from garment_dataset.cli import application
from garment_dataset.errors import FilterError, GarmentError, StoreError, UsageError
from garment_dataset.features.reading import load_features, tables_in
from tests.cli.conftest import Ran
from tests.conftest import DEPTH_PIPELINE, RECORDINGS, make_workspace

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from garment_dataset.workspace import Workspace
    from tests.cli.conftest import Garment

SCARF = RECORDINGS[2]


def with_thesis(workspace: Workspace) -> Workspace:
    """Build a workspace with the thesis' method as a variant."""
    pipeline = f'variant = "thesis"\n{DEPTH_PIPELINE}[params.depth_points]\nmethod = "thesis"\n'
    (workspace.pipelines_dir / "thesis.toml").write_text(pipeline)
    workspace.build(jobs=0)
    return workspace


@pytest.fixture(scope="module")
def varied(tmp_path_factory: pytest.TempPathFactory, sample_bags: dict[str, Path]) -> Workspace:
    """A workspace with a variant that no test changes."""
    made = make_workspace(tmp_path_factory.mktemp("diff") / "workspace")
    for name, path in sample_bags.items():
        (made.recordings_dir / f"{name}.bag").symlink_to(path)
    return with_thesis(made)


@pytest.fixture
def copied(workspace: Workspace) -> Workspace:
    """The workspace with a variant of the same parameters, built: all that differs is what a test changes."""
    (workspace.pipelines_dir / "copy.toml").write_text(f'variant = "copy"\n{DEPTH_PIPELINE}')
    workspace.build(jobs=0)
    return workspace


def diff(workspace: Workspace, *arguments: str) -> Ran:
    done = CliRunner().invoke(application(), ["diff", *arguments, "-w", str(workspace.root)], catch_exceptions=False)
    return Ran(done.exit_code, done.stdout, done.stderr)


def in_json(workspace: Workspace, *arguments: str) -> dict[str, Any]:
    ran = diff(workspace, *arguments, "--json")
    assert ran.code == 0
    return {table["table"]: table for table in json.loads(ran.out)["tables"]}


def column(table: dict[str, Any], name: str) -> dict[str, Any]:
    found: dict[str, Any] = next(one for one in table["columns"] if one["column"] == name)
    return found


def change(workspace: Workspace, table: str, edit: Callable[[pa.Table], pa.Table], variant: str = "copy") -> None:
    """Replace the scarf's file in a variant; the object in the store stays as it is."""
    (path,) = (workspace.features_dir / f"variant={variant}" / table).rglob(f"{SCARF}.parquet")
    rows = edit(pq.read_table(path, partitioning=None))
    path.unlink()
    pq.write_table(rows, path)


def shifted(by: float) -> Callable[[pa.Table], pa.Table]:
    def edit(rows: pa.Table) -> pa.Table:
        place = rows.schema.get_field_index("z_m")
        return rows.set_column(place, rows.schema.field(place), pc.add(rows["z_m"], pa.scalar(by)))

    return edit


def test_how_much_two_methods_differ(varied: Workspace) -> None:
    tables = in_json(varied, "default", "thesis", "garment=GreenTowel")
    assert {"frames", "chains", "points", "kinematics"} < set(tables)
    a, b = (
        load_features("points", folder=varied.features_dir, variant=name, garment="GreenTowel")
        for name in ("", "thesis")
    )
    difference = (a["z_m"] - b["z_m"]).to_numpy()
    in_std = difference / np.sqrt(a["z_std_m"] ** 2 + b["z_std_m"] ** 2)
    points, z = tables["points"], column(tables["points"], "z_m")
    assert (points["results"], points["rows"], z["unit"]) == (2, 2 * 24 * 5, "m")
    assert (z["differing"], z["only_a"], z["only_b"]) == (np.count_nonzero(difference), 0, 0)
    assert z["rms"] == pytest.approx(np.sqrt(np.mean(difference**2)))
    assert z["largest"] == pytest.approx(np.abs(difference).max())
    assert z["rms_in_std"] == pytest.approx(np.sqrt(np.mean(in_std**2)))
    assert not any(one["differing"] for one in tables["frames"]["columns"])
    assert tables["chains"]["rows_only_a"] > 0
    back = in_json(varied, "thesis", "default", "garment=GreenTowel")
    assert back["chains"]["rows_only_b"] == tables["chains"]["rows_only_a"]


def test_the_tables_are_printed(varied: Workspace, garment: Garment) -> None:
    ran = garment("diff", "default", "thesis", "--table", "points", "-t", "frames", cwd=varied.root)
    assert ran.err == ""
    first, second = ran.out.split("\n\n")
    heads = [line.split()[:2] for line in first.splitlines()]
    assert heads == [["table", "results"], ["frames", "3"], ["points", "3"]]
    assert "only default" in first
    assert "only thesis" in first
    z = next(line.split() for line in second.splitlines() if " z_m " in line)
    assert z[:2] == ["points", "z_m"]
    assert z[-2] == "m"
    assert float(z[-1]) > 0


def test_a_variant_does_not_differ_from_itself(varied: Workspace) -> None:
    ran = diff(varied, "thesis", "thesis")
    assert ran.code == 0
    tables = len(tables_in(varied.features_dir / "variant=thesis"))
    line = rf"no difference between thesis and thesis: {tables} tables, {3 * tables} results, \d+ rows\n"
    assert re.fullmatch(line, ran.out)
    for table in in_json(varied, "default", "default").values():
        assert not table["rows_only_a"] + table["rows_only_b"]
        assert not any(one["differing"] or one["largest"] or one["rms_in_std"] for one in table["columns"])


def test_what_was_changed_is_found(copied: Workspace) -> None:
    assert diff(copied, "default", "copy").out.startswith("no difference between default and copy: ")
    change(copied, "points", shifted(0.25))
    change(copied, "kinematics", lambda rows: rows.slice(0, rows.num_rows - 2))
    tables = in_json(copied, "default", "copy", "MyScarf*")
    z = column(tables["points"], "z_m")
    assert (z["differing"], z["rms"], z["largest"]) == (120, pytest.approx(0.25), pytest.approx(0.25))
    assert (tables["kinematics"]["rows"], tables["kinematics"]["rows_only_a"]) == (144 - 2, 2)
    every = in_json(copied, "default", "copy")["points"]
    assert column(every, "z_m")["rms"] == pytest.approx(0.25 / np.sqrt(3))
    assert "no difference" in diff(copied, "default", "copy", "garment=GreenTowel").out


def test_what_one_has_alone_is_said(copied: Workspace) -> None:
    for path in (copied.features_dir / "variant=copy" / "points").rglob(f"{SCARF}.parquet"):
        path.unlink()
    for path in (copied.features_dir / "variant=copy" / "joints").rglob("*.parquet"):
        path.unlink()
    ran = diff(copied, "default", "copy")
    assert ran.code == 0
    assert ran.out.endswith(f"only default: all of joints\nonly default: {SCARF} (points)\n")
    # decode of all three and points of one are not where they should be; what is built of them is
    assert ran.err == "copy: 4 stale; compared is what was built last (`garment status` says why)\n"
    assert diff(copied, "copy", "default", "-t", "joints").out.endswith("only default: all of joints\n")


def test_what_the_pipelines_ask_for_now_is_told_from_what_was_built(workspace: Workspace) -> None:
    varied = with_thesis(workspace)
    assert diff(varied, "default", "thesis").err == ""
    pipeline = varied.pipelines_dir / "thesis.toml"
    pipeline.write_text(pipeline.read_text() + "band_half_width_m = 0.2\n")
    assert diff(varied, "default", "thesis", "MyScarf*").err == (
        "thesis: 2 stale; compared is what was built last (`garment status` says why)\n"
    )
    assert diff(varied, "default", "thesis", "-t", "frames").err == "", "only what is compared is looked at"
    assert diff(varied, "default", "default").err == ""


def test_a_variant_that_was_not_built_is_missing(workspace: Workspace) -> None:
    workspace.build(jobs=0)
    (workspace.pipelines_dir / "copy.toml").write_text(f'variant = "copy"\n{DEPTH_PIPELINE}')
    ran = diff(workspace, "default", "copy")
    assert ran.code == 0
    *_, line = ran.out.splitlines()
    assert line.startswith("only default: all of frames, camera, gripper, joints, ")
    assert set(line.removeprefix("only default: all of ").split(", ")) == set(tables_in(workspace.features_dir))
    assert ran.err == "copy: 9 stale; compared is what was built last (`garment status` says why)\n"


def test_a_variant_that_no_pipeline_names_any_more_can_still_be_compared(workspace: Workspace) -> None:
    varied = with_thesis(workspace)
    (varied.pipelines_dir / "thesis.toml").unlink()
    ran = diff(varied, "default", "thesis", "-t", "points")
    assert (ran.code, ran.err) == (0, "")
    assert "z_m" in ran.out
    (varied.features_dir / "points").rename(varied.features_dir / "dots")
    assert "not compared, since no pipeline makes them: dots" in diff(varied, "default", "thesis").err


@pytest.mark.parametrize(
    ("arguments", "kind", "message"),
    [
        (
            ("default", "theses"),
            UsageError,
            "no variant 'theses': expected one of default, thesis. Did you mean thesis?",
        ),
        (("other", "default"), UsageError, "no variant 'other': expected one of default, thesis. A pipeline file"),
        (("default", "thesis", "-t", "pints"), UsageError, "no table 'pints': expected one of frames, .*mean points"),
        (("default", "thesis", "garment=Nobody"), FilterError, "no such garment"),
        (("default", "thesis", "garmet=Nobody"), FilterError, "Did you mean garment=Nobody"),
        (
            ("default", "thesis", "GreenTowel_Free*"),
            FilterError,
            r"no results of what is selected: found GreenTowel_Fr",
        ),
        (("default", "thesis", "-t", "silhouettes"), StoreError, "no results to compare. `garment build`"),
    ],
)
def test_what_is_not_there_is_refused(
    varied: Workspace, arguments: tuple[str, ...], kind: type[GarmentError], message: str
) -> None:
    with pytest.raises(kind, match=message) as caught:
        diff(varied, *arguments)
    assert caught.value.exit_code == 2


def test_a_refusal_is_one_line(varied: Workspace, garment: Garment) -> None:
    ran = garment("diff", "default", "theses", cwd=varied.root, code=2)
    assert ran.out == ""
    assert ran.err.count("\n") == 1


def test_nothing_built_is_said(workspace: Workspace) -> None:
    with pytest.raises(StoreError, match="no results to compare"):
        diff(workspace, "default", "default")


def test_camera_positions_are_compared_by_their_own_names(color_workspace: Workspace) -> None:
    """Both positions have a background, and one of them is of a recording that is also compared for itself."""
    colour = (color_workspace.pipelines_dir / "colour.toml").read_text()
    (color_workspace.pipelines_dir / "copy.toml").write_text(f'variant = "copy"\n{colour}')
    color_workspace.build(jobs=0)
    tables = in_json(color_workspace, "default", "copy")
    assert tables["background"]["results"] == 2
    assert tables["silhouettes"]["results"] == 3
    assert "no difference" in diff(color_workspace, "default", "copy").out
    one = in_json(color_workspace, "default", "copy", "MyScarf*")
    assert (one["background"]["results"], one["silhouettes"]["results"]) == (1, 1)


OWN = """
from garment_dataset.stages import FRAME, Column, Stage, StageParams, TableSpec

POINTS = TableSpec("points", 1, "one depth frame", (FRAME, Column("z_m", "float64", "m", "where"),
                                                    Column("guess_m", "float64", "m", "another")), keys=("frame",))


class MeanParams(StageParams):
    pass


def mean_points(frames, params):
    frame = frames.filter(frames["stream"].to_numpy() == "depth")["frame"]
    return {"points": POINTS.table({"frame": frame, "z_m": [1.0] * len(frame), "guess_m": [2.0] * len(frame)})}


STAGE = Stage(mean_points, params=MeanParams, outputs=(POINTS,))
"""


def test_a_stage_in_place_of_ours_is_compared_in_what_both_make(workspace: Workspace, garment: Garment) -> None:
    workspace.stages_dir.mkdir()
    (workspace.stages_dir / "mean_points.py").write_text(OWN)
    (workspace.root / "garment.toml").write_text('[stages]\nmodules = ["mean_points"]\n')
    own = 'variant = "own"\nrecordings = ["axis=R"]\nstages = ["decode", "mean_points"]\n'
    (workspace.pipelines_dir / "own.toml").write_text(own)
    garment("build", "-j", "0", cwd=workspace.root)
    answer = json.loads(garment("diff", "default", "own", "MyScarf*", "-t", "points", "--json", cwd=workspace.root).out)
    (points,) = answer["tables"]
    assert points["columns_only_b"] == ["guess_m"]
    assert "x_std_m" in points["columns_only_a"]
    assert [one["column"] for one in points["columns"]] == ["z_m"]
    assert (points["rows"], points["rows_only_a"], points["rows_only_b"]) == (24, 24 * 4, 0)
    text = garment("diff", "default", "own", "-t", "points", cwd=workspace.root).out
    assert "only own: columns guess_m of points" in text
