"""Columns of results over time, by recording and point, ready to be drawn."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from garment_dataset.errors import FilterError, StoreError, UsageError, did_you_mean, one_of
from garment_dataset.features.reading import declared_uncertainties, load_features, table_description, variant_folder
from garment_dataset.view.curves import Curve, Panel, broken_at_gaps

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import pandas as pd

SINCE_ONSET, SINCE_FIRST = "time since the gripper began to move [s]", "time since the first frame [s]"

_LONGEST_GAP_S = 0.1
"""Three frames of 30 a second: more is drawn as a gap."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A column of a table, to be drawn over time.

    Parameters
    ----------
    table, column : str
        Where it stands.
    points : tuple of int
        Which points; all by default.
    """

    table: str
    column: str
    points: tuple[int, ...] = ()

    @classmethod
    def of(cls, text: str, points: Sequence[int] = ()) -> Quantity:
        """Read ``TABLE.COLUMN``.

        Raises
        ------
        UsageError
            If it is not of that form.
        """
        table, dot, column = text.partition(".")
        if not (table and dot and column):
            raise UsageError("no column", expected="TABLE.COLUMN, such as kinematics.vz_m_s", found=repr(text))
        return cls(table, column, tuple(points))


@dataclass(frozen=True, slots=True)
class Drawn:
    """Curves of one quantity of one recording.

    Parameters
    ----------
    quantity : str
        Its name and unit.
    curves : list of Curve
        One per point.
    is_since_onset : bool
        Whether time counts from when the gripper began to move.
    unit : str
        Of the values; empty for what has none.
    """

    quantity: str
    curves: list[Curve]
    is_since_onset: bool
    unit: str


class Results:
    """What is drawn of some recordings: every table is read once, whatever number of its columns is asked for.

    Parameters
    ----------
    recordings : sequence of str
        Names.
    folder : Path
        Features.
    variant : str
        Of which variant.
    """

    def __init__(self, recordings: Sequence[str], *, folder: Path, variant: str = "") -> None:
        self._recordings = list(recordings)
        self._folder, self._variant = folder, variant
        self._tables: dict[str, tuple[pd.DataFrame, dict[str, Any]]] = {}

    def read(self, quantity: Quantity, recording: str) -> Drawn | None:
        """Read a column of one recording; None where it has no rows of that table.

        Raises
        ------
        StoreError
            If nothing was built.
        FilterError
            If none of the recordings is there.
        UsageError
            If the table has no such number for each frame, or each point of a frame.
        """
        table, described = self._table(quantity.table)
        rows = table[table["recording"] == recording] if "recording" in table else table.iloc[:0]
        _check(rows, quantity, described.get("keys", ()))
        if rows.empty:
            return None
        time_s, is_since_onset = self._time_s(rows, recording)
        rows = rows.assign(_time_s=time_s).dropna(subset=["_time_s"]).sort_values("_time_s", kind="stable")
        std = declared_uncertainties(described).get(quantity.column)
        unit = rows.attrs["units"].get(quantity.column, "")
        return Drawn(_label(rows, quantity.column), list(_curves(rows, quantity, std)), is_since_onset, unit)

    def _table(self, name: str) -> tuple[pd.DataFrame, dict[str, Any]]:
        if name not in self._tables:
            rows = load_features(name, folder=self._folder, variant=self._variant, recording=self._recordings)
            described = table_description(variant_folder(self._folder, self._variant), name)
            self._tables[name] = rows, described
        return self._tables[name]

    def _time_s(self, rows: pd.DataFrame, recording: str) -> tuple[Any, bool]:
        """Return the time of each row since the onset, or, where none is known, since the first frame."""
        if "time_s" in rows and rows["time_s"].notna().any():
            return rows["time_s"], True
        onset_ns = self._onsets_ns.get(recording)
        start_ns = int(rows["stamp_ns"].min()) if onset_ns is None else onset_ns
        return (rows["stamp_ns"].astype("int64") - start_ns) * 1e-9, onset_ns is not None

    @cached_property
    def _onsets_ns(self) -> dict[str, int]:
        """When the gripper began to move, where that is known."""
        try:
            motion, _ = self._table("motion")
        except (StoreError, FilterError):
            return {}
        known = motion.dropna(subset=["onset_stamp_ns"])
        return {str(name): int(each) for name, each in zip(known["recording"], known["onset_stamp_ns"], strict=True)}


def _check(rows: pd.DataFrame, quantity: Quantity, keys: Sequence[str]) -> None:
    numbers = [str(name) for name in rows.columns if rows[name].dtype.kind in "iuf"]
    if quantity.column not in numbers:
        known = [name for name in numbers if name not in {"frame", "point", "stamp_ns"}]
        raise UsageError(
            f"{quantity.column!r} is no column of numbers",
            where=quantity.table,
            expected=one_of(known),
            hint=did_you_mean(quantity.column, known),
        )
    if "frame" not in keys or {*keys} - {"frame", "point"} or "stamp_ns" not in rows:
        expected = "a table with a row per frame, or per frame and point"
        raise UsageError("cannot be drawn over time", where=quantity.table, expected=expected, found=f"rows by {keys}")
    if quantity.points and (unknown := {*quantity.points} - {*rows.get("point", ())}):
        there = ", ".join(map(str, sorted({*rows["point"]}))) if "point" in rows else "no points"
        raise UsageError(f"no point {min(unknown)}", where=quantity.table, expected=there)


def _label(rows: pd.DataFrame, column: str) -> str:
    """Return what a column is, its name and its unit, in lines as long as a panel is high."""
    unit = rows.attrs["units"].get(column, "")
    name = column.removesuffix(f"_{unit.replace('/', '_')}")
    words = textwrap.shorten(rows.attrs["descriptions"].get(column, ""), 56, placeholder=" ...")
    return "\n".join([*textwrap.wrap(words, 30), f"{name} [{unit}]" if unit not in {"", "1"} else name])


def _curves(rows: pd.DataFrame, quantity: Quantity, uncertainty: str | None) -> Any:  # noqa: ANN401 - an iterator
    groups = rows.groupby("point") if "point" in rows else [(None, rows)]
    for point, of_point in groups:
        if quantity.points and point not in quantity.points:
            continue
        value = of_point[quantity.column].to_numpy(np.float64, na_value=np.nan)
        std = None if uncertainty is None else of_point[uncertainty].to_numpy(np.float64, na_value=np.nan)
        if np.isfinite(value).any():
            number = None if point is None else int(str(point))
            yield broken_at_gaps(Curve(number, of_point["_time_s"].to_numpy(np.float64), value, std), _LONGEST_GAP_S)


def panel(title: str, drawn: Sequence[Drawn], *, with_bands: bool) -> Panel:
    """Put the curves of one quantity, of one recording or of several repeats, into one panel.

    Parameters
    ----------
    title : str
        Above it.
    drawn : sequence of Drawn
        At least one.
    with_bands : bool
        Whether to show uncertainties: bands of several repeats would hide each other.
    """
    curves = [curve for each in drawn for curve in each.curves]
    if not with_bands:
        curves = [Curve(curve.point, curve.time_s, curve.value) for curve in curves]
    return Panel(title, drawn[0].quantity, curves)
