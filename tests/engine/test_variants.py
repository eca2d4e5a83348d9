"""Variants: results of other parameters, side by side; what is equal is made once."""

from __future__ import annotations

import dataclasses
from contextlib import closing
from typing import TYPE_CHECKING

import pytest

from garment_dataset.engine.events import Ending
from garment_dataset.engine.graph import Graph, NodeId
from garment_dataset.engine.plan import State
from garment_dataset.engine.store import Store

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


@pytest.mark.parametrize("jobs", [0, 2])
def test_forcing_makes_everything_anew_and_what_is_equal_once(varied: Toy, jobs: int) -> None:
    varied.build()
    before = varied.files()
    report = varied.build(jobs=jobs, forced=True)
    assert varied.endings(report) == {
        "numbers built": ["a", "b"],
        "numbers linked": ["a", "b"],
        "squares built": ["a", "a", "b", "b"],
        "total built": ["a", "a", "b", "b"],
    }
    assert varied.files() == before


@pytest.mark.parametrize("jobs", [0, 2])
def test_what_is_equal_fails_alike(varied: Toy, jobs: int) -> None:
    varied.edit("numbers.py", 'if "bug" in text:', 'if "bug" in text and not (bag.parent / "mark").exists():')
    touch = '(bag.parent / "mark").touch()\n        raise ValueError'
    varied.edit("numbers.py", 'raise ZeroDivisionError("a bug")', touch)
    varied.edit("numbers.py", 'if "skip" in text:', 'text = text.replace("bug", "")\n    if "skip" in text:')
    varied.source("b", "4 bug")
    report = varied.build(jobs=jobs)
    events = [report.events[NodeId("numbers", "b", variant)] for variant in ("", "big")]
    assert [(event.ending, event.is_repeated) for event in events] == [(Ending.FAILED, False)] * 2
    assert {varied.plan()[event.node].state for event in events} == {State.FAILED}
    again = varied.build(jobs=jobs)
    assert all(again.events[event.node].is_repeated for event in events)


@pytest.mark.parametrize("lost", ["big", ""])
def test_files_that_one_lost_are_linked_again_from_what_both_share(varied: Toy, lost: str) -> None:
    varied.build()
    before = varied.files()
    with closing(Store(varied.private_dir, varied.features_dir)) as store:
        store.feature_path("numbers", "kind=toy", "a", lost).unlink()
    decisions = {decision.node: decision for decision in varied.plan()}
    assert next(node for node, found in decisions.items() if found.state is not State.FRESH) == ("numbers", "a", lost)
    report = varied.build()
    assert [event.node for event in report.of(Ending.LINKED)] == [NodeId("numbers", "a", lost)]
    assert varied.files() == before


def test_subjects_of_equal_content_have_results_of_their_own(toy: Toy) -> None:
    toy.source("b", "1 2 3")
    toy.build()
    decisions = list(toy.plan())
    assert len({decision.key for decision in decisions}) == len(decisions) == 6
    files = toy.files()
    assert files["numbers/kind=toy/a.parquet"] != files["numbers/kind=toy/b.parquet"]
