"""The catalog: which recordings there should be, which there are, and all that tables and names say about them."""

from __future__ import annotations

import dataclasses
import os
import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from garment_dataset.catalog.background_source import BackgroundSource
from garment_dataset.catalog.filters import compile_filter, parse_term, terms_of
from garment_dataset.catalog.folder import FolderScan, scan
from garment_dataset.catalog.hints import idle_globs, why_nothing
from garment_dataset.catalog.names import BackgroundName, RecordingName
from garment_dataset.catalog.rows import (
    ROW_KEYS,
    ROW_UNITS,
    CatalogRow,
    join_rows,
    to_frame,
    words_of,
)
from garment_dataset.catalog.schemes import THESIS, Scheme, scheme_of
from garment_dataset.catalog.showing import as_html, summary
from garment_dataset.catalog.tables import Background, Garment, Holding, Recording, Tables, read_tables
from garment_dataset.errors import CatalogError, DataWarning, FilterError, as_path, nearest_word, printable
from garment_dataset.files import hint_of, read_text
from garment_dataset.layout import Layout, nearest_catalog, workspace_above

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import pandas as pd

    from garment_dataset.catalog.filters import Kind, Predicate

__all__ = [
    "ROW_KEYS",
    "ROW_UNITS",
    "Background",
    "BackgroundSource",
    "Catalog",
    "CatalogRow",
    "Garment",
    "Holding",
    "Recording",
    "Tables",
]


