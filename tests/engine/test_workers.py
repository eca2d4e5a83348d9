"""Workers that die, and work that several nodes need: who is blamed, and what is run how often."""

from __future__ import annotations

import dataclasses
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from typing import TYPE_CHECKING, Any

import pytest

from garment_dataset.engine import run
from garment_dataset.engine.events import Ending
from garment_dataset.engine.executors import SerialExecutor
from garment_dataset.engine.graph import Graph, NodeId
from garment_dataset.engine.plan import State
from garment_dataset.engine.worker import Reading, Task

if TYPE_CHECKING:
    from collections.abc import Callable

    from garment_dataset.engine.stage import Stage
    from tests.engine.conftest import Toy


class Fragile(SerialExecutor):
    """Runs tasks in this process, and breaks as a pool does: one death takes all with it, and it takes no more work."""

    def __init__(self, log: list[str]) -> None:
        self.log = log
        self.given: list[Future[Any]] = []
        self.is_broken = False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        if self.is_broken:
            raise BrokenProcessPool
        (work,) = args
        if isinstance(work, Reading):
            self.log.append(f"read {work.path.stem}")
        else:
            assert isinstance(work, Task)
            self.log.append(f"{work.facts['stage']} {work.subject}")
            if any("die" in path.read_text() for path, _ in work.sources.values()):
                self.is_broken = True
                future: Future[Any] = Future()
                future.set_exception(BrokenProcessPool())
                return future
        return super().submit(fn, *args, **kwargs)


@pytest.fixture
def log(toy: Toy, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the toy project hands to its workers from here on, in order; its sources count as large."""
    monkeypatch.setattr(run, "_READ_AT_ONCE_BYTES", -1)
    found: list[str] = []
    toy.executor = lambda _: Fragile(found)
    return found


@pytest.fixture
def twice(toy: Toy, monkeypatch: pytest.MonkeyPatch) -> Toy:
    """The toy project, and all of it once more as variant ``same``."""
    graph_of = toy.graph

    def graph(stages: dict[str, Stage]) -> Graph:
        usual = list(graph_of(stages))
        # both variants of a node stand side by side, so that workers meet them at the same time
        same = [
            dataclasses.replace(
                node,
                inputs={table: feeder._replace(variant="same") for table, feeder in node.inputs.items()},
                variant="same",
            )
            for node in usual
        ]
        return Graph(node for pair in zip(usual, same, strict=True) for node in pair)

    monkeypatch.setattr(toy, "graph", graph)
    return toy


def test_nobody_else_is_run_twice_when_a_worker_dies(toy: Toy, log: list[str]) -> None:
    toy.source("b", "4 die")
    toy.source("c", "6")
    report = toy.build(jobs=2)
    assert toy.endings(report)["numbers failed"] == ["b"]
    assert toy.endings(report)["total built"] == ["a", "c"]
    assert log.count("numbers b") == 2
    assert {name: log.count(name) for name in log if not name.endswith("b")} == dict.fromkeys(
        [f"{stage} {name}" for stage in ("read", "numbers", "squares", "total") for name in ("a", "c")], 1
    )


@pytest.mark.parametrize("jobs", [1, 2, 3, 8])
def test_every_worker_that_dies_is_found(toy: Toy, log: list[str], jobs: int) -> None:
    for name in ("b", "d", "e"):
        toy.source(name, "4 die")
    toy.source("c", "6")
    endings = toy.endings(toy.build(jobs=jobs))
    assert endings["numbers failed"] == ["b", "d", "e"]
    assert endings["total built"] == ["a", "c"]
    assert log.count("numbers c") <= 2
    assert {decision.state for decision in toy.plan()} == {State.FRESH, State.FAILED, State.BLOCKED}


@pytest.mark.parametrize("jobs", [1, 2, 3])
def test_what_two_nodes_need_is_read_and_run_once(twice: Toy, log: list[str], jobs: int) -> None:
    report = twice.build(jobs=jobs)
    assert sorted(log) == sorted(
        f"{stage} {name}" for stage in ("read", "numbers", "squares", "total") for name in ("a", "b")
    )
    assert (len(report.of(Ending.BUILT)), len(report.of(Ending.LINKED))) == (6, 6)
    log.clear()
    assert {event.ending for event in twice.build(jobs=jobs).events.values()} == {Ending.FRESH}
    assert log == []


@pytest.mark.parametrize("jobs", [1, 2, 3])
def test_what_fails_is_not_run_again_for_another_node(twice: Toy, log: list[str], jobs: int) -> None:
    twice.source("b", "4 bug")
    report = twice.build(jobs=jobs)
    assert log.count("numbers b") == 1
    for variant in ("", "same"):
        assert report.events[NodeId("numbers", "b", variant)].message == "ZeroDivisionError: a bug"
        assert report.events[NodeId("total", "a", variant)].ending in {Ending.BUILT, Ending.LINKED}
    log.clear()
    twice.build(jobs=jobs)
    assert log == []
    twice.build(jobs=jobs, retry_failed=True)
    assert log == ["numbers b"]


@pytest.mark.parametrize("jobs", [1, 2, 3])
def test_a_worker_that_dies_while_another_node_waits_for_it(twice: Toy, log: list[str], jobs: int) -> None:
    twice.source("b", "4 die")
    twice.source("c", "6")
    report = twice.build(jobs=jobs)
    assert log.count("numbers b") == 2
    for variant in ("", "same"):
        assert "died twice" in report.events[NodeId("numbers", "b", variant)].message
        assert report.events[NodeId("total", "c", variant)].ending in {Ending.BUILT, Ending.LINKED}
    assert {decision.state for decision in twice.plan()} == {State.FRESH, State.FAILED, State.BLOCKED}


def test_real_workers_do_the_same(twice: Toy) -> None:
    twice.source("b", "4 die")
    twice.source("c", "6")
    endings = twice.endings(twice.build(jobs=2))
    assert endings["numbers failed"] == ["b", "b"]
    assert endings["total blocked"] == ["b", "b"]
    assert (endings["total built"], endings["total linked"]) == (["a", "c"], ["a", "c"])
