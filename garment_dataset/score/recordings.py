"""Find the truth of recordings beside their features, and score them one by one and together."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

from garment_dataset.errors import DataWarning, StoreError, TableError
from garment_dataset.features.reading import (
    load_features,
    result_files,
    table_description,
    tables_in,
    variant_folder,
    variants_of,
)
from garment_dataset.layout import Layout, is_workspace
from garment_dataset.score.points import PointErrors, join_errors, point_errors, score_errors
from garment_dataset.score.silhouettes import SilhouetteErrors, score_silhouettes, silhouette_errors
from garment_dataset.score.tables import column_errors, join_columns, score_column

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import pandas as pd

    from garment_dataset.score.points import Line, PointScore
    from garment_dataset.score.silhouettes import SilhouetteScore
    from garment_dataset.score.tables import ColumnErrors, ColumnScore

POOLED = "all"
LINES: tuple[Line, ...] = ("surface", "material")
_SUFFIX = ".truth"
_SCORED = frozenset({"points", "kinematics", "silhouettes", "central_curves"})
"""Tables whose errors are more than differences of columns."""


@dataclass(frozen=True, slots=True)
class Scores:
    """Per recording, and pooled as ``all`` when there are several."""

    points: tuple[PointScore, ...]
    silhouettes: tuple[SilhouetteScore, ...]
    tables: tuple[ColumnScore, ...] = ()


def score(features: Path, truth: Path, variant: str = "") -> Scores:
    """Score every recording that has both features and truth.

    Parameters
    ----------
    features : Path
        A features folder, or a workspace.
    truth : Path
        Folder that holds, at any depth, ``<recording>.truth`` folders.
    variant : str
        Which results; by default those of the pipelines without a variant.

    Raises
    ------
    StoreError
        If there is no truth, no such variant, or no features of any recording with truth.
    WorkspaceError
        If the first folder holds no features.

    Warns
    -----
    DataWarning
        For each table of truth that cannot be compared.
    """
    folders = {path.name.removesuffix(_SUFFIX): path for path in sorted(truth.rglob(f"*{_SUFFIX}")) if path.is_dir()}
    if not folders:
        raise StoreError(
            "no truth", where=truth, expected="<recording>.truth", hint="`garment simulate` writes it beside each bag."
        )
    folder = variant_folder(features_folder(features), variant)
    points = _point_scores(folder, folders)
    silhouettes = _silhouette_scores(folder, folders)
    tables = _table_scores(folder, folders)
    if not points and not silhouettes and not tables:
        found = ", ".join(folders)
        raise StoreError("no features of a recording with truth", where=folder, found=f"truth of {found}")
    return Scores(tuple(points), tuple(silhouettes), tuple(tables))


def features_folder(path: Path) -> Path:
    """Return the features folder of a workspace, or the folder itself when it is one."""
    if not is_workspace(path) and (tables_in(path) or variants_of(path)):
        return path
    return Layout.find(path).features_dir


def _point_scores(features: Path, truth: Mapping[str, Path]) -> list[PointScore]:
    import pandas as pd

    known = {name: folder for name, folder in truth.items() if (folder / "points.parquet").is_file()}
    points, kinematics = _tables(features, "points", known), _tables(features, "kinematics", known)
    kinematics = {name: own for name, own in kinematics.items() if _source(own) == "points"}
    lines = {name: pd.read_parquet(truth[name] / "points.parquet") for name in points}
    rows = []
    for line in LINES:
        errors: dict[str, PointErrors] = {
            name: point_errors(points[name], kinematics.get(name), lines[name], line) for name in points
        }
        for name, own in errors.items():
            rows += score_errors(own, name, line)
        if len(errors) > 1:
            rows += score_errors(join_errors(errors.values()), POOLED, line)
    return rows


def _source(kinematics: pd.DataFrame) -> str:
    """Return whose motion a table is of; those built before it was said are of points."""
    return str(kinematics["source"].iloc[0]) if "source" in kinematics else "points"


def _silhouette_scores(features: Path, truth: Mapping[str, Path]) -> list[SilhouetteScore]:
    import pandas as pd

    known = {name: folder for name, folder in truth.items() if (folder / "color.parquet").is_file()}
    silhouettes, curves = _tables(features, "silhouettes", known), _tables(features, "central_curves", known)
    errors: dict[str, SilhouetteErrors] = {
        name: silhouette_errors(table, curves.get(name), pd.read_parquet(truth[name] / "color.parquet"))
        for name, table in silhouettes.items()
    }
    rows = [score_silhouettes([own], name) for name, own in errors.items()]
    return rows + ([score_silhouettes(list(errors.values()), POOLED)] if len(errors) > 1 else [])


def _table_scores(features: Path, truth: Mapping[str, Path]) -> list[ColumnScore]:
    """Score the tables of other stages of which there is truth, and kinematics of tracks with those of the material."""
    rows: list[ColumnScore] = []
    for table in tables_in(features):
        file = "tracks" if table == "kinematics" else table
        known = {name: path for name, folder in truth.items() if (path := folder / f"{file}.parquet").is_file()}
        if (table in _SCORED and table != "kinematics") or not known:
            continue
        by_column: dict[str, list[ColumnErrors]] = {}
        described = table_description(features, table)
        for name, own in _tables(features, table, known).items():
            if table == "kinematics" and _source(own) != "tracks":
                continue
            try:
                errors = column_errors(own, _read_truth(known[name]), described)
            except TableError as error:
                warnings.warn(f"not scored: {known[name]}: {error}", DataWarning, stacklevel=2)
                continue
            rows += [score_column(one, name, table) for one in errors]
            for one in errors:
                by_column.setdefault(one.column, []).append(one)
        rows += [score_column(join_columns(parts), POOLED, table) for parts in by_column.values() if len(parts) > 1]
    return rows


def _read_truth(path: Path) -> pd.DataFrame:
    import pandas as pd

    try:
        return pd.read_parquet(path)
    except (OSError, ValueError) as error:
        raise TableError("cannot be read as Parquet", found=error) from error


def _tables(features: Path, table: str, truth: Mapping[str, Path]) -> dict[str, pd.DataFrame]:
    """Return a table by recording, of those with truth; nothing when it was not built, is of groups, or has no rows."""
    import pyarrow.parquet as pq

    files = [path for path in result_files(features, table) if path.stem in truth]
    known = [path.stem for path in files if pq.read_metadata(path).num_rows]
    if not known:
        return {}
    rows = load_features(table, folder=features, recording=known)
    return {str(name): own for name, own in rows.groupby("recording", sort=True)}
