"""Cut every silhouette across its major axis; the midpoints are its central curve: thesis 5.2.3."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.stages.columns import FRAME, STAMP
from garment_dataset.stages.stage import Stage, StageParams

if TYPE_CHECKING:
    import pyarrow as pa


CENTRAL_CURVES = TableSpec(
    "central_curves",
    1,
    "one cut across the silhouette of one colour frame, from its upper end down",
    (
        FRAME,
        STAMP,
        Column("cut", "int32", "1", "number of the cut, from 0 at the upper end"),
        Column("u_px", "float64", "px", "u of the midpoint between the outermost crossings of cut and outline"),
        Column("v_px", "float64", "px", "v of the same midpoint"),
        Column("width_px", "float64", "px", "distance between the outermost crossings"),
        Column("position_px", "float64", "px", "of the cut along the major axis, from the upper end"),
        Column("arc_length_px", "float64", "px", "along the curve, from its first midpoint"),
        Column("parts", "int32", "1", "how many separate parts the cut meets: more than 1 at folds, sleeves and holes"),
    ),
    keys=("frame", "cut"),
)


class CentralCurveParams(StageParams):
    """Where the cuts are."""

    pitch_px: float = Field(default=5.0, gt=0, description="distance of the cuts along the major axis")
    lines: int = Field(
        default=5,
        ge=1,
        description="parallel lines, evenly spaced over a pitch, whose crossings a cut is the mean of; the thesis: 1",
    )


def central_curve(silhouettes: pa.Table, params: CentralCurveParams) -> dict[str, pa.Table]:
    """Find the midpoints of the cuts across every silhouette.

    Parameters
    ----------
    silhouettes : pyarrow.Table
        As ``silhouette`` made them.
    params : CentralCurveParams
        See there.

    Returns
    -------
    dict of str to pyarrow.Table
        ``central_curves``: one row per cut of every frame with a mask, from the upper end of the garment down. Where a
        cut meets several parts, its midpoint is that between the outermost crossings, and ``parts`` tells.
    """
    import numpy as np

    from garment_dataset.vision.color.axes import region_axes
    from garment_dataset.vision.color.central_curve import central_curves
    from garment_dataset.vision.color.masks import borders, decode_mask

    rows = [row for row in silhouettes.select(["frame", "stamp_ns", "mask"]).to_pylist() if row["mask"] is not None]
    outlines, axes = [], []
    for row in rows:
        mask = decode_mask(row["mask"])
        outlines.append(borders(mask))
        axes.append(region_axes(mask))
    curves = central_curves(outlines, axes, params.pitch_px, lines=params.lines)
    columns = {name: np.array([row[name] for row in rows], np.int64)[curves.region] for name in ("frame", "stamp_ns")}
    columns |= {name: values for name, values in curves._asdict().items() if name != "region"}
    return {"central_curves": CENTRAL_CURVES.table(columns)}


STAGE = Stage(central_curve, params=CentralCurveParams, outputs=(CENTRAL_CURVES,))
