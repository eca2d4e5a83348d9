"""Names held against content: pure comparisons of what recordings are called with what they show."""

from __future__ import annotations

import math
from collections import defaultdict
from datetime import UTC, datetime
from itertools import combinations
from statistics import median
from typing import TYPE_CHECKING

from garment_dataset.catalog.lint import SEVERITIES, Finding
from garment_dataset.checks.garments import check_garments
from garment_dataset.checks.naming import Change, Contradiction, changed

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from garment_dataset.catalog import CatalogRow
    from garment_dataset.catalog.tables import Garment
    from garment_dataset.checks.content import Content
    from garment_dataset.checks.naming import Measured

_TOLERANCE = 1.25  # ratio of swings or speeds that are still the same
_AGREEMENT = 1.1  # ratio by which a proposal may be off
_CONVENTIONS = (1.0, 0.5, 2.0)
"""What half of the way may be beside the swing of the name, throughout a data set."""
_SAME_SHARE, _SAME_PIXELS = 0.5, 4
_SPEED_STEP = 0.05
_FEW = 2  # others that a recording is compared with

_AXES = {"R": "along the optical axis", "B": "across the view"}


def compare(measured: Sequence[Measured], garments: Sequence[Garment]) -> tuple[Finding, ...]:
    """Hold the names of recordings against what they show.

    Parameters
    ----------
    measured : sequence of Measured
        Of as many recordings of a data set as there are: speeds, repeats and copies are found by comparison.
    garments : sequence of Garment
        Those of the tables, among which the right one is looked for.

    Returns
    -------
    tuple of Finding
        In the order of the codes; all findings of a recording propose the one name in which all of them are mended.
    """
    found = [
        *_axes(measured),
        *_swings(measured),
        *_speeds(measured),
        *check_garments(measured, garments),
        *_copies(measured),
    ]
    wrong = {each.recording for each in found}
    found += _repeats([each for each in measured if each.row.recording not in wrong])
    found += _unmeasured(measured)
    rows = {each.row.recording: each.row for each in measured}
    changes: dict[str, Change] = defaultdict(Change)
    copies = {each.recording for each in found if each.code == "copied"}  # what they show, another shows as well
    for each in found:
        if each.recording in copies:
            continue
        changes[each.recording] = changes[each.recording].also(each.change)
    order = list(SEVERITIES)
    found.sort(key=lambda each: order.index(each.code))
    return tuple(_finding(each, rows[each.recording], changes[each.recording]) for each in found)


def _finding(found: Contradiction, row: CatalogRow, change: Change) -> Finding:
    right = changed(row.name, change)
    where = None if row.path is None else str(row.path)
    if right is None or found.code == "unmeasured":
        return Finding(found.code, SEVERITIES[found.code], row.recording, where, found.message, None)
    suffix = ".bag" if row.path is not None and row.path.name.lower().endswith(".bag") else ""
    target = f"{right}{suffix}"
    hint = f"Should be {target}: `garment lint --content --rename` shows what would be done."
    return Finding(found.code, SEVERITIES[found.code], row.recording, where, found.message, hint, target)


def _axes(measured: Iterable[Measured]) -> Iterator[Contradiction]:
    for row, content in measured:
        if content.axis is not None and content.axis != row.axis:
            across_m, _, along_m = content.extent_m
            moved = f"{1e3 * along_m:.0f} mm along the optical axis and {1e3 * across_m:.0f} mm across it"
            text = f"named {row.axis} ({_AXES[row.axis]}), but the gripper moves {moved}"
            yield Contradiction(row.recording, "axis-contradicted", text, Change(axis=content.axis))


def _swings(measured: Sequence[Measured]) -> Iterator[Contradiction]:
    """Yield ``swing-contradicted``; whether the swing is the way or half of it, the data set as a whole says."""
    ratios = [turn.swing_rad / row.swing_rad for row, content in measured if row.swing_rad and (turn := content.turn)]
    if not ratios:
        return
    usual = median(ratios) if len(ratios) > _FEW else 1.0
    convention = min(_CONVENTIONS, key=lambda each: abs(math.log(usual / each)))
    for row, content in measured:
        if not row.swing_rad or content.turn is None:
            continue
        swing_rad = content.turn.swing_rad / convention
        if not _is_same(swing_rad, row.swing_rad, _TOLERANCE):
            divisor = round(math.pi / swing_rad)
            is_sure = 1 <= divisor <= 999 and _is_same(math.pi / divisor, swing_rad, _AGREEMENT)
            text = f"named pi{row.name.swing_divisor}, but {content.turn.joint} swings by pi/{math.pi / swing_rad:.1f}"
            change = Change(swing_divisor=divisor) if is_sure else Change()
            yield Contradiction(row.recording, "swing-contradicted", text, change)


