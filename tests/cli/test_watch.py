"""``garment watch`` as a user meets it: a folder that fills, what is built of it, and how it stops."""

from __future__ import annotations

import os
import queue
import shutil
import signal
import subprocess
import sys
import threading
import time
from typing import TYPE_CHECKING

import pytest

from tests.conftest import COLOR_RECORDINGS, RECORDINGS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from garment_dataset.workspace import Workspace
    from tests.cli.conftest import Garment
    from tests.conftest import MakeRecording

NAME, OTHER, OWN = RECORDINGS
SCENE = "camera_default_0"
LONGEST_S = 60.0


def news(text: str) -> list[str]:
    """Return the lines without their times."""
    return [" ".join(line.split()[1:]) for line in text.splitlines()]


@pytest.fixture
def once(garment: Garment) -> Callable[..., list[str]]:
    def run(place: Workspace, *arguments: str, code: int = 0) -> list[str]:
        ran = garment("watch", "--once", "--settle-s", "0.05", "-j", "0", *arguments, cwd=place.root, code=code)
        assert "Traceback" not in ran.err
        return news(ran.out)

    return run


def cut(path: Path, most_bytes: int = 100_000) -> bytes:
    """Leave the beginning of a bag, as a copy that is under way has it; return all of it."""
    content = path.read_bytes()
    path.unlink()  # a link to a sample, perhaps
    path.write_bytes(content[:most_bytes])
    return content


def published(place: Workspace) -> set[str]:
    return {path.stem for path in place.features_dir.rglob("*.parquet")}


def test_once_builds_what_is_final_together_and_then_finds_it_fresh(workspace: Workspace, garment: Garment) -> None:
    ran = garment("watch", "--once", "--settle-s", "0.05", "-j", "0", cwd=workspace.root)
    assert "building 3 of 3 recordings" in ran.err
    first, *built = news(ran.out)
    assert first == f"unknown {OWN} not in recordings.csv; it is built all the same"
    assert [line.split()[:4] for line in built] == [["built", name, "3", "results"] for name in RECORDINGS]
    assert published(workspace) == set(RECORDINGS)
    again = garment("watch", "--once", "--settle-s", "0.05", "-j", "0", cwd=workspace.root)
    assert news(again.out) == [first, "fresh 3 recordings"]


def test_filters_choose_what_is_built(workspace: Workspace, once: Callable[..., list[str]]) -> None:
    assert [line.split()[1] for line in once(workspace, "garment=GreenTowel", "*_02_*")] == [OTHER]
    assert published(workspace) == {OTHER}
    assert once(workspace, "FelShirt*") == []


def test_bags_that_are_not_final_are_not_built(workspace: Workspace, once: Callable[..., list[str]]) -> None:
    folder = workspace.recordings_dir
    whole = cut(folder / f"{NAME}.bag")
    (folder / f"{OWN}.bag").rename(folder / f"{OWN}.bag.active")
    (folder / "BlueShirt_Free_pi16_0.5_R1.bag").touch()
    (folder / "wrong.bag").touch()
    lines = once(workspace)
    assert published(workspace) == {OTHER}
    assert sorted(line[:34] for line in lines) == sorted(
        line[:34]
        for line in (
            f"built {OTHER}",
            f"still written {NAME}",
            f"still written {OWN}.bag.active",
            "still written BlueShirt_Free_pi16_0.5_R1",
            "left out wrong.bag not a recording name",
        )
    )
    assert any("salvage" in line for line in lines)
    (folder / f"{NAME}.bag").write_bytes(whole)
    (folder / f"{OWN}.bag.active").rename(folder / f"{OWN}.bag")
    once(workspace)
    assert published(workspace) == set(RECORDINGS)


def test_what_fails_is_said_and_the_exit_code_is_1(
    workspace: Workspace, once: Callable[..., list[str]], make_recording: MakeRecording
) -> None:
    foreign, failing = "RedSkirt_Belt_pi16_0.5_R1", "BlueShirt_Free_pi16_0.5_R1"
    (workspace.recordings_dir / f"{foreign}.bag").write_bytes(b"no bag at all")
    make_recording(workspace.recordings_dir / f"{failing}.bag", fault="zero_k")
    lines = once(workspace, code=1)
    assert [line for line in lines if line.startswith(f"failed {foreign} not a ROS 1 bag")]
    assert [line for line in lines if line.startswith(f"failed {failing} ")]
    assert published(workspace) >= set(RECORDINGS)
    (workspace.recordings_dir / f"{failing}.bag").unlink()
    make_recording(workspace.recordings_dir / f"{failing}.bag")
    (workspace.recordings_dir / f"{foreign}.bag").unlink()
    assert [line for line in once(workspace) if line.startswith(f"built {failing}")]


def test_recordings_wait_for_their_empty_scene_and_are_built_when_it_arrives(
    color_workspace: Workspace, once: Callable[..., list[str]]
) -> None:
    first, second, third = COLOR_RECORDINGS
    scene = color_workspace.recordings_dir / f"{SCENE}.bag"
    whole = cut(scene)
    lines = once(color_workspace)
    assert [line for line in lines if line.startswith(f"still written {SCENE} cut")]
    assert f"waiting {first} for {SCENE}, not final" in lines
    assert f"waiting {second} for {SCENE}, not final" in lines
    assert published(color_workspace) == {third, "position_2"}
    scene.unlink()
    waiting = [line for line in once(color_workspace) if "no background" in line]
    assert [line.split()[:2] for line in waiting] == [["waiting", first], ["waiting", second]]
    assert "silhouettes" not in {path.parts[-4] for path in color_workspace.features_dir.rglob(f"{first}.parquet")}
    scene.write_bytes(whole)
    lines = once(color_workspace)
    assert f"final {SCENE} an empty scene" in lines
    assert len([line for line in lines if line.startswith("built")]) == 2
    assert (color_workspace.features_dir / "silhouettes").is_dir()


