"""How a table is read from its CSV file: every problem is noted, and as much as can be read is kept."""

from __future__ import annotations

import csv
import io
import unicodedata
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from garment_dataset.catalog.columns import (
    RESERVED,
    SIDECAR,
    CellError,
    Column,
    ColumnEntry,
    decimal_hint,
    name_complaint,
    parse_cell,
    read_entries,
)
from garment_dataset.catalog.schemes import THESIS, Scheme
from garment_dataset.errors import did_you_mean, one_of
from garment_dataset.files import hint_of, read_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

_COMMAS = "Save it with commas between the cells, and points in numbers."
_SEPARATORS = {";": ("semicolons", _COMMAS), "\t": ("tabs", _COMMAS)}


class Row(BaseModel):
    """A row of a table: immutable; the descriptions say what a cell may hold, ``model_extra`` holds one's own."""

    model_config: ClassVar[ConfigDict] = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False)


@dataclass(frozen=True, slots=True)
class TableProblem:
    """One thing wrong with one table.

    Parameters
    ----------
    path : Path
        The file.
    what, expected, found, hint : str
        As in :class:`~garment_dataset.errors.GarmentError`.
    line : int, optional
        From 1, the header's.
    column : str, optional
        Name of the column.
    subject : str
        First cell of the row, or the name of the file.
    """

    path: Path
    what: str
    expected: str
    found: str
    subject: str
    line: int | None = None
    column: str | None = None
    hint: str | None = None

    @property
    def where(self) -> str:
        """File, line and column in one text."""
        line = "" if self.line is None else f", line {self.line}"
        return f"{self.path}{line}" + ("" if self.column is None else f", column {self.column}")


RowT = TypeVar("RowT", bound=Row)


