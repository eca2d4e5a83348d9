"""A recording that is not as it should be is never just "fresh": every verb that looks says so, again and again."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from typer.testing import CliRunner

from garment_dataset.cli import application
from garment_dataset.errors import FilterError
from garment_dataset.features.quality import read_quality

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace
    from tests.conftest import MakeColorRecording, MakeRecording

GOOD, BLIND, TORN = (f"GreenTowel_Ruler_0{number}_pi16_0.5_R1" for number in (1, 4, 5))


def run(workspace: Workspace, *arguments: str) -> tuple[str, str]:
    done = CliRunner().invoke(application(), [*arguments, "--workspace", str(workspace.root)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout, done.stderr


@pytest.fixture
def judged(workspace: Workspace, make_recording: MakeRecording, make_color_recording: MakeColorRecording) -> Workspace:
    """A workspace with a good recording, one whose depth camera was unplugged, and one with a torn image."""
    for path in workspace.recordings_dir.iterdir():
        path.unlink()
    make_recording(workspace.recordings_dir / f"{GOOD}.bag", frames=40)
    make_color_recording(workspace.recordings_dir / f"{BLIND}.bag")
    make_recording(workspace.recordings_dir / f"{TORN}.bag", frames=40, fault="short_image")
    text = 'recordings = ["axis=R"]\nstages = ["decode", "depth_points", "kinematics", "quality"]\n'
    (workspace.pipelines_dir / "depth.toml").write_text(text)
    return workspace


def test_it_is_said_by_every_verb_and_every_time(judged: Workspace) -> None:
    text = f"{BLIND}: unusable: decode (depth): no depth images at all"
    assert text in run(judged, "build", "-j", "0")[1]
    for verb in (("build",), ("status",)):
        out, err = run(judged, *verb)
        assert text in err, verb
        assert f"{GOOD}:" not in err
        assert "fresh" in out + err
    out, _ = run(judged, "why", BLIND)
    assert "note: unusable: decode (depth): no depth images at all" in out
    assert "no depth images, /xtion1/depth/image_raw is missing" in out
    out, _ = run(judged, "show", BLIND)
    assert "no depth images at all" in out
    assert "/xtion1/rgb/image_raw  6 x sensor_msgs/msg/Image" in out
    assert "/xtion1/depth/image_raw  not in the bag" in out


def test_recordings_can_be_chosen_by_it(judged: Workspace) -> None:
    run(judged, "build", "-j", "0")
    rows = json.loads(run(judged, "list", "quality=unusable", "--json")[0])
    assert [row["recording"] for row in rows] == [BLIND]
    assert rows[0]["coverage"] == 0.0
    assert "decode: no depth images at all" in rows[0]["why"]
    few = json.loads(run(judged, "list", "coverage<0.9", "--json")[0])
    assert [row["recording"] for row in few] == [BLIND]
    most = json.loads(run(judged, "list", "coverage>=0.9", "--json")[0])
    assert [row["recording"] for row in most] == [GOOD, TORN]
    table, _ = run(judged, "list", "state=present")
    assert [line.split()[-2:] for line in table.splitlines()[1:]] == [
        ["ok", "100%"],
        ["unusable", "0%"],
        ["ok", "100%"],
    ]
    with pytest.raises(FilterError, match="< compares numbers"):
        run(judged, "list", "quality<1")


def test_a_fault_of_an_image_stands_in_the_table(judged: Workspace) -> None:
    run(judged, "build", "-j", "0")
    out, _ = run(judged, "show", TORN)
    assert "40 depth images, 39 used; data: 1" in out
    assert "1 of 40 messages skipped, first message 2" in out
    assert read_quality(judged.features_dir)[TORN].quality == "ok"


def test_what_failed_is_shown_with_the_recording(judged: Workspace, make_recording: MakeRecording) -> None:
    (judged.recordings_dir / f"{GOOD}.bag").unlink()
    make_recording(judged.recordings_dir / f"{GOOD}.bag", fault="zero_k")
    CliRunner().invoke(application(), ["build", "-j", "0", "--workspace", str(judged.root)])
    assert "failed: " in run(judged, "show", GOOD)[0]
    (judged.recordings_dir / f"{GOOD}.bag").write_bytes(b"#ROSBAG V2.0\n")
    assert "cannot be read: " in run(judged, "show", GOOD)[0]


def test_bags_that_are_skipped_are_named(judged: Workspace) -> None:
    path = judged.recordings_dir / f"{TORN}.bag"
    path.rename(path.with_suffix(".BAG"))
    (judged.recordings_dir / f"{BLIND}.bag.active").touch()
    for verb in (("build", "-j", "0"), ("build",), ("status",)):
        err = run(judged, *verb)[1]
        assert f"left out: {TORN}.BAG: not a recording name" in err
        assert f"left out: {BLIND}.bag.active: not finished" in err
