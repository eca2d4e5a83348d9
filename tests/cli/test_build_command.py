"""``build``, ``status``, ``why`` and ``dag`` as a user meets them, on small recordings."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import pyarrow.parquet as pq
import pytest

from garment_dataset.features.reading import tables_in

if TYPE_CHECKING:
    from pathlib import Path

    from garment_dataset.workspace import Workspace
    from tests.cli.conftest import Garment
    from tests.conftest import MakeRecording

DECODED = {"frames", "camera", "gripper", "joints", "world"}
TABLES = DECODED | {"chains", "points", "kinematics"}


def feature_bytes(workspace: Workspace) -> dict[str, bytes]:
    root = workspace.features_dir
    return {path.relative_to(root).as_posix(): path.read_bytes() for path in sorted(root.glob("**/*.parquet"))}


def test_a_build_makes_every_table_and_a_second_does_nothing(workspace: Workspace, garment: Garment) -> None:
    first = garment("build", "--json", cwd=workspace.root)
    assert json.loads(first.out)["counts"]["built"] == 9
    assert set(tables_in(workspace.features_dir)) == TABLES
    before = feature_bytes(workspace)
    assert len(before) == 3 * len(TABLES)
    second = garment("build", cwd=workspace.root)
    assert second.out == ""
    assert "nothing to do: all 9 results of 3 recordings are fresh" in second.err
    assert json.loads(garment("build", "--json", cwd=workspace.root).out)["counts"] == {"fresh": 9}
    assert feature_bytes(workspace) == before


def test_the_bytes_do_not_depend_on_the_workers(workspace: Workspace, garment: Garment) -> None:
    garment("build", "-j", "0", cwd=workspace.root)
    alone = feature_bytes(workspace)
    shutil.rmtree(workspace.features_dir)
    shutil.rmtree(workspace.private_dir)
    garment("build", "-j", "2", cwd=workspace.root)
    assert feature_bytes(workspace) == alone


def test_filters_and_stages_choose_what_is_built(workspace: Workspace, garment: Garment) -> None:
    garment("build", "garment=MyScarf", "--stage", "decode", cwd=workspace.root)
    assert set(tables_in(workspace.features_dir)) == DECODED
    assert {path.stem for path in workspace.features_dir.rglob("*.parquet")} == {"MyScarf_Corner_pi16_0.5_R1"}
    assert "no such garment" in garment("build", "garment=Nobody", code=2, cwd=workspace.root).err
    unmatched = garment("build", "MyScraf_*", code=2, cwd=workspace.root).err
    assert "no recording matches" in unmatched
    assert "the nearest is MyScarf_Corner_pi16_0.5_R1" in unmatched
    assert len(unmatched.splitlines()) == 1
    assert "no stage 'decoed'" in garment("build", "-s", "decoed", code=2, cwd=workspace.root).err
    nothing = garment("build", "GreenTowel_Free*", code=2, cwd=workspace.root).err
    assert "nothing to build" in nothing
    assert len(nothing.splitlines()) == 1


def test_a_dry_run_and_status_say_the_same_and_do_nothing(workspace: Workspace, garment: Garment) -> None:
    dry = json.loads(garment("build", "--dry-run", "--json", cwd=workspace.root).out)
    assert dry == json.loads(garment("status", "--json", cwd=workspace.root).out)
    assert dry["counts"]["missing"] == 9
    assert dry["absent"] == 44
    assert not workspace.features_dir.exists()
    garment("status", "--exit-code", code=1, cwd=workspace.root)
    garment("build", cwd=workspace.root)
    garment("status", "--exit-code", cwd=workspace.root)


def test_why_gives_every_reason_old_and_new(workspace: Workspace, garment: Garment) -> None:
    garment("build", cwd=workspace.root)
    pipeline = workspace.pipelines_dir / "depth.toml"
    pipeline.write_text(pipeline.read_text() + "\n[params.depth_points]\npoint_count = 4\n")
    text = garment("why", "MyScarf_Corner_pi16_0.5_R1", cwd=workspace.root).out
    assert "decode:MyScarf_Corner_pi16_0.5_R1: fresh" in text
    assert "parameter point_count: 5 -> 4" in text
    decisions = json.loads(garment("why", "MyScarf_Corner_pi16_0.5_R1", "--json", cwd=workspace.root).out)
    assert [decision["state"] for decision in decisions] == ["fresh", "stale", "stale"]
    assert decisions[1]["reasons"] == [{"kind": "parameter", "name": "point_count", "old": "5", "new": "4"}]
    assert "point_count: 5 -> 4" in garment("status", cwd=workspace.root).out
    garment("why", "GreenTowel_Free_pi16_0.5_R1", code=2, cwd=workspace.root)


def test_a_parameter_set_back_is_linked_from_the_store(workspace: Workspace, garment: Garment) -> None:
    garment("build", cwd=workspace.root)
    before = feature_bytes(workspace)
    pipeline = workspace.pipelines_dir / "depth.toml"
    original = pipeline.read_text()
    pipeline.write_text(original + "\n[params.depth_points]\npoint_count = 4\n")
    changed = json.loads(garment("build", "--json", cwd=workspace.root).out)["counts"]
    assert (changed["built"], changed["fresh"]) == (6, 3)
    assert feature_bytes(workspace) != before
    pipeline.write_text(original)
    back = json.loads(garment("build", "--json", cwd=workspace.root).out)["counts"]
    assert (back["linked"], back["built"]) == (6, 0)
    assert feature_bytes(workspace) == before


def test_one_bad_bag_does_not_stop_the_others(
    workspace: Workspace, garment: Garment, make_recording: MakeRecording
) -> None:
    bad = workspace.recordings_dir / "RedSkirt_Belt_pi16_0.5_R1.bag"
    bad.write_bytes(b"#ROSBAG V2.0\n and then nothing")
    make_recording(workspace.recordings_dir / "BlueShirt_Free_pi16_0.5_R1.bag", fault="zero_k")
    ran = garment("build", code=1, cwd=workspace.root)
    assert "2 failed:" in ran.err
    assert "decode:RedSkirt_Belt_pi16_0.5_R1" in ran.err
    assert "Traceback" not in ran.err
    assert len(feature_bytes(workspace)) == 3 * len(TABLES)
    again = garment("build", code=1, cwd=workspace.root)
    assert "garment build --failed" in again.err
    assert "Traceback" in garment("why", "RedSkirt_Belt_pi16_0.5_R1", cwd=workspace.root).out
    bad.unlink()
    make_recording(bad)
    counts = json.loads(garment("build", "--json", code=1, cwd=workspace.root).out)["counts"]
    # the bag has the bytes of another recording: nothing has to be run
    assert (counts["relabelled"], counts["built"], counts["failed"], counts["blocked"]) == (3, 0, 1, 2)


def test_a_faulty_message_is_skipped_and_reported(
    workspace: Workspace, garment: Garment, make_recording: MakeRecording
) -> None:
    name = "BlueShirt_Free_pi16_0.5_R1"
    make_recording(workspace.recordings_dir / f"{name}.bag", fault="short_image")
    ran = garment("build", name, cwd=workspace.root)
    assert "note:" in ran.err
    (path,) = (workspace.features_dir / "frames").rglob(f"{name}.parquet")
    frames = pq.ParquetFile(path).read().to_pylist()
    faulty = [row for row in frames if row["fault"] is not None]
    assert [(row["stream"], row["frame"]) for row in faulty] == [("depth", 2)]
    (path,) = (workspace.features_dir / "points").rglob(f"{name}.parquet")
    points = pq.ParquetFile(path).read()
    assert 2 not in points["frame"].to_pylist()
    assert points.num_rows == 23 * 5


def test_a_changed_bag_and_rehash(workspace: Workspace, garment: Garment, make_recording: MakeRecording) -> None:
    garment("build", cwd=workspace.root)
    name = "GreenTowel_Ruler_01_pi16_0.5_R1"
    (workspace.recordings_dir / f"{name}.bag").unlink()
    make_recording(workspace.recordings_dir / f"{name}.bag", shift_m=0.01)
    counts = json.loads(garment("build", "--json", cwd=workspace.root).out)["counts"]
    assert (counts["built"], counts["fresh"]) == (3, 6)
    counts = json.loads(garment("build", "--rehash", "--json", cwd=workspace.root).out)["counts"]
    assert (counts["built"], counts["fresh"]) == (0, 9)


@pytest.mark.parametrize("form", ["text", "mermaid"])
def test_the_graph_is_drawn(workspace: Workspace, garment: Garment, form: str) -> None:
    text = garment("dag", "--form", form, cwd=workspace.root).out
    for stage in ("decode", "depth_points", "kinematics"):
        assert stage in text
    assert "flowchart" in text or form == "text"
    drawn = json.loads(garment("dag", "--json", cwd=workspace.root).out)
    depth = next(item for item in drawn if item["pipeline"] == "depth")
    assert [stage["name"] for stage in depth["stages"]] == ["decode", "depth_points", "kinematics"]
    assert depth["stages"][1]["params"]["point_count"] == 5
    assert "point_count = 5" in garment("dag", "--params", cwd=workspace.root).out


def test_an_interrupted_build_keeps_what_it_has_and_leaves_no_rubbish(
    workspace: Workspace, garment: Garment, make_recording: MakeRecording
) -> None:
    for number in range(3, 6):
        make_recording(workspace.recordings_dir / f"GreenTowel_Ruler_{number:02}_pi16_0.5_R1.bag")
    command = [sys.executable, "-m", "garment_dataset", "build", "-j", "1"]
    process = subprocess.Popen(command, cwd=workspace.root, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    first = process.stderr.readline()
    process.send_signal(signal.SIGINT)
    rest = process.communicate(timeout=60)[1]
    assert first.startswith("built")
    assert "interrupted" in rest
    assert process.returncode == 130
    assert not (workspace.private_dir / "scratch").exists()
    counts = json.loads(garment("build", "--json", cwd=workspace.root).out)["counts"]
    assert counts["fresh"] >= 1
    assert counts["fresh"] + counts["built"] + counts["relabelled"] == 18


def test_no_workspace_is_one_line(tmp_path: Path, garment: Garment) -> None:
    for verb in ("build", "status", "dag", "list", "lint"):
        ran = garment(verb, code=2, cwd=tmp_path)
        assert ran.err.startswith("garment: ")
        assert len(ran.err.splitlines()) == 1
