"""A toy project for the engine: a package of its own with three stages, and sources that are text files."""

from __future__ import annotations

import importlib
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import garment_dataset
from garment_dataset.engine.code import CodeCache
from garment_dataset.engine.events import Event, Report
from garment_dataset.engine.executors import Pool, local_executor
from garment_dataset.engine.graph import Graph, Node, NodeId
from garment_dataset.engine.loaded import note_loaded
from garment_dataset.engine.options import Options
from garment_dataset.engine.plan import Plan, make_plan
from garment_dataset.engine.run import Run
from garment_dataset.engine.store import Store
from garment_dataset.engine.table import Column, Label

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from concurrent.futures import Executor

    from garment_dataset.engine.stage import Stage

ROOTS = {"garment_dataset": Path(garment_dataset.__file__).parent}
SUBJECT = Column("subject", "string", "", "whose rows these are")
TOY = {
    "__init__.py": '"""A toy package."""\n',
    "tables.py": """
from garment_dataset.engine.table import Column, TableSpec

NUMBERS = TableSpec("numbers", 1, "one number", (Column("value", "int64", "1", "the number"),))
SQUARES = TableSpec("squares", 1, "one number", (Column("value", "float64", "1", "its square"),))
TOTAL = TableSpec("total", 1, "the sum", (Column("value", "float64", "1", "sum of the squares"),))
""",
    "helpers.py": """
UNIT = 1


def parse(text):
    return [int(word) * UNIT for word in text.split()]


def square(value):
    return multiply(value, value)


def multiply(a, b):
    return a * b


def unrelated():
    return "nobody calls this"
""",
    "numbers.py": """
import warnings
from pathlib import Path

import pyarrow as pa

from garment_dataset.engine.stage import Stage, StageParams
from garment_dataset.engine.errors import DataWarning, SourceError
from toy.helpers import parse
from toy.tables import NUMBERS


class NumbersParams(StageParams):
    offset: int = 0


def numbers(bag: Path, params: NumbersParams):
    text = bag.read_text()
    if "grow" in text:
        bag.write_text(text + " 1")
        text = text.replace("grow", "")
    if "die" in text:
        import os

        os._exit(9)
    if "touch" in text:
        import os

        if bag.stat().st_mtime_ns != 1:
            os.utime(bag, ns=(1, 1))
        text = text.replace("touch", "")
    if "bad" in text:
        raise SourceError("holds the word bad", where=bag.name)
    if "bug" in text:
        raise ZeroDivisionError("a bug")
    if "skip" in text:
        warnings.warn("one word skipped", DataWarning, stacklevel=2)
        text = text.replace("skip", "")
    return {"numbers": NUMBERS.table({"value": [v + params.offset for v in parse(text)]})}


STAGE = Stage(numbers, params=NumbersParams, outputs=(NUMBERS,), sources=frozenset({"bag"}))
""",
    "squares.py": """
import pyarrow as pa

from garment_dataset.engine.stage import Stage, StageParams
from toy.helpers import square
from toy.tables import SQUARES


class SquaresParams(StageParams):
    factor: float = 1.0


def squares(numbers: pa.Table, params: SquaresParams):
    values = [params.factor * square(v) for v in numbers["value"].to_pylist()]
    return {"squares": SQUARES.table({"value": values})}


STAGE = Stage(squares, params=SquaresParams, outputs=(SQUARES,))
""",
    "total.py": """
import pyarrow as pa

from garment_dataset.engine.stage import Stage, StageParams
from toy.tables import TOTAL


class TotalParams(StageParams):
    pass


def total(squares: pa.Table, params: TotalParams):
    return {"total": TOTAL.table({"value": [sum(squares["value"].to_pylist())]})}


STAGE = Stage(total, params=TotalParams, outputs=(TOTAL,))
""",
}


@dataclass
class Toy:
    """A toy project in a folder of its own."""

    root: Path
    params: dict[str, dict[str, Any]] = field(default_factory=dict)
    executor: Callable[[int], Executor] = local_executor

    @property
    def private_dir(self) -> Path:
        return self.root / ".private"

    @property
    def features_dir(self) -> Path:
        return self.root / "features"

    def source(self, name: str, text: str) -> Path:
        path = self.root / "sources" / f"{name}.txt"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        return path

    def edit(self, module: str, old: str, new: str) -> None:
        path = self.root / "toy" / module
        text = path.read_text()
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in {module}"
        path.write_text(text.replace(old, new))

    def stages(self) -> dict[str, Stage]:
        for name in [name for name in sys.modules if name.partition(".")[0] == "toy"]:
            del sys.modules[name]
        importlib.invalidate_caches()
        note_loaded()
        return {name: importlib.import_module(f"toy.{name}").STAGE for name in ("numbers", "squares", "total")}

    def graph(self, stages: dict[str, Stage]) -> Graph:
        nodes = []
        for path in sorted((self.root / "sources").glob("*.txt")):
            feeds: dict[str, tuple[dict[str, Path], dict[str, NodeId]]] = {
                "numbers": ({"bag": path}, {}),
                "squares": ({}, {"numbers": NodeId("numbers", path.stem)}),
                "total": ({}, {"squares": NodeId("squares", path.stem)}),
            }
            nodes += [
                Node(
                    stage,
                    path.stem,
                    stage.params.model_validate(self.params.get(name, {})),
                    sources=feeds[name][0],
                    inputs=feeds[name][1],
                    labels=(Label(SUBJECT, path.stem),),
                    partition="kind=toy",
                )
                for name, stage in stages.items()
            ]
        return Graph(nodes)

    def plan(self) -> Plan:
        return self.build_with(None)[0]

    def build(self, jobs: int = 0, *, retry_failed: bool = False, forced: bool = False) -> Report:
        return self.build_with(Options(max(1, jobs), retry_failed, forced), jobs)[1]

    def build_with(self, options: Options | None, jobs: int = 0) -> tuple[Plan, Report]:
        stages = self.stages()
        graph = self.graph(stages)
        cache = CodeCache(self.private_dir / "code", ROOTS | {"toy": self.root / "toy"})
        codes = cache.codes(stages.values())
        store = Store(self.private_dir, self.features_dir)
        events: list[Event] = []
        try:
            plan = make_plan(graph, codes, store)
            report = Report()
            if options is not None:
                run = Run(
                    graph,
                    plan,
                    codes=codes,
                    code_cache=cache,
                    store=store,
                    pool=Pool(lambda: self.executor(jobs)),
                    options=options,
                    emit=events.append,
                )
                report = run.finish()
                assert set(report.events) == {node.id for node in graph}
                assert set(events) <= set(report.events.values())
        finally:
            store.close()
        return plan, report

    def endings(self, report: Report) -> dict[str, list[str]]:
        """Return the subjects by stage and ending, in order."""
        found: dict[str, list[str]] = {}
        for event in report.events.values():
            found.setdefault(f"{event.node.stage} {event.ending}", []).append(event.node.subject)
        return {name: sorted(subjects) for name, subjects in found.items()}

    def files(self) -> dict[str, bytes]:
        """Return the bytes of all published files by relative path."""
        paths = sorted(self.features_dir.glob("**/*.parquet"))
        return {path.relative_to(self.features_dir).as_posix(): path.read_bytes() for path in paths}


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Toy]:
    (tmp_path / "toy").mkdir()
    for name, text in TOY.items():
        (tmp_path / "toy" / name).write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    project = Toy(tmp_path)
    project.source("a", "1 2 3")
    project.source("b", "4 5")
    yield project
    for name in [name for name in sys.modules if name.partition(".")[0] == "toy"]:
        del sys.modules[name]