@dataclass
class TableReader:
    """Reads the tables of one catalog, one after the other.

    Parameters
    ----------
    folder : Path
        The catalog.
    scheme : Scheme
        By which recordings are named.
    problems : list of TableProblem
        What was wrong so far.
    columns : list of Column
        The columns of one's own so far.
    """

    folder: Path
    scheme: Scheme = THESIS
    problems: list[TableProblem] = field(default_factory=list)
    columns: list[Column] = field(default_factory=list)
    _entries: Mapping[str, ColumnEntry] = field(init=False)

    def __post_init__(self) -> None:
        self._entries, faults = read_entries(self.folder)
        for fault in faults:
            self._note_sidecar(fault.what, fault.expected, fault.found, fault.hint)

    def read(self, file: str, model: type[RowT], unique: Sequence[str]) -> list[tuple[int, RowT]]:
        """Return the numbers and rows of a table; of two that agree in a ``unique`` column the first."""
        path = self.folder / file
        rows: list[tuple[int, RowT]] = []
        seen: dict[tuple[str, object], int] = {}
        for line, cells in self._lines(path, model):
            if (row := self._row(path, line, cells, model)) is None:
                continue
            twice = [column for column in unique if (column, getattr(row, column)) in seen]
            for column in twice:
                first = seen[column, getattr(row, column)]
                found = f"{getattr(row, column)}, also in line {first}"
                subject = str(getattr(row, column))
                self.problems.append(TableProblem(path, "row given twice", "each once", found, subject, line, column))
            if not twice:
                seen.update({(column, getattr(row, column)): line for column in unique})
                rows.append((line, row))
        return rows

    def finish(self) -> None:
        """Note what the sidecar says of columns that are not there, once all tables are read."""
        if self.unread - {SIDECAR}:
            return  # the column may be in a table that could not be read
        own = [column.name for column in self.columns]
        for name in self._entries:
            if name in RESERVED:
                hint = "Its type and unit are fixed: remove the entry."
                self._note_sidecar(f"{name!r} is no column of your own", "one of your own", repr(name), hint)
            elif name not in own:
                hint = did_you_mean(name, own) or "Add it to the header of a table, or remove the entry."
                self._note_sidecar(f"no table has a column {name!r}", one_of(own), repr(name), hint)

    @property
    def unread(self) -> frozenset[str]:
        """Names of the files that could not be read as a table."""
        return unread(self.problems)

    def _note_sidecar(self, what: str, expected: str, found: str, hint: str | None) -> None:
        self.problems.append(TableProblem(self.folder / SIDECAR, what, expected, found, SIDECAR, hint=hint))

    def _lines(self, path: Path, model: type[Row]) -> Iterator[tuple[int, dict[str, str | None]]]:
        """Yield the number and the cells of every line under a sound header."""
        columns = ",".join(model.model_fields)
        try:
            # one letter in one form: names and words are compared
            text = unicodedata.normalize("NFC", read_text(path))
            reader = csv.reader(io.StringIO(text, newline=""), strict=True)
            filled = (cells for cells in reader if any(cell.strip() for cell in cells))
            written = next(filled, [])
            header = [cell.strip() for cell in written]
            if (complaint := _header_complaint(header, model)) is not None:
                what, hint = complaint
                found = repr(",".join(written))
                self.problems.append(TableProblem(path, what, columns, found, path.name, 1, hint=hint))
                return
            if not self._take_columns(path, header, model):
                return
            for cells in filled:
                if len(cells) != len(header):
                    expected, found = f"{len(header)} ({','.join(header)})", str(len(cells))
                    what, subject = "wrong number of cells", cells[0].strip()
                    self.problems.append(TableProblem(path, what, expected, found, subject, reader.line_num))
                    cells = (cells + [""] * len(header))[: len(header)]  # noqa: PLW2901 - the row as far as it goes
                yield reader.line_num, {name: cell.strip() or None for name, cell in zip(header, cells, strict=True)}
        except FileNotFoundError:
            problem = TableProblem(path, "table missing", f"a CSV file with {columns}", "no file", path.name)
            self.problems.append(problem)
        except (ValueError, OSError, csv.Error) as error:
            what, hint = "not a CSV file in UTF-8", hint_of(error)
            problem = TableProblem(path, what, f"columns {columns}", str(error), path.name, hint=hint)
            self.problems.append(problem)

    def _take_columns(self, path: Path, header: Sequence[str], model: type[Row]) -> bool:
        """Note the columns of one's own; whether all of them can be one."""
        names = [name for name in header if name not in model.model_fields]
        for name in names:
            if (complaint := self._own_complaint(name, header, model)) is not None:
                what, hint = complaint
                expected = "a name of its own"
                self.problems.append(TableProblem(path, what, expected, repr(name), path.name, 1, hint=hint))
                return False
        for name in names:
            entry = self._entries.get(name)
            known = {} if entry is None else entry.model_dump()
            self.columns.append(Column(name, path.name, **known))
        return True

    def _own_complaint(self, name: str, header: Sequence[str], model: type[Row]) -> tuple[str, str | None] | None:
        if (complaint := name_complaint(name)) is not None:
            return complaint
        if other := next((column.table for column in self.columns if column.name == name), None):
            return f"column {name!r} is in {other}, too", "A recording has one value of it: rename one of the two."
        missing = [each for each in model.model_fields if each not in header]
        if name not in self._entries and (nearest := did_you_mean(name, missing)) is not None:
            # a typing error would lose a column without a word
            return f"unknown column {name!r}", f"{nearest} If it is one of your own, say its type in {SIDECAR}."
        return None

    def _row(self, path: Path, line: int, cells: dict[str, str | None], model: type[RowT]) -> RowT | None:
        own = self._own_values(path, line, cells, model)
        try:
            return model.model_validate(cells | own, context=self.scheme)
        except ValidationError as error:
            faults: Iterable[Any] = error.errors(include_url=False)
        for fault in faults:
            column = str(fault["loc"][0])
            cell = cells[column]
            expected = model.model_fields[column].description or "another value"
            hint = str(fault["ctx"]["error"]) if fault["type"] == "value_error" else None
            if fault["type"] == "float_parsing":
                hint = decimal_hint(cell or "")
            self._note_cell(path, line, column, cells, model, expected, hint)
            cells = {**cells, column: None}
        try:
            return model.model_validate(cells | own, context=self.scheme)
        except ValidationError:
            return None

    def _own_values(
        self, path: Path, line: int, cells: Mapping[str, str | None], model: type[Row]
    ) -> dict[str, object]:
        """Return the cells of one's own columns, by their types; what is of another is noted and missing."""
        found: dict[str, object] = {}
        for column in self.columns:
            if column.table != path.name or (cell := cells[column.name]) is None:
                continue
            try:
                found[column.name] = parse_cell(column, cell)
            except CellError as error:
                self._note_cell(path, line, column.name, cells, model, error.expected, error.hint)
                found[column.name] = None
        return found

    def _note_cell(
        self,
        path: Path,
        line: int,
        column: str,
        cells: Mapping[str, str | None],
        model: type[Row],
        expected: str,
        hint: str | None,
    ) -> None:
        found = "nothing" if cells[column] is None else repr(cells[column])
        subject = cells[next(iter(model.model_fields))] or path.name
        what = "cell not understood"
        self.problems.append(TableProblem(path, what, expected, found, subject, line, column, hint))


def unread(problems: Iterable[TableProblem]) -> frozenset[str]:
    """Return the names of the files that could not be read as a table."""
    return frozenset(problem.path.name for problem in problems if problem.line in (None, 1))


def _header_complaint(header: Sequence[str], model: type[Row]) -> tuple[str, str | None] | None:
    """Return what is wrong with a header, and what to do; columns of one's own are no matter of this."""
    fields = model.model_fields
    if len(header) == 1:
        for separator, (name, hint) in _SEPARATORS.items():
            if separator in header[0]:
                return f"unknown column {header[0]!r}: its cells are separated by {name}", hint
        if "," in header[0]:
            return f"unknown column {header[0]!r}: every line is one cell in quotes", "Remove the quotes around lines."
    if header[:1] and header[0].lower().startswith("sep="):
        return f"unknown column {header[0]!r}: a line for Excel alone", "Remove the first line."
    unknown = [name for name in header if name not in fields]
    if missing := [name for name, each in fields.items() if each.is_required() and name not in header]:
        if unknown:
            hints = (did_you_mean(name, missing) for name in unknown)
            return f"unknown column {unknown[0]!r}", next(filter(None, hints), f"Columns needed: {', '.join(missing)}.")
        return f"no column {missing[0]!r}", None
    return ("column given twice", None) if len(set(header)) < len(header) else None
