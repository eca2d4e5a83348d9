"""Workspaces: made, found upward, configured, and refused with a hint."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from garment_dataset.cli import application
from garment_dataset.errors import WorkspaceError
from garment_dataset.workspace import Workspace


def test_a_new_workspace_is_found_from_within(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Workspace.create(tmp_path / "ws")
    deep = made.recordings_dir / "a" / "b"
    deep.mkdir(parents=True)
    monkeypatch.chdir(deep)
    assert Workspace.find() == made
    assert Workspace.find(tmp_path / "ws") == made
    assert len(made.catalog().rows) == 46


def test_an_empty_workspace_has_the_headers_and_pipelines_of_a_new_one(tmp_path: Path) -> None:
    made, usual = Workspace.create(tmp_path / "ws", empty=True), Workspace.create(tmp_path / "usual")
    assert made.catalog().rows == ()
    assert {path.name for path in made.catalog_dir.iterdir()} == {
        path.name for path in usual.catalog_dir.iterdir() if path.name != "topics"
    }
    for path in made.catalog_dir.glob("*.csv"):
        (header,) = path.read_text("utf-8").splitlines()
        assert (usual.catalog_dir / path.name).read_text("utf-8").startswith(f"{header}\n")
    for path in usual.pipelines_dir.iterdir():
        assert (made.pipelines_dir / path.name).read_bytes() == path.read_bytes()


def test_a_data_set_of_ones_own_is_begun_by_two_commands(tmp_path: Path) -> None:
    run = CliRunner(env={"NO_COLOR": "1"}).invoke
    made = run(application(), ["init", "--empty", str(tmp_path / "ws")])
    assert made.exit_code == 0
    assert "catalog/garments.csv, holdings.csv and recordings.csv" in made.stderr
    assert "garment lint" in made.stderr
    assert run(application(), ["lint", "-w", str(tmp_path / "ws")]).stdout == "names, tables and folder agree\n"
    listed = run(application(), ["list", "-w", str(tmp_path / "ws")])
    assert (listed.exit_code, listed.stderr) == (0, "0 recordings\n")


def test_nothing_is_ever_overwritten(tmp_path: Path) -> None:
    Workspace.create(tmp_path / "ws")
    with pytest.raises(WorkspaceError, match="already a workspace"):
        Workspace.create(tmp_path / "ws")
    (tmp_path / "half" / "catalog").mkdir(parents=True)
    with pytest.raises(WorkspaceError, match="in the way"):
        Workspace.create(tmp_path / "half")
    assert list((tmp_path / "half").iterdir()) == [tmp_path / "half" / "catalog"]


def test_no_workspace_is_one_line_with_a_hint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(WorkspaceError, match="garment init"):
        Workspace.find()
    with pytest.raises(WorkspaceError, match="not a workspace"):
        Workspace.find(tmp_path)


def test_settings_move_the_folders(tmp_path: Path) -> None:
    made = Workspace.create(tmp_path / "ws")
    (made.root / "garment.toml").write_text('[paths]\nrecordings = "/data/bags"\nfeatures = "out"\n')
    moved = Workspace.find(made.root)
    assert moved.recordings_dir == Path("/data/bags")
    assert moved.features_dir == made.root / "out"
    assert moved.private_dir == made.private_dir


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[paths", "not TOML"),
        ("[paths]\nbags = 'x'", "bags"),
        ("[path]\n", r"expected one of paths, stages, names, snapshot, found 'path'\. Did you mean paths\?"),
        ("[paths]\nfeatres = 'x'", r"'paths\.featres' is not .*found 'featres'\. Did you mean features\?"),
        ("[stages]\nmodule = ['x']", r"Did you mean modules\?"),
        ("x = " + "[" * 5000, "not TOML: found nested too deeply"),
        ("a." * 200 + "a = 1", "not TOML: found a key of more than 100 parts"),
        ("x = 1\n" * 200_000, "not TOML: found 1200000 bytes, and it may have 1000000"),
        (f"[paths]\nfeatures = '{'x' * 5000}'", "no path for 'features': found .*too long"),
        ('[paths]\nprivate = "a\\u0000b"', "no path for 'private': found .*null byte"),
    ],
)
def test_settings_that_cannot_be_read_are_named(tmp_path: Path, text: str, message: str) -> None:
    made = Workspace.create(tmp_path / "ws")
    (made.root / "garment.toml").write_text(text)
    with pytest.raises(WorkspaceError, match=message):
        Workspace.find(made.root)
