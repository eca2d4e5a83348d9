"""Laws of the graph: order, and what is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.engine.graph import Graph, Node, NodeId, producers
from garment_dataset.engine.stage import Stage, StageParams
from garment_dataset.engine.table import TableSpec
from garment_dataset.errors import StageError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


def first(bag: Path, params: StageParams) -> dict[str, Any]:
    return {"one": (bag, params)}


def second(one: Any, params: StageParams) -> dict[str, Any]:
    return {"two": (one, params)}


ONE = TableSpec("one", 1, "one", ())
FIRST = Stage(first, StageParams, (ONE,), frozenset({"bag"}))
SECOND = Stage(second, StageParams, (TableSpec("two", 1, "one", ()),))


def node(name: str, feeds: Mapping[str, NodeId] | None = None) -> Node:
    stage = FIRST if not feeds else SECOND
    return Node(stage, name, StageParams(), inputs=feeds or {})


def test_a_stage_reads_its_inputs_from_its_arguments() -> None:
    assert (SECOND.name, SECOND.inputs, SECOND.arguments) == ("second", ("one",), ("one",))
    assert (FIRST.inputs, FIRST.arguments) == ((), ("bag",))


@given(st.permutations(range(6)))
def test_feeders_come_first_whatever_the_order_given(order: list[int]) -> None:
    feeders = [node(f"r{i}") for i in range(3)]
    readers = [node(f"r{i}", {"one": NodeId("first", f"r{i}")}) for i in range(3)]
    given_nodes = [[*feeders, *readers][i] for i in order]
    ids = [found.id for found in Graph(given_nodes)]
    assert sorted(ids) == sorted(item.id for item in given_nodes)
    for i in range(3):
        assert ids.index(NodeId("first", f"r{i}")) < ids.index(NodeId("second", f"r{i}"))


def test_stages_of_one_subject_stand_together() -> None:
    nodes = [node(f"r{i}", {"one": NodeId("first", f"r{i}")}) for i in range(3)] + [node(f"r{i}") for i in range(3)]
    assert [found.subject for found in Graph(nodes)] == ["r0", "r0", "r1", "r1", "r2", "r2"]


def test_a_restricted_graph_keeps_what_feeds_it() -> None:
    nodes = [node("a"), node("b"), node("a", {"one": NodeId("first", "a")})]
    graph = Graph(nodes)
    assert [found.id for found in graph.restricted_to([NodeId("second", "a")])] == [
        NodeId("first", "a"),
        NodeId("second", "a"),
    ]
    assert graph.downstream(NodeId("first", "a")) == [NodeId("second", "a")]


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(StageError, match="made by no node"):
        Graph([node("a", {"one": NodeId("first", "elsewhere")})])
    with pytest.raises(StageError, match="two nodes"):
        Graph([node("a"), node("a")])
    with pytest.raises(StageError, match="gathers 'one' of one subject twice"):
        Graph([node("a"), Node(SECOND, "all", StageParams(), gathers={"one": (NodeId("first", "a"),) * 2})])
    circle = NodeId("second", "a")
    with pytest.raises(StageError, match="second:a -> second:a"):
        Graph([node("a", {"one": circle})])


def test_tables_have_one_maker_each() -> None:
    assert producers([FIRST, SECOND]) == {"one": FIRST, "two": SECOND}
    with pytest.raises(StageError, match="'one' is no table of any stage"):
        producers([SECOND])
    with pytest.raises(StageError, match="made by two stages"):
        producers([FIRST, Stage(first, StageParams, (ONE,), frozenset({"bag"}))])
