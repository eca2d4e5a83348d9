"""``garment new stage``: what it writes works as it is, and nothing is ever overwritten."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from typer.testing import CliRunner

from garment_dataset.cli import application
from garment_dataset.engine.events import Ending
from garment_dataset.errors import GarmentError
from garment_dataset.features.reading import load_features
from garment_dataset.files import read_toml
from garment_dataset.workspace import Workspace

if TYPE_CHECKING:
    from collections.abc import Iterator

NEXT = re.compile(r"^Next: in (?P<file>.+) write\n    (?P<line>stages = .*)$", re.MULTILINE)
"""What is left to a person, as the command says it."""


@pytest.fixture(autouse=True)
def forget_modules(tmp_path: Path) -> Iterator[None]:
    """Leave no stage of one test to the next."""
    yield
    for name, module in list(sys.modules.items()):
        if Path(getattr(module, "__file__", None) or "/").is_relative_to(tmp_path):
            del sys.modules[name]


def run(workspace: Workspace, *arguments: str) -> str:
    """Run ``garment`` in this process; return all that it prints."""
    done = CliRunner().invoke(application(), [*arguments, "--workspace", str(workspace.root)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def new(workspace: Workspace, *arguments: str) -> str:
    return run(workspace, "new", "stage", *arguments)


def pytest_says(folder: Path) -> str:
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-W",
        "error",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:dash",
        str(folder),
    ]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env=environment, check=False)
    return done.stdout + done.stderr


@pytest.mark.parametrize(
    ("per", "fixture", "file", "rows", "subject"),
    [
        ("recording", "workspace", "depth", 3 * 24, "MyScarf_Corner_pi16_0.5_R1"),
        ("repeats", "workspace", "depth", 3, "MyScarf_Corner_pi16_0.5_R_topics_file1"),
        ("position", "color_workspace", "colour", 2 * 3, "position_2"),
    ],
)
def test_what_it_writes_is_tested_built_and_shown(
    request: pytest.FixtureRequest, per: str, fixture: str, file: str, rows: int, subject: str
) -> None:
    workspace: Workspace = request.getfixturevalue(fixture)
    said = new(workspace, "far_reach", "--per", per)
    assert "1 passed" in pytest_says(workspace.root / "stages")
    step = NEXT.search(said)
    assert step is not None
    path = Path(step["file"])
    assert path == workspace.pipelines_dir / f"{file}.toml"
    path.write_text(re.sub(r"(?m)^stages = .*$", step["line"], path.read_text()))
    assert "far_reach" in run(workspace, "build", "-j", "0")
    assert {event.ending for event in Workspace.find(workspace.root).build(jobs=0).events.values()} == {Ending.FRESH}
    table = load_features("far_reach", folder=workspace.features_dir)
    assert len(table) == rows
    assert table.iloc[:, -3:].notna().any(axis=None)
    assert "[far_reach] -> far_reach" in run(workspace, "dag", "--params")
    assert f"far_reach:{subject}: fresh" in run(workspace, "why", subject)
    assert '"fresh"' in run(workspace, "status", "--json")


def test_without_a_pipeline_that_feeds_it_a_new_one_is_proposed(workspace: Workspace) -> None:
    (workspace.pipelines_dir / "depth.toml").unlink()
    step = NEXT.search(new(workspace, "far_reach"))
    assert step is not None
    Path(step["file"]).write_text(step["line"])
    report = Workspace.find(workspace.root).build("axis=R", jobs=0)
    assert {event.ending for event in report.events.values()} == {Ending.BUILT}
    assert {event.node.stage for event in report.events.values()} > {"kinematics", "far_reach"}


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (None, '[stages]\nmodules = ["one"]\n'),
        ("", '[stages]\nmodules = ["one"]\n'),
        ('[paths]\nfeatures = "out"\n', '[paths]\nfeatures = "out"\n\n[stages]\nmodules = ["one"]\n'),
        ("[stages]  # mine\n", '[stages]  # mine\nmodules = ["one"]\n'),
        ("[stages]\nmodules = [ ]\n", '[stages]\nmodules = ["one"]\n'),
        ('[stages]\nmodules = ["two",]  # mine\n', '[stages]\nmodules = ["two", "one"]  # mine\n'),
        (
            '[stages]\nmodules = [\n    "two",  # mine\n]\n\n[paths]\n',
            '[stages]\nmodules = [\n    "two",  # mine\n    "one",\n]\n\n[paths]\n',
        ),
        ('[stages]\r\nmodules = ["two"]\r\n', '[stages]\r\nmodules = ["two", "one"]\r\n'),
    ],
)
def test_its_module_is_named_in_the_settings(workspace: Workspace, before: str | None, after: str) -> None:
    path = workspace.root / "garment.toml"
    if before is not None:
        path.write_bytes(before.encode())
    assert "under [stages]" not in new(workspace, "one")
    assert path.read_bytes().decode() == after


@pytest.mark.parametrize(
    "before",
    [
        'stages = {modules = ["two"]}\n',
        'stages.modules = ["two"]\n',
        '[stages]\nmodules = [\n    "two"  # [mine]\n]\n',
    ],
)
def test_settings_of_another_form_are_left_to_a_person(workspace: Workspace, before: str) -> None:
    path = workspace.root / "garment.toml"
    path.write_text(before)
    said = new(workspace, "one")
    assert f'under [stages] of {path} write\n    modules = ["two", "one"]\n' in said
    assert path.read_text() == before
    assert read_toml(path)["stages"]["modules"] == ["two"]


def test_a_module_that_the_settings_name_already_is_written(workspace: Workspace) -> None:
    """As the message about a missing module says."""
    path = workspace.root / "garment.toml"
    path.write_text('[stages]\nmodules = ["two", "one"]\n')
    with pytest.raises(GarmentError, match="garment new stage two"):
        run(workspace, "dag")
    for name in ("one", "two"):
        new(workspace, name)
    assert path.read_text() == '[stages]\nmodules = ["two", "one"]\n'
    run(workspace, "dag")


def test_stages_may_lie_elsewhere(workspace: Workspace) -> None:
    (workspace.root / "garment.toml").write_text('[paths]\nstages = "mine"\n')
    assert f"wrote {workspace.root / 'mine' / 'one.py'} and" in new(workspace, "one")
    assert not (workspace.root / "stages").exists()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        *((name, "not a name for a stage") for name in ("9lives", "class", "Reach", "a-b", "a.b", "länge", "_a", "")),
        *((name, "not a name for a stage") for name in ("params", "bag", "stage", "repeats", "test_it", "conftest")),
        ("decode", "there is a stage 'decode' already"),
        ("points", "there is a table 'points' already"),
        ("numpy", r"stages/numpy\.py: a module's name is taken"),
        ("json", r"stages/json\.py: a module's name is taken"),
        ("garment_dataset", "a module's name is taken"),
    ],
)
def test_names_that_cannot_be_are_refused(workspace: Workspace, name: str, message: str) -> None:
    with pytest.raises(GarmentError, match=message) as caught:
        new(workspace, name)
    assert caught.value.exit_code == 2
    assert not (workspace.root / "stages").exists()
    assert not (workspace.root / "garment.toml").exists()


@pytest.mark.parametrize("taken", ["reach.py", "test_reach.py", "reach"])
def test_nothing_is_overwritten(workspace: Workspace, taken: str) -> None:
    path = workspace.root / "stages" / taken
    path.parent.mkdir()
    path.write_text("mine")
    with pytest.raises(GarmentError, match=f"{taken}: in the way of a new stage"):
        new(workspace, "reach")
    assert [found.read_text() for found in path.parent.iterdir()] == ["mine"]
    assert not (workspace.root / "garment.toml").exists()


def test_nothing_is_written_when_a_pipeline_file_cannot_be_read(workspace: Workspace) -> None:
    (workspace.pipelines_dir / "aa.toml").write_text("stages = [")
    with pytest.raises(GarmentError, match=r"aa\.toml: cannot be read as TOML"):
        new(workspace, "reach")
    assert not (workspace.root / "stages").exists()
