"""Nodes that gather the tables of several subjects: order, reasons, and what a member that fails does."""

from __future__ import annotations

import dataclasses
import importlib
import re
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


def restricted(toy: Toy, monkeypatch: pytest.MonkeyPatch, *wanted: NodeId) -> None:
    """From here on, plan and build these nodes only, with what feeds them."""
    graph_of = toy.graph
    monkeypatch.setattr(toy, "graph", lambda known: graph_of(known).restricted_to(wanted))


def regrouped(toy: Toy, monkeypatch: pytest.MonkeyPatch, *members: str) -> None:
    """From here on, gather the totals of these sources, in this order."""
    graph_of = toy.graph

    def graph(known: dict[str, Stage]) -> Graph:
        nodes = {node.id: node for node in graph_of(known)}
        gathers = {"total": tuple(NodeId("total", name) for name in members)}
        return Graph({**nodes, ALL: dataclasses.replace(nodes[ALL], gathers=gathers)}.values())

    monkeypatch.setattr(toy, "graph", graph)


def settled(toy: Toy) -> bool:
    """Say whether plan and build agree that nothing is left to do."""
    states = {decision.node: decision.state for decision in toy.plan()}
    report = toy.build()
    assert {node: event.ending.value for node, event in report.events.items()} == {
        node: state.value for node, state in states.items()
    }
    assert all(event.is_repeated for event in report.of(Ending.FAILED))
    return set(states.values()) <= {State.FRESH, State.FAILED, State.BLOCKED}


def test_members_come_by_subject_in_the_order_given(gathering: Toy) -> None:
    gathering.build(jobs=2)
    assert list(sums(gathering).items()) == [("b", 41.0), ("a", 14.0)]
    assert gathering.plan().is_fresh


def test_another_order_is_a_reason(gathering: Toy, monkeypatch: pytest.MonkeyPatch) -> None:
    gathering.build()
    regrouped(gathering, monkeypatch, "a", "b")
    assert reasons(gathering) == ["member order: changed"]
    gathering.build()
    assert list(sums(gathering)) == ["a", "b"]
    assert settled(gathering)


def test_a_member_added_gone_or_changed_is_a_reason(gathering: Toy) -> None:
    gathering.build()
    gathering.source("c", "1")
    assert reasons(gathering) == ["member total of c: added", "upstream total:c: missing"]
    assert (gathering.plan()[ALL].state, gathering.plan()[ALL].certain) == (State.STALE, True)
    report = gathering.build()
    assert report.events[ALL].ending is Ending.BUILT
    assert set(sums(gathering)) == {"a", "b", "c"}
    (gathering.root / "sources" / "c.txt").unlink()
    assert reasons(gathering) == ["member total of c: gone"]
    gathering.source("b", "5 5")
    assert reasons(gathering) == ["member total of c: gone", "upstream total:b: stale"]
    gathering.build()
    assert sums(gathering) == {"b": 50.0, "a": 14.0}
    assert settled(gathering)


def test_a_member_that_is_perhaps_the_same_is_no_certain_reason(gathering: Toy) -> None:
    gathering.build()
    gathering.edit("helpers.py", "return multiply(value, value)", "return multiply(value, value) + 0")
    assert reasons(gathering) == ["upstream total:b: stale", "upstream total:a: stale"]
    assert not gathering.plan()[ALL].certain
    assert gathering.build().events[ALL].ending is Ending.FRESH


def test_what_is_known_of_a_member_is_said(gathering: Toy, monkeypatch: pytest.MonkeyPatch) -> None:
    gathering.build()
    gathering.source("b", "6")
    with monkeypatch.context() as patch:
        restricted(gathering, patch, NodeId("total", "b"))
        gathering.build()
    (reason,) = reasons(gathering)
    assert re.fullmatch("member total of b: [0-9a-f]{12} -> [0-9a-f]{12}", reason)
    gathering.source("b", "bug")
    with monkeypatch.context() as patch:
        restricted(gathering, patch, NodeId("total", "b"))
        gathering.build()
    (reason,) = reasons(gathering)
    assert re.fullmatch("member total of b: [0-9a-f]{12} -> left out", reason)
    gathering.build()
    assert settled(gathering)


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
    assert settled(gathering)


def test_a_member_whose_source_goes_is_left_out(gathering: Toy, monkeypatch: pytest.MonkeyPatch) -> None:
    gathering.build()
    graph_of, path = gathering.graph, gathering.root / "sources" / "b.txt"
    stages = gathering.stages()
    drawn = graph_of(stages)
    monkeypatch.setattr(gathering, "graph", lambda _: drawn)
    monkeypatch.setattr(gathering, "stages", lambda: stages)
    path.unlink()
    assert gathering.plan()[NodeId("total", "b")].state is State.BLOCKED
    assert reasons(gathering)[0].endswith("-> left out")
    report = gathering.build()
    assert report.events[ALL].notes == ("b is left out: its total cannot be had",)
    assert settled(gathering)
    gathering.source("b", "4 5")
    assert reasons(gathering) == ["upstream total:b: stale"]
    assert gathering.build().events[ALL].ending is Ending.LINKED
    assert settled(gathering)


def test_a_member_that_is_mended_comes_back(gathering: Toy) -> None:
    gathering.source("b", "4 bug")
    gathering.build()
    gathering.edit("numbers.py", 'raise ZeroDivisionError("a bug")', 'text = text.replace("bug", "")')
    report = gathering.build(retry_failed=True)
    assert report.events[ALL].ending is Ending.BUILT
    assert set(sums(gathering)) == {"a", "b"}
    assert gathering.plan().is_fresh


def test_a_failure_that_is_tried_again_and_passes_is_gathered_in_the_same_run(gathering: Toy) -> None:
    mark = gathering.root / "sources" / "mark"
    gathering.edit("numbers.py", 'if "bug" in text:', 'if "bug" in text and not (bag.parent / "mark").exists():')
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
    assert reasons(gathering) == ["upstream total:b: blocked", "upstream total:a: blocked"]
    assert settled(gathering)


def test_a_group_of_nobody_is_blocked(gathering: Toy, monkeypatch: pytest.MonkeyPatch) -> None:
    regrouped(gathering, monkeypatch)
    assert reasons(gathering) == ["absent total of any subject"]
    report = gathering.build()
    assert (report.events[ALL].ending, report.events[ALL].message) == (
        Ending.BLOCKED,
        "there is no total of any subject",
    )
    assert settled(gathering)
