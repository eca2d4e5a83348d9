"""The pace of a build: speed and time left are what was measured, and nothing is said before anything was."""

from __future__ import annotations

import pytest

from garment_dataset.cli.pace import Left, Pace
from garment_dataset.cli.progress import at_work, time_left
from garment_dataset.engine.events import Ending, Event
from garment_dataset.engine.graph import NodeId

FIRST = [NodeId("first", f"r{number}") for number in range(4)]
SECOND = [NodeId("second", f"r{number}") for number in range(4)]


def built(node: NodeId, seconds: float, frames: int = 0) -> Event:
    """Return the ending of a node that was built."""
    return Event(node, Ending.BUILT, seconds, counts={"frame": frames, "point": 5} if frames else {})


def test_nothing_is_foretold_before_anything_was_measured() -> None:
    pace = Pace([*FIRST, *SECOND])
    assert pace.left(1.0) is None
    pace.begin(FIRST[0], 1.0)
    assert pace.left(5.0) is None
    assert pace.frames_per_s("first") is None
    assert at_work(pace, 5.0) == ["  first r0  4 s"]
    assert time_left(pace, 5.0) == ""


@pytest.mark.parametrize("width", range(40, 121, 8))
def test_names_at_work_fit_a_line_and_stay_different(width: int) -> None:
    name = "GreenTowelOfTheLargestSize_Corner_{:02}_pi16_0.5_R1"
    nodes = [NodeId("depth_points", name.format(number), variant) for number in range(3) for variant in ("", "wide")]
    pace = Pace(nodes)
    for node in nodes:
        pace.begin(node, 0.0)
    lines = at_work(pace, 1234.0, width)
    assert len(set(lines)) == len(nodes)
    assert all(len(line) <= width and line.endswith("  1234 s") for line in lines)


def test_one_worker_needs_what_its_stages_needed() -> None:
    pace = Pace([*FIRST, *SECOND])
    pace.begin(FIRST[0], 0.0)
    pace.end(built(FIRST[0], 10.0, frames=240))
    assert pace.left(10.0) == Left(30.0, is_least=True), "of the second stage nothing is known"
    assert time_left(pace, 10.0) == "more than 0:30 left"
    pace.begin(SECOND[0], 10.0)
    pace.end(built(SECOND[0], 2.0))
    assert pace.left(12.0) == Left(3 * 12.0, is_least=False)
    pace.begin(FIRST[1], 12.0)
    assert pace.left(16.0) == Left(3 * 12.0 - 4.0, is_least=False)
    assert at_work(pace, 16.0) == ["  first r1  4 s  24.0 frames/s"]
    assert time_left(pace, 16.0) == "about 0:32 left"


def test_two_workers_need_half_of_it() -> None:
    pace = Pace(FIRST)
    for node in FIRST[:2]:
        pace.begin(node, 0.0)
    for node in FIRST[:2]:
        pace.end(built(node, 10.0, frames=240))
    assert pace.left(10.0) == Left(10.0, is_least=False)
    assert pace.frames_per_s("first") == pytest.approx(24.0)


def test_what_was_not_run_says_nothing_of_speed_and_is_not_left() -> None:
    pace = Pace(FIRST)
    pace.begin(FIRST[0], 0.0)
    pace.end(built(FIRST[0], 10.0))
    for node, ending in zip(FIRST[1:], (Ending.LINKED, Ending.BLOCKED, Ending.FAILED), strict=True):
        pace.end(Event(node, ending))
    assert pace.ended == pace.total
    assert pace.left(10.0) == Left(0.0, is_least=False)
    assert pace.frames_per_s("first") is None


def test_a_node_whose_source_was_read_first_began_then() -> None:
    pace = Pace(FIRST)
    pace.begin(FIRST[0], 1.0)
    pace.begin(FIRST[0], 2.0)
    assert pace.running == {FIRST[0]: 1.0}


def test_many_at_work_are_counted() -> None:
    nodes = [NodeId("first", f"r{number}") for number in range(11)]
    pace = Pace(nodes)
    for node in nodes:
        pace.begin(node, 0.0)
    lines = at_work(pace, 1.0)
    assert len(lines) == 9
    assert lines[-1] == "  and 3 more"


def test_more_than_nothing_is_not_said() -> None:
    pace = Pace([FIRST[0], *SECOND])
    pace.begin(FIRST[0], 0.0)
    pace.end(built(FIRST[0], 10.0))
    assert pace.left(10.0) == Left(0.0, is_least=True)
    assert time_left(pace, 10.0) == ""
