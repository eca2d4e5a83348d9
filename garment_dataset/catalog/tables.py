"""The tables of a catalog, as CSV files.

Garments are thesis table 4.1, holdings figure C.1, recordings tables B.2 and B.3. A user adds rows of their own.
Backgrounds say what shows the empty scene; that table may be missing.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from pydantic import AfterValidator, Field, NonNegativeFloat, PositiveFloat, PositiveInt, ValidationInfo

from garment_dataset.catalog.names import RecordingName
from garment_dataset.catalog.reading import Row, TableProblem, TableReader, unread
from garment_dataset.catalog.schemes import THESIS, Scheme
from garment_dataset.errors import CatalogError, RecordingNameError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from garment_dataset.catalog.columns import Column


def _scheme(info: ValidationInfo) -> Scheme:
    return THESIS if info.context is None else info.context


def _canonical(text: str, info: ValidationInfo) -> str:
    try:
        name = _scheme(info).parse(text)
    except RecordingNameError as error:
        raise ValueError(error.hint) from error
    if not isinstance(name, RecordingName):
        raise ValueError("An empty scene is found by its name and needs no row.")  # noqa: TRY004 - pydantic's protocol
    return str(name)


def _canonical_bag(text: str, info: ValidationInfo) -> str:
    try:
        return str(_scheme(info).parse(text))
    except RecordingNameError as error:
        raise ValueError(error.hint) from error


def _word(text: str, info: ValidationInfo) -> str:
    if not _scheme(info).is_word(text):
        raise ValueError("A letter, then letters, digits and hyphens.")
    return text


Letter = Annotated[str, Field(pattern=r"^[A-Za-z0-9]+$", description="a letter, or letters and digits")]
Word = Annotated[str, AfterValidator(_word), Field(description="the word that stands in file names")]
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


@dataclass(frozen=True)
class Tables:
    """What the files hold, and what is wrong with them."""

    garments: tuple[Garment, ...]
    holdings: tuple[Holding, ...]
    recordings: tuple[Recording, ...]
    problems: tuple[TableProblem, ...]
    backgrounds: tuple[Background, ...] = ()
    columns: tuple[Column, ...] = ()
    """Columns of one's own, in the order of the tables; their values are in ``model_extra`` of the rows."""

    @property
    def unread(self) -> frozenset[str]:
        """Names of the files that could not be read as a table."""
        return unread(self.problems)

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


def read_tables(folder: Path, scheme: Scheme = THESIS) -> Tables:
    """Read the tables; whatever is wrong becomes a problem, and as much as can be read is kept.

    A cell that cannot be read is kept as missing; of two rows for the same thing the first is kept.
    """
    reader = TableReader(folder, scheme)
    garments = reader.read("garments.csv", Garment, ("letter", "garment"))
    holdings = reader.read("holdings.csv", Holding, ("letter",))
    recordings = reader.read("recordings.csv", Recording, ("recording",))
    # A table that could not be read at all contradicts nothing.
    broken = reader.unread
    words = {
        column: None if f"{column}s.csv" in broken else known
        for column, known in (
            ("garment", {row.letter: row.garment for _, row in garments}),
            ("holding", {row.letter: row.holding for _, row in holdings}),
        )
    }
    for line, recording in recordings:
        reader.problems.extend(_contradictions(folder / "recordings.csv", line, recording, scheme, words))
    backgrounds = _read_backgrounds(reader)
    reader.finish()
    return Tables(
        tuple(row for _, row in garments),
        tuple(row for _, row in holdings),
        tuple(row for _, row in recordings),
        backgrounds=backgrounds,
        problems=tuple(reader.problems),
        columns=tuple(reader.columns),
    )


def _read_backgrounds(reader: TableReader) -> tuple[Background, ...]:
    """Read the rows that make sense; one that does not is no background at all, rather than another one."""
    path = reader.folder / "backgrounds.csv"
    if not os.path.lexists(path):
        return ()
    sound: list[Background] = []
    for line, row in reader.read(path.name, Background, ("topics_file",)):
        begin_s = row.from_s or 0.0
        whole = row.from_s is None and row.to_s is None
        if row.to_s is not None and row.to_s <= begin_s:
            what, expected, found = "an interval that holds nothing", f"more than {begin_s:g}", f"{row.to_s:g}"
        elif whole and isinstance(reader.scheme.parse(row.source), RecordingName):
            what, expected, found = "a recording without an interval", "when its scene is empty", "nothing"
        else:
            sound.append(row)
            continue
        reader.problems.append(TableProblem(path, what, expected, found, row.source, line, "to_s"))
    return tuple(sound)


def _contradictions(
    path: Path, line: int, row: Recording, scheme: Scheme, words: Mapping[str, Mapping[str, str] | None]
) -> Iterator[TableProblem]:
    name = scheme.parse(row.recording)
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
