"""Say how good a recording is, stage by stage: what was seen, used and found, and what the stages said of it."""

from __future__ import annotations

import warnings
from collections import Counter
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.errors import DataWarning
from garment_dataset.stages.stage import Stage, StageParams

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    import pyarrow as pa

    Row = dict[str, Any]

Verdict = Literal["ok", "look", "unusable"]
"""``look``: something is out of the ordinary, and ``why`` says what; ``unusable``: nothing can be taken from it."""

QUALITY = TableSpec(
    "quality",
    1,
    "one stage of one stream",
    (
        Column("stage", "string", "", "name of the stage"),
        Column("stream", "string", "", "depth or color"),
        Column("verdict", "string", "", "ok, look or unusable"),
        Column("why", "list<string>", "", "what speaks against ok, in words"),
        Column("seen", "int32", "1", "images, or rows that there could be"),
        Column("used", "int32", "1", "images without a fault, or frames with at least one value"),
        Column("coverage", "float64", "1", "share of the possible values that were found", nullable=True),
        Column("bridged", "float64", "1", "share of the found values that no pixel carries", nullable=True),
        Column("faults", "list<string>", "", "reasons why images or values are missing, with their number"),
        Column("period_s", "float64", "s", "median time between used images", nullable=True),
        Column("longest_gap_s", "float64", "s", "longest time between used images", nullable=True),
        Column("gaps", "int32", "1", "times longer than the parameter gap_periods allows", nullable=True),
        Column("noise_m", "float64", "m", "standard deviation of z at rest, median over the points", nullable=True),
        Column("notes", "list<string>", "", "what the stage said of data left out, in full"),
    ),
    keys=("stage", "stream"),
)


class QualityParams(StageParams):
    """When a recording deserves a look."""

    least_coverage: float = Field(default=0.9, ge=0, le=1, description="less of the possible values found: look")
    most_bridged: float = Field(default=0.2, ge=0, le=1, description="more of the found values without pixels: look")
    most_faults: float = Field(default=0.05, ge=0, le=1, description="a larger share of images not used: look")
    gap_periods: float = Field(default=5.5, gt=1, description="a longer time between images, in periods, is a gap")
    noise_m: float = Field(default=0.005, gt=0, description="more scatter of z at rest: look")


def quality(
    frames: pa.Table,
    notes: Mapping[str, Sequence[str]],
    params: QualityParams,
    points: pa.Table | None = None,
    kinematics: pa.Table | None = None,
    silhouettes: pa.Table | None = None,
    central_curves: pa.Table | None = None,
) -> dict[str, pa.Table]:
    """Count what every stage saw and found, and judge it.

    Parameters
    ----------
    frames : pyarrow.Table
        As ``decode`` made it.
    notes : mapping of str to sequence of str
        What the stages said, by stage.
    params : QualityParams
        See there.
    points, kinematics, silhouettes, central_curves : pyarrow.Table, optional
        Of the stages that the pipeline has.

    Returns
    -------
    dict of str to pyarrow.Table
        ``quality``.

    Warns
    -----
    DataWarning
        One for each stage that is not ok: so that whoever looks at results, without opening a table, is told.
    """
    axes = {row["axis"] for row in frames.select(["axis"]).to_pylist()}
    rows = list(_streams(frames, axes, params))
    if points is not None:
        rows.append(_values("depth_points", "depth", points, "z_m", "reason", params))
    if kinematics is not None:
        rows.append(_motion(kinematics, params))
    if silhouettes is not None:
        rows.append(_values("silhouette", "color", silhouettes, "area_px2", "reason", params))
        if central_curves is not None:
            rows.append(_curves(silhouettes, central_curves, params))
    for row in rows:
        row["notes"] = list(notes.get(row["stage"], ()))
        row["verdict"] = _verdict(row)
        if row["verdict"] != "ok":
            text = f"{row['verdict']}: {row['stage']} ({row['stream']}): {'; '.join(row['why'])}"
            warnings.warn(text, DataWarning, stacklevel=2)
    names = [column.name for column in QUALITY.columns]
    return {"quality": QUALITY.table({name: [row.get(name) for row in rows] for name in names})}


