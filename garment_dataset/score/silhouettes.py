"""Errors of silhouettes, their axes and the central curves against the truth of the colour frames."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.vision.color.axes import region_axes
from garment_dataset.vision.color.central_curve import central_curve
from garment_dataset.vision.color.masks import borders, decode_mask, largest_component

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from garment_dataset.arrays import BoolArray, FloatArray


@dataclass(frozen=True, slots=True)
class SilhouetteScore:
    """One row of a score; a figure is None when nothing can be said.

    Parameters
    ----------
    recording : str
        Name of the recording, or of the group that was pooled.
    expected : int
        Number of colour frames that show the garment.
    coverage : float
        Share of these with a silhouette.
    iou_mean, iou_min : float
        Intersection over union with the garment below the gripper: mean, and the worst frame.
    orientation_mean_rad : float
        Mean size of the error of the major axis' angle.
    midline_mean_px, midline_p95_px : float
        Distance of the central curve's points from the central curve of the true mask.
    material_mean_px : float
        Distance of the central curve's points from the projected material line. The two are not the same thing: on a
        garment that is not symmetric the middle of the silhouette is off the material line.
    """

    recording: str
    expected: int
    coverage: float | None
    iou_mean: float | None
    iou_min: float | None
    orientation_mean_rad: float | None
    midline_mean_px: float | None
    midline_p95_px: float | None
    material_mean_px: float | None

    def record(self) -> dict[str, object]:
        """Return the row as plain data."""
        return asdict(self)


@dataclass(frozen=True, slots=True, eq=False)
class SilhouetteErrors:
    """Errors of one recording: per frame of the truth NaN where there is no silhouette; per point of the curves."""

    iou: FloatArray
    angle_rad: FloatArray
    midline_px: FloatArray
    material_px: FloatArray


def silhouette_errors(silhouettes: pd.DataFrame, curves: pd.DataFrame | None, truth: pd.DataFrame) -> SilhouetteErrors:
    """Compare one recording's silhouettes with the truth.

    Parameters
    ----------
    silhouettes, curves : pandas.DataFrame
        Tables ``silhouettes`` and ``central_curves``.
    truth : pandas.DataFrame
        ``color.parquet`` of the truth. Frames are matched by their number; those without garment are left out.
    """
    found = {int(row["frame"]): row for row in silhouettes.to_dict("records")}
    midpoints = {} if curves is None else dict(list(curves.groupby(curves["frame"])))
    shown = [row for row in truth.to_dict("records") if row["area_px"] > 0]
    iou, angle_rad = np.full((2, len(shown)), np.nan)
    midline_px, material_px = [np.empty(0)], [np.empty(0)]
    for index, row in enumerate(shown):
        seen = found.get(int(row["frame"]))
        if seen is None or seen["mask"] is None:
            continue
        true_mask = _below(decode_mask(row["garment_mask"]), seen["gripper_v_px"])
        iou[index] = _iou(_below(decode_mask(seen["mask"]), seen["gripper_v_px"]), true_mask)
        turn = float(seen["orientation_rad"]) - float(row["orientation_rad"])
        angle_rad[index] = (turn + np.pi / 2) % np.pi - np.pi / 2
        if (cuts := midpoints.get(row["frame"])) is not None:
            curve = cuts[["u_px", "v_px"]].to_numpy(np.float64)
            material_px.append(distance_to_line(curve, np.column_stack([row["line_u_px"], row["line_v_px"]])))
            if len(midline := _midline(true_mask)) > 1:
                midline_px.append(distance_to_line(curve, midline))
    return SilhouetteErrors(iou, angle_rad, np.concatenate(midline_px), np.concatenate(material_px))


def score_silhouettes(errors: Sequence[SilhouetteErrors], recording: str) -> SilhouetteScore:
    """Summarise the errors of one or several recordings."""
    iou, angle_rad, midline_px, material_px = (
        np.concatenate([np.asarray(part) for part in parts])
        for parts in zip(
            *((part.iou, part.angle_rad, part.midline_px, part.material_px) for part in errors), strict=True
        )
    )
    there = np.isfinite(iou)
    return SilhouetteScore(
        recording,
        int(iou.size),
        float(there.mean()) if iou.size else None,
        float(iou[there].mean()) if there.any() else None,
        float(iou[there].min()) if there.any() else None,
        float(np.abs(angle_rad[there]).mean()) if there.any() else None,
        float(midline_px.mean()) if midline_px.size else None,
        float(np.percentile(midline_px, 95)) if midline_px.size else None,
        float(material_px.mean()) if material_px.size else None,
    )


def distance_to_line(points_px: FloatArray, line_px: FloatArray) -> FloatArray:
    """Return the distance of points from the nearest segment of a polyline.

    Parameters
    ----------
    points_px : (n, 2) float64
        Points.
    line_px : (k, 2) float64
        At least two nodes.

    Returns
    -------
    (n,) float64
    """
    start, along = line_px[:-1], np.diff(line_px, axis=0)
    length2 = np.maximum((along**2).sum(axis=1), 1e-12)
    away = points_px[:, None, :] - start
    share = np.clip((away * along).sum(axis=2) / length2, 0, 1)
    distance: FloatArray = np.linalg.norm(away - share[:, :, None] * along, axis=2).min(axis=1)
    return distance


def _below(mask: BoolArray, gripper_v_px: float | None) -> BoolArray:
    """Return a mask without the rows above the gripper's end point."""
    first = 0 if gripper_v_px is None or np.isnan(gripper_v_px) else max(int(np.ceil(gripper_v_px)), 0)
    below = mask.copy()
    below[:first] = False
    return below


def _iou(found: BoolArray, truth: BoolArray) -> float:
    """Return intersection over union."""
    either = (found | truth).sum()
    return float((found & truth).sum() / either) if either else float("nan")


def _midline(mask: BoolArray) -> FloatArray:
    """Return the central curve of a mask's largest region, (k, 2); cuts are a pixel apart."""
    region = largest_component(mask.view(np.uint8)).astype(bool)
    if not region.any():
        return np.empty((0, 2))
    curve = central_curve(borders(region), region_axes(region), 1.0)
    return np.column_stack([curve.u_px, curve.v_px])
