"""Curves over time as data of a page: short numbers, each time once, and what is missing with its reason."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from garment_dataset.errors import GarmentError, printable
from garment_dataset.view.curves import point_color, value_limits
from garment_dataset.view.over_time import SINCE_FIRST, SINCE_ONSET, Quantity, Results

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from garment_dataset.arrays import FloatArray
    from garment_dataset.view.curves import Curve
    from garment_dataset.view.over_time import Drawn

_AXES = {"z": "forward", "y": "down", "x": "right"}
_OFFERED = (
    *((f"kinematics.d{axis}_m", f"displacement {side}, d{axis}") for axis, side in _AXES.items()),
    *((f"kinematics.v{axis}_m_s", f"velocity {side}, v{axis}") for axis, side in _AXES.items()),
    *((f"kinematics.a{axis}_m_s2", f"acceleration {side}, a{axis}") for axis, side in _AXES.items()),
    *((f"kinematics.{axis}_m", f"position {side}, {axis}") for axis, side in _AXES.items()),
    ("points.garment_length_m", "length of the garment"),
    ("silhouettes.centroid_u_px", "silhouette: centroid, u"),
    ("silhouettes.centroid_v_px", "silhouette: centroid, v"),
    ("silhouettes.area_px2", "silhouette: area"),
    ("silhouettes.orientation_rad", "silhouette: orientation"),
    ("silhouettes.major_px", "silhouette: major axis"),
    ("silhouettes.minor_px", "silhouette: minor axis"),
    ("silhouettes.confidence", "silhouette: confidence"),
)
"""What a page offers, of what there is; the first is shown first."""

_SPARKS = {
    "kinematics.dz_m": "displacement of the last point along the optical axis",
    "silhouettes.centroid_u_px": "centroid of the silhouette, u",
}

READING_ERRORS = (GarmentError, OSError, ValueError)
"""What reading a table may raise: of ours, of the disk, of Arrow."""

_DIGITS = 5
_SPARK_SAMPLES = 60
_DARK_ENDS = (0.35, 1.0)


def curves_of(recording: str, folder: Path, made: Iterable[str]) -> tuple[dict[str, Any] | None, list[str]]:
    """Return the curves of a recording, and what could not be read.

    Parameters
    ----------
    recording : str
        Its name.
    folder : Path
        The features.
    made : iterable of str
        Stages of which there are results.

    Returns
    -------
    data : dict or None
        JSON-like: ``quantities`` with their ``traces``, ``times``, ``label`` of the time. None: there are none.
    faults : list of str
        One line for each table that cannot be read as it should be.
    """
    results = Results([recording], folder=folder)
    tables = _tables(made)
    quantities: list[dict[str, Any]] = []
    times: list[list[float | None]] = []
    faults: list[str] = []
    missing: list[str] = []
    since = set()
    for text, label in _OFFERED:
        if text.partition(".")[0] not in tables:
            continue
        try:
            drawn = results.read(Quantity.of(text), recording)
        except READING_ERRORS as error:
            faults.append(f"{text}: {said(error)}")
            continue
        if drawn is not None and drawn.curves:
            quantities.append(_quantity(text, label, drawn, times))
            since.add(drawn.is_since_onset)
        elif drawn is not None:
            missing.append(text)
    if missing:
        faults.append(f"every value is missing (the quality of the stages says why): {', '.join(missing)}")
    label = SINCE_ONSET if since == {True} else SINCE_FIRST
    return ({"quantities": quantities, "times": times, "time": label} if quantities else None), faults


def _tables(made: Iterable[str]) -> set[str]:
    by_stage = {"depth_points": "points", "silhouette": "silhouettes"}
    return {by_stage.get(stage, stage) for stage in made}


def _quantity(text: str, label: str, drawn: Drawn, times: list[list[float | None]]) -> dict[str, Any]:
    last = max((curve.point or 0 for curve in drawn.curves), default=0)
    limits = value_limits(drawn.curves)
    description = " ".join(drawn.quantity.split("\n")[:-1])
    return {
        "column": text,
        "label": label,
        "description": printable(description),
        "unit": {"1": "", "px2": "px²"}.get(drawn.unit, drawn.unit),
        "limits": None if limits is None else [_short(value) for value in limits],
        "traces": [_trace(curve, last, times) for curve in drawn.curves],
    }


def _trace(curve: Curve, last: int, times: list[list[float | None]]) -> dict[str, Any]:
    time = _numbers(curve.time_s)
    if time not in times:
        times.append(time)
    name = "value" if curve.point is None else "gripper" if curve.point == 0 else f"point {curve.point}"
    colors = [point_color(curve.point, last), point_color(curve.point, last, _DARK_ENDS)] if curve.point else None
    std = None if curve.std is None else _numbers(curve.std)
    return {"name": name, "colors": colors, "time": times.index(time), "value": _numbers(curve.value), "std": std}


def _numbers(values: FloatArray) -> list[float | None]:
    return [_short(value) if np.isfinite(value) else None for value in values.tolist()]


def _short(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


def summary(data: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the least and the greatest value of the curves that are shown first, with their times; for a table.

    Parameters
    ----------
    data : dict
        What :func:`curves_of` returned.
    """
    found = []
    for quantity in data["quantities"]:
        for trace in quantity["traces"]:
            times = data["times"][trace["time"]]
            known = [
                (value, time)
                for value, time in zip(trace["value"], times, strict=True)
                if value is not None and time is not None
            ]
            if known:
                least, most = min(known), max(known)
                named = {"label": quantity["label"], "unit": quantity["unit"], "name": trace["name"]}
                found.append({**named, "count": len(known), "least": least, "most": most})
    return found


def spark_values(recordings: Sequence[str], folder: Path) -> dict[str, tuple[str, str, list[float | None]]]:
    """Return what is drawn small beside each recording: of the last point, or of the silhouette.

    Parameters
    ----------
    recordings : sequence of str
        Names.
    folder : Path
        The features.

    Returns
    -------
    dict of str to (str, str, list)
        What it is, its unit, and at most 60 values; recordings of which there are none are left out.
    """
    found: dict[str, tuple[str, str, list[float | None]]] = {}
    for recording in recordings:
        results = Results([recording], folder=folder)
        for text, what in _SPARKS.items():
            try:
                drawn = results.read(Quantity.of(text), recording)
            except READING_ERRORS:
                continue  # the recording's page says why
            if drawn is not None and drawn.curves:
                values = _numbers(drawn.curves[-1].value)
                step = max(1, -(-len(values) // _SPARK_SAMPLES))
                found[recording] = what, drawn.unit, values[::step]
                break
    return found


def said(error: Exception) -> str:
    """Return what an error of reading says, without a path."""
    return error.what if isinstance(error, GarmentError) else f"cannot be read ({type(error).__name__})"
