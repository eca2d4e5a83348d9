"""Variants: results of other parameters, side by side; what is equal is made once."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import pytest

from garment_dataset.engine.events import Ending
from garment_dataset.engine.graph import Graph, NodeId
from garment_dataset.engine.plan import State

if TYPE_CHECKING:
    from garment_dataset.engine.stage import Stage
    from tests.engine.conftest import Toy


@pytest.fixture
def varied(toy: Toy, monkeypatch: pytest.MonkeyPatch) -> Toy:
    """The toy project, and all of it once more as variant ``big``, which multiplies squares by ``factor``."""
    graph_of = toy.graph
    factors = {"big": 10.0}

    def graph(stages: dict[str, Stage]) -> Graph:
        usual = list(graph_of(stages))
        nodes = usual.copy()
        for name, factor in factors.items():
            for node in usual:
                params = node.params
                if node.stage.name == "squares":
                    params = node.stage.params.model_validate({"factor": factor})
                inputs = {table: feeder._replace(variant=name) for table, feeder in node.inputs.items()}
                nodes.append(dataclasses.replace(node, params=params, inputs=inputs, variant=name))
        return Graph(nodes)

    monkeypatch.setattr(toy, "graph", graph)
    toy.params["factors"] = factors
    return toy


@pytest.mark.parametrize("jobs", [0, 2])
def test_what_is_equal_is_made_once_and_stands_in_both(varied: Toy, jobs: int) -> None:
    report = varied.build(jobs=jobs)
    assert report.events[NodeId("numbers", "a")].ending is Ending.BUILT
    assert report.events[NodeId("numbers", "a", "big")].ending is Ending.LINKED
    assert report.events[NodeId("squares", "a", "big")].ending is Ending.BUILT
    files = varied.files()
    assert files["numbers/kind=toy/a.parquet"] == files["variant=big/numbers/kind=toy/a.parquet"]
    assert files["squares/kind=toy/a.parquet"] != files["variant=big/squares/kind=toy/a.parquet"]
    assert varied.plan().is_fresh
    assert len(files) == 12


def test_a_change_of_one_leaves_the_other_alone(varied: Toy) -> None:
    varied.build()
    before = varied.files()
    varied.params["factors"]["big"] = 3.0
    plan = varied.plan()
    assert {decision.node for decision in plan if decision.state is not State.FRESH} == {
        NodeId(stage, subject, "big") for stage in ("squares", "total") for subject in ("a", "b")
    }
    varied.build()
    after = varied.files()
    assert {name for name in before if before[name] != after[name]} == {
        f"variant=big/{table}/kind=toy/{subject}.parquet" for table in ("squares", "total") for subject in ("a", "b")
    }


def test_a_lost_index_is_read_anew_with_all_variants(varied: Toy) -> None:
    varied.build()
    (varied.private_dir / "index.sqlite").unlink()
    report = varied.build()
    assert set(report.of(Ending.FRESH)) == set(report.events.values())


def test_a_failure_stays_in_its_variant(varied: Toy) -> None:
    varied.edit("squares.py", "values = [", "assert params.factor < 5\n    values = [")
    report = varied.build()
    assert report.events[NodeId("squares", "a")].ending is Ending.BUILT
    assert report.events[NodeId("squares", "a", "big")].ending is Ending.FAILED
    assert varied.plan()[NodeId("squares", "a")].state is State.FRESH
    assert varied.plan()[NodeId("squares", "a", "big")].state is State.FAILED


def test_forcing_makes_both(varied: Toy) -> None:
    varied.build()
    before = varied.files()
    report = varied.build(jobs=2, forced=True)
    assert {event.ending for event in report.events.values()} == {Ending.BUILT}
    assert varied.files() == before


def test_subjects_of_equal_content_have_results_of_their_own(toy: Toy) -> None:
    toy.source("b", "1 2 3")
    toy.build()
    keys = {decision.key for decision in toy.plan()}
    assert len(keys) == len(list(toy.plan()))
