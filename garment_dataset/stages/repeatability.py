"""How far the repeats of one movement are from each other, point by point: thesis figures 6.1 and 6.2 as numbers."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, NamedTuple

from pydantic import Field

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.errors import DataWarning
from garment_dataset.stages.stage import REPEATS, Stage, StageParams

if TYPE_CHECKING:
    import pyarrow as pa

    from garment_dataset.arrays import FloatArray
    from garment_dataset.vision.repeats import Repeat, Spread, Summary

_SIDES = {"x": "right", "y": "down", "z": "forward"}


class _Kind(NamedTuple):
    """A kind of quantity in ``kinematics``: its letter there, its name here, and the letter of its derivative."""

    letter: str
    name: str
    unit: str
    suffix: str
    what: str
    derivative: str


_KINDS = (
    _Kind("d", "displacement", "m", "m", "displacement from rest", "v{}_m_s"),
    _Kind("v", "velocity", "m/s", "m_s", "velocity", "a{}_m_s2"),
)


def _over_time(kind: _Kind, axis: str) -> dict[str, Column]:
    """Return the column for each attribute of a spread."""
    name = f"{kind.letter}{axis}"
    mean = f"mean over the repeats of {kind.what}, {_SIDES[axis]}"
    between = f"standard deviation of {name} between the repeats"
    stated = f"most of that which the stated uncertainties of {name} and of the onset explain"
    return {
        "mean": Column(f"{name}_mean_{kind.suffix}", "float64", kind.unit, mean, True),
        "std": Column(f"{name}_between_{kind.suffix}", "float64", kind.unit, between, True),
        "stated": Column(f"{name}_stated_{kind.suffix}", "float64", kind.unit, stated, True),
    }


def _summaries(kind: _Kind) -> dict[str, Column]:
    """Return the column for each attribute of a summary."""
    _, name, unit, suffix, what, _ = kind
    rms = f"standard deviation of {what} between repeats, rms over time"
    low, high = (f"{end} end of the 95 % interval of that" for end in ("lower", "upper"))
    largest, stated = "the greatest standard deviation between repeats", "what the stated uncertainties make of it, rms"
    return {
        "rms": Column(f"{name}_rms_{suffix}", "float64", unit, rms, True),
        "rms_low": Column(f"{name}_rms_low_{suffix}", "float64", unit, low, True),
        "rms_high": Column(f"{name}_rms_high_{suffix}", "float64", unit, high, True),
        "largest": Column(f"{name}_max_{suffix}", "float64", unit, largest, True),
        "largest_time_s": Column(f"{name}_max_time_s", "float64", "s", "when that is, since the onset", True),
        "stated_rms": Column(f"{name}_stated_rms_{suffix}", "float64", unit, stated, True),
        "degrees": Column(f"{name}_degrees", "float64", "1", "degrees of freedom of the rms", True),
    }


REPEAT_CURVES = TableSpec(
    "repeat_curves",
    1,
    "one point of a movement at one time after the onset",
    (
        Column("point", "int32", "1", "number of the point; 0 is the gripper, 1 next to it"),
        Column("time_s", "float64", "s", "since the gripper began to move, in each repeat"),
        Column("repeats", "int32", "1", "recordings with a displacement then"),
        *(column for kind in _KINDS for axis in _SIDES for column in _over_time(kind, axis).values()),
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
        *(column for kind in _KINDS for column in _summaries(kind).values()),
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
    for kind in _KINDS:
        spread, values = spread_of([_repeat(table, kind, axis) for table in tables], times_s)
        over_time |= _named(spread, _over_time(kind, axis))
        if kind.letter == "d":
            over_time["repeats"] = spread.repeats
        summary = summarise(spread, values, times_s)
        found |= {"reason": "no_common_time"} if summary is None else _named(summary, _summaries(kind))
    return found


def _named(found: Spread | Summary, columns: dict[str, Column]) -> dict[str, Any]:
    """Return what was found by the names of its columns."""
    return {column.name: getattr(found, attribute) for attribute, column in columns.items()}


def _repeat(table: pa.Table, kind: _Kind, axis: str) -> Repeat:
    """Return a coordinate over time; that of the onset is uncertain, which moves it as fast as it changes."""
    import numpy as np

    from garment_dataset.vision.repeats import Repeat

    time_s = _values(table, "time_s")
    if kind.letter == "v":
        time_s = time_s + (_values(table, "velocity_stamp_ns") - _values(table, "stamp_ns")) * 1e-9
    moved = np.nan_to_num(_values(table, kind.derivative.format(axis))) * _values(table, "time_std_s")
    std = np.hypot(_values(table, f"{kind.letter}{axis}_std_{kind.suffix}"), moved)
    return Repeat(time_s, _values(table, f"{kind.letter}{axis}_{kind.suffix}"), std)


def _values(table: pa.Table, name: str) -> FloatArray:
    import numpy as np

    return np.asarray(table[name].to_numpy(), np.float64)


STAGE = Stage(repeatability, params=RepeatabilityParams, outputs=(REPEATABILITY, REPEAT_CURVES), per=REPEATS)
