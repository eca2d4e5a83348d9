"""``garment new stage``: what it writes works as it is, and nothing is ever overwritten."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import pytest
from typer.testing import CliRunner

from garment_dataset.cli import app
from garment_dataset.engine.events import Ending
from garment_dataset.errors import GarmentError
from garment_dataset.features.reading import load_features
from garment_dataset.layout import read_toml
from garment_dataset.workspace import Workspace


def new(workspace: Workspace, *arguments: str) -> Any:
    command = ["new", "stage", *arguments, "--workspace", str(workspace.root)]
    return CliRunner().invoke(app, command, catch_exceptions=False)


@pytest.mark.parametrize(("per", "rows"), [("recording", 72), ("repeats", 3)])
def test_what_it_writes_is_built_and_tested(workspace: Workspace, per: str, rows: int) -> None:
    assert new(workspace, "far_reach", "--per", per).exit_code == 0
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(workspace.root / "stages")],
        capture_output=True,
        text=True,
        cwd=workspace.root,
        check=False,
    )
    assert "1 passed" in done.stdout, done.stdout
    text = 'recordings = ["axis=R"]\nstages = ["decode", "depth_points", "kinematics", "far_reach"]\n'
    (workspace.pipelines_dir / "depth.toml").write_text(text)
    report = Workspace.find(workspace.root).build(jobs=0)
    assert {event.ending for event in report.events.values()} == {Ending.BUILT}
    assert len(load_features("far_reach", folder=workspace.features_dir)) == rows


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (None, ["one"]),
        ('[paths]\nfeatures = "out"\n', ["one"]),
        ("[stages]\nmodules = []\n", ["one"]),
        ('[stages]\nmodules = ["two",]  # mine\n', ["two", "one"]),
        ('[stages]\nmodules = [\n  "two",\n]\n', ["two", "one"]),
    ],
)
def test_its_module_is_named_in_the_settings(workspace: Workspace, before: str | None, after: list[str]) -> None:
    path = workspace.root / "garment.toml"
    (workspace.root / "stages").mkdir()
    (workspace.root / "stages" / "two.py").touch()
    if before is not None:
        path.write_text(before)
    assert new(workspace, "one").exit_code == 0
    assert read_toml(path)["stages"]["modules"] == after
    assert before is None or ("features" in before) == ("paths" in read_toml(path))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("9lives", "not a name"),
        ("class", "not a name"),
        ("Reach", "not a name"),
        ("decode", "there is a stage 'decode' already"),
        ("numpy", "name is taken"),
        ("json", "name is taken"),
    ],
)
def test_names_that_cannot_be_are_refused(workspace: Workspace, name: str, message: str) -> None:
    with pytest.raises(GarmentError, match=message):
        new(workspace, name)
    assert not (workspace.root / "stages").exists()


def test_nothing_is_overwritten(workspace: Workspace) -> None:
    (workspace.root / "stages").mkdir()
    path = workspace.root / "stages" / "test_reach.py"
    path.write_text("mine")
    with pytest.raises(GarmentError, match=r"test_reach\.py: in the way"):
        new(workspace, "reach")
    assert path.read_text() == "mine"
    assert not (workspace.root / "stages" / "reach.py").exists()
