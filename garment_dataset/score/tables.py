"""Tables of anyone's stages against truth of the same name: ``<recording>.truth/<table>.parquet``.

What tells rows apart are the columns that both have and that are no quantities (``frame``, ``point``); the quantities
that both have are scored.
"""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

    from garment_dataset.arrays import FloatArray

_UNIT = re.compile(r"_(m_s2|rad_s|m_s|px2|px|rad|kg|ns|m|s)$")


@dataclass(frozen=True, slots=True)
class ColumnScore:
    """How far one column is from its truth.

    Parameters
    ----------
    recording, table, column : str
        Which.
    expected : int
        Rows of the truth.
    coverage : float
        Share of them with a value.
    rms, median, p95 : float or None
        Root mean square, median and 95 % of the absolute error, in the column's unit; None without any value.
    variance : float or None
        Mean squared error over stated standard uncertainty: 1 when that is right; None where none is stated.
    """

    recording: str
    table: str
    column: str
    expected: int
    coverage: float
    rms: float | None
    median: float | None
    p95: float | None
    variance: float | None

    def record(self) -> dict[str, str | int | float | None]:
        """Return it as plain values."""
        return asdict(self)


def score_table(recording: str, table: str, features: pd.DataFrame, truth: pd.DataFrame) -> list[ColumnScore]:
    """Score every quantity that a table and its truth share.

    Parameters
    ----------
    recording, table : str
        Names, for the scores.
    features, truth : pandas.DataFrame
        Rows of one recording.
    """
    import pandas as pd

    shared = [name for name in truth.columns if name in features.columns]
    quantities = [name for name in shared if pd.api.types.is_float_dtype(truth[name])]
    keys = [name for name in shared if name not in quantities]
    if not keys or not quantities:
        return []
    std = {name: uncertainty_name(name) for name in quantities}
    stated = [name for name in std.values() if name in features.columns and name not in quantities]
    joined = truth[[*keys, *quantities]].merge(
        features[[*keys, *quantities, *stated]], on=keys, how="left", suffixes=("_true", "")
    )
    return [_score(recording, table, name, std[name], joined) for name in quantities]


def uncertainty_name(column: str) -> str:
    """Return how the column with a quantity's standard uncertainty is called: ``vz_std_m_s`` of ``vz_m_s``."""
    found = _UNIT.search(column)
    return f"{column}_std" if found is None else f"{column[: found.start()]}_std{found[0]}"


def _score(recording: str, table: str, column: str, std: str, joined: pd.DataFrame) -> ColumnScore:
    error: FloatArray = (joined[column] - joined[f"{column}_true"]).to_numpy(np.float64)
    wanted = joined[f"{column}_true"].notna().to_numpy()
    known = wanted & np.isfinite(error)
    found = np.abs(error[known])
    variance = None
    if std in joined and found.size:
        normalised = (error[known] / joined[std].to_numpy(np.float64)[known]) ** 2
        finite = normalised[np.isfinite(normalised)]
        variance = float(finite.mean()) if finite.size else None
    expected = int(wanted.sum())
    return ColumnScore(
        recording,
        table,
        column,
        expected,
        float(known.sum() / expected) if expected else 0.0,
        float(np.sqrt(np.mean(found**2))) if found.size else None,
        float(np.median(found)) if found.size else None,
        float(np.percentile(found, 95)) if found.size else None,
        variance,
    )
