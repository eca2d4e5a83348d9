"""The tables of a catalog, as CSV files.

Garments are thesis table 4.1, holdings figure C.1, recordings tables B.2 and B.3. A user adds rows of their own.
Backgrounds say what shows the empty scene; that table may be missing.
"""

from __future__ import annotations

import csv
import io
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeFloat,
    PositiveFloat,
    PositiveInt,
    ValidationError,
)

from garment_dataset.catalog.names import RecordingName, parse_bag_name
from garment_dataset.errors import CatalogError, RecordingNameError, did_you_mean
from garment_dataset.files import hint_of, read_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path


class Row(BaseModel):
    """A row of a table: immutable, unknown columns refused; the descriptions say what a cell may hold."""

    model_config: ClassVar[ConfigDict] = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def _canonical(text: str) -> str:
    try:
        name = parse_bag_name(text)
    except RecordingNameError as error:
        raise ValueError(error.hint) from error
    if not isinstance(name, RecordingName):
        raise ValueError("An empty scene is found by its name and needs no row.")  # noqa: TRY004 - pydantic's protocol
    return str(name)


def _canonical_bag(text: str) -> str:
    try:
        return str(parse_bag_name(text))
    except RecordingNameError as error:
        raise ValueError(error.hint) from error


Letter = Annotated[str, Field(pattern=r"^[A-Za-z0-9]+$", description="a letter, or letters and digits")]
Word = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9-]*$", description="the word that stands in file names")]
Text = Annotated[str | None, Field(description="text or nothing")]
Positive = Annotated[PositiveFloat | None, Field(description="a number above zero or nothing")]


class Garment(Row):
    """One piece of cloth."""

    letter: Letter
    garment: Word
    kind: Text = None
    color: Text = None
    width_cm: Positive = None
    height_cm: Positive = None
    weight_g: Positive = None


class Holding(Row):
    """One way of holding a garment; several may share a word."""

    letter: Letter
    holding: Word
    description: Text = None


class Recording(Row):
    """One bag that should exist."""

    recording: Annotated[str, AfterValidator(_canonical), Field(description="the name of a recording")]
    table: Text = None
    number: Annotated[PositiveInt | None, Field(description="a whole number above zero or nothing")] = None
    garment: Annotated[Letter | None, Field(description="a letter of garments.csv or nothing")] = None
    holding: Annotated[Letter | None, Field(description="a letter of holdings.csv or nothing")] = None
    dvd: Annotated[bool | None, Field(description="yes, no or nothing")] = None


class Background(Row):
    """What shows the empty scene to the recordings of one topics file, that is, of one camera position.

    The interval is from ``from_s`` to before ``to_s``, both after the first colour image; without, it is the whole bag.
    """

    topics_file: Annotated[PositiveInt, Field(description="the number of a topics file: X in the names")]
    source: Annotated[str, AfterValidator(_canonical_bag), Field(description="the name of a bag")]
    from_s: Annotated[NonNegativeFloat | None, Field(description="seconds after its first image or nothing")] = None
    to_s: Annotated[PositiveFloat | None, Field(description="seconds after its first image or nothing")] = None


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


@dataclass(frozen=True)
class Tables:
    """What the files hold, and what is wrong with them."""

    garments: tuple[Garment, ...]
    holdings: tuple[Holding, ...]
    recordings: tuple[Recording, ...]
    problems: tuple[TableProblem, ...]
    backgrounds: tuple[Background, ...] = ()

    @property
    def unread(self) -> frozenset[str]:
        """Names of the files that could not be read as a table."""
        return _unread(self.problems)

    def check(self) -> None:
        """Raise the first problem.

        Raises
        ------
        CatalogError
            If there is any; the hint counts the others.
        """
        if not self.problems:
            return
        first, others = self.problems[0], len(self.problems) - 1
        more = f"{others} more problem{'s' * (others > 1)}: `garment lint` lists them all." if others else None
        hint = " ".join(filter(None, (first.hint, more))) or None
        raise CatalogError(first.what, where=first.where, expected=first.expected, found=first.found, hint=hint)


def read_tables(folder: Path) -> Tables:
    """Read the tables; whatever is wrong becomes a problem, and as much as can be read is kept.

    A cell that cannot be read is kept as missing; of two rows for the same thing the first is kept.
    """
    problems: list[TableProblem] = []
    garments = _read(folder / "garments.csv", Garment, ("letter", "garment"), problems)
    holdings = _read(folder / "holdings.csv", Holding, ("letter",), problems)
    recordings = _read(folder / "recordings.csv", Recording, ("recording",), problems)
    # A table that could not be read at all contradicts nothing.
    broken = _unread(problems)
    words = {
        column: None if f"{column}s.csv" in broken else known
        for column, known in (
            ("garment", {row.letter: row.garment for _, row in garments}),
            ("holding", {row.letter: row.holding for _, row in holdings}),
        )
    }
    for line, recording in recordings:
        problems.extend(_contradictions(folder / "recordings.csv", line, recording, words))
    return Tables(
        tuple(row for _, row in garments),
        tuple(row for _, row in holdings),
        tuple(row for _, row in recordings),
        backgrounds=_read_backgrounds(folder / "backgrounds.csv", problems),
        problems=tuple(problems),
    )


