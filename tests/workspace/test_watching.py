"""The laws of the state machine behind ``garment watch``, on folders that change at random, and its outcomes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.engine.events import Ending, Event, Report
from garment_dataset.engine.graph import NodeId
from garment_dataset.workspace import building
from garment_dataset.workspace.session import Session
from garment_dataset.workspace.watching import Batch, Needs, Watching, idle_report, needs_of, outcome_of
from tests.conftest import COLOR_RECORDINGS

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace

SETTLE_S = 3.0
SCENE = "camera_default_0"
NEEDS: Needs = {"alone": frozenset(), "first": frozenset({SCENE}), "second": frozenset({SCENE})}
NAMES = (*NEEDS, SCENE)

looks = st.lists(
    st.tuples(
        st.sampled_from([0.5, 1.0, 4.0]),
        st.dictionaries(st.sampled_from(NAMES), st.integers(0, 2), max_size=len(NAMES)),
        st.booleans(),
    ),
    max_size=30,
)
"""How long after the last one, what is there in which state (2: not final), and whether what is built then fails."""


def needs_among(there: dict[str, int]) -> Needs:
    """Return what is needed, as a graph of what is there says it."""
    return {name: frozenset(each for each in NEEDS[name] if each in there) for name in NEEDS if name in there}


def settle(watching: Watching, now_s: float, states: dict[str, int]) -> Batch:
    """Look once, judge, and build what is due; what is in state 3 fails."""
    seen = watching.see(now_s, states)
    watching.judge({name: states[name] != 2 for name in seen.settled})
    batch = watching.due(needs_among(states))
    watching.built(batch, needs_among(states), [name for name in batch.due if states[name] == 3])
    return batch


@given(history=looks)
def test_the_laws_hold_whatever_the_folder_does(history: list[tuple[float, dict[str, int], bool]]) -> None:
    watching, now_s = Watching(SETTLE_S), 0.0
    since: dict[str, tuple[int, float]] = {}
    judged: set[str] = set()
    built: dict[str, dict[str, int]] = {}
    failed: set[str] = set()
    for wait_s, states, fails in history:
        now_s += wait_s
        changed = {name for name, (state, _) in since.items() if states.get(name) != state}
        since = {
            name: (state, now_s if name in changed or name not in since else since[name][1])
            for name, state in states.items()
        }
        judged -= changed
        built = {name: with_ for name, with_ in built.items() if name not in changed}
        seen = watching.see(now_s, states)
        assert set(seen.changed) == changed & states.keys()
        # judged when it has stood still, and once
        still = {name for name, (_, begin_s) in since.items() if now_s - begin_s >= SETTLE_S}
        assert set(seen.settled) == still - judged
        judged |= still
        watching.judge({name: states[name] != 2 for name in seen.settled})
        final = {name for name in still if states[name] != 2}
        needs = needs_among(states)
        ready = {name for name in needs if name in final and needs[name] <= final}
        versions = {name: {each: states[each] for each in (name, *needs[name])} for name in ready}
        # due when it and what it needs are final, once in these states
        due = {name for name in ready if not versions[name].items() <= built.get(name, {}).items()}
        batch = watching.due(needs)
        assert set(batch.due) == due
        failed -= changed | due
        assert set(batch.along) == (ready - due - failed if due else set())
        assert watching.held(needs).keys() == {name for name in needs if name in final} - ready
        built |= {name: versions[name] for name in due}
        failed |= due if fails else set()
        watching.built(batch, needs, due if fails else ())
        assert watching.due(needs) == ((), ())


def test_a_bag_that_grows_is_never_built_until_it_stands_still() -> None:
    watching = Watching(SETTLE_S)
    for second in range(100):
        assert watching.see(second, {"alone": second}).settled == ()
    assert watching.see(100, {"alone": 99}).settled == ()
    assert settle(watching, 102, {"alone": 99}).due == ("alone",)


def test_what_becomes_final_at_once_is_built_together() -> None:
    watching = Watching(SETTLE_S)
    there = dict.fromkeys(NAMES, 0)
    assert settle(watching, 0, there) == ((), ())
    assert settle(watching, 3, there) == (("alone", "first", "second"), ())


def test_recordings_wait_for_their_empty_scene_while_it_arrives_and_are_built_again_with_it() -> None:
    watching = Watching(0)
    assert settle(watching, 0, {"first": 0}).due == ("first",)
    assert settle(watching, 1, {"first": 0, "second": 0, SCENE: 2}) == ((), ())
    assert watching.held(NEEDS) == {"first": (SCENE,), "second": (SCENE,)}
    assert settle(watching, 2, {"first": 0, "second": 0, SCENE: 1}) == (("first", "second"), ())
    assert settle(watching, 3, {"first": 0, "second": 0}) == ((), ())


def test_what_failed_is_left_alone_until_its_bag_or_its_scene_changes() -> None:
    watching = Watching(0)
    assert settle(watching, 0, {"first": 3, "alone": 0, SCENE: 0}).due == ("alone", "first")
    assert settle(watching, 1, {"first": 3, "alone": 1, SCENE: 0}) == (("alone",), ())
    assert settle(watching, 2, {"first": 3, "alone": 1, SCENE: 1}) == (("first",), ("alone",))
    assert settle(watching, 3, {"first": 1, "alone": 1, SCENE: 1}) == (("first",), ("alone",))
    assert settle(watching, 4, {"first": 1, "alone": 0, SCENE: 1}) == (("alone",), ("first",))


def test_what_could_not_be_built_at_all_stays_due() -> None:
    watching = Watching(0)
    watching.judge(dict.fromkeys(watching.see(0, {"alone": 0}).settled, True))
    assert watching.due({"alone": frozenset()}) == watching.due({"alone": frozenset()}) == (("alone",), ())


def test_a_bag_that_vanishes_is_forgotten() -> None:
    watching = Watching(SETTLE_S)
    watching.see(0, {"alone": 0})
    assert settle(watching, 3, {"alone": 0}).due == ("alone",)
    assert settle(watching, 4, {}) == ((), ())
    assert settle(watching, 5, {"alone": 0}) == ((), ())
    assert settle(watching, 8, {"alone": 0}).due == ("alone",)


def test_what_is_not_wanted_is_not_built() -> None:
    watching = Watching(0)
    seen = watching.see(0, {"alone": 0, "first": 0})
    watching.judge(dict.fromkeys(seen.settled, True))
    assert watching.due({"first": frozenset(), "elsewhere": frozenset()}) == (("first",), ())


# With the graph of a workspace


def test_the_graph_says_which_scenes_recordings_are_built_with(color_workspace: Workspace) -> None:
    first, second, third = COLOR_RECORDINGS
    with Session(color_workspace) as session:
        assert session.catalog.found is not None
        names = {bag.path: str(bag.name) for bag in session.catalog.found.bags}
        needs = needs_of(session.graph, [first, third, "Unnamed_Free_pi16_0.5_R1"], names)
        assert needs == {first: {SCENE}, third: set(), "Unnamed_Free_pi16_0.5_R1": set()}
        # one camera position takes its empty scene from a recording
        table = color_workspace.catalog_dir / "backgrounds.csv"
        table.write_text(f"topics_file,source,from_s,to_s\n1,{second},0,0.09\n2,{third},0,0.09\n")
        session.reload(everything=True)
        assert needs_of(session.graph, [first, second], names) == {first: {second}, second: set()}


def test_outcomes_say_what_failed_and_what_is_lacking(color_workspace: Workspace) -> None:
    first, _, third = COLOR_RECORDINGS
    (color_workspace.recordings_dir / f"{SCENE}.bag").unlink()
    with Session(color_workspace) as session:
        report = building.build(session, jobs=0)
        graph = session.graph
    waiting = outcome_of(report, graph, first)
    assert waiting.word == "waiting"
    assert waiting.text.startswith(f"no background: recordings/{SCENE}.bag")
    assert waiting.text.endswith("(1 result without it)")
    assert outcome_of(report, graph, third)[:2] == ("built", "3 results")
    assert outcome_of(report, graph, "nobody")[:2] == ("waiting", "no pipeline names it")


def test_a_build_with_nothing_to_do_is_known_before_it_begins(color_workspace: Workspace) -> None:
    first, _, third = COLOR_RECORDINGS
    (color_workspace.recordings_dir / f"{SCENE}.bag").unlink()
    with Session(color_workspace) as session:
        assert idle_report(session.plan(), session.graph) is None
        report = building.build(session, jobs=0)
    with Session(color_workspace) as session:
        idle = idle_report(session.plan(), session.graph)
        assert idle is not None
        assert outcome_of(idle, session.graph, third)[:2] == ("fresh", "3 results")
        assert outcome_of(idle, session.graph, first)[:2] == outcome_of(report, session.graph, first)[:2]


@pytest.mark.parametrize("stage", ["background", "decode"])
def test_a_scene_that_fails_fails_its_recordings(color_workspace: Workspace, stage: str) -> None:
    first, *_ = COLOR_RECORDINGS
    with Session(color_workspace) as session:
        graph = session.graph
    of_scene = {"background": NodeId("background", "position_1"), "decode": NodeId("decode", SCENE)}
    report = Report({node.id: Event(node.id, Ending.BLOCKED, message="upstream") for node in graph})
    report.events[of_scene[stage]] = Event(of_scene[stage], Ending.FAILED, message="no images", is_repeated=True)
    outcome = outcome_of(report, graph, first)
    assert outcome.word == "failed"
    assert outcome.text.startswith(f"{of_scene[stage]}: no images (as before")


def test_paths_that_nobody_has_named_are_no_needs(workspace: Workspace) -> None:
    with Session(workspace) as session:
        rows = [row.recording for row in session.selection.rows]
        assert needs_of(session.graph, rows, {Path("elsewhere.bag"): "elsewhere"}) == dict.fromkeys(rows, frozenset())
