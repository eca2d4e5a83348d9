"""Mutate the package's own code: whatever line a stage runs, a change of it must change that stage's fingerprint.

Which lines a stage runs is not asked of the fingerprint: each stage is run on a small recording in a fresh interpreter,
and the interpreter tells. Lines that run while a module is imported may make what the stage does not use; where a
mutation of such a line leaves the fingerprint as it was, the stage is run again, and must make the same.
"""

from __future__ import annotations

import ast
import importlib
import json
import random
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import garment_dataset
from garment_dataset.engine.codebase.fingerprint import fingerprint
from garment_dataset.errors import UntraceableCodeError
from tests.conftest import write_color_recording, write_recording
from tests.drills.mutation_edits import Mutation, Place, harmless, mutate, places

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    RecordProperty = Callable[[str, object], None]

PACKAGE = Path(garment_dataset.__file__).parent
SEED = 7


def params_of(name: str) -> type[Any]:
    """Return the class of a stage's parameters: its fields' values are in the key."""
    kind: type[Any] = importlib.import_module(f"garment_dataset.stages.{name}").STAGE.params
    return kind


@dataclass
class Drill:
    """A copy of the package to mutate, and what its stages run and make as it is."""

    folder: Path
    depth_bag: Path
    color_bag: Path
    found: dict[str, Any]

    @property
    def package(self) -> Path:
        return self.folder / "garment_dataset"

    def digest(self, name: str) -> str:
        """Return the fingerprint of a stage in the copy; a refusal is as good as another one."""
        params = params_of(name)
        entry = f"garment_dataset.stages.{name}:{name}"
        excluded = (f"{params.__module__}:{params.__qualname__}",)
        try:
            return fingerprint(entry, roots={"garment_dataset": self.package}, fields_excluded=excluded).digest
        except UntraceableCodeError as error:
            return f"refused: {error}"

    def with_source(self, file: str, source: str) -> Edited:
        return Edited(self.package / file, source)

    def lines(self, name: str, kind: str) -> dict[str, list[int]]:
        lines: dict[str, list[int]] = self.found[name].get(kind, {})
        return lines

    def run(self, what: str) -> dict[str, Any]:
        """Run all stages of the copy in a fresh interpreter."""
        output = self.folder / "found.json"
        output.unlink(missing_ok=True)
        script = Path(__file__).with_name("mutation_coverage.py")
        command = [sys.executable, *map(str, [script, self.folder, self.depth_bag, self.color_bag, what, output])]
        ran = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
        if not output.exists():
            return {"error": ran.stderr[-500:]}
        found: dict[str, Any] = json.loads(output.read_text("utf-8"))
        return found


@dataclass
class Edited:
    """A file that holds other source for a while."""

    path: Path
    source: str

    def __enter__(self) -> None:
        self.before = self.path.read_text("utf-8")
        self.path.write_text(self.source, "utf-8")

    def __exit__(self, *_: object) -> None:
        self.path.write_text(self.before, "utf-8")


@pytest.fixture(scope="module")
def drill(tmp_path_factory: pytest.TempPathFactory) -> Drill:
    folder = tmp_path_factory.mktemp("mutations")
    shutil.copytree(PACKAGE, folder / "garment_dataset", ignore=shutil.ignore_patterns("__pycache__"))
    depth = write_recording(folder / "depth.bag", frames=24)
    color = write_color_recording(folder / "color.bag", frames=12, empty_frames=6)
    made = Drill(folder, depth, color, {})
    made.found = made.run("lines")
    assert "error" not in made.found, made.found
    return made


def candidates(drill: Drill, kind: str) -> list[tuple[str, str, Place]]:
    """Return every place that a stage runs, with the stage and the file, shuffled."""
    every = []
    trees = {}
    for name in sorted(drill.found):
        excluded = frozenset({params_of(name).__name__})
        for file, numbers in sorted(drill.lines(name, kind).items()):
            if file not in trees:
                trees[file] = ast.parse((drill.package / file).read_text("utf-8"))
            lines = set(numbers)
            every += [(name, file, place) for place in places(trees[file], excluded) if place.lines & lines]
    random.Random(SEED).shuffle(every)
    return every


def mutations(drill: Drill, kind: str, count: int) -> Iterator[tuple[str, str, Mutation]]:
    for name, file, place in candidates(drill, kind)[:count]:
        yield name, file, mutate((drill.package / file).read_text("utf-8"), place)


def test_every_stage_runs_code_of_its_own(drill: Drill) -> None:
    for name in drill.found:
        assert f"stages/{name}.py" in drill.lines(name, "run")
        assert "stages/stage.py" in drill.lines(name, "import")
    assert "vision/depth/chain.py" in drill.lines("depth_points", "run")
    assert "vision/depth/chain.py" not in drill.lines("decode", "run")


@pytest.mark.parametrize("count", [12, pytest.param(1200, marks=pytest.mark.slow)])
def test_a_mutation_of_a_line_that_a_stage_runs_changes_its_fingerprint(
    drill: Drill, record_property: RecordProperty, count: int
) -> None:
    before = {name: drill.digest(name) for name in drill.found}
    missed, tried = [], 0
    for name, file, mutation in mutations(drill, "run", count):
        with drill.with_source(file, mutation.source):
            tried += 1
            if drill.digest(name) == before[name]:
                missed.append(f"{name}: {file}: {mutation.what}")
    record_property("mutations", tried)
    record_property("places", len(candidates(drill, "run")))
    assert not missed
    assert tried == count


@pytest.mark.slow
@pytest.mark.parametrize("count", [100])
def test_a_mutation_on_import_that_keeps_a_fingerprint_keeps_the_result(
    drill: Drill, record_property: RecordProperty, count: int
) -> None:
    before = {name: drill.digest(name) for name in drill.found}
    results = {name: drill.found[name]["results"] for name in drill.found}
    kept, missed = 0, []
    for name, file, mutation in mutations(drill, "import", count):
        with drill.with_source(file, mutation.source):
            if drill.digest(name) != before[name]:
                continue
            kept += 1
            found = drill.run("results")
            if "error" not in found and found[name]["results"] != results[name]:
                missed.append(f"{name}: {file}: {mutation.what}")
    record_property("mutations", count)
    record_property("kept", kept)
    assert not missed


@pytest.mark.parametrize("count", [2, pytest.param(120, marks=pytest.mark.slow)])
def test_an_edit_that_no_program_can_see_keeps_every_fingerprint(
    drill: Drill, record_property: RecordProperty, count: int
) -> None:
    dice = random.Random(SEED)
    before = {name: drill.digest(name) for name in drill.found}
    changed, tried = [], 0
    for _ in range(count):
        name = dice.choice(sorted(drill.found))
        file = dice.choice(sorted(drill.lines(name, "run")))
        for edit in harmless((drill.package / file).read_text("utf-8"), dice):
            with drill.with_source(file, edit.source):
                tried += 1
                if drill.digest(name) != before[name]:
                    changed.append(f"{name}: {file}: {edit.what}")
    record_property("edits", tried)
    assert not changed
    assert tried >= 2 * count
