"""Which header stamps can be believed: pure functions on stamps and record times.

A driver that forgot to stamp, a clock that jumped and a message that was sent twice all leave a stamp that would move
an image, or what is interpolated to it, to a time at which it was not seen.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from itertools import pairwise
from statistics import median_low
from typing import TYPE_CHECKING, Literal, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

Kind = Literal["repeat", "order", "zero", "far"]

SAMPLE_DISORDER_S = 0.1
"""How far samples of one topic may be out of order and still be sorted in: publishers of one topic overtake each other
by milliseconds; a stamp farther off is a wrong one."""

TRANSFORM_DISORDER_S = 1.0
"""The same for the transforms of one link: a real robot has two publishers of a link, one of them 0.5 s ahead."""


_ONE_CLOCK_NS = 1_000_000_000  # cameras and networks delay by less


class Stamped(NamedTuple):
    """The two times of one message."""

    number: int
    """In its topic."""
    stamp_ns: int
    """Header stamp."""
    record_stamp_ns: int
    """When the recorder received it."""


class StampFault(NamedTuple):
    """Why a header stamp is not used: in a word to count by, and in one line."""

    kind: Kind
    text: str


def median_offset_ns(messages: Iterable[Stamped]) -> int:
    """Return the median of header stamp less record time, in nanoseconds; 0 when no message has a stamp."""
    return median_low([each.stamp_ns - each.record_stamp_ns for each in messages if each.stamp_ns] or [0])


def clock_note(messages: Iterable[Stamped]) -> str | None:
    """Say that the header stamps of a stream are of another clock than the record times; None when they are not."""
    if abs(offset_ns := median_offset_ns(messages)) <= _ONE_CLOCK_NS:
        return None
    return f"header stamps are {_beside(offset_ns)} the record times in the median: they are of another clock"


def check_stamps(
    messages: Sequence[Stamped], *, max_offset_s: float, disorder_s: float = 0.0, offset_ns: int | None = None
) -> dict[int, StampFault]:
    """Say which of the messages have a header stamp that must not be used.

    Parameters
    ----------
    messages : sequence of Stamped
        In the order in which they were recorded.
    max_offset_s : float
        How far, in seconds, header stamp less record time may be from its median. A constant offset, as between two
        clocks, is in the median and no fault.
    disorder_s : float
        How far, in seconds, it may be from its median in a message that is out of order; 0: stamps must increase.
    offset_ns : int, optional
        That median, when the messages are a part of a stream; by default theirs.

    Returns
    -------
    dict of int to StampFault
        By the number of the message, in order; messages whose stamps can be used are not in it.

    Notes
    -----
    Out of order are the messages beside the largest set whose stamps strictly increase: one stamp too large does not
    condemn all that follow. Of several such sets it is the one whose stamps fit the record times best, and of messages
    with one stamp the first, so that a message that was sent twice, or with a wrong stamp, costs no other its stamp.
    """
    offset_ns = median_offset_ns(messages) if offset_ns is None else offset_ns
    faults: dict[int, StampFault] = {}
    sound: list[Stamped] = []
    for each in messages:
        own_ns = each.stamp_ns - each.record_stamp_ns
        if each.stamp_ns == 0:
            faults[each.number] = StampFault("zero", "header stamp is zero")
        elif abs(own_ns - offset_ns) > max_offset_s * 1e9:
            text = f"header stamp is {_beside(own_ns)} its record time, in the median {_beside(offset_ns)}"
            faults[each.number] = StampFault("far", text)
        else:
            sound.append(each)
    faults |= _out_of_order(sound, offset_ns, round(disorder_s * 1e9))
    return dict(sorted(faults.items()))


def summarise(faults: Mapping[int, StampFault]) -> str:
    """Return in one line how many stamps are out of order, zero or far off; empty when there are none."""
    counts = Counter(fault.kind for fault in faults.values())
    parts: list[str] = []
    if disorder := [number for number, fault in faults.items() if fault.kind in {"repeat", "order"}]:
        parts.append(f"{len(disorder)} header stamps do not increase, first that of message {disorder[0]}")
    if counts["zero"]:
        parts.append(f"{counts['zero']} header stamps are zero")
    if counts["far"]:
        parts.append(f"{counts['far']} header stamps are far from the record times")
    return "; ".join(parts)


def _out_of_order(messages: Sequence[Stamped], offset_ns: int, disorder_ns: int) -> dict[int, StampFault]:
    if all(before.stamp_ns < after.stamp_ns for before, after in pairwise(messages)):
        return {}
    stamps_ns = [each.stamp_ns for each in messages]
    strays_ns = [abs(each.stamp_ns - each.record_stamp_ns - offset_ns) for each in messages]
    chosen = _longest_increase(stamps_ns, strays_ns)
    first = {stamps_ns[position]: messages[position].number for position in reversed(chosen)}
    faults: dict[int, StampFault] = {}
    members = set(chosen)
    for position, each in enumerate(messages):
        if position in members:
            continue
        if each.stamp_ns in first:
            faults[each.number] = StampFault("repeat", f"header stamp repeats that of message {first[each.stamp_ns]}")
        elif disorder_ns and strays_ns[position] <= disorder_ns:
            first[each.stamp_ns] = each.number
        else:
            faults[each.number] = StampFault("order", _astray(messages, chosen, position))
    return faults


def _longest_increase(stamps_ns: Sequence[int], costs: Sequence[int]) -> list[int]:
    """Return the positions of the longest strict increase; of equally long ones, of the lowest sum of costs.

    Best ends are kept in a Fenwick tree over the ranks of the stamps, as (-length, cost, position): n log n.
    """
    ranks = {stamp_ns: rank for rank, stamp_ns in enumerate(sorted(set(stamps_ns)), 1)}
    ends = [(0, 0, -1)] * (len(ranks) + 1)

    def best_below(rank: int) -> tuple[int, int, int]:
        best = (0, 0, -1)
        while rank > 0:
            best = min(best, ends[rank])
            rank -= rank & -rank
        return best

    before: list[int] = []
    for position, (stamp_ns, cost) in enumerate(zip(stamps_ns, costs, strict=True)):
        length, total, last = best_below(ranks[stamp_ns] - 1)
        before.append(last)
        rank = ranks[stamp_ns]
        while rank < len(ends):
            ends[rank] = min(ends[rank], (length - 1, total + cost, position))
            rank += rank & -rank
    position = best_below(len(ranks))[2]
    found: list[int] = []
    while position >= 0:
        found.append(position)
        position = before[position]
    return _earliest(stamps_ns, [stamps_ns[position] for position in reversed(found)])


def _earliest(stamps_ns: Sequence[int], wanted_ns: Sequence[int]) -> list[int]:
    """Return where the stamps that are wanted come first, in their order."""
    positions: list[int] = []
    for position, stamp_ns in enumerate(stamps_ns):
        if len(positions) < len(wanted_ns) and stamp_ns == wanted_ns[len(positions)]:
            positions.append(position)
    return positions


def _astray(messages: Sequence[Stamped], chosen: Sequence[int], position: int) -> str:
    """Say which of its neighbours in the chosen set a stamp contradicts."""
    own_ns, following = messages[position].stamp_ns, bisect_left(chosen, position)
    if following and own_ns <= (before := messages[chosen[following - 1]]).stamp_ns:
        lag_s = (before.stamp_ns - own_ns) / 1e9
        return f"header stamp runs backwards, {lag_s:.3f} s before that of message {before.number}"
    after = messages[chosen[following]]
    lead_s = (own_ns - after.stamp_ns) / 1e9
    return f"header stamp runs ahead, {lead_s:.3f} s after that of message {after.number}"


def _beside(offset_ns: int) -> str:
    return f"{abs(offset_ns) / 1e9:.3f} s {'after' if offset_ns > 0 else 'before'}"
