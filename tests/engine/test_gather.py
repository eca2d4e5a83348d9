"""Nodes that gather the tables of several subjects: order, reasons, and what a member that fails does."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pyarrow.parquet as pq
import pytest

from garment_dataset.engine.events import Ending
from garment_dataset.engine.graph import Graph, Node, NodeId
from garment_dataset.engine.plan import State

if TYPE_CHECKING:
    from garment_dataset.engine.stage import Stage
    from tests.engine.conftest import Toy

SUM = """
from garment_dataset.engine.stage import Stage, StageParams
from garment_dataset.engine.table import Column, TableSpec

SUMS = TableSpec("sums", 1, "one subject", (
    Column("subject", "string", "", "whose"), Column("value", "float64", "1", "its total")))


class SumsParams(StageParams):
    pass


def sums(total, params: SumsParams):
    return {"sums": SUMS.table({
        "subject": list(total), "value": [table["value"][0].as_py() for table in total.values()]})}


STAGE = Stage(sums, params=SumsParams, outputs=(SUMS,))
"""
ALL = NodeId("sums", "all")


@pytest.fixture
def gathering(toy: Toy, monkeypatch: pytest.MonkeyPatch) -> Toy:
    """The toy project with a fourth stage, that takes the totals of all sources together."""
    import importlib

    (toy.root / "toy" / "sums.py").write_text(SUM)
    stages_of, graph_of = toy.stages, toy.graph

    def stages() -> dict[str, Stage]:
        return {**stages_of(), "sums": importlib.import_module("toy.sums").STAGE}

    def graph(known: dict[str, Stage]) -> Graph:
        single = graph_of({name: stage for name, stage in known.items() if name != "sums"})
        members = tuple(sorted((node.id for node in single if node.stage.name == "total"), reverse=True))
        node = Node(known["sums"], "all", known["sums"].params(), gathers={"total": members})
        return Graph([*single, node])

    monkeypatch.setattr(toy, "stages", stages)
    monkeypatch.setattr(toy, "graph", graph)
    return toy


def sums(toy: Toy) -> dict[str, float]:
    table = pq.ParquetFile(toy.features_dir / "sums" / "all.parquet").read()
    return {str(row["subject"]): float(row["value"]) for row in table.to_pylist()}


def reasons(toy: Toy) -> list[str]:
    return [str(reason) for reason in toy.plan()[ALL].reasons]


def test_members_come_by_subject_in_the_order_given(gathering: Toy) -> None:
    gathering.build(jobs=2)
    assert list(sums(gathering).items()) == [("b", 41.0), ("a", 14.0)]
    assert gathering.plan().is_fresh


def test_a_member_added_gone_or_changed_is_a_reason(gathering: Toy) -> None:
    gathering.build()
    gathering.source("c", "1")
    assert gathering.plan()[ALL].state is State.STALE
    report = gathering.build()
    assert report.events[ALL].ending is Ending.BUILT
    assert set(sums(gathering)) == {"a", "b", "c"}
    (gathering.root / "sources" / "c.txt").unlink()
    assert reasons(gathering) == ["member total of c: gone"]
    gathering.source("b", "5 5")
    gathering.build()
    assert sums(gathering) == {"b": 50.0, "a": 14.0}
    assert gathering.plan().is_fresh


def test_a_member_that_fails_is_left_out_and_said(gathering: Toy) -> None:
    gathering.build()
    gathering.source("b", "4 bug")
    report = gathering.build()
    assert report.events[ALL].ending is Ending.BUILT
    assert report.events[ALL].notes == ("b is left out: its total cannot be had",)
    assert sums(gathering) == {"a": 14.0}
    plan = gathering.plan()
    assert plan[NodeId("numbers", "b")].state is State.FAILED
    assert plan[NodeId("total", "b")].state is State.BLOCKED
    assert plan[ALL].state is State.FRESH
    assert gathering.build().events[ALL].notes == ("b is left out: its total cannot be had",)


def test_a_member_that_is_mended_comes_back(gathering: Toy) -> None:
    gathering.source("b", "4 bug")
    gathering.build()
    gathering.edit("numbers.py", 'raise ZeroDivisionError("a bug")', 'text = text.replace("bug", "")')
    report = gathering.build(retry_failed=True)
    assert report.events[ALL].ending is Ending.BUILT
    assert set(sums(gathering)) == {"a", "b"}
    assert gathering.plan().is_fresh


def test_a_failure_that_is_tried_again_and_passes_is_gathered_in_the_same_run(gathering: Toy) -> None:
    mark = gathering.root / "mark"
    gathering.edit("numbers.py", 'if "bug" in text:', f'if "bug" in text and not Path("{mark}").exists():')
    gathering.edit("numbers.py", 'if "skip" in text:', 'text = text.replace("bug", "")\n    if "skip" in text:')
    gathering.source("b", "4 bug")
    gathering.build()
    assert set(sums(gathering)) == {"a"}
    mark.touch()
    assert gathering.build().events[ALL].ending is Ending.FRESH
    report = gathering.build(retry_failed=True)
    assert report.events[ALL].ending is Ending.BUILT
    assert set(sums(gathering)) == {"a", "b"}


def test_without_any_member_it_is_blocked(gathering: Toy) -> None:
    for name in ("a", "b"):
        gathering.source(name, "bug")
    report = gathering.build()
    assert report.events[ALL].ending is Ending.BLOCKED
    assert gathering.plan()[ALL].state is State.BLOCKED