@dataclass(frozen=True, repr=False)
class Catalog:
    """The tables of a data set, and the bags of a folder if one was looked at.

    Parameters
    ----------
    folder : Path
        Where the tables are.
    tables : Tables
        Garments, holdings, recordings and backgrounds; and what is wrong with them, if loaded with ``strict=False``.
    found : FolderScan, optional
        What the folder of recordings holds.
    scheme : Scheme
        By which recordings are named.

    Examples
    --------
    >>> catalog = Catalog.load()
    >>> len(catalog.query("GreenTowel_*", axis="R"))
    11
    """

    folder: Path
    tables: Tables
    found: FolderScan | None = None
    scheme: Scheme = THESIS

    def __repr__(self) -> str:
        return f"<Catalog {printable(str(self.folder))}: {summary(self.rows, self.tables)}>"

    def _repr_html_(self) -> str:
        return as_html(self.folder, self.rows, self.tables)

    @classmethod
    def load(cls, folder: Path | str | None = None, *, strict: bool = True, scheme: Scheme = THESIS) -> Catalog:
        """Read the tables.

        Parameters
        ----------
        folder : Path or str, optional
            Folder with garments.csv, holdings.csv, recordings.csv and perhaps backgrounds.csv. By default that of the
            workspace at or above the current folder, else the thesis' own, which the package carries.
        strict : bool
            Whether a table that cannot be read or contradicts itself is an error; otherwise it is kept in
            ``tables.problems``.
        scheme : Scheme
            By which recordings are named; without a folder, that of the workspace.

        Raises
        ------
        CatalogError
            With file, line, column, what was expected and what was found.
        """
        if folder is None:
            folder = nearest_catalog(Path.cwd())
            root = workspace_above(Path.cwd())
            scheme = scheme if root is None else scheme_of(Layout.at(root))
        folder = as_path(folder)
        tables = read_tables(folder, scheme)
        if strict:
            tables.check()
        return cls(folder, tables, scheme=scheme)

    @classmethod
    def of(cls, layout: Layout, *, strict: bool = True) -> Catalog:
        """Read the tables of a workspace, and look at its folder of recordings; see :meth:`load`."""
        catalog = cls.load(layout.catalog_dir, strict=strict, scheme=scheme_of(layout))
        return catalog.with_folder(layout.recordings_dir)

    def with_folder(self, recordings_dir: Path | str) -> Catalog:
        """Return this catalog with the state of every recording in a folder of bags."""
        return dataclasses.replace(self, found=scan(as_path(recordings_dir), self.scheme))

    @cached_property
    def rows(self) -> tuple[CatalogRow, ...]:
        """All recordings: the tables' in their order, then the unexpected ones by name."""
        if self.found is None:
            return join_rows(self.tables, None, self.scheme)
        bags = {str(bag.name): bag.path for bag in self.found.bags if isinstance(bag.name, RecordingName)}
        return join_rows(self.tables, bags, self.scheme)

    @cached_property
    def backgrounds(self) -> Mapping[int, BackgroundSource]:
        """What shows the empty scene, by topics file: those of all recordings, of backgrounds.csv and of the folder."""
        numbers = {row.topics_file for row in self.rows} | {row.topics_file for row in self.tables.backgrounds}
        bags = () if self.found is None else self.found.bags
        numbers |= {bag.name.topics_file for bag in bags if isinstance(bag.name, BackgroundName)}
        return {number: self.background(number) for number in sorted(numbers)}

    def background(self, topics_file: int) -> BackgroundSource:
        """Return what shows the empty scene to the recordings of a topics file.

        A row of backgrounds.csv says it; without one it is the bag ``camera_default_<topics_file - 1>``.
        """
        row = next((row for row in self.tables.backgrounds if row.topics_file == topics_file), None)
        default = f"camera_default_{topics_file - 1}"
        source = default if row is None else row.source
        bag = f"{'recordings' if self.found is None else self.found.folder.name}/{source}.bag"
        table = f"{self.folder.name}/backgrounds.csv"
        missing = (
            f"{bag}, or a row for topics file {topics_file} in {table}"
            if source == default
            else f"{bag}, which {table} names for topics file {topics_file}"
        )
        from_s, to_s = (None, None) if row is None else (row.from_s, row.to_s)
        path, recording = self._paths.get(source), self._by_name.get(source)
        return BackgroundSource(topics_file, source, from_s, to_s, path, missing, recording)

    @cached_property
    def _paths(self) -> Mapping[str, Path]:
        return {} if self.found is None else {str(bag.name): bag.path for bag in self.found.bags}

    @cached_property
    def _by_name(self) -> Mapping[str, CatalogRow]:
        return {row.recording: row for row in self.rows}

    @cached_property
    def filter_keys(self) -> Mapping[str, Kind]:
        """What its rows can be filtered by, columns of one's own among it."""
        return ROW_KEYS | {column.name: column.kind for column in self.tables.columns}

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Units of the quantities of a row."""
        return ROW_UNITS | {column.name: column.unit for column in self.tables.columns if column.unit is not None}

    @cached_property
    def words(self) -> Mapping[str, tuple[str, ...]]:
        """Of every key that is text, all words that there are."""
        return words_of(self.tables, self.rows)

    def row(self, recording: str) -> CatalogRow:
        """Return one recording, by its name in any form that is read.

        Raises
        ------
        RecordingNameError
            If that is no name of a recording.
        CatalogError
            If it is, but neither tables nor folder have it; the hint gives the nearest that they have.
        """
        name = str(self.scheme.parse(recording))
        if (row := self._by_name.get(name)) is None:
            nearest = nearest_word(name, self._by_name, cutoff=0.8)
            hint = f"Did you mean {nearest}?" if nearest else "`garment list` shows what there is."
            raise CatalogError("no such recording", expected="one in the tables or the folder", found=name, hint=hint)
        return row

    def matching(self, terms: Iterable[str]) -> Predicate:
        """Return the predicate of a filter (:mod:`garment_dataset.catalog.filters`) whose words this catalog knows.

        Raises
        ------
        FilterError
            If a term cannot be understood, or names what is not in the catalog; the hint gives the nearest that is.
        """
        terms = list(terms)
        wanted = compile_filter(terms, self.filter_keys, self.words if terms else {})
        if self.found is None:
            for term in (parse_term(text, self.filter_keys) for text in terms):
                if term.key == "state" and any(term.values):
                    hint = "`catalog.with_folder(FOLDER)` looks at one, `Workspace.find().catalog()` at its own."
                    raise FilterError("no folder of recordings was looked at", where=term.text, hint=hint)
        return wanted

    def select(self, terms: Iterable[str] = ()) -> tuple[CatalogRow, ...]:
        """Return the rows that a filter wants: see :meth:`matching` for what it may say.

        Warns
        -----
        DataWarning
            For each glob that nothing looks like, where other terms find something.
        """
        terms = list(terms)
        wanted = self.matching(terms)
        rows = tuple(row for row in self.rows if wanted(row))
        for text in idle_globs(terms, self.filter_keys, self.words) if rows and terms else ():
            warnings.warn(text, DataWarning, stacklevel=2)
        return rows

    def some(self, terms: Sequence[str]) -> tuple[CatalogRow, ...]:
        """Return the rows that a filter wants; any number of them where there is no filter.

        Raises
        ------
        FilterError
            If it wants none; the hint says why.
        """
        rows = self.select(terms)
        if terms and not rows:
            hint = self.why_nothing(terms) or "`garment list` shows them all."
            raise FilterError("no recording matches", found=" ".join(terms), hint=hint)
        return rows

    def why_nothing(self, terms: Iterable[str]) -> str | None:
        """Say why a filter finds nothing: the name nearest to a glob, and the bounds of a number that is compared."""
        records = [row.record() for row in self.rows]
        return "; ".join(why_nothing(list(terms), records, self.filter_keys, self.words, self.units)) or None

    def query(self, *terms: str, **filters: object) -> pd.DataFrame:
        """Return the rows that a filter wants as a DataFrame with typed columns.

        Parameters
        ----------
        *terms : str
            As on the command line.
        **filters : object
            The same by keyword: a value, several in a list, or None for a missing one.

        Returns
        -------
        pandas.DataFrame
            One row per recording, one column per field of :class:`CatalogRow` and per column of one's own. Text is
            ``string`` or categorical, whole numbers are ``Int64``, flags ``boolean``, dates ``datetime64``, quantities
            ``float64`` with their units in ``attrs["units"]``; what is not known is missing.

        Raises
        ------
        FilterError
            See :meth:`matching`.
        """
        return to_frame(self.select([*terms, *terms_of(filters)]), self.rows, self.tables.columns)

    def topics(self, number: int) -> tuple[str, ...] | None:
        """Return the topics of a topics file, in order; None when the catalog has no such file.

        Raises
        ------
        CatalogError
            If it is no text in UTF-8.
        """
        path = self.folder / "topics" / f"{number}.txt"
        try:
            return tuple(read_text(path).split()) if os.path.lexists(path) else None
        except (OSError, ValueError) as error:
            found, hint = error, hint_of(error)
            raise CatalogError(
                "cannot be read", where=path, expected="text in UTF-8", found=found, hint=hint
            ) from error