def _speeds(measured: Sequence[Measured]) -> Iterator[Contradiction]:
    """Yield ``speed-contradicted``: its peak is not that of the others of the same speed and the same swing.

    The speed of a name has no unit, so that only others can tell; a short way does not reach a high speed.
    """
    turns = [(row, content.turn) for row, content in measured if content.turn is not None]
    for row, turn in turns:
        alike = [
            (other.speed, peak.speed_rad_s)
            for other, peak in turns
            if other is not row and _is_same(peak.swing_rad, turn.swing_rad, _TOLERANCE)
        ]
        same = [peak for speed, peak in alike if speed == row.speed]
        if len(same) < _FEW or not turn.speed_rad_s or _is_same(turn.speed_rad_s, median(same), _TOLERANCE):
            continue
        text = f"named {row.name.speed}, but its peak is {turn.speed_rad_s:.2f} rad/s, and {median(same):.2f} rad/s"
        text += f" that of {len(same)} others of that speed"
        speed = _right_speed(row, turn.speed_rad_s, median(same), alike)
        yield Contradiction(row.recording, "speed-contradicted", text, Change(speed=speed))


def _right_speed(row: CatalogRow, peak: float, usual: float, alike: Sequence[tuple[float, float]]) -> str | None:
    """Return the speed of the others with such a peak; of a slower one, the round number in proportion."""
    fitting = {speed for speed, other in alike if speed != row.speed and _is_same(other, peak, _AGREEMENT)}
    if fitting:
        return f"{fitting.pop():g}" if len(fitting) == 1 else None
    proportional = row.speed * peak / usual
    rounded = round(proportional / _SPEED_STEP) * _SPEED_STEP
    if peak < usual and rounded > 0 and _is_same(rounded, proportional, _AGREEMENT):
        return f"{rounded:.2f}".rstrip("0")
    return None


def _copies(measured: Sequence[Measured]) -> Iterator[Contradiction]:
    """Yield ``copied``: the images of two recordings are the same, in one order or another, or in part."""
    for first, second in combinations(sorted(measured, key=lambda each: each.row.recording), 2):
        if (share := _shared(first.content, second.content)) is not None:
            for one, other in ((first, second), (second, first)):
                text = f"{share} is in {other.row.recording}, too: one of them is a copy"
                yield Contradiction(one.row.recording, "copied", text)


def _shared(one: Content, other: Content) -> str | None:
    for stream in one.messages.keys() & other.messages.keys():
        least = min(len(one.messages[stream]), len(other.messages[stream]))
        same = len(one.messages[stream] & other.messages[stream])
        if least and same >= _SAME_SHARE * least:
            return f"{100 * same / least:.0f} % of the {stream} images"
    for stream in one.pixels.keys() & other.pixels.keys():
        least = min(len(one.pixels[stream]), len(other.pixels[stream]))
        if (same := len(one.pixels[stream] & other.pixels[stream])) >= max(_SAME_PIXELS, _SAME_SHARE * least):
            return f"{same} of {least} {stream} images that were looked at"
    return None


def _repeats(measured: Iterable[Measured]) -> Iterator[Contradiction]:
    """Yield ``repeats-reversed``: the numbers of repeats are not in the order in which they were recorded."""
    groups: dict[object, list[Measured]] = defaultdict(list)
    for each in measured:
        row = each.row
        if row.repeat is not None:
            key = (
                row.garment,
                row.holding,
                row.swing_rad,
                row.speed,
                row.axis,
                row.topics_file,
                row.name.counter is None,
            )
            groups[key].append(each)
    for group in groups.values():
        by_time = sorted(group, key=lambda each: each.content.start_ns)
        for each, number in zip(by_time, sorted(each.row.repeat or 0 for each in group), strict=True):
            if each.row.repeat != number:
                place = f"{by_time.index(each) + 1} of {len(group)}"
                text = f"repeat {each.row.repeat}, but it was recorded as {place}, on {_date(each.content.start_ns)}"
                yield Contradiction(each.row.recording, "repeats-reversed", text, Change(repeat=number))


def _unmeasured(measured: Iterable[Measured]) -> Iterator[Contradiction]:
    """Yield ``unmeasured``: what of a name nothing in the recording tells."""
    for row, content in measured:
        unknown = ["axis: the gripper is not known, or has no clear direction"] if content.axis is None else []
        unknown += ["swing and speed: no joint moves, and the gripper does not turn"] if content.turn is None else []
        if unknown:
            yield Contradiction(row.recording, "unmeasured", f"not held against its content: {'; '.join(unknown)}")


def _is_same(one: float, other: float, ratio: float) -> bool:
    return one > 0 and other > 0 and abs(math.log(one / other)) <= math.log(ratio)


def _date(time_ns: int) -> str:
    return f"{datetime.fromtimestamp(time_ns // 10**9, UTC):%Y-%m-%d %H:%M:%S} UTC"
