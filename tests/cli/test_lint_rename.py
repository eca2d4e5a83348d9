"""``garment lint --rename``: what it proposes, what it does, and what a kill or a hand in between leaves."""

from __future__ import annotations

import contextlib
import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from garment_dataset.catalog.renaming import Rename
from garment_dataset.errors import WorkspaceError
from garment_dataset.workspace import renames
from garment_dataset.workspace.renames import JOURNAL, apply_renames, finish_renames

if TYPE_CHECKING:
    from collections.abc import Callable

    from garment_dataset.workspace import Workspace
    from tests.cli.conftest import Garment
    from tests.conftest import MakeRecording

WRONG = "FelShirt_Free_pi16.0.5_B1.bag"
RIGHT = "FelShirt_Free_pi16_0.5_B1.bag"
FIRST, SECOND = "GreenTowel_Corner_01_pi16_0.5_R1.bag", "GreenTowel_Corner_02_pi16_0.5_R1.bag"


@pytest.fixture
def place(workspace: Workspace) -> Workspace:
    """A workspace without bags."""
    for path in workspace.recordings_dir.iterdir():
        path.unlink()
    return workspace


@pytest.fixture
def run(garment: Garment, place: Workspace) -> Callable[..., Any]:
    def in_place(*arguments: str, code: int = 0) -> Any:
        return json.loads(garment("lint", "--rename", "--json", *arguments, cwd=place.root, code=code).out)

    return in_place


def named(place: Workspace) -> list[str]:
    return sorted(path.name for path in place.recordings_dir.iterdir())


def test_renames_are_shown_then_done_and_then_there_are_none(place: Workspace, garment: Garment) -> None:
    (place.recordings_dir / WRONG).touch()
    shown = garment("lint", "--rename", cwd=place.root, code=1).out
    assert shown == f"rename recordings/{WRONG} -> {RIGHT}\n1 to rename; `--apply` does it\n"
    assert named(place) == [WRONG]
    done = garment("lint", "--rename", "--apply", cwd=place.root).out
    assert done == f"renamed recordings/{WRONG} -> {RIGHT}\n1 renamed; `garment build` moves their results along\n"
    assert named(place) == [RIGHT]
    assert garment("lint", "--rename", cwd=place.root).out == "nothing to rename\n"


def test_filters_choose_what_is_renamed(place: Workspace, run: Callable[..., Any]) -> None:
    (place.recordings_dir / WRONG).touch()
    assert run("code=duplicate") == {"applied": False, "renames": [], "refused": []}
    assert [each["name"] for each in run("FelShirt*", code=1)["renames"]] == [RIGHT]


def test_a_folder_is_renamed_as_a_folder(place: Workspace, run: Callable[..., Any]) -> None:
    folder = place.recordings_dir / WRONG.removesuffix(".bag")
    folder.mkdir()
    (folder / "metadata.yaml").touch()
    run("--apply")
    assert named(place) == [RIGHT.removesuffix(".bag")]


def test_links_stay_as_they_are(place: Workspace, run: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / WRONG).touch()
    (tmp_path / "GreenTowel_Free_pi16.0.5_R1.bag").touch()
    (place.recordings_dir / WRONG).symlink_to(tmp_path / WRONG)
    (place.recordings_dir / "more").symlink_to(tmp_path)
    refused = run("--apply", code=1)["refused"]
    assert {each["reason"] for each in refused} == {"a link into somewhere else"}
    assert named(place) == [WRONG, "more"]
    assert sorted(path.name for path in tmp_path.glob("*.bag")) == [WRONG, "GreenTowel_Free_pi16.0.5_R1.bag"]


def test_what_has_the_name_already_is_not_overwritten(place: Workspace, run: Callable[..., Any]) -> None:
    wrong = "FelShirt_Free_pi16_0,5_B1.bag"
    (place.recordings_dir / wrong).write_text("one")
    (place.recordings_dir / RIGHT).write_text("other")
    assert "has that name already" in run("--apply", code=1)["refused"][0]["reason"]
    (place.recordings_dir / RIGHT).unlink()
    (place.recordings_dir / RIGHT).mkdir()  # no bag at all
    assert "is in the way" in run("--apply", code=1)["refused"][0]["reason"]
    assert (place.recordings_dir / wrong).read_text() == "one"


def test_apply_alone_is_refused(place: Workspace, garment: Garment) -> None:
    ran = garment("lint", "--apply", cwd=place.root, code=2)
    assert "--rename" in ran.err
    assert "Traceback" not in ran.err


