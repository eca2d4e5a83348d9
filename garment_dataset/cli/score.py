"""``garment score``: how far features are from the truth of simulated recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from garment_dataset.cli import completion
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
    "quantity",
    "rms",
    "median",
    "95 %",
    "unit",
    "(error/std)²",
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
        str,
        typer.Option(
            "--variant",
            help="Which results; `default`: those without a name.",
            autocompletion=completion.variants,
        ),
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
        cells = [each for row in scores.points for each in _point_cells(row)]
        print_table(_POINT_COLUMNS, cells, title="Points", heads=("recording", "line"))
    if scores.silhouettes:
        print_table(_SILHOUETTE_COLUMNS, [_silhouette_cells(row) for row in scores.silhouettes], title="Silhouettes")
    if scores.tables:
        cells = [_table_cells(row) for row in scores.tables]
        print_table(_TABLE_COLUMNS, cells, title="Other tables", heads=("recording", "table"))


def _point_cells(row: PointScore) -> list[list[object]]:
    """Return a line for every quantity of which something is known."""
    names = [row.recording, row.line, "all" if row.point is None else row.point, _number(row.coverage, 100, 1)]
    distances = (row.rmse_m, row.median_m, row.p95_m)
    depths = (row.z_rmse_m, row.z_median_m, row.z_p95_m)
    speeds = (row.vz_rmse_m_s, row.vz_median_m_s, row.vz_p95_m_s)
    lines = [
        ("3-D", distances, 2, "mm", None),
        ("x", (None, None, None), 2, "mm", row.x_variance),
        ("y", (None, None, None), 2, "mm", row.y_variance),
        ("z", depths, 2, "mm", row.z_variance),
        ("vz", speeds, 1, "mm/s", row.vz_variance),
    ]
    return [
        [*names, quantity, *(_number(value, 1000, digits) for value in values), unit, _number(variance, 1, 2)]
        for quantity, values, digits, unit, variance in lines
        if quantity == "3-D" or any(value is not None for value in (*values, variance))
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
