"""Stages of one's own, in the workspace or in an installed package: run, followed and shown like the shipped ones."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

import pytest
from typer.testing import CliRunner

from garment_dataset.cli import app
from garment_dataset.engine.events import Ending
from garment_dataset.engine.plan import State
from garment_dataset.errors import GarmentError, StageError
from garment_dataset.features.reading import load_features
from garment_dataset.workspace import Workspace
from garment_dataset.workspace.known_stages import KnownStages
from garment_dataset.workspace.session import Session
from tests.conftest import RECORDINGS
from tests.workspace.conftest import HELPER, LENGTHS, name_stages

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from garment_dataset.engine.events import Report


def built(report: Report) -> set[str]:
    assert not report.of(Ending.FAILED), report.of(Ending.FAILED)
    return {event.node.stage for event in report.of(Ending.BUILT)}


def stale(workspace: Workspace) -> Mapping[str, set[str]]:
    """Return the reasons of what is not fresh, by stage."""
    found: dict[str, set[str]] = {}
    with Session(workspace) as session:
        for decision in session.plan():
            if decision.state is not State.FRESH:
                found.setdefault(decision.node.stage, set()).update(map(str, decision.reasons))
    return found


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))


def run(*arguments: str) -> str:
    done = CliRunner().invoke(app, list(arguments), catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.mark.parametrize("jobs", [0, 2])
def test_a_stage_of_the_workspace_is_run_and_shown_like_any(with_lengths: Workspace, jobs: int) -> None:
    assert "lengths" in built(with_lengths.build(jobs=jobs))
    table = load_features("lengths", folder=with_lengths.features_dir)
    assert set(table["recording"]) == set(RECORDINGS)
    assert table["length_m"].dropna().between(0.4, 0.6).all()
    assert table.attrs["units"]["length_m"] == "m"
    assert (with_lengths.features_dir / "lengths" / "_schema.json").is_file()
    here = ("--workspace", str(with_lengths.root))
    assert "points -> [lengths] -> lengths" in run("dag", *here)
    assert f"lengths:{RECORDINGS[0]}: fresh" in run("why", RECORDINGS[0], *here)
    counts = json.loads(run("status", "--json", *here))["counts"]
    assert counts == {"fresh": 12, "stale": 0, "missing": 0, "blocked": 0, "failed": 0}


def test_its_code_is_followed_with_its_helpers(with_lengths: Workspace) -> None:
    with_lengths.build(jobs=0)
    edit(with_lengths.stages_dir / "lengths.py", '"""How long', '# a remark\n"""How long')
    edit(
        with_lengths.stages_dir / "lengths_helper.py", "def in_metres", "def other():\n    return 1\n\n\ndef in_metres"
    )
    assert stale(with_lengths) == {}
    edit(with_lengths.stages_dir / "lengths_helper.py", "value * factor", "value * factor * 2")
    assert stale(with_lengths) == {"lengths": {"code lengths_helper:in_metres: changed"}}
    assert built(with_lengths.build(jobs=1)) == {"lengths"}
    assert load_features("lengths", folder=with_lengths.features_dir)["length_m"].dropna().between(0.8, 1.2).all()


def test_its_parameters_are_in_the_pipeline_file(with_lengths: Workspace) -> None:
    with_lengths.build(jobs=0)
    name_stages(with_lengths, "lengths", params="[params.lengths]\nfactor = 3.0\n")
    assert stale(with_lengths) == {"lengths": {"parameter factor: 1.0 -> 3.0"}}


