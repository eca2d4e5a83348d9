"""Find the truth of recordings beside their features, and score them one by one and together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from garment_dataset.errors import StoreError
from garment_dataset.features.reading import load_features, tables_in, variant_folder
from garment_dataset.score.points import PointErrors, join_errors, point_errors, score_errors
from garment_dataset.score.silhouettes import SilhouetteErrors, score_silhouettes, silhouette_errors
from garment_dataset.score.tables import score_table

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import pandas as pd

    from garment_dataset.score.points import Line, PointScore
    from garment_dataset.score.silhouettes import SilhouetteScore
    from garment_dataset.score.tables import ColumnScore

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
        If there is no truth, or no features of any recording with truth.
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
    from garment_dataset.layout import Layout

    if (path / "points").is_dir() or (path / "silhouettes").is_dir():
        return path
    return Layout.find(path).features_dir


def _point_scores(features: Path, truth: Mapping[str, Path]) -> list[PointScore]:
    import pandas as pd

    known = {name: folder for name, folder in truth.items() if (folder / "points.parquet").is_file()}
    points, kinematics = _tables(features, "points", known), _tables(features, "kinematics", known)
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
    """Score the tables of other stages of which there is truth."""
    import pandas as pd

    rows: list[ColumnScore] = []
    for table in tables_in(features):
        known = {name: path for name, folder in truth.items() if (path := folder / f"{table}.parquet").is_file()}
        if table in _SCORED or not known:
            continue
        for name, own in _tables(features, table, known).items():
            rows += score_table(name, table, own, pd.read_parquet(known[name]))
    return rows


def _tables(features: Path, table: str, truth: Mapping[str, Path]) -> dict[str, pd.DataFrame]:
    """Return a table by recording, of those with truth; nothing when it was not built."""
    if not (features / table).is_dir():
        return {}
    rows = load_features(table, folder=features, recording=list(truth))
    return {str(name): own for name, own in rows.groupby("recording", sort=True)}
