"""``garment score``: how far features are from the truth of simulated recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from garment_dataset.cli.output import JsonOption, print_json, print_table

if TYPE_CHECKING:
    from garment_dataset.score.points import PointScore
    from garment_dataset.score.silhouettes import SilhouetteScore
    from garment_dataset.score.tables import ColumnScore

_POINT_COLUMNS = [
    "recording",
    "line",
    "point",
    "coverage [%]",
    "3-D rms",
    "median",
    "95 % [mm]",
    "z rms",
    "median",
    "95 % [mm]",
    "vz rms",
    "median",
    "95 % [mm/s]",
    "(error/std)² x",
    "y",
    "z",
    "vz",
]
_SILHOUETTE_COLUMNS = [
    "recording",
    "frames",
    "coverage [%]",
    "IoU mean",
    "worst",
    "axis [°]",
    "midline mean",
    "95 % [px]",
    "material line [px]",
]
_TABLE_COLUMNS = ["recording", "table", "column", "coverage [%]", "rms", "median", "95 %", "(error/std)²"]


def score(
    features: Annotated[
        Path,
        typer.Argument(exists=True, file_okay=False, help="A features folder, or a workspace.", metavar="FEATURES"),
    ],
    truth: Annotated[
        Path, typer.Argument(exists=True, file_okay=False, help="Folder with *.truth folders.", metavar="TRUTH")
    ],
    variant: Annotated[
        str, typer.Option("--variant", help="Which results; `default`: those without a name.")
    ] = "default",
    as_json: JsonOption = False,
) -> None:
    """Compare features of simulated recordings with their truth."""
    from garment_dataset.layout import refuse_bytes
    from garment_dataset.score.recordings import score as score_recordings
    from garment_dataset.workspace.pipelines import DEFAULT_VARIANT

    for name, folder in (("features", features), ("the truth", truth)):
        refuse_bytes(name, folder.absolute(), folder)

    scores = score_recordings(features, truth, "" if variant == DEFAULT_VARIANT else variant)
    if as_json:
        print_json(
            {
                "points": [row.record() for row in scores.points],
                "silhouettes": [row.record() for row in scores.silhouettes],
                "tables": [row.record() for row in scores.tables],
            }
        )
        return
    if scores.points:
        print_table(_POINT_COLUMNS, [_point_cells(row) for row in scores.points], title="Points")
    if scores.silhouettes:
        print_table(_SILHOUETTE_COLUMNS, [_silhouette_cells(row) for row in scores.silhouettes], title="Silhouettes")
    if scores.tables:
        print_table(_TABLE_COLUMNS, [_table_cells(row) for row in scores.tables], title="Other tables")


def _point_cells(row: PointScore) -> list[object]:
    lengths = (row.rmse_m, row.median_m, row.p95_m, row.z_rmse_m, row.z_median_m, row.z_p95_m)
    speeds = (row.vz_rmse_m_s, row.vz_median_m_s, row.vz_p95_m_s)
    variances = (row.x_variance, row.y_variance, row.z_variance, row.vz_variance)
    return [
        row.recording,
        row.line,
        "all" if row.point is None else row.point,
        _number(row.coverage, 100, 1),
        *(_number(value, 1000, 2) for value in lengths),
        *(_number(value, 1000, 1) for value in speeds),
        *(_number(value, 1, 2) for value in variances),
    ]


def _silhouette_cells(row: SilhouetteScore) -> list[object]:
    return [
        row.recording,
        row.expected,
        _number(row.coverage, 100, 1),
        _number(row.iou_mean, 1, 3),
        _number(row.iou_min, 1, 3),
        _number(row.orientation_mean_rad, 57.29578, 2),
        _number(row.midline_mean_px, 1, 2),
        _number(row.midline_p95_px, 1, 2),
        _number(row.material_mean_px, 1, 1),
    ]


def _table_cells(row: ColumnScore) -> list[object]:
    sizes = (None if value is None else f"{value:.3g}" for value in (row.rms, row.median, row.p95))
    names = (row.recording, row.table, row.column)
    return [*names, _number(row.coverage, 100, 1), *sizes, _number(row.variance, 1, 2)]


def _number(value: float | None, factor: float, digits: int) -> str | None:
    return None if value is None else f"{value * factor:.{digits}f}"
