"""Two variants of results compared, column by column, also in units of what they state as uncertain."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import pandas as pd

    from garment_dataset.arrays import FloatArray
    from garment_dataset.engine.table import Column, TableSpec

_TEXT = "text"


@dataclass(frozen=True, slots=True)
class ColumnDifference:
    """How much one column differs between two variants.

    Parameters
    ----------
    table, column, unit : str
        Which, and its unit.
    rows : int
        Rows that both have.
    differing : int
        Rows whose values differ, those with a value in one alone among them.
    only_a, only_b : int
        Rows with a value in the first or in the second variant alone.
    rms, largest : float or None
        Of the differences, in the column's unit; None for text, or where no row has two values.
    rms_in_std : float or None
        Root mean square of the differences over the root of the sum of both squared standard uncertainties; None where
        none are stated.
    """

    table: str
    column: str
    unit: str
    rows: int
    differing: int
    only_a: int
    only_b: int
    rms: float | None = None
    largest: float | None = None
    rms_in_std: float | None = None

    def record(self) -> dict[str, Any]:
        """Return it as plain values."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class TableDifference:
    """How much one table differs: rows that one variant has alone, and every column of the others."""

    table: str
    rows_only_a: int
    rows_only_b: int
    columns: tuple[ColumnDifference, ...]

    @property
    def is_none(self) -> bool:
        """Whether both are equal."""
        return not (self.rows_only_a or self.rows_only_b or any(column.differing for column in self.columns))


def compare_tables(spec: TableSpec, a: pd.DataFrame, b: pd.DataFrame, subject: str) -> TableDifference:
    """Compare the rows of two variants of a table.

    Parameters
    ----------
    spec : TableSpec
        Says which columns tell rows apart, and which state uncertainties.
    a, b : pandas.DataFrame
        The rows, with the column ``subject`` among them.
    subject : str
        Column that says whose rows they are.
    """
    keys = [subject, *spec.keys] if spec.keys else [subject, _ORDER]
    left, right = (_numbered(frame, subject) for frame in (a, b))
    joined = left.merge(right, on=keys, how="outer", suffixes=("_a", "_b"), indicator="_side")
    both = joined[joined["_side"] == "both"]
    columns = [column for column in spec.columns if column.name not in spec.keys]
    return TableDifference(
        spec.name,
        int((joined["_side"] == "left_only").sum()),
        int((joined["_side"] == "right_only").sum()),
        tuple(_compare_column(spec.name, column, both) for column in columns),
    )


_ORDER = "_order"


def _numbered(frame: pd.DataFrame, subject: str) -> pd.DataFrame:
    return frame.assign(**{_ORDER: frame.groupby(subject).cumcount()})


def _compare_column(table: str, column: Column, both: pd.DataFrame) -> ColumnDifference:
    a, b = both[f"{column.name}_a"], both[f"{column.name}_b"]
    only_a, only_b = int((a.notna() & b.isna()).sum()), int((a.isna() & b.notna()).sum())
    if not column.type.startswith(("float", "int", "uint")):
        unequal = sum(not _same(one, other) for one, other in zip(a, b, strict=True))
        return ColumnDifference(table, column.name, column.unit or _TEXT, len(both), unequal, only_a, only_b)
    difference = (a - b).to_numpy(np.float64, na_value=np.nan)  # exact first: a float holds no stamp in ns
    known = np.isfinite(difference)
    found = difference[known]
    differing = int(np.count_nonzero(found)) + only_a + only_b
    rms = largest = None
    if found.size:
        rms, largest = float(np.sqrt(np.mean(found**2))), float(np.abs(found).max())
    return ColumnDifference(
        table, column.name, column.unit, len(both), differing, only_a, only_b, rms, largest,
        _in_std(difference, column, both),
    )  # fmt: skip


def _same(one: object, other: object) -> bool:
    if one is other:
        return True
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return bool(np.array_equal(one, other))
    is_null = [value is None or value != value for value in (one, other)]  # noqa: PLR0124 - NaN
    return all(is_null) or (not any(is_null) and bool(one == other))


def _in_std(difference: FloatArray, column: Column, both: pd.DataFrame) -> float | None:
    """Return the root mean square of differences over their stated standard uncertainty."""
    if not column.uncertainty:
        return None
    variance = sum(
        both[f"{column.uncertainty}_{side}"].to_numpy(np.float64, na_value=np.nan) ** 2 for side in ("a", "b")
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        squared = difference**2 / variance
    squared = np.asarray(squared)[np.isfinite(squared)]
    return float(np.sqrt(squared.mean())) if squared.size else None


def summarise(differences: Iterable[TableDifference]) -> Sequence[ColumnDifference]:
    """Return the columns that differ, of all tables."""
    return [column for table in differences for column in table.columns if column.differing]
