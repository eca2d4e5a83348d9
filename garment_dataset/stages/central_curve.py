"""Cut every silhouette across its major axis; the midpoints are its central curve: thesis 5.2.3."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from garment_dataset.engine.stage import Stage, StageParams
from garment_dataset.tables import CENTRAL_CURVES

if TYPE_CHECKING:
    import pyarrow as pa


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

    from garment_dataset.vision.axes import region_axes
    from garment_dataset.vision.central_curve import central_curves
    from garment_dataset.vision.masks import borders, decode_mask

    rows = [row for row in silhouettes.select(["frame", "stamp_ns", "mask"]).to_pylist() if row["mask"] is not None]
    outlines, axes = [], []
    for row in rows:
        mask = decode_mask(row["mask"])
        outlines.append(borders(mask))
        axes.append(region_axes(mask))
    curves = central_curves(outlines, axes, params.pitch_px, lines=params.lines)
    columns = {name: np.array([row[name] for row in rows], np.int64)[curves.region] for name in ("frame", "stamp_ns")}
    columns |= {name: values for name, values in curves._asdict().items() if name != "region"}
    return {"central_curves": CENTRAL_CURVES.build(columns)}


STAGE = Stage(central_curve, params=CentralCurveParams, outputs=(CENTRAL_CURVES,))