def _streams(frames: pa.Table, axes: set[str | None], params: QualityParams) -> Iterator[Row]:
    """Describe the images of both streams; the one that the movement is seen in must be there."""
    import numpy as np

    rows = frames.select(["stream", "stamp_ns", "fault"]).to_pylist()
    for stream, axis in (("depth", "R"), ("color", "B")):
        own = [row for row in rows if row["stream"] == stream]
        faults = [row["fault"] for row in own if row["fault"] is not None]
        stamps_ns = np.sort([row["stamp_ns"] for row in own if row["fault"] is None])
        steps_s = np.diff(stamps_ns) / 1e9
        period_s = float(np.median(steps_s)) if steps_s.size else None
        gaps = int((steps_s > params.gap_periods * period_s).sum()) if period_s else 0
        longest_s = float(steps_s.max()) if steps_s.size else None
        why = []
        if not stamps_ns.size and axis in axes:
            why.append(f"no usable {stream} image" if own else f"no {stream} images at all")
        elif len(faults) > params.most_faults * max(len(own), 1):
            why.append(f"{len(faults)} of {len(own)} images cannot be used")
        if gaps:
            why.append(f"{gaps} gaps between images, the longest {longest_s:.2f} s")
        yield {
            "stage": "decode",
            "stream": stream,
            "why": why,
            "seen": len(own),
            "used": int(stamps_ns.size),
            "coverage": stamps_ns.size / len(own) if own else None,
            "faults": _counted(faults),
            "period_s": period_s,
            "longest_gap_s": longest_s,
            "gaps": gaps if period_s else None,
            "needed": axis in axes,
        }


def _values(stage: str, stream: str, table: pa.Table, value: str, reason: str, params: QualityParams) -> Row:
    """Describe a table with a row for every possible value, null with a reason where there is none."""
    import numpy as np

    found = ~np.isnan(table[value].to_numpy().astype(np.float64)) if len(table) else np.zeros(0, np.bool_)
    frame = table["frame"].to_numpy()
    coverage = float(found.mean()) if found.size else 0.0
    bridged = None
    if "bridged_m" in table.column_names and found.any():
        bridged = float((table["bridged_m"].to_numpy()[found] > 0).mean())
    why = []
    if coverage < params.least_coverage:
        why.append(f"{int(found.sum())} of {found.size} values found")
    if bridged is not None and bridged > params.most_bridged:
        why.append(f"{bridged:.0%} of them without pixels")
    return {
        "stage": stage,
        "stream": stream,
        "why": why,
        "seen": found.size,
        "used": int(np.unique(frame[found]).size),
        "coverage": coverage,
        "bridged": bridged,
        "faults": _counted(text for text in table[reason].to_pylist() if text is not None),
        "needed": True,
    }


def _motion(kinematics: pa.Table, params: QualityParams) -> Row:
    """Describe the motion: without an onset there is no time to count from."""
    import numpy as np

    row = _values("kinematics", "depth", kinematics, "vz_m_s", "reason", params)
    row["needed"] = False  # what is missing here is missing in the points already
    time_s = kinematics["time_s"].to_numpy()
    if len(kinematics) and np.isnan(time_s).all():
        row["why"].append("no onset of motion: the gripper never moves, or its rest was not seen")
    point, z_m = kinematics["point"].to_numpy(), kinematics["z_m"].to_numpy()
    at_rest = (time_s < 0) & np.isfinite(z_m)
    spread = [
        float(np.std(z_m[at_rest & (point == number)], ddof=1))
        for number in np.unique(point[point > 0])
        if (at_rest & (point == number)).sum() > 2
    ]
    row["noise_m"] = float(np.median(spread)) if spread else None
    if spread and row["noise_m"] > params.noise_m:
        row["why"].append(f"z scatters by {1000 * row['noise_m']:.1f} mm at rest")
    return row


def _curves(silhouettes: pa.Table, central_curves: pa.Table, params: QualityParams) -> Row:
    """Describe the central curves: every mask should have one."""
    masks = set(silhouettes.filter(silhouettes["mask"].is_valid())["frame"].to_pylist())
    found = set(central_curves["frame"].to_pylist())
    coverage = len(found) / len(masks) if masks else None
    is_thin = coverage is not None and coverage < params.least_coverage
    return {
        "stage": "central_curve",
        "stream": "color",
        "why": [f"{len(found)} of {len(masks)} masks have a curve"] if is_thin else [],
        "seen": len(masks),
        "used": len(found),
        "coverage": coverage,
        "faults": [],
        "needed": False,
    }


def _verdict(row: Row) -> Verdict:
    if not row["used"] and row["needed"]:
        return "unusable"
    return "look" if row["why"] else "ok"


def _counted(reasons: Iterable[str]) -> list[str]:
    """Count reasons; of a fault only what is wrong, without the numbers of the one message."""
    counts = Counter(reason.partition(": expected")[0] for reason in reasons)
    return [f"{reason}: {count}" for reason, count in counts.most_common()]


STAGE = Stage(quality, params=QualityParams, outputs=(QUALITY,), reads_identity=True)
