"""Stages that take notes, and tables that need not be made by anyone."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

import pyarrow.parquet as pq
import pytest

from garment_dataset.engine.events import Ending
from garment_dataset.engine.graph import Graph, Node, NodeId, producers
from garment_dataset.engine.plan import State

if TYPE_CHECKING:
    from garment_dataset.engine.stage import Stage
    from tests.engine.conftest import Toy

SAID = """
from garment_dataset.engine.stage import Stage, StageParams
from garment_dataset.engine.table import Column, TableSpec

SAID = TableSpec("said", 1, "one subject", (
    Column("texts", "list<string>", "", "notes"), Column("rows", "int64", "1", "of the table")))


class SaidParams(StageParams):
    pass


def said(numbers, notes, params: SaidParams, absent=None):
    assert absent is None
    return {"said": SAID.table({"texts": [list(notes["numbers"])], "rows": [numbers.num_rows]})}


STAGE = Stage(said, params=SaidParams, outputs=(SAID,))
"""


@pytest.fixture
def noting(toy: Toy, monkeypatch: pytest.MonkeyPatch) -> Toy:
    (toy.root / "toy" / "said.py").write_text(SAID)
    stages_of, graph_of = toy.stages, toy.graph

    def stages() -> dict[str, Stage]:
        return {**stages_of(), "said": importlib.import_module("toy.said").STAGE}

    def graph(known: dict[str, Stage]) -> Graph:
        usual = list(graph_of({name: stage for name, stage in known.items() if name != "said"}))
        stage = known["said"]
        nodes = [
            Node(stage, node.subject, stage.params(), inputs={"numbers": node.id})
            for node in usual
            if node.stage.name == "numbers"
        ]
        return Graph([*usual, *nodes])

    monkeypatch.setattr(toy, "stages", stages)
    monkeypatch.setattr(toy, "graph", graph)
    return toy


def texts(toy: Toy, subject: str) -> object:
    return pq.ParquetFile(toy.features_dir / "said" / f"{subject}.parquet").read()["texts"].to_pylist()


def test_notes_of_what_feeds_a_stage_reach_it(noting: Toy) -> None:
    noting.source("b", "4 skip 5")
    noting.build(jobs=2)
    assert texts(noting, "a") == [[]]
    assert texts(noting, "b") == [["one word skipped"]]
    assert noting.plan().is_fresh


def test_another_note_is_a_reason_though_the_rows_are_the_same(noting: Toy) -> None:
    noting.build()
    noting.source("b", "4 skip 5")
    report = noting.build()
    assert report.events[NodeId("squares", "b")].ending is Ending.FRESH
    assert report.events[NodeId("said", "b")].ending is Ending.BUILT
    assert texts(noting, "b") == [["one word skipped"]]
    noting.edit("numbers.py", '"one word skipped"', '"a word skipped"')
    noting.build()
    assert texts(noting, "b") == [["a word skipped"]]
    assert {decision.state for decision in noting.plan()} == {State.FRESH}


def test_notes_of_gathered_tables_name_their_subjects(noting: Toy, monkeypatch: pytest.MonkeyPatch) -> None:
    graph_of = noting.graph

    def graph(known: dict[str, Stage]) -> Graph:
        nodes = list(graph_of(known))
        members = tuple(node.id for node in nodes if node.stage.name == "numbers")
        return Graph([*nodes, Node(known["said"], "all", known["said"].params(), gathers={"numbers": members})])

    noting.edit("said.py", "[numbers.num_rows]", "[len(numbers)]")
    monkeypatch.setattr(noting, "graph", graph)
    for name, text in {"a": "1 skip", "b": "4 skip 5", "c": "6"}.items():
        noting.source(name, text)
    noting.build()
    assert texts(noting, "all") == [["a: one word skipped", "b: one word skipped"]]
    assert noting.plan().is_fresh


def test_a_table_with_a_default_need_not_be_made(noting: Toy) -> None:
    stages = noting.stages()
    assert stages["said"].inputs == ("numbers", "absent")
    assert stages["said"].optional == {"absent"}
    assert set(producers(stages.values())) == {"numbers", "squares", "total", "said"}