def _read_backgrounds(path: Path, problems: list[TableProblem]) -> tuple[Background, ...]:
    """Read the rows that make sense; one that does not is no background at all, rather than another one."""
    if not os.path.lexists(path):
        return ()
    sound: list[Background] = []
    for line, row in _read(path, Background, ("topics_file",), problems):
        begin_s = row.from_s or 0.0
        whole = row.from_s is None and row.to_s is None
        if row.to_s is not None and row.to_s <= begin_s:
            what, expected, found = "an interval that holds nothing", f"more than {begin_s:g}", f"{row.to_s:g}"
        elif whole and isinstance(parse_bag_name(row.source), RecordingName):
            what, expected, found = "a recording without an interval", "when its scene is empty", "nothing"
        else:
            sound.append(row)
            continue
        problems.append(TableProblem(path, what, expected, found, row.source, line, "to_s"))
    return tuple(sound)


def _unread(problems: Iterable[TableProblem]) -> frozenset[str]:
    return frozenset(problem.path.name for problem in problems if problem.line in (None, 1))


def _contradictions(
    path: Path, line: int, row: Recording, words: Mapping[str, Mapping[str, str] | None]
) -> Iterator[TableProblem]:
    name = parse_bag_name(row.recording)
    assert isinstance(name, RecordingName)
    for column, letter, word in (("garment", row.garment, name.garment), ("holding", row.holding, name.holding)):
        known = words[column]
        if letter is None or known is None:
            continue
        if letter not in known:
            what, expected, found = f"a letter that is not in {column}s.csv", ", ".join(known), repr(letter)
        elif word not in (None, known[letter]):
            letters = " or ".join(other for other in known if known[other] == word) or f"a row in {column}s.csv"
            what, expected, found = "name and letter disagree", f"{letters} ({word})", f"{letter} ({known[letter]})"
        else:
            continue
        yield TableProblem(path, what, expected, found, row.recording, line, column)


RowT = TypeVar("RowT", bound=Row)


def _read(path: Path, model: type[RowT], unique: Sequence[str], problems: list[TableProblem]) -> list[tuple[int, RowT]]:
    rows: list[tuple[int, RowT]] = []
    seen: dict[tuple[str, object], int] = {}
    for line, cells in _lines(path, model, problems):
        if (row := _row(path, line, cells, model, problems)) is None:
            continue
        twice = [column for column in unique if (column, getattr(row, column)) in seen]
        for column in twice:
            first = seen[column, getattr(row, column)]
            found = f"{getattr(row, column)}, also in line {first}"
            subject = str(getattr(row, column))
            problems.append(TableProblem(path, "row given twice", "each once", found, subject, line, column))
        if not twice:
            seen.update({(column, getattr(row, column)): line for column in unique})
            rows.append((line, row))
    return rows


def _lines(path: Path, model: type[Row], problems: list[TableProblem]) -> Iterator[tuple[int, dict[str, str | None]]]:
    """Yield the number and the cells of every line under a sound header."""
    columns = ",".join(model.model_fields)
    try:
        reader = csv.reader(io.StringIO(read_text(path), newline=""), strict=True)
        header = next(reader, [])
        if (complaint := _header_complaint(header, model)) is not None:
            found, hint = repr(",".join(header)), _header_hint(header, model)
            problems.append(TableProblem(path, complaint, columns, found, path.name, 1, hint=hint))
            return
        for cells in reader:
            if not any(cell.strip() for cell in cells):
                continue
            if len(cells) != len(header):
                expected, found = f"{len(header)} ({','.join(header)})", str(len(cells))
                problems.append(
                    TableProblem(path, "wrong number of cells", expected, found, cells[0].strip(), reader.line_num)
                )
                cells = (cells + [""] * len(header))[: len(header)]  # noqa: PLW2901 - the row as far as it goes
            yield reader.line_num, {name: cell.strip() or None for name, cell in zip(header, cells, strict=True)}
    except FileNotFoundError:
        problems.append(TableProblem(path, "table missing", f"a CSV file with {columns}", "no file", path.name))
    except (ValueError, OSError, csv.Error) as error:
        what, hint = "not a CSV file in UTF-8", hint_of(error)
        problems.append(TableProblem(path, what, f"columns {columns}", str(error), path.name, hint=hint))


def _header_complaint(header: list[str], model: type[Row]) -> str | None:
    fields = model.model_fields
    if unknown := [name for name in header if name not in fields]:
        return f"unknown column {unknown[0]!r}"
    if missing := [name for name, field in fields.items() if field.is_required() and name not in header]:
        return f"no column {missing[0]!r}"
    return "column given twice" if len(set(header)) < len(header) else None


def _header_hint(header: list[str], model: type[Row]) -> str | None:
    """Return which column that is not there an unknown one may stand for."""
    missing = [name for name in model.model_fields if name not in header]
    hints = (did_you_mean(name, missing) for name in header if name not in model.model_fields)
    return next(filter(None, hints), None)


def _row(
    path: Path, line: int, cells: dict[str, str | None], model: type[RowT], problems: list[TableProblem]
) -> RowT | None:
    try:
        return model.model_validate(cells)
    except ValidationError as error:
        faults: Iterable[Any] = error.errors(include_url=False)
    subject = cells[next(iter(model.model_fields))] or path.name
    for fault in faults:
        column = str(fault["loc"][0])
        expected = model.model_fields[column].description or "another value"
        found = "nothing" if cells[column] is None else repr(cells[column])
        hint = str(fault["ctx"]["error"]) if fault["type"] == "value_error" else None
        problems.append(TableProblem(path, "cell not understood", expected, found, subject, line, column, hint))
        cells = {**cells, column: None}
    try:
        return model.model_validate(cells)
    except ValidationError:
        return None
