"""What a build that found nothing to do remembers: nothing can change that it rested on without its being forgotten."""

from __future__ import annotations

import json
import os
import time
from typing import TYPE_CHECKING

import pytest

from garment_dataset.workspace import Workspace, settled
from garment_dataset.workspace.settled import Settled, recall
from tests.workspace.conftest import edit, put_stages, run, small_stage, stale

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

NAMES = ("GreenTowel_Ruler_01_pi16_0.5_R1", "GreenTowel_Ruler_02_pi16_0.5_R1")
HELPER = "def weigh(size):\n    return 2 * size\n"


@pytest.fixture
def resting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    """A workspace of two recordings and one stage, all fresh and remembered, though its files are young."""
    monkeypatch.setattr(settled, "_YOUNG_NS", -3600 * 10**9)
    workspace = Workspace.create(tmp_path / "ws", empty=True)
    for path in workspace.pipelines_dir.glob("*.toml"):
        path.unlink()
    (workspace.pipelines_dir / "small.toml").write_text('stages = ["sizes"]\n[params.sizes]\nfactor = 1.0\n')
    stage = small_stage(
        "sizes", "bag, params", value="weigh(params.factor * len(bag.read_bytes()))", knobs="factor: float = 1.0"
    )
    workspace = put_stages(workspace, "sizes", sizes=f"from weights import weigh\n{stage}", weights=HELPER)
    for number, name in enumerate(NAMES):
        (workspace.recordings_dir / f"{name}.bag").write_text(f"bag {number}")
    run(workspace, "build", "-j", "0")
    run(workspace, "build", "-j", "0")
    assert recall(workspace) == Settled(2, 2, 0, ())
    time.sleep(0.02)  # the clock of a file system ticks every few milliseconds
    return workspace


def bag(workspace: Workspace) -> Path:
    return workspace.recordings_dir / f"{NAMES[0]}.bag"


def published(workspace: Workspace) -> Path:
    return next(workspace.features_dir.rglob(f"{NAMES[0]}.parquet"))


def stored(workspace: Workspace) -> Path:
    return next((workspace.private_dir / "objects").rglob("*.parquet"))


def put(path: Path) -> None:
    path.parent.mkdir()
    path.write_text("another bag")


def append(path: Path, text: str) -> None:
    path.write_text(path.read_text() + text)


def overwrite(path: Path) -> None:
    """Put other bytes into a file without a trace in its size and time of content."""
    stat = path.stat()
    path.chmod(0o644)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))


