"""Two variants of results compared, column by column, also in units of what they state as uncertain."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from garment_dataset.features.reading import read_result, result_files

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping
    from pathlib import Path

    import pandas as pd

    from garment_dataset.arrays import FloatArray, IntArray
    from garment_dataset.engine.table import Column, TableSpec

    Pair = tuple[pd.DataFrame, pd.DataFrame]


@dataclass(frozen=True, slots=True)
class ColumnDifference:
    """How much one column differs, over the rows that both variants have.

    Parameters
    ----------
    column, unit : str
        Which, and its unit; empty for text.
    differing : int
        Rows whose values differ, those with a value in one alone among them.
    only_a, only_b : int
        Rows with a value in the first or in the second variant alone.
    rms, largest : float or None
        Of the differences, in the column's unit; None for text, flags and lists, or where no row has two values.
    rms_in_std : float or None
        Root mean square of the differences over the root of the sum of both squared standard uncertainties; None where
        none are stated.
    """

    column: str
    unit: str
    differing: int
    only_a: int
    only_b: int
    rms: float | None
    largest: float | None
    rms_in_std: float | None


@dataclass(frozen=True, slots=True)
class TableDifference:
    """How much one table differs.

    Parameters
    ----------
    table : str
        Which.
    results : int
        Files that both variants have: of recordings, camera positions or groups.
    results_only_a, results_only_b : tuple of str
        What only one has a file of; their rows are not counted.
    rows : int
        Rows that both have.
    rows_only_a, rows_only_b : int
        Rows of the common files that only one has.
    columns_only_a, columns_only_b : tuple of str
        Columns that only one has, or that have another unit there: the variants use different stages.
    columns : tuple of ColumnDifference
        The others.
    """

    table: str
    results: int
    results_only_a: tuple[str, ...]
    results_only_b: tuple[str, ...]
    rows: int
    rows_only_a: int
    rows_only_b: int
    columns_only_a: tuple[str, ...]
    columns_only_b: tuple[str, ...]
    columns: tuple[ColumnDifference, ...]

    @property
    def is_none(self) -> bool:
        """Whether both are equal."""
        alone = (self.results_only_a, self.results_only_b, self.columns_only_a, self.columns_only_b)
        return not (any(alone) or self.rows_only_a or self.rows_only_b or any(self.differing))

    @property
    def differing(self) -> tuple[ColumnDifference, ...]:
        """The columns that differ."""
        return tuple(column for column in self.columns if column.differing)

    def record(self) -> dict[str, Any]:
        """Return it as plain values."""
        return asdict(self)


def compare_variants(
    folders: tuple[Path, Path],
    specs: Mapping[str, tuple[TableSpec, TableSpec]],
    selected: Collection[str] | None = None,
) -> Iterator[TableDifference]:
    """Compare the tables that any of two variants has.

    Parameters
    ----------
    folders : (Path, Path)
        Where the tables of each lie.
    specs : mapping of str to (TableSpec, TableSpec)
        By table, what each variant's stage says of it.
    selected : collection of str, optional
        Of which recordings, camera positions and groups; by default all.
    """
    for table, pair in specs.items():
        a, b = (
            {path.stem: path for path in result_files(folder, table) if selected is None or path.stem in selected}
            for folder in folders
        )
        if a or b:
            both = ((read_result(path), read_result(b[name])) for name, path in a.items() if name in b)
            only_a, only_b = (tuple(name for name in one if name not in other) for one, other in ((a, b), (b, a)))
            yield replace(compare_tables(*pair, both), results_only_a=only_a, results_only_b=only_b)


def compare_tables(spec_a: TableSpec, spec_b: TableSpec, pairs: Iterable[Pair]) -> TableDifference:
    """Compare the rows of files that both variants have.

    Parameters
    ----------
    spec_a, spec_b : TableSpec
        What each variant's stage says of the table: units, uncertainties, and the keys by which rows are matched.
    pairs : iterable of (pandas.DataFrame, pandas.DataFrame)
        The rows of one file in both. A column that a file lacks, since it was built before there was one, has no value.
    """
    keys = tuple(name for name in spec_a.keys if name in spec_b.keys)
    columns = _shared(spec_a, spec_b)
    tallies = {name: _Tally() for name in columns if name not in keys}
    results = rows = rows_only_a = rows_only_b = 0
    for a, b in pairs:
        in_a, in_b = _matched(a, b, [name for name in keys if name in a and name in b])
        left, right = a.iloc[in_a].reindex(columns=list(columns)), b.iloc[in_b].reindex(columns=list(columns))
        results, rows = results + 1, rows + len(left)
        rows_only_a, rows_only_b = rows_only_a + len(a) - len(left), rows_only_b + len(b) - len(right)
        for name, tally in tallies.items():
            tally.add(left, right, columns[name])
    return TableDifference(
        table=spec_a.name,
        results=results,
        results_only_a=(),
        results_only_b=(),
        rows=rows,
        rows_only_a=rows_only_a,
        rows_only_b=rows_only_b,
        columns_only_a=tuple(column.name for column in spec_a.columns if column.name not in columns),
        columns_only_b=tuple(column.name for column in spec_b.columns if column.name not in columns),
        columns=tuple(tally.difference(columns[name]) for name, tally in tallies.items()),
    )


def _shared(spec_a: TableSpec, spec_b: TableSpec) -> dict[str, Column]:
    """Return the columns that have one name and one unit; an uncertainty counts when it has one name, too."""
    others = {(column.name, column.unit): column for column in spec_b.columns}
    found = {}
    for column in spec_a.columns:
        if (other := others.get((column.name, column.unit))) is not None:
            has_std = column.uncertainty == other.uncertainty
            found[column.name] = column if has_std else replace(column, uncertainty="")
    return {
        name: column if column.uncertainty in found else replace(column, uncertainty="")
        for name, column in found.items()
    }


def _matched(a: pd.DataFrame, b: pd.DataFrame, keys: list[str]) -> tuple[IntArray, IntArray]:
    """Return the positions of the rows that both have: of equal keys, and in order among those of equal keys."""
    parts = []
    for frame in (a, b):
        part = frame[keys]
        order = part.groupby(keys, dropna=False).cumcount().to_numpy() if keys else np.arange(len(part))
        parts.append(part.assign(order_=order, position_=np.arange(len(part))))
    joined = parts[0].merge(parts[1], on=[*keys, "order_"])
    return joined["position__x"].to_numpy(np.int64), joined["position__y"].to_numpy(np.int64)


@dataclass(slots=True)
class _Tally:
    """What is summed up of one column, file by file: all files at once may not fit into memory."""

    differing: int = 0
    only_a: int = 0
    only_b: int = 0
    values: int = 0
    squares: float = 0.0
    largest: float = 0.0
    stated: int = 0
    squares_in_std: float = 0.0

    def add(self, a: pd.DataFrame, b: pd.DataFrame, column: Column) -> None:
        """Add the matched rows of a file."""
        known_a, known_b = (frame[column.name].notna().to_numpy() for frame in (a, b))
        known = known_a & known_b
        only_a, only_b = int((known_a & ~known_b).sum()), int((known_b & ~known_a).sum())
        self.only_a += only_a
        self.only_b += only_b
        self.differing += only_a + only_b
        x, y = a[column.name][known], b[column.name][known]
        if not (_is_quantity(x) and _is_quantity(y)):
            self.differing += sum(not _same(one, other) for one, other in zip(x, y, strict=True))
            return
        # the larger less the smaller: exact for stamps in ns, and right for unsigned numbers
        large, small = np.maximum(x.to_numpy(), y.to_numpy()), np.minimum(x.to_numpy(), y.to_numpy())
        self.differing += int((large != small).sum())
        with np.errstate(invalid="ignore"):  # infinity less infinity
            size = (large - small).astype(np.float64)
        finite = np.isfinite(size)
        self._add_sizes(size[finite])
        if column.uncertainty:
            stds = (frame[column.uncertainty][known].to_numpy(np.float64, na_value=np.nan) for frame in (a, b))
            self._add_stated(size[finite], sum(std[finite] ** 2 for std in stds))

    def _add_sizes(self, size: FloatArray) -> None:
        self.values += size.size
        self.squares += math.fsum(size**2)  # in whatever order the rows come
        self.largest = max(self.largest, float(size.max(initial=0.0)))

    def _add_stated(self, size: FloatArray, variance: FloatArray) -> None:
        stated = variance > 0
        self.stated += int(stated.sum())
        self.squares_in_std += math.fsum(size[stated] ** 2 / variance[stated])

    def difference(self, column: Column) -> ColumnDifference:
        """Return what the sums say."""
        return ColumnDifference(
            column=column.name,
            unit=column.unit,
            differing=self.differing,
            only_a=self.only_a,
            only_b=self.only_b,
            rms=math.sqrt(self.squares / self.values) if self.values else None,
            largest=self.largest if self.values else None,
            rms_in_std=math.sqrt(self.squares_in_std / self.stated) if self.stated else None,
        )


def _is_quantity(values: pd.Series) -> bool:
    from pandas.api import types

    return types.is_numeric_dtype(values) and not types.is_bool_dtype(values)


def _same(one: object, other: object) -> bool:
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return np.array_equal(one, other, equal_nan=one.dtype.kind == other.dtype.kind == "f")
    return not isinstance(one, np.ndarray) and not isinstance(other, np.ndarray) and bool(one == other)
