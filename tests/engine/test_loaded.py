"""The code that ran is the code that was read: stale bytecode, modules that stay loaded, two installations."""

from __future__ import annotations

import os
import shutil
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from garment_dataset.engine.code import CodeCache
from garment_dataset.engine.events import Ending
from garment_dataset.engine.graph import NodeId
from garment_dataset.engine.loaded import edited_since_loaded, state_of
from garment_dataset.engine.loading import load_module
from garment_dataset.engine.plan import State
from tests.engine.conftest import ROOTS, Toy

if TYPE_CHECKING:
    from garment_dataset.engine.stage import Stage


def values(toy: Toy) -> list[object]:
    import pyarrow.parquet as pq

    return list(pq.read_table(toy.features_dir / "squares" / "kind=toy" / "a.parquet")["value"].to_pylist())


def same_size_and_time(path: Path, old: str, new: str) -> None:
    """Edit a file as nobody would notice who looks at size and time."""
    stat = path.stat()
    text = path.read_text()
    assert text.count(old) == 1
    assert len(old) == len(new)
    path.write_text(text.replace(old, new))
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))


@pytest.mark.parametrize("jobs", [0, 1])
def test_an_edit_that_keeps_size_and_time_is_noticed_and_run(toy: Toy, jobs: int) -> None:
    toy.build(jobs=jobs)
    assert values(toy) == [1, 4, 9]
    same_size_and_time(toy.root / "toy" / "helpers.py", "return a * b", "return a + b")
    assert toy.plan()[NodeId("squares", "a")].state is State.STALE
    assert toy.endings(toy.build(jobs=jobs))["squares built"] == ["a", "b"]
    assert values(toy) == [2, 4, 6]


def test_bytecode_that_python_takes_for_current_is_not_run(toy: Toy, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two edits of one size within a second: the first one's bytecode fits the second one's size and second."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    toy.build(jobs=1)
    helpers = toy.root / "toy" / "helpers.py"
    assert list((toy.root / "toy" / "__pycache__").glob("helpers.*"))
    same_size_and_time(helpers, "return a * b", "return a + b")
    toy.build(jobs=1)
    assert values(toy) == [2, 4, 6]


def test_code_that_is_still_loaded_is_not_taken_for_what_is_read_now(toy: Toy, monkeypatch: pytest.MonkeyPatch) -> None:
    """A notebook that has built, an edit, and ``jobs=0``: the old code must not run under the new key."""
    toy.build()
    stages = toy.stages()
    toy.edit("helpers.py", "return a * b", "return a + b")
    monkeypatch.setattr(toy, "stages", lambda: stages)  # nobody loads them anew
    report = toy.build()
    event = report.events[NodeId("squares", "a")]
    assert event.ending is Ending.FAILED
    assert "edited since it was loaded" in event.message
    assert values(toy) == [1, 4, 9]
    assert toy.endings(toy.build(jobs=1))["squares built"] == ["a", "b"]
    assert values(toy) == [2, 4, 6]


def test_a_file_that_was_only_touched_is_fresh(toy: Toy) -> None:
    toy.build()
    for path in (toy.root / "toy").glob("*.py"):
        os.utime(path, ns=(1, time.time_ns()))
    assert toy.plan().is_fresh


def test_a_file_that_was_written_again_as_it_was_is_loaded_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker of a cluster outlives many builds: what it has loaded must not become a dead end."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    file = tmp_path / "written_again.py"
    file.write_text("VALUE = 1\n")
    read = {str(file): state_of(file.read_bytes())}
    first = load_module("written_again", tmp_path)
    assert edited_since_loaded(read) is None
    assert load_module("written_again", tmp_path) is first
    file.write_text("VALUE = 1\n")
    assert edited_since_loaded(read) == str(file)
    assert load_module("written_again", tmp_path).VALUE == 1
    assert edited_since_loaded(read) is None


def test_two_installations_on_one_store_keep_their_own_fingerprints(toy: Toy, tmp_path: Path) -> None:
    stages: dict[str, Stage] = toy.stages()
    here = ROOTS | {"toy": toy.root / "toy"}
    shutil.copytree(toy.root / "toy", tmp_path / "other" / "toy")
    there = ROOTS | {"toy": tmp_path / "other" / "toy"}
    helpers = tmp_path / "other" / "toy" / "helpers.py"
    helpers.write_text(helpers.read_text().replace("return a * b", "return a + b"))
    folder = toy.private_dir / "code"
    own = [CodeCache(folder, roots).codes(stages.values())["squares"].digest for roots in (here, there, here, there)]
    assert own[0] == own[2] != own[1] == own[3]


def test_one_and_no_worker_make_the_same_bytes_where_a_library_would_use_several_threads(toy: Toy) -> None:
    toy.edit("squares.py", "import pyarrow as pa\n", "import numpy as np\nimport pyarrow as pa\n")
    toy.edit(
        "squares.py",
        '    values = [params.factor * square(v) for v in numbers["value"].to_pylist()]\n',
        "    noise = np.random.default_rng(3).normal(size=3_000_000)\n    values = [square(float(noise @ noise))]\n",
    )
    import numpy as np

    assert np.ones((300, 300)).sum() == 90000  # loaded here, with as many threads as there are processors
    toy.build(jobs=0)
    serial = toy.files()
    shutil.rmtree(toy.private_dir)
    toy.build(jobs=1)
    assert toy.files() == serial
