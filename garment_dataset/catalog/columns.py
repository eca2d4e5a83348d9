"""Columns of one's own in the tables: what ``catalog/columns.toml`` says of them, and how their cells are read."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
from datetime import date
from typing import TYPE_CHECKING, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, ValidationError

from garment_dataset.files import first_fault, hint_of, read_toml

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from garment_dataset.catalog.filters import Kind

SIDECAR = "columns.toml"
"""File in the catalog that says of which types the columns of one's own are."""

Value = str | int | float | bool | date
"""What stands in a cell of such a column."""

ColumnType = Literal["text", "integer", "number", "boolean", "date"]

RESERVED = frozenset(
    [
        *(
            "recording",
            "name",
            "garment",
            "holding",
            "repeat",
            "swing_rad",
            "speed",
            "axis",
            "topics_file",
            "dvd",
            "table",
        ),
        *("partner", "garment_kind", "color", "width_m", "height_m", "weight_kg", "in_tables", "state", "path"),
        *("letter", "kind", "width_cm", "height_cm", "weight_g", "description", "number", "source", "from_s", "to_s"),
        *("quality", "coverage", "bridged", "noise_m", "why", "damage", "topics", "background", "holding_description"),
    ]
)
"""Names that say something of a recording already: in a table, in ``list`` or in ``show``."""

_NAME = re.compile(r"[^\W\d_][\w-]*")
_DECIMAL_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+")


class ColumnEntry(BaseModel):
    """What the sidecar says of one column."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    type: ColumnType
    unit: str | None = None
    description: str | None = None


@dataclass(frozen=True, slots=True)
class Column:
    """A column of one's own.

    Parameters
    ----------
    name : str
        As in the header.
    table : str
        Name of the file.
    type : {"text", "integer", "number", "boolean", "date"}
        Of its values; text where the sidecar does not say.
    unit, description : str, optional
        As in the sidecar.
    """

    name: str
    table: str
    type: ColumnType = "text"
    unit: str | None = None
    description: str | None = None

    @property
    def kind(self) -> Kind:
        """How filters take its values."""
        return _READERS[self.type].kind


class Fault(NamedTuple):
    """What is wrong with the sidecar: as in a :class:`~garment_dataset.catalog.reading.TableProblem`."""

    what: str
    expected: str
    found: str
    hint: str | None = None


def read_entries(folder: Path) -> tuple[Mapping[str, ColumnEntry], list[Fault]]:
    """Read the sidecar, one table per column; a catalog without one has no typed columns of its own."""
    path = folder / SIDECAR
    if not os.path.lexists(path):
        return {}, []
    try:
        found = read_toml(path)
    except (OSError, ValueError) as error:
        return {}, [Fault("not TOML", "one table per column: [NAME] type = ...", str(error), hint_of(error))]
    entries: dict[str, ColumnEntry] = {}
    faults: list[Fault] = []
    for name, entry in found.items():
        try:
            entries[name] = ColumnEntry.model_validate(entry)
        except ValidationError as error:
            if not isinstance(entry, dict):
                hint = f"Write [{name}] and below it type = {entry!r}."
                faults.append(Fault(f"entry {name!r} is not understood", "a table", repr(entry), hint))
                continue
            key, expected, value, suggestion = first_fault(error, ColumnEntry)
            what = f"entry '{name}.{key}' is not understood"
            faults.append(Fault(what, expected, "nothing" if value is None else value, suggestion))
    return entries, faults


def name_complaint(name: str) -> tuple[str, str | None] | None:
    """Return what is wrong with the name of a column of one's own, and what to do; None when nothing is."""
    if not name:
        return "a column without a name", "Give it one, or delete it."
    if name in RESERVED:
        return f"{name!r} says something else already", "Give the column a name of its own."
    if _NAME.fullmatch(name) is None:
        plain = re.sub(r"\W+", "_", name).strip("_").lower()
        example = f", for example {plain!r}" if _NAME.fullmatch(plain) else ""
        return (
            f"{name!r} cannot be asked for in filters",
            f"Let it begin with a letter, of letters, digits, _ and -{example}; {SIDECAR} has room for its unit.",
        )
    return None


class CellError(Exception):
    """A cell that is not of its column's type: what it may be, and what may be meant."""

    def __init__(self, expected: str, hint: str | None) -> None:
        super().__init__(expected)
        self.expected = expected
        self.hint = hint


def parse_cell(column: Column, cell: str) -> Value:
    """Read a cell that is not empty.

    Raises
    ------
    CellError
        If it is not of the column's type.
    """
    known = _READERS[column.type]
    try:
        return known.read(cell)
    except ValueError:
        raise CellError(f"{known.described} or nothing", decimal_hint(cell) or known.hint) from None


def decimal_hint(cell: str) -> str | None:
    """Return how a number with a decimal comma is written; None for any other cell."""
    if _DECIMAL_COMMA.fullmatch(cell) is None:
        return None
    return f"The decimal mark is a point: {cell.replace(',', '.')}."


def _integer(cell: str) -> int:
    if re.fullmatch(r"[+-]?[0-9]{1,18}", cell) is None:  # what 64 bits hold
        raise ValueError
    return int(cell)


def _number(cell: str) -> float:
    if re.fullmatch(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?", cell) is None:
        raise ValueError
    if math.isinf(value := float(cell)):
        raise ValueError
    return value


def _boolean(cell: str) -> bool:
    words = {"yes": True, "true": True, "no": False, "false": False}
    if cell.lower() not in words:
        raise ValueError
    return words[cell.lower()]


def _date(cell: str) -> date:
    if re.fullmatch(r"[0-9]{4}-[0-9]{2}-[0-9]{2}", cell) is None:  # Python reads other forms of ISO 8601, too
        raise ValueError
    return date.fromisoformat(cell)


class _Reader(NamedTuple):
    """How cells of one type are read, and how filters take them."""

    kind: Kind
    described: str
    read: Callable[[str], Value]
    hint: str | None = None


_READERS: Mapping[ColumnType, _Reader] = {
    "text": _Reader(str, "text", str),
    "integer": _Reader(float, "a whole number", _integer),
    "number": _Reader(float, "a number", _number),
    "boolean": _Reader(bool, "yes or no", _boolean),
    "date": _Reader(date, "a date", _date, "Dates are written 2026-11-25."),
}
