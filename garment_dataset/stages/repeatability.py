"""How far the repeats of one movement are from each other, point by point: thesis figures 6.1 and 6.2 as numbers."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

from pydantic import Field

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.errors import DataWarning
from garment_dataset.stages.stage import REPEATS, Stage, StageParams

if TYPE_CHECKING:
    import pyarrow as pa

    from garment_dataset.arrays import FloatArray
    from garment_dataset.vision.repeats import Repeat, Summary

_KINDS = {"d": ("m", "displacement from rest"), "v": ("m/s", "velocity")}
_SIDES = {"x": "right", "y": "down", "z": "forward"}


def _over_time(kind: str, axis: str) -> tuple[Column, ...]:
    unit, what = _KINDS[kind]
    name, suffix = f"{kind}{axis}", unit.replace("/", "_")
    between, stated = f"{name}_between_{suffix}", f"{name}_stated_{suffix}"
    return (
        Column(f"{name}_mean_{suffix}", "float64", unit, f"mean over the repeats of {what}, {_SIDES[axis]}", True),
        Column(between, "float64", unit, f"standard deviation of {name} between the repeats", True),
        Column(
            stated,
            "float64",
            unit,
            f"most of that which the stated uncertainties of {name} and of the onset explain",
            True,
        ),
    )


def _summaries(kind: str) -> tuple[Column, ...]:
    unit, what = _KINDS[kind]
    name, suffix = {"d": "displacement", "v": "velocity"}[kind], unit.replace("/", "_")
    return (
        Column(
            f"{name}_rms_{suffix}",
            "float64",
            unit,
            f"standard deviation of {what} between repeats, rms over time",
            True,
        ),
        Column(f"{name}_rms_low_{suffix}", "float64", unit, "lower end of the 95 % interval of that", True),
        Column(f"{name}_rms_high_{suffix}", "float64", unit, "upper end of the 95 % interval of that", True),
        Column(f"{name}_max_{suffix}", "float64", unit, "the greatest standard deviation between repeats", True),
        Column(f"{name}_max_time_s", "float64", "s", "when that is, since the onset", True),
        Column(f"{name}_stated_rms_{suffix}", "float64", unit, "what the stated uncertainties make of it, rms", True),
        Column(f"{name}_degrees", "float64", "1", "degrees of freedom of the rms", True),
    )


REPEAT_CURVES = TableSpec(
    "repeat_curves",
    1,
    "one point of a movement at one time after the onset",
    (
        Column("point", "int32", "1", "number of the point; 0 is the gripper, 1 next to it"),
        Column("time_s", "float64", "s", "since the gripper began to move, in each repeat"),
        Column("repeats", "int32", "1", "recordings with a displacement then"),
        *(column for kind in _KINDS for axis in _SIDES for column in _over_time(kind, axis)),
    ),
    keys=("point", "time_s"),
)

REPEATABILITY = TableSpec(
    "repeatability",
    1,
    "one coordinate of one point of a movement",
    (
        Column("point", "int32", "1", "number of the point; 0 is the gripper, 1 next to it"),
        Column("coordinate", "string", "", "x: right, y: down, z: forward"),
        Column("repeats", "int32", "1", "recordings that were compared"),
        *(column for kind in _KINDS for column in _summaries(kind)),
        Column(
            "reason",
            "string",
            "",
            "why there is no comparison: one_repeat (with an onset), no_common_time; null when there is one",
            nullable=True,
        ),
    ),
    keys=("point", "coordinate"),
)


class RepeatabilityParams(StageParams):
    """When repeats are compared."""

    step_s: float = Field(default=1 / 30, gt=0, description="distance of the times at which repeats are compared")


def repeatability(kinematics: dict[str, pa.Table], params: RepeatabilityParams) -> dict[str, pa.Table]:
    """Compare repeats, relative to rest and aligned at the onset.

    Parameters
    ----------
    kinematics : dict of str to pyarrow.Table
        Of the recordings of one movement.
    params : RepeatabilityParams
        See there.

    Returns
    -------
    dict of str to pyarrow.Table
        ``repeat_curves``: a row for each point and each time at which two repeats were under way. ``repeatability``: a
        row for each coordinate of each point.

    Warns
    -----
    DataWarning
        Of recordings without an onset, which are left out.
    """
    import numpy as np
    import pyarrow as pa

    from garment_dataset.vision.repeats import common_times_s

    moving = {name: table for name, table in kinematics.items() if np.isfinite(_values(table, "time_s")).any()}
    if still := sorted(kinematics.keys() - moving.keys()):
        text = f"{len(still)} of {len(kinematics)} repeats have no onset, first {still[0]}"
        warnings.warn(f"{text}; they are left out", DataWarning, stacklevel=2)
    times_s = common_times_s([_values(table, "time_s") for table in moving.values()], params.step_s)
    points = sorted({int(point) for table in kinematics.values() for point in np.unique(_values(table, "point"))})
    curves: list[dict[str, Any]] = []
    rows: list[dict[str, Any]] = []
    for point in points:
        of_point = [table.filter(pa.array(_values(table, "point") == point)) for table in moving.values()]
        over_time: dict[str, Any] = {"point": np.full(len(times_s), point), "time_s": times_s}
        summaries = {axis: _compare(of_point, axis, times_s, over_time) for axis in _SIDES}
        if len(moving) > 1:
            curves.append(over_time)
        rows += [{"point": point, "coordinate": axis, "repeats": len(moving), **summaries[axis]} for axis in _SIDES]
    return {
        "repeat_curves": REPEAT_CURVES.table(
            {c.name: np.concatenate([each[c.name] for each in curves]) if curves else [] for c in REPEAT_CURVES.columns}
        ),
        "repeatability": REPEATABILITY.table({c.name: [r.get(c.name) for r in rows] for c in REPEATABILITY.columns}),
    }


def _compare(tables: list[pa.Table], axis: str, times_s: FloatArray, over_time: dict[str, Any]) -> dict[str, Any]:
    """Compare one coordinate; add what it is over time, and return its summary."""
    from garment_dataset.vision.repeats import spread_of, summarise

    if len(tables) < 2:
        return {"reason": "one_repeat"}
    found: dict[str, Any] = {}
    for kind, (unit, _) in _KINDS.items():
        suffix, name = unit.replace("/", "_"), f"{kind}{axis}"
        spread, values = spread_of([_repeat(table, kind, axis) for table in tables], times_s)
        over_time |= {
            **({"repeats": spread.repeats} if kind == "d" else {}),
            f"{name}_mean_{suffix}": spread.mean,
            f"{name}_between_{suffix}": spread.std,
            f"{name}_stated_{suffix}": spread.stated,
        }
        summary = summarise(spread, values, times_s)
        found |= {"reason": "no_common_time"} if summary is None else _summary(summary, kind, suffix)
    return found


def _summary(summary: Summary, kind: str, suffix: str) -> dict[str, float]:
    name = {"d": "displacement", "v": "velocity"}[kind]
    return {
        f"{name}_rms_{suffix}": summary.rms,
        f"{name}_rms_low_{suffix}": summary.rms_low,
        f"{name}_rms_high_{suffix}": summary.rms_high,
        f"{name}_max_{suffix}": summary.largest,
        f"{name}_max_time_s": summary.largest_time_s,
        f"{name}_stated_rms_{suffix}": summary.stated_rms,
        f"{name}_degrees": summary.degrees,
    }


def _repeat(table: pa.Table, kind: str, axis: str) -> Repeat:
    """Return a coordinate over time; that of the onset is uncertain, which moves it as fast as it changes."""
    import numpy as np

    from garment_dataset.vision.repeats import Repeat

    suffix = _KINDS[kind][0].replace("/", "_")
    time_s = _values(table, "time_s")
    if kind == "v":
        time_s = time_s + (_values(table, "velocity_stamp_ns") - _values(table, "stamp_ns")) * 1e-9
    slope = _values(table, {"d": f"v{axis}_m_s", "v": f"a{axis}_m_s2"}[kind])
    moved = np.nan_to_num(slope) * _values(table, "time_std_s")
    std = np.hypot(_values(table, f"{kind}{axis}_std_{suffix}"), moved)
    return Repeat(time_s, _values(table, f"{kind}{axis}_{suffix}"), std)


def _values(table: pa.Table, name: str) -> FloatArray:
    import numpy as np

    return np.asarray(table[name].to_numpy(), np.float64)


STAGE = Stage(repeatability, params=RepeatabilityParams, outputs=(REPEATABILITY, REPEAT_CURVES), per=REPEATS)