@pytest.fixture
def installed(workspace: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package that brings the stage ``lengths`` by an entry point, as pip would lay it out."""
    site = tmp_path / "site"
    package = site / "cloth_lengths"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "lengths.py").write_text(LENGTHS.format(helper="cloth_lengths.helper"))
    (package / "helper.py").write_text(HELPER)
    info = site / "cloth_lengths-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: cloth-lengths\nVersion: 1.2\n")
    (info / "entry_points.txt").write_text("[garment_dataset.stages]\nlengths = cloth_lengths.lengths\n")
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setenv("PYTHONPATH", str(site))
    name_stages(workspace, "lengths")
    return package


@pytest.mark.parametrize("jobs", [0, 1])
def test_a_stage_of_an_installed_package_is_run_and_followed(workspace: Workspace, installed: Path, jobs: int) -> None:
    assert "lengths" in built(workspace.build(jobs=jobs))
    assert stale(workspace) == {}
    edit(installed / "helper.py", "value * factor", "value * factor + 1")
    assert stale(workspace) == {"lengths": {"code cloth_lengths.helper:in_metres: changed"}}


def test_two_of_one_name_are_refused_with_both_places(with_lengths: Workspace, installed: Path) -> None:
    assert installed.is_dir()
    with pytest.raises(StageError, match=r"two stages are called 'lengths'.*lengths\.py and .*cloth-lengths 1\.2"):
        KnownStages.of(with_lengths)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("absent", None, r"no module 'absent' .*garment new stage absent"),
        ("empty", "", r"empty\.py: a module without STAGE"),
        ("broken", "def broken(:\n", r"broken\.py: the module .* cannot be imported: found SyntaxError"),
        ("lacking", "import no_such_module\n", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("another", LENGTHS.format(helper="lengths_helper"), r"expected a Stage 'another', found stage 'lengths'"),
        ("numpy", LENGTHS.format(helper="lengths_helper"), r"numpy\.py: a module's name is taken"),
        ("json", LENGTHS.format(helper="lengths_helper"), r"json\.py: a module's name is taken"),
        ("decode", LENGTHS.format(helper="lengths_helper"), r"two stages are called 'decode'"),
    ],
)
def test_what_is_no_stage_is_refused_in_one_line(
    with_lengths: Workspace, name: str, text: str | None, message: str
) -> None:
    if text is not None:
        (with_lengths.stages_dir / f"{name}.py").write_text(text)
    (with_lengths.root / "garment.toml").write_text(f'[stages]\nmodules = ["{name}"]\n')
    name_stages(with_lengths, name)
    with pytest.raises(GarmentError, match=message):
        Session(Workspace.find(with_lengths.root))


def test_columns_that_the_product_adds_are_refused(with_lengths: Workspace) -> None:
    edit(with_lengths.stages_dir / "lengths.py", '"length_m", "float64"', '"garment", "float64"')
    with pytest.raises(StageError, match="has columns that the product adds: found garment"):
        Session(with_lengths)


MINE = """
from garment_dataset.stages import Stage, StageParams
from garment_dataset.stages.depth_points import POINTS


class MyPointsParams(StageParams):
    pass


def my_points(frames, gripper, params: MyPointsParams):
    rows = [row for row in gripper.to_pylist() if row["stream"] == "depth"]
    columns = {column.name: [None] * len(rows) for column in POINTS.columns}
    columns |= {name: [row[name] for row in rows] for name in ("frame", "stamp_ns", "x_m", "z_m")}
    columns |= {"point": [1] * len(rows), "pixels": [9] * len(rows), "y_m": [row["y_m"] + 0.1 for row in rows]}
    return {"points": POINTS.table(columns)}


STAGE = Stage(my_points, params=MyPointsParams, outputs=(POINTS,))
"""


def test_a_stage_may_stand_in_for_one_of_ours(workspace: Workspace) -> None:
    """Whoever has a better extraction makes the table ``points``; ``kinematics`` reads it."""
    (workspace.root / "stages").mkdir()
    (workspace.root / "stages" / "my_points.py").write_text(MINE.replace("    FILL\n", ""))
    (workspace.root / "garment.toml").write_text('[stages]\nmodules = ["my_points"]\n')
    text = 'recordings = ["axis=R"]\nstages = ["decode", "my_points", "kinematics"]\n'
    (workspace.pipelines_dir / "depth.toml").write_text(text)
    found = Workspace.find(workspace.root)
    assert built(found.build(jobs=0)) == {"decode", "my_points", "kinematics"}
    table = load_features("kinematics", folder=found.features_dir, point=1)
    assert table["vz_m_s"].notna().any()
    other = 'recordings = ["axis=R"]\nstages = ["decode", "depth_points"]\n'
    (workspace.pipelines_dir / "other.toml").write_text(other)
    with pytest.raises(GarmentError, match="by different stages: found my_points and depth_points"):
        Session(found)
    (workspace.pipelines_dir / "other.toml").write_text(f'variant = "ours"\n{other}')
    assert built(found.build(jobs=0)) == {"depth_points"}


def test_two_workspaces_in_one_process_keep_their_own(with_lengths: Workspace, tmp_path: Path) -> None:
    other = Workspace.create(tmp_path / "other")
    for path in with_lengths.recordings_dir.iterdir():
        (other.recordings_dir / path.name).symlink_to(path.resolve())
    (other.root / "stages").mkdir()
    (other.root / "stages" / "lengths.py").write_text(LENGTHS.format(helper="lengths_helper"))
    (other.root / "stages" / "lengths_helper.py").write_text(HELPER.replace("value * factor", "-1.0"))
    (other.root / "garment.toml").write_text('[stages]\nmodules = ["lengths"]\n')
    name_stages(other, "lengths")
    for _ in range(2):
        for workspace, wanted in ((with_lengths, 0.5), (Workspace.find(other.root), -1.0)):
            workspace.build(RECORDINGS[0], jobs=0, forced=True)
            table = load_features("lengths", folder=workspace.features_dir)
            assert table["length_m"].dropna().to_list() == pytest.approx(
                [wanted] * len(table["length_m"].dropna()), abs=0.1
            )


def test_the_shipped_stages_import_nothing_of_ones_own(workspace: Workspace) -> None:
    Session(workspace).store.close()
    assert "lengths" not in sys.modules
