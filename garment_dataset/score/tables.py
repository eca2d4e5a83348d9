"""Errors of anyone's tables against truth of the same name: ``<recording>.truth/<table>.parquet``.

Rows are matched by the table's keys, or by what both have that is no quantity (``frame``, ``point``); every quantity
that both have is scored.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from garment_dataset.errors import TableError
from garment_dataset.features.reading import declared_uncertainties

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    import pandas as pd

    from garment_dataset.arrays import FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class ColumnErrors:
    """Errors of one column of one recording, or of several joined: feature less truth, one row per value of the truth.

    Parameters
    ----------
    column : str
        Which.
    error : (n,) float64
        In the column's unit; NaN where nothing was found.
    std : (n,) float64
        The standard uncertainty stated for it; NaN where none is.
    """

    column: str
    error: FloatArray
    std: FloatArray


@dataclass(frozen=True, slots=True)
class ColumnScore:
    """How far one column is from its truth.

    Parameters
    ----------
    recording : str
        Name of the recording, or of the group that was pooled.
    table, column : str
        Which.
    expected : int
        Values of the truth.
    coverage : float or None
        Share of these that were found; None where the truth has none.
    rms, median, p95 : float or None
        Root mean square, median and 95 % of the absolute error, in the column's unit; None without any value.
    variance : float or None
        Mean square of the errors divided by their stated standard uncertainties: 1 when these are honest; None where
        none are stated.
    """

    recording: str
    table: str
    column: str
    expected: int
    coverage: float | None
    rms: float | None
    median: float | None
    p95: float | None
    variance: float | None

    def record(self) -> dict[str, str | int | float | None]:
        """Return the row as plain data."""
        return asdict(self)


def column_errors(features: pd.DataFrame, truth: pd.DataFrame, described: Mapping[str, Any]) -> list[ColumnErrors]:
    """Subtract the truth from one recording's table, column by column.

    Parameters
    ----------
    features, truth : pandas.DataFrame
        Rows of one recording.
    described : mapping
        What ``schemas.json`` says of the table: its keys, and which columns are uncertainties. It may be empty.

    Raises
    ------
    TableError
        If they have nothing in common to match rows by or to compare, or it does not tell rows apart.
    """
    keys = _keys(features, truth, described.get("keys", ()))
    quantities = [
        name for name in truth.columns if name in features and name not in keys and _is_quantity(features[name])
    ]
    if wrong := [name for name in quantities if not _is_number(truth[name])]:
        raise TableError("a quantity that is no number", where=wrong[0], found=truth[wrong[0]].dtype)
    if not quantities:
        columns = [name for name in features.columns if _is_quantity(features[name])]
        raise TableError("no quantity to compare", expected=f"one of {columns}", found=list(truth.columns))
    declared = declared_uncertainties(described)
    rows = _rows_of(features, truth, keys)
    errors = []
    for name in quantities:
        expected = truth[name].notna().to_numpy()
        found = _values(features, name, rows[expected])
        std = declared.get(name)
        if std not in features:
            std = uncertainty_column(name, features.columns)
        errors.append(
            ColumnErrors(
                name,
                found - truth[name].to_numpy(np.float64, na_value=np.nan)[expected],
                np.full_like(found, np.nan) if std is None else _values(features, std, rows[expected]),
            )
        )
    return errors


def uncertainty_column(column: str, names: Collection[str]) -> str | None:
    """Return which of some columns has the standard uncertainty of another: ``vz_std_m_s`` of ``vz_m_s``."""
    words = column.split("_")
    candidates = ("_".join([*words[:place], "std", *words[place:]]) for place in range(len(words), 0, -1))
    return next((name for name in candidates if name in names), None)


def join_columns(errors: Sequence[ColumnErrors]) -> ColumnErrors:
    """Pool one column of several recordings."""
    return ColumnErrors(
        errors[0].column,
        np.concatenate([part.error for part in errors]),
        np.concatenate([part.std for part in errors]),
    )


def score_column(errors: ColumnErrors, recording: str, table: str) -> ColumnScore:
    """Summarise errors."""
    known = np.isfinite(errors.error)
    size = np.abs(errors.error[known])
    stated = known & (errors.std > 0)
    return ColumnScore(
        recording=recording,
        table=table,
        column=errors.column,
        expected=known.size,
        coverage=float(known.mean()) if known.size else None,
        rms=float(np.sqrt(np.mean(size**2))) if size.size else None,
        median=float(np.median(size)) if size.size else None,
        p95=float(np.percentile(size, 95)) if size.size else None,
        variance=float(np.mean((errors.error[stated] / errors.std[stated]) ** 2)) if stated.any() else None,
    )


def _keys(features: pd.DataFrame, truth: pd.DataFrame, declared: Sequence[str]) -> list[str]:
    """Return the columns by which rows are matched: the table's keys, if the truth has them all."""
    keys = list(declared) if declared and set(declared) <= set(truth.columns) else []
    if not keys:
        shared = [name for name in truth.columns if name in features.columns]
        keys = [name for name in shared if _is_label(features[name]) and _is_label(truth[name])]
    if not keys:
        columns = list(declared) or [name for name in features.columns if _is_label(features[name])]
        raise TableError("nothing to match rows by", expected=f"columns of {columns}", found=list(truth.columns))
    for what, table in (("features", features), ("truth", truth)):
        if count := int(table.duplicated(keys).sum()):
            raise TableError(
                f"rows of the {what} are not told apart",
                expected=f"one row for each {', '.join(keys)}",
                found=f"{count} more",
            )
    return keys


def _rows_of(features: pd.DataFrame, truth: pd.DataFrame, keys: list[str]) -> IntArray:
    """Return where the features have each row of the truth; -1 where they have none."""
    places = features[keys].assign(place_=np.arange(len(features)))
    try:
        joined = truth[keys].merge(places, on=keys, how="left")
    except ValueError as error:  # text and numbers
        raise TableError(
            "keys of another type", expected=dict(features[keys].dtypes), found=dict(truth[keys].dtypes)
        ) from error
    return joined["place_"].fillna(-1).to_numpy(np.int64)


def _values(table: pd.DataFrame, column: str, rows: IntArray) -> FloatArray:
    values = np.append(table[column].to_numpy(np.float64, na_value=np.nan), np.nan)  # the last: there is no row
    return values[rows]


def _is_number(values: pd.Series) -> bool:
    from pandas.api import types

    return types.is_numeric_dtype(values) and not types.is_bool_dtype(values)


def _is_label(values: pd.Series) -> bool:
    from pandas.api import types

    return types.is_integer_dtype(values) or types.is_bool_dtype(values) or types.is_string_dtype(values)


def _is_quantity(values: pd.Series) -> bool:
    from pandas.api import types

    return types.is_float_dtype(values)
