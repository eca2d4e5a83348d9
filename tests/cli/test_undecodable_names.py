"""Folders and files whose names are no UTF-8: bags may have such, results not; never a traceback."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from garment_dataset.cli import application
from garment_dataset.engine.events import Ending
from garment_dataset.engine.index import Index
from garment_dataset.engine.results import Failure
from garment_dataset.engine.sources import SourceStat
from garment_dataset.errors import WorkspaceError
from garment_dataset.workspace import Workspace
from tests.conftest import make_workspace

ODD = os.fsdecode(b"d\xe4")


@pytest.fixture
def odd(tmp_path: Path) -> Path:
    """A folder whose name is no UTF-8."""
    try:
        (made := tmp_path / ODD).mkdir()
    except OSError:
        pytest.skip("this file system has no such names")
    return made


def run(place: Workspace, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a verb as a person does: what the terminal has no letters for is written as escapes by ``main``."""
    command = [sys.executable, "-m", "garment_dataset", *arguments, "-w", str(place.root)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_bags_in_such_a_folder_are_built_and_known_again(
    odd: Path, tmp_path: Path, make_recording: Callable[..., Path]
) -> None:
    place = make_workspace(tmp_path / "ws")
    (place.recordings_dir / "more").symlink_to(odd)
    make_recording(odd / "GreenTowel_Ruler_01_pi16_0.5_R1.bag")
    make_recording(place.recordings_dir / ODD / "GreenTowel_Ruler_02_pi16_0.5_R1.bag")
    (place.recordings_dir / ODD / "BlueShirt_Free_pi16_0.5_R1.bag").touch()
    for ending in (Ending.BUILT, Ending.FRESH):
        found = {event.node.subject: event.ending for event in place.build(jobs=0).events.values()}
        assert {found[f"GreenTowel_Ruler_0{number}_pi16_0.5_R1"] for number in (1, 2)} == {ending}
    for verb in ("list", "lint", "status", "verify"):
        done = run(place, verb)
        assert done.returncode in (0, 1), verb
        assert "Traceback" not in done.stderr
    (row,) = json.loads(run(place, "list", "--json", "garment=BlueShirt", "state=present").stdout)
    assert row["path"].endswith("/BlueShirt_Free_pi16_0.5_R1.bag")


def test_a_workspace_there_is_refused_in_one_line(odd: Path, tmp_path: Path) -> None:
    with pytest.raises(WorkspaceError, match=r"names in UTF-8.*Rename that folder"):
        Workspace.create(odd / "ws")
    assert list(odd.iterdir()) == []
    Workspace.create(tmp_path / "ws")
    (tmp_path / "ws").rename(odd / "ws")
    with pytest.raises(WorkspaceError, match=r"no path for 'features'.*Rename that folder"):
        Workspace.find(odd / "ws")


@pytest.mark.parametrize("command", ["simulate camera_default_0 --out ODD", "score ODD .", "score . ODD"])
def test_parquet_there_is_refused_in_one_line(odd: Path, tmp_path: Path, command: str) -> None:
    Workspace.create(tmp_path / "ws")
    arguments = [str(odd) if word == "ODD" else word for word in command.split()]
    more = ["-w", str(tmp_path / "ws")] if command.startswith("simulate") else []
    done = CliRunner().invoke(application(), [*arguments, *more])
    assert isinstance(done.exception, WorkspaceError)
    assert "names in UTF-8" in str(done.exception)


def test_the_index_keeps_what_is_no_utf8(tmp_path: Path) -> None:
    index = Index.create(tmp_path / "index", Index(None))
    stat = SourceStat(1, 2, 3, 4)
    failure = Failure("decode", "a", "", "key", "BagError", f"{ODD}: \ud800 is empty", "", 1)
    index.set_source_digest(Path(ODD), stat, "digest")
    index.set_failure(failure)
    index.close()
    index = Index(tmp_path / "index")
    assert index.source_digests() == {ODD: (stat, "digest")}
    assert list(index.failures().values()) == [failure]
    index.forget_sources([ODD])
    assert index.source_digests() == {}
    index.close()
