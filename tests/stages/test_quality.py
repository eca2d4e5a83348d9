"""What the table ``quality`` says of made tables: counts that are known, and a word for everything that is wrong."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pytest

from garment_dataset.errors import DataWarning
from garment_dataset.stages.quality import QualityParams, quality

if TYPE_CHECKING:
    from collections.abc import Sequence

PERIOD_NS = 33_000_000


def frames(depth: Sequence[int | None], color: Sequence[int | None] = (), axis: str = "R") -> pa.Table:
    """Return images by their stamps in periods; None for a faulty one."""
    rows = [
        {
            "axis": axis,
            "stream": stream,
            "stamp_ns": None if at is None else at * PERIOD_NS,
            "fault": None if at is not None else f"data: expected 100 bytes, found {index}",
        }
        for stream, stamps in (("depth", depth), ("color", color))
        for index, at in enumerate(stamps)
    ]
    texts: list[pa.Field[Any]] = [pa.field(name, pa.string()) for name in ("axis", "stream", "fault")]
    return pa.Table.from_pylist(rows, pa.schema([*texts, pa.field("stamp_ns", pa.int64())]))


def points(z_m: Sequence[float | None], bridged_m: Sequence[float | None] | None = None) -> pa.Table:
    columns: dict[str, Any] = {
        "frame": pa.array(range(len(z_m)), pa.int32()),
        "z_m": pa.array(z_m, pa.float64()),
        "reason": [None if value is not None else "gap" for value in z_m],
    }
    if bridged_m is not None:
        columns["bridged_m"] = pa.array(bridged_m, pa.float64())
    return pa.table(columns)


def judged(images: pa.Table, **tables: Any) -> tuple[dict[tuple[str, str], dict[str, Any]], list[str]]:
    """Return the rows by stage and stream, and what was warned of."""
    notes = tables.pop("notes", {})
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        table = quality(images, notes, QualityParams(), **tables)["quality"]
    assert all(issubclass(one.category, DataWarning) for one in caught)
    return {(row["stage"], row["stream"]): row for row in table.to_pylist()}, [str(one.message) for one in caught]


def test_a_sound_recording_is_ok_and_says_nothing() -> None:
    rows, said = judged(frames(range(60), range(60)), points=points([1.0] * 300))
    assert {row["verdict"] for row in rows.values()} == {"ok"}
    assert said == []
    depth = rows["decode", "depth"]
    assert (depth["seen"], depth["used"], depth["gaps"], depth["faults"]) == (60, 60, 0, [])
    assert depth["period_s"] == pytest.approx(0.033)


def test_the_stream_that_the_movement_is_seen_in_must_be_there() -> None:
    rows, said = judged(frames([], range(60)))
    assert rows["decode", "depth"]["verdict"] == "unusable"
    assert said == ["unusable: decode (depth): no depth images at all"]
    rows, said = judged(frames(range(60), [], axis="R"))
    assert rows["decode", "color"]["verdict"] == "ok"
    rows, said = judged(frames(range(60), [None, None], axis="B"))
    assert said == ["unusable: decode (color): no usable color image"]


def test_faults_are_counted_by_what_is_wrong() -> None:
    rows, said = judged(frames([*range(10), None, None]))
    assert rows["decode", "depth"]["faults"] == ["data: 2"]
    assert said == ["look: decode (depth): 2 of 12 images cannot be used"]


def test_gaps_are_counted_in_periods() -> None:
    rows, said = judged(frames([*range(10), *range(20, 30), *range(32, 40)]))
    depth = rows["decode", "depth"]
    assert (depth["gaps"], depth["longest_gap_s"]) == (1, pytest.approx(11 * 0.033))
    assert said == ["look: decode (depth): 1 gaps between images, the longest 0.36 s"]


def test_coverage_and_bridges_are_shares_of_the_points() -> None:
    rows, said = judged(frames(range(10)), points=points([1.0] * 6 + [None] * 4, [0.0] * 3 + [0.1] * 3 + [None] * 4))
    row = rows["depth_points", "depth"]
    assert (row["coverage"], row["bridged"], row["faults"]) == (0.6, 0.5, ["gap: 4"])
    assert said == ["look: depth_points (depth): 6 of 10 values found; 50% of them without pixels"]
    rows, _ = judged(frames(range(10)), points=points([None] * 10))
    assert rows["depth_points", "depth"]["verdict"] == "unusable"


def kinematics(time_s: float | None, scatter_m: float) -> pa.Table:
    count = 40
    rng = np.random.default_rng(3)
    return pa.table(
        {
            "frame": pa.array(np.repeat(np.arange(count), 2), pa.int32()),
            "point": pa.array(np.tile([0, 1], count), pa.int32()),
            "time_s": pa.array([time_s] * (2 * count), pa.float64()),
            "z_m": pa.array(1 + scatter_m * rng.standard_normal(2 * count)),
            "vz_m_s": pa.array(np.zeros(2 * count)),
            "reason": pa.array([None] * (2 * count), pa.string()),
        }
    )


def test_motion_needs_an_onset_and_a_quiet_rest() -> None:
    rows, said = judged(frames(range(40)), kinematics=kinematics(-1.0, 1e-4))
    assert rows["kinematics", "depth"]["noise_m"] == pytest.approx(1e-4, rel=0.3)
    assert said == []
    _, said = judged(frames(range(40)), kinematics=kinematics(-1.0, 2e-2))
    assert "z scatters by" in said[0]
    _, said = judged(frames(range(40)), kinematics=kinematics(None, 1e-4))
    assert said == ["look: kinematics (depth): no onset of motion: the gripper never moves, or its rest was not seen"]


def test_notes_are_kept_in_full_beside_the_stage_that_said_them() -> None:
    notes = {"decode": ("one thing", "another"), "depth_points": ()}
    rows, _ = judged(frames(range(10)), points=points([1.0] * 10), notes=notes)
    assert rows["decode", "depth"]["notes"] == ["one thing", "another"]
    assert rows["depth_points", "depth"]["notes"] == []