@pytest.mark.skipif(sys.platform != "linux", reason="file names are bytes on Linux alone")
def test_a_name_that_is_no_text_is_renamed(place: Workspace, run: Callable[..., Any]) -> None:
    wrong = os.fsdecode(b"Gr\xc3\xbcnTowel_Free_pi16_0,5_R1.bag\xff.bag")
    place.private_dir.mkdir(exist_ok=True)
    apply_renames(place, [Rename(place.recordings_dir / _touch(place, wrong), RIGHT)])
    assert named(place) == [RIGHT]
    (place.recordings_dir / RIGHT).rename(place.recordings_dir / "BlauTücher_Free_pi16_0,5_R1.bag")
    run("--apply")
    assert named(place) == ["BlauTucher_Free_pi16_0.5_R1.bag"]


def _touch(place: Workspace, name: str) -> str:
    (place.recordings_dir / name).touch()
    return name


# A kill, and a hand in between


@pytest.mark.parametrize("killed_at", range(8))
def test_two_bags_that_swap_their_names_do_so_wherever_it_is_killed(
    place: Workspace, monkeypatch: pytest.MonkeyPatch, killed_at: int
) -> None:
    folder = place.recordings_dir
    (folder / FIRST).write_text("first")
    (folder / SECOND).write_text("second")
    place.private_dir.mkdir(exist_ok=True)
    with monkeypatch.context() as patched:
        calls = iter(range(100))

        def die_before_or_after(function: Callable[..., Any]) -> Callable[..., Any]:
            def call(*arguments: Any) -> Any:
                if next(calls) == killed_at:
                    raise KeyboardInterrupt
                return function(*arguments)

            return call

        for name in ("_write", "_sync"):
            patched.setattr(renames, name, die_before_or_after(getattr(renames, name)))
        with contextlib.suppress(KeyboardInterrupt):
            apply_renames(place, [Rename(folder / FIRST, SECOND), Rename(folder / SECOND, FIRST)])
    begun = (place.private_dir / JOURNAL).exists()
    assert begun or killed_at in (0, 1) or (folder / FIRST).read_text() == "second"
    finish_renames(place)
    assert named(place) == [FIRST, SECOND]
    assert {(folder / FIRST).read_text(), (folder / SECOND).read_text()} == {"first", "second"}
    if begun:
        assert (folder / FIRST).read_text() == "second"
    assert not (place.private_dir / JOURNAL).exists()


def test_an_interrupted_renaming_is_said_and_finished_by_the_next(place: Workspace, garment: Garment) -> None:
    (place.recordings_dir / WRONG).touch()
    place.private_dir.mkdir(exist_ok=True)
    (place.private_dir / JOURNAL).write_text(json.dumps({"done": 0, "steps": [[WRONG, RIGHT]]}))
    assert "was interrupted" in garment("lint", "--rename", cwd=place.root, code=1).err
    ran = garment("lint", "--rename", "--apply", cwd=place.root)
    assert ran.err == f"finished what was interrupted: {WRONG} -> {RIGHT}\n"
    assert named(place) == [RIGHT]


def test_a_bag_that_is_gone_meanwhile_is_said_and_nothing_is_done(place: Workspace) -> None:
    place.private_dir.mkdir(exist_ok=True)
    journal = place.private_dir / JOURNAL
    journal.write_text(json.dumps({"done": 0, "steps": [[WRONG, RIGHT]]}))
    with pytest.raises(WorkspaceError, match="neither is there"):
        finish_renames(place)
    journal.write_text("{")
    with pytest.raises(WorkspaceError, match="journal"):
        finish_renames(place)


def test_a_build_at_work_keeps_renaming_out(place: Workspace, garment: Garment) -> None:
    (place.recordings_dir / WRONG).touch()
    with renames.locked(place):
        ran = garment("lint", "--rename", "--apply", cwd=place.root, code=None)
    assert ran.code != 0
    assert "another process writes it" in ran.err
    assert named(place) == [WRONG]


# Results


def test_results_go_along_and_no_stage_is_run_again(
    place: Workspace, garment: Garment, make_recording: MakeRecording
) -> None:
    make_recording(place.recordings_dir / "GreenTowel_Rular_01_pi16_0.5_R1.bag")
    garment("build", cwd=place.root)
    garment("lint", "--rename", "--apply", cwd=place.root)
    assert named(place) == ["GreenTowel_Ruler_01_pi16_0.5_R1.bag"]
    counts = json.loads(garment("build", "--json", cwd=place.root).out)["counts"]
    assert (counts["relabelled"], counts["built"]) == (3, 0)
    published = place.features_dir.rglob("*.parquet")
    assert {path.stem for path in published} == {"GreenTowel_Ruler_01_pi16_0.5_R1"}
