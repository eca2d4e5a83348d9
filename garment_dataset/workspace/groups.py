"""Recordings that a stage takes together: those that agree in some columns of the catalog."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from garment_dataset.catalog.rows import ROW_KEYS, UNSPECIFIED
from garment_dataset.errors import StageError, did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from garment_dataset.catalog import CatalogRow
    from garment_dataset.stages import Group


@dataclass(frozen=True)
class RecordingGroup:
    """Recordings that a stage takes together.

    Parameters
    ----------
    name : str
        Made of what they share: ``GreenTowel_Ruler_pi16_0.5_R_topics_file1``.
    by : tuple of str
        The columns in which they agree.
    rows : tuple of CatalogRow
        In alphabetical order of their names.
    """

    name: str
    by: tuple[str, ...]
    rows: tuple[CatalogRow, ...]

    @property
    def recordings(self) -> tuple[str, ...]:
        """Names of the recordings."""
        return tuple(row.recording for row in self.rows)

    @property
    def labels(self) -> Mapping[str, str | int | float | None]:
        """What stands in the identity columns; null where the recordings differ."""
        shared = {name: {getattr(row, name) for row in self.rows} for name in ("axis", "speed", "swing_rad")}
        values = {name: next(iter(found)) if len(found) == 1 else None for name, found in shared.items()}
        return {"group": self.name, **values}

    @property
    def partition(self) -> Mapping[str, str]:
        """The hive partition of its results."""
        parts = [row.partition for row in self.rows]
        shared = {name: {part[name] for part in parts} for name in parts[0]}
        return {name: next(iter(found)) if len(found) == 1 else UNSPECIFIED for name, found in shared.items()}


def groups_of(rows: Iterable[CatalogRow], group: Group, stage: str) -> list[RecordingGroup]:
    """Put rows together that agree in the columns of a group.

    Raises
    ------
    StageError
        If the catalog has no such column, or two groups would have one name.
    """
    if unknown := [name for name in group.by if name not in ROW_KEYS]:
        raise StageError(
            f"groups by {unknown[0]!r}",
            where=stage,
            expected=f"columns of the catalog: {', '.join(ROW_KEYS)}",
            hint=did_you_mean(unknown[0], ROW_KEYS),
        )
    found: dict[tuple[str | float | None, ...], list[CatalogRow]] = {}
    for row in sorted(rows, key=lambda row: row.recording):
        found.setdefault(tuple(_value(row, column) for column in group.by), []).append(row)
    named: dict[str, RecordingGroup] = {}
    for values, members in found.items():
        name = "_".join(_word(column, value) for column, value in zip(group.by, values, strict=True)) or "all"
        if name in named:
            hint = "Add a column that tells them apart."
            raise StageError("two groups of recordings have one name", where=stage, found=name, hint=hint)
        named[name] = RecordingGroup(name, group.by, tuple(members))
    return list(named.values())


def _value(row: CatalogRow, column: str) -> str | float | None:
    """Return a value of a row; a garment that is not known has a name, all the same."""
    value: str | float | None = row.partition["garment"] if column == "garment" else getattr(row, column)
    return value


def _word(column: str, value: str | float | None) -> str:
    """Write a value as it stands in names: ``pi16``, ``0.5``, ``R``; other numbers with what they are of."""
    if value is None:
        return UNSPECIFIED
    if isinstance(value, str):
        return value.replace("/", "-")
    if column == "swing_rad":
        return f"pi{round(math.pi / value)}"
    return f"{value:g}" if column == "speed" else f"{column}{value:g}"
