"""``garment export``: a snapshot, whatever the folder is called; what is wrong is one line."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from garment_dataset.workspace import Workspace
    from tests.cli.conftest import Garment


@pytest.fixture
def built(workspace: Workspace) -> Workspace:
    workspace.build(jobs=0)
    return workspace


def test_a_snapshot_is_written_verified_and_compared(garment: Garment, built: Workspace, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = garment("export", str(out), cwd=built.root)
    assert done.out == ""
    assert f"snapshot: {out}" in done.err
    assert "left out: 4" in done.err
    assert "all " in garment("export", "--verify", str(out), cwd=tmp_path).err
    assert "nothing has changed since" in garment("export", str(out), cwd=built.root).err
    part = str(tmp_path / "part")
    again = garment("export", part, "MyScarf_*", "--table", "points", "--since", str(out), "--json", cwd=built.root)
    found = json.loads(again.out)
    assert found["recordings"] == ["MyScarf_Corner_pi16_0.5_R1"]
    assert any("gone" in line for line in found["changes"])
    (out / "motion").mkdir()
    (out / "motion" / "mine.parquet").write_bytes(b"")
    done = garment("export", "--verify", str(out), cwd=tmp_path, code=1)
    assert done.out == "not in the sums: motion/mine.parquet\n"
    assert "not replaced" in garment("export", str(out), cwd=built.root, code=2).err


def test_a_folder_may_be_called_like_a_form(garment: Garment, built: Workspace) -> None:
    garment("export", "./mcap", cwd=built.root)
    garment("export", "snapshot", "clouds", cwd=built.root)
    assert (built.root / "mcap" / "snapshot.json").is_file()
    assert (built.root / "clouds" / "snapshot.json").is_file()


def test_clouds_are_written_and_what_could_not_be_is_named(garment: Garment, built: Workspace, tmp_path: Path) -> None:
    (built.recordings_dir / "MyScarf_Corner_pi16_0.5_R1.bag").unlink()
    (built.recordings_dir / "MyScarf_Corner_pi16_0.5_R1.bag").write_bytes(b"no bag at all")
    out = tmp_path / "clouds"
    done = garment("export", "clouds", str(out), "axis=R", "--every", "8", "--no-ply", cwd=built.root, code=1)
    assert f"2 recordings; clouds: {out}" in done.err
    assert "failed: MyScarf_Corner_pi16_0.5_R1: " in done.err
    assert "files are as written" in garment("export", "--verify", str(out), cwd=tmp_path).err


def test_what_is_wrong_is_one_line(garment: Garment, workspace: Workspace, tmp_path: Path) -> None:
    for arguments, expected in (
        (["export", str(tmp_path / "out")], "nothing to export: found missing"),
        (["export", str(tmp_path / "out"), "--table", "pints"], "Did you mean points?"),
        (["export", "--verify", str(tmp_path)], "not a snapshot: expected a file SHA256SUMS"),
        (["export", "--verify", str(tmp_path), "axis=R"], "verified as a whole"),
        (["export", str(workspace.catalog_dir)], "in the way of what is exported"),
    ):
        done = garment(*arguments, cwd=workspace.root, code=2)
        assert expected in done.err
        assert len(done.err.splitlines()) == 1
    assert not (tmp_path / "out").exists()
