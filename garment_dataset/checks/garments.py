"""Garments held against their tables, and against the other recordings of the same: by length and colour."""

from __future__ import annotations

import math
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.checks.appearance import Color, contradicts
from garment_dataset.checks.naming import Change, Contradiction

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from garment_dataset.catalog.lint import Code
    from garment_dataset.catalog.tables import Garment
    from garment_dataset.checks.content import Content
    from garment_dataset.checks.naming import Measured

_LONGEST, _SHORTEST = 1.1, 0.3  # of the diagonal, and of the longer side: cloth stretches, and is gathered where held
_ANOTHER_COLOR, _SAME_COLOR = 25.0, 12.0  # distances in CIELAB
_ANOTHER_LENGTH, _SAME_LENGTH, _LEAST_M = 0.2, 0.12, 0.08
_FEW = 3  # others that a recording is compared with: of three, one may be wrong itself
_KNOWN = 2  # recordings by which a garment is known


def check_garments(measured: Sequence[Measured], garments: Sequence[Garment]) -> Iterator[Contradiction]:
    """Yield ``colour-contradicted``, ``length-contradicted`` and ``differs-from-repeats``.

    Parameters
    ----------
    measured : sequence of Measured
        All recordings.
    garments : sequence of Garment
        Those of the tables: the one that alone fits is proposed.
    """
    tables = {each.garment: each for each in garments}
    for each in measured:
        table = tables.get(each.row.garment or "")
        told: list[tuple[Code, str]] = []
        if table is not None and (text := _against_color(each.content, table)) is not None:
            told.append(("colour-contradicted", text))
        if table is not None and (text := _against_size(each.content, table)) is not None:
            told.append(("length-contradicted", text))
        if not told and (text := _against_others(each, measured)) is not None:
            told.append(("differs-from-repeats", text))
        right = _right_garment(each, measured, tables) if told else None
        for code, text in told:
            looks = "" if right is None else f"; it looks like {right}"
            yield Contradiction(each.row.recording, code, text + looks, Change(garment=right))


def _against_color(content: Content, table: Garment) -> str | None:
    if content.color is None or table.color is None or not contradicts(content.color, table.color):
        return None
    return f"{table.garment} is {table.color}, what hangs there is not ({content.color})"


def _against_size(content: Content, table: Garment) -> str | None:
    if content.length_m is None or table.width_cm is None or table.height_cm is None:
        return None
    sides_m = sorted((float(table.width_cm) / 100, float(table.height_cm) / 100))
    longest_m, shortest_m = _LONGEST * math.hypot(*sides_m), _SHORTEST * sides_m[1]
    size = f"{sides_m[0]:g} m x {sides_m[1]:g} m"
    if content.length_m > longest_m:
        return f"{table.garment} is {size}, what hangs there reaches {content.length_m:.2f} m down"
    if content.length_m < shortest_m and not content.is_cut:
        return f"{table.garment} is {size}, what hangs there reaches {content.length_m:.2f} m down only"
    return None


def _against_others(each: Measured, measured: Sequence[Measured]) -> str | None:
    """Say how a recording differs from the others of its garment, or of its garment held in the same way."""
    row, content = each.row, each.content
    if row.garment is None:
        return None
    same = [other for other in measured if other.row.garment == row.garment and other.row.recording != row.recording]
    usual = _usual_color(same)
    if usual is not None and content.color is not None and content.color.distance(usual) > _ANOTHER_COLOR:
        return f"of another colour ({content.color}) than the others of {row.garment} ({usual})"
    lengths_m = _lengths_m(other for other in same if other.row.holding == row.holding)
    if content.length_m is None or content.is_cut or len(lengths_m) < _FEW:
        return None
    usual_m, spread_m = median(lengths_m), max(lengths_m) - min(lengths_m)
    bound_m = max(_LEAST_M, _ANOTHER_LENGTH * usual_m, 2 * spread_m)
    if abs(content.length_m - usual_m) <= bound_m:
        return None
    return f"reaches {content.length_m:.2f} m down, the others of {row.garment}, held in the same way, {usual_m:.2f} m"


def _usual_color(same: Sequence[Measured], least: int = _FEW) -> Color | None:
    found = [other.content.color for other in same if other.content.color is not None]
    return Color(*np.median(np.array(found), axis=0).tolist()) if len(found) >= least else None


def _lengths_m(measured: Iterable[Measured]) -> list[float]:
    return [each.content.length_m for each in measured if each.content.length_m is not None and not each.content.is_cut]


def _right_garment(each: Measured, measured: Sequence[Measured], tables: dict[str, Garment]) -> str | None:
    """Return the one garment among the others whose recordings look like this one, and whose table allows it."""
    content = each.content
    if content.color is None:
        return None
    fitting: list[str] = []
    for garment, table in tables.items():
        same = [other for other in measured if other.row.garment == garment]
        usual, lengths_m = (
            _usual_color(same, least=_KNOWN),
            _lengths_m(m for m in same if m.row.holding == each.row.holding),
        )
        if garment == each.row.garment or usual is None or content.color.distance(usual) > _SAME_COLOR:
            continue
        if _against_color(content, table) is None and _against_size(content, table) is None:
            known_m = median(lengths_m) if lengths_m else None
            if known_m is None or content.length_m is None or abs(content.length_m / known_m - 1) < _SAME_LENGTH:
                fitting.append(garment)
    return fitting[0] if len(fitting) == 1 else None