def replace(path: Path) -> None:
    """Put another file of the same size and time in the place of one."""
    stat = path.stat()
    other = path.with_name("other")
    other.write_bytes(b"x" * stat.st_size)
    os.utime(other, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    other.replace(path)


CHANGES: dict[str, Callable[[Workspace], object]] = {
    "a bag is touched": lambda ws: os.utime(bag(ws)),
    "a bag is written, size and time as before": lambda ws: overwrite(bag(ws)),
    "a bag is replaced, size and time as before": lambda ws: replace(bag(ws)),
    "a bag is gone": lambda ws: bag(ws).unlink(),
    "a bag is renamed": lambda ws: bag(ws).rename(bag(ws).with_name("GreenTowel_Ruler_03_pi16_0.5_R1.bag")),
    "a bag arrives in a folder": lambda ws: put(ws.recordings_dir / "more" / "GreenTowel_Ruler_04_pi16_0.5_R1.bag"),
    "a bag is ignored": lambda ws: (ws.recordings_dir / ".garmentignore").write_text(f"{NAMES[0]}.bag\n"),
    "a parameter is changed": lambda ws: edit(ws.pipelines_dir / "small.toml", "1.0", "2.0"),
    "a pipeline is added": lambda ws: (ws.pipelines_dir / "b.toml").write_text('variant = "b"\nstages = ["sizes"]\n'),
    "a stage is edited": lambda ws: edit(ws.root / "stages" / "sizes.py", "one value", "one number"),
    "a helper function is edited": lambda ws: edit(ws.root / "stages" / "weights.py", "2 * size", "3 * size"),
    "the catalog is changed": lambda ws: append(ws.catalog_dir / "recordings.csv", f"{NAMES[0]},,,,,no\n"),
    "a setting is changed": lambda ws: append(ws.root / "garment.toml", '[paths]\nfeatures = "tables"\n'),
    "a published file is deleted": lambda ws: published(ws).unlink(),
    "a published file is edited by hand": lambda ws: overwrite(published(ws)),
    "a published file is replaced": lambda ws: replace(published(ws)),
    "an orphaned file arrives": lambda ws: published(ws).with_name("x.parquet").write_bytes(b""),
    "an object is deleted": lambda ws: stored(ws).unlink(),
    "an object is damaged": lambda ws: overwrite(stored(ws)),
    "the index is deleted": lambda ws: (ws.private_dir / "index.sqlite").unlink(),
    "the index is damaged": lambda ws: overwrite(ws.private_dir / "index.sqlite"),
    "scratch was left behind": lambda ws: (ws.private_dir / "scratch").mkdir(),
    "the memory itself is damaged": lambda ws: overwrite(ws.private_dir / "settled.json"),
}


@pytest.mark.parametrize("what", CHANGES)
def test_whatever_changes_a_plan_is_made(resting: Workspace, what: str) -> None:
    CHANGES[what](resting)
    assert recall(Workspace.find(resting.root)) is None


@pytest.mark.parametrize("what", ["a bag is written, size and time as before", "a helper function is edited"])
def test_what_changed_is_built(resting: Workspace, what: str) -> None:
    CHANGES[what](resting)
    assert stale(resting) != {}
    run(resting, "build", "-j", "0")
    assert stale(resting) == {}


def test_another_version_of_a_library_is_a_change(
    resting: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    info = tmp_path / "site" / "pyarrow-99.0.dist-info"
    info.mkdir(parents=True)
    about = "Metadata-Version: 2.1\nName: pyarrow\nVersion: {}.0\n"
    (info / "METADATA").write_text(about.format(98))
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    assert recall(resting) is None
    run(resting, "build", "-j", "0")
    run(resting, "build", "-j", "0")
    assert recall(resting) is not None
    (info / "METADATA").write_text(about.format(99))
    assert recall(resting) is None


def test_what_is_remembered_is_said_as_by_a_plan(resting: Workspace) -> None:
    (resting.recordings_dir / "no_name_at_all.bag").write_text("")
    said = run(resting, "build", "-j", "0"), run(resting, "status")
    assert recall(resting) is not None
    assert (run(resting, "build"), run(resting, "status")) == said
    assert "left out: no_name_at_all.bag" in said[0]
    assert json.loads(run(resting, "build", "--json").partition("\nnothing")[0])["counts"] == {"fresh": 2}


def test_only_a_build_of_everything_that_is_all_fresh_is_remembered(resting: Workspace) -> None:
    bag(resting).unlink()
    for arguments in (["build", f"{NAMES[1]}"], ["build", "--stage", "sizes"], ["status"], ["build", "--dry-run"]):
        run(resting, *arguments)
        assert recall(resting) is None


def test_a_file_that_is_young_or_of_the_future_may_change_without_a_trace(
    resting: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(settled, "_YOUNG_NS", 2 * 10**9)
    os.utime(bag(resting))
    run(resting, "build", "-j", "0")
    run(resting, "build", "-j", "0")
    assert recall(resting) is None
    # the clock is set back by an hour after all that has happened
    now_ns = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: now_ns() - 3600 * 10**9)
    run(resting, "build", "-j", "0")
    assert recall(resting) is None
    later_ns = now_ns() + 3 * 10**9
    monkeypatch.setattr(time, "time_ns", lambda: later_ns)
    run(resting, "build", "-j", "0")
    assert recall(resting) is not None