@pytest.mark.parametrize(
    "arguments",
    [
        ("--settle-s", "nan"),
        ("--settle-s", "-1"),
        ("--poll-s", "0"),
        ("--poll-s", "inf"),
        ("garment=Nobody",),
        ("--workspace", "nowhere"),
    ],
)
def test_what_cannot_be_watched_is_refused_in_one_line(
    workspace: Workspace, garment: Garment, arguments: tuple[str, ...]
) -> None:
    ran = garment("watch", "--once", *arguments, cwd=workspace.root, code=2)
    assert len(ran.err.splitlines()) == 1
    assert ran.out == ""


# While it runs


class Watch:
    """``garment watch`` in a process of its own, and what it has said."""

    def __init__(self, place: Workspace) -> None:
        command = [sys.executable, "-m", "garment_dataset", "watch", "--settle-s", "0.3", "--poll-s", "0.1", "-j", "0"]
        self.process = subprocess.Popen(
            command, cwd=place.root, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ}
        )
        self.lines: list[str] = []
        self._queue: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._queue.put(line)

    def wait_for(self, *words: str) -> str:
        """Return the next line that has all words."""
        end_s = time.monotonic() + LONGEST_S
        while True:
            (line,) = news(self._queue.get(timeout=max(0.0, end_s - time.monotonic())))
            self.lines.append(line)
            if all(word in line for word in words):
                return line

    def stop(self, number: signal.Signals) -> tuple[int, str]:
        """Send a signal; return the exit code and what was said."""
        self.process.send_signal(number)
        assert self.process.stderr is not None
        said = self.process.stderr.read()
        return self.process.wait(LONGEST_S), said


@pytest.fixture
def watch(workspace: Workspace) -> Iterator[Watch]:
    """A watch of a workspace with one recording."""
    for name in (OTHER, OWN):
        (workspace.recordings_dir / f"{name}.bag").unlink()
    running = Watch(workspace)
    yield running
    running.process.kill()
    running.process.wait()
    for pipe in (running.process.stdout, running.process.stderr):
        assert pipe is not None
        pipe.close()


def test_recordings_are_built_as_they_arrive_until_it_is_stopped(
    workspace: Workspace, watch: Watch, sample_bags: dict[str, Path]
) -> None:
    folder = workspace.recordings_dir
    assert watch.wait_for("built").startswith(f"built {NAME} ")
    (folder / "wrong.bag").touch()
    (folder / "nowhere.bag").symlink_to(folder / "gone")
    watch.wait_for("left out wrong.bag")
    content = sample_bags[OTHER].read_bytes()
    with (folder / f"{OTHER}.bag").open("wb") as file:
        for begin in range(0, len(content), len(content) // 8):
            file.write(content[begin : begin + len(content) // 8])
            file.flush()
            time.sleep(0.15)
    assert watch.wait_for("built").startswith(f"built {OTHER} ")
    assert any(line.startswith(f"still written {OTHER}") for line in watch.lines)
    (folder / f"{OTHER}.bag").unlink()
    shutil.copy(sample_bags[OTHER], folder / f"{OTHER}.bag")
    watch.wait_for("fresh", OTHER)
    code, said = watch.stop(signal.SIGINT)
    assert code == 0
    assert said.count("a link to nothing") == 1
    assert said.endswith("garment: stopped watching\n")
    assert sum("wrong.bag" in line for line in watch.lines) == 1


def test_what_failed_is_not_tried_again_until_its_bag_changes(
    workspace: Workspace, watch: Watch, sample_bags: dict[str, Path]
) -> None:
    bad = workspace.recordings_dir / f"{OWN}.bag"
    bad.write_bytes(b"no bag at all")
    watch.wait_for("failed", OWN, "not a ROS 1 bag")
    shutil.copy(sample_bags[OTHER], workspace.recordings_dir / f"{OTHER}.bag")
    watch.wait_for("built", OTHER)
    assert sum(line.startswith(f"failed {OWN}") for line in watch.lines) == 1
    bad.write_bytes(sample_bags[OWN].read_bytes())
    watch.wait_for("built", OWN)
    assert watch.stop(signal.SIGTERM)[0] == 0


def test_a_pipeline_that_somebody_is_at_work_on_is_said_once_and_waited_for(
    workspace: Workspace, watch: Watch, sample_bags: dict[str, Path]
) -> None:
    watch.wait_for("built", NAME)
    pipeline = workspace.pipelines_dir / "depth.toml"
    text = pipeline.read_text()
    pipeline.write_text("stages = [")
    shutil.copy(sample_bags[OTHER], workspace.recordings_dir / f"{OTHER}.bag")
    watch.wait_for("failed all builds", "depth.toml")
    time.sleep(0.5)
    mended = pipeline.with_suffix(".new")
    mended.write_text(text)
    mended.replace(pipeline)
    watch.wait_for("built", OTHER)
    assert sum("depth.toml" in line for line in watch.lines) == 1
    assert watch.stop(signal.SIGINT)[0] == 0
