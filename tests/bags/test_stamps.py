"""Header stamps: which are believed, which one of several, and that a wrong one changes nothing else."""

from __future__ import annotations

from itertools import combinations, pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.bags.stamps import Stamped, check_stamps, clock_note, median_offset_ns, summarise

MS = 1_000_000
START = 1_391_700_000_000_000_000
DELAY = 20 * MS
PERIOD = 33 * MS

Times = tuple[int, int]
"""Header stamp and record time."""


def numbered(times: list[Times]) -> list[Stamped]:
    return [Stamped(number, *each) for number, each in enumerate(times)]


def even(count: int) -> list[Times]:
    return [(START + step * PERIOD, START + step * PERIOD + DELAY) for step in range(count)]


def texts(times: list[Times], *, max_offset_s: float = 10.0, disorder_s: float = 0.0) -> dict[int, str]:
    faults = check_stamps(numbered(times), max_offset_s=max_offset_s, disorder_s=disorder_s)
    return {number: fault.text for number, fault in faults.items()}


def test_stamps_that_increase_have_no_fault() -> None:
    assert texts(even(5)) == {}
    assert texts([]) == {}
    assert summarise({}) == ""


def test_each_fault_says_what_is_wrong_and_by_how_much() -> None:
    times = even(8)
    times[1] = (0, times[1][1])
    times[3] = (times[3][0] - 86_400 * 10**9, times[3][1])
    times[4] = (times[2][0], times[4][1])
    times[6] = (times[6][0] - 3 * 10**9, times[6][1])
    assert texts(times) == {
        1: "header stamp is zero",
        3: "header stamp is 86400.020 s before its record time, in the median 0.020 s before",
        4: "header stamp repeats that of message 2",
        6: "header stamp runs backwards, 2.967 s before that of message 5",
    }
    expected = "2 header stamps do not increase, first that of message 4; 1 header stamps are zero; "
    expected += "1 header stamps are far from the record times"
    assert summarise(check_stamps(numbered(times), max_offset_s=10.0)) == expected


def test_one_stamp_too_large_does_not_condemn_all_that_follow() -> None:
    times = even(20)
    times[4] = (times[4][0] + 5 * 10**9, times[4][1])
    assert texts(times) == {4: "header stamp runs ahead, 4.967 s after that of message 5"}


def test_of_two_sets_as_large_the_stamps_that_fit_the_record_times_are_used() -> None:
    times = even(6)
    times.insert(2, (times[2][0] + MS, times[1][1] + 1))
    assert list(texts(times)) == [2], "the inserted one stands before the true one, and only one of the two can be used"


def test_a_constant_offset_between_two_clocks_is_no_fault() -> None:
    times = [(stamp_ns - 10**9 * 10**9, record_ns) for stamp_ns, record_ns in even(5)]
    assert texts(times) == {}
    expected = "header stamps are 1000000000.020 s before the record times in the median: they are of another clock"
    assert clock_note(numbered(times)) == expected
    assert clock_note(numbered(even(5))) is None
    assert clock_note([]) is None


def test_how_far_is_far_can_be_chosen() -> None:
    times = even(5)
    times[4] = (times[4][0] + 10**9, times[4][1])
    assert texts(times, max_offset_s=1.0) == {}
    assert list(texts(times, max_offset_s=0.9)) == [4]


def test_samples_a_little_out_of_order_are_kept_where_disorder_is_allowed() -> None:
    times = even(6)
    times[2], times[3] = (times[3][0], times[2][1]), (times[2][0], times[3][1])
    assert len(texts(times)) == 1
    assert texts(times, disorder_s=0.1) == {}
    times[4] = (times[4][0] - 200 * MS, times[4][1])
    assert list(texts(times, disorder_s=0.1)) == [4]


def test_the_median_of_a_stream_may_be_given() -> None:
    lone = [Stamped(0, START - 60 * 10**9, START)]
    assert not check_stamps(lone, max_offset_s=10.0)
    assert list(check_stamps(lone, max_offset_s=10.0, offset_ns=0)) == [0]
    assert median_offset_ns([*lone, Stamped(1, 0, START)]) == -60 * 10**9, "a zero stamp says nothing of the clock"


@given(st.lists(st.integers(0, 6), min_size=1, max_size=8))
def test_no_larger_set_of_increasing_stamps_exists(steps: list[int]) -> None:
    times = [(START + step * PERIOD, START + position * PERIOD) for position, step in enumerate(steps)]
    kept = [times[number][0] for number in range(len(times)) if number not in texts(times)]
    assert all(a < b for a, b in pairwise(kept))
    subsets = (each for size in range(len(steps), 0, -1) for each in combinations(steps, size))
    largest = next(each for each in subsets if all(a < b for a, b in pairwise(each)))
    assert len(kept) == len(largest)


clean_streams = st.lists(
    st.tuples(st.integers(30 * MS, 36 * MS), st.integers(-2 * MS, 2 * MS)), min_size=20, max_size=40
).map(
    lambda rows: [
        (
            START + sum(step for step, _ in rows[: i + 1]),
            START + sum(step for step, _ in rows[: i + 1]) + DELAY + jitter,
        )
        for i, (_, jitter) in enumerate(rows)
    ]
)


@given(clean_streams, st.data())
def test_a_message_sent_twice_or_with_a_wild_stamp_costs_no_other_its_stamp(
    clean: list[Times], data: st.DataObject
) -> None:
    """Its stamp, not itself: before the first of a stream any stamp fits, and then the second of two may be taken."""
    times = list(clean)
    for _ in range(data.draw(st.integers(0, 3))):
        position = data.draw(st.integers(0, len(clean) - 1))
        wild_ms = data.draw(st.integers(150, 400_000)) * data.draw(st.sampled_from([-1, 1]))
        stamp_ns = data.draw(st.sampled_from([0, clean[position][0] + wild_ms * MS]))
        times.append((stamp_ns, clean[position][1] + MS))
    again = data.draw(st.lists(st.tuples(st.sampled_from(clean), st.integers(1, 500)), max_size=5))
    times += [(stamp_ns, record_ns + late_ms * MS) for (stamp_ns, record_ns), late_ms in again]
    times.sort(key=lambda each: each[1])
    faults = texts(times)
    used = [stamp_ns for number, (stamp_ns, _) in enumerate(times) if number not in faults]
    assert {stamp_ns for stamp_ns, _ in clean} <= set(used), faults
    assert len(set(used)) == len(used), faults


@pytest.mark.parametrize("second", [1, 500 * MS])
def test_of_messages_with_one_stamp_the_first_is_used(second: int) -> None:
    times = even(10)
    times.insert(4, (times[3][0], times[3][1] + second))
    times.sort(key=lambda each: each[1])
    (number,) = texts(times)
    assert times[number][1] == even(4)[3][1] + second
