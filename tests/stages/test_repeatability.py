"""Repeats of one movement are compared relative to rest and aligned at the onset; nothing is told of a single one."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest

from garment_dataset.errors import DataWarning
from garment_dataset.stages.kinematics import KINEMATICS
from garment_dataset.stages.repeatability import RepeatabilityParams, repeatability

PARAMS = RepeatabilityParams()
FRAMES = 90


def moved(*, late_s: float = 0.0, level_m: float = 0.0, scale: float = 1.0, has_onset: bool = True) -> pa.Table:
    """Gripper and a point that swing after their onset; the frames fall ``late_s`` later between those of others."""
    time_s = np.arange(FRAMES) / 30 - 0.5 + late_s
    rows = {column.name: [None] * (2 * FRAMES) for column in KINEMATICS.columns}
    values = {
        "frame": np.repeat(np.arange(FRAMES), 2),
        "stamp_ns": np.repeat(np.rint(time_s * 1e9).astype(int) + 10**18, 2),
        "point": np.tile([0, 1], FRAMES),
        "time_s": np.repeat(time_s if has_onset else np.full(FRAMES, np.nan), 2),
        "time_std_s": np.full(2 * FRAMES, 0.0),
        "source": ["points"] * (2 * FRAMES),
    }
    values["velocity_stamp_ns"] = values["stamp_ns"]
    swing_m = scale * np.where(time_s > 0, 1 - np.cos(2 * time_s), 0)
    for name in ("x", "y", "z"):
        values[f"d{name}_m"] = np.stack([swing_m, swing_m + level_m], axis=1).ravel()
        values[f"d{name}_std_m"] = np.tile([0.001, 0.003], FRAMES)
        values[f"v{name}_m_s"] = np.repeat(scale * np.where(time_s > 0, 2 * np.sin(2 * time_s), 0), 2)
        values[f"v{name}_std_m_s"] = np.full(2 * FRAMES, 0.01)
        values[f"a{name}_m_s2"] = np.zeros(2 * FRAMES)
    return KINEMATICS.table({**rows, **values})


def summary(tables: dict[str, pa.Table], point: int = 1) -> dict[str, object]:
    rows = repeatability(tables, PARAMS)["repeatability"].to_pylist()
    (found,) = [row for row in rows if row["point"] == point and row["coordinate"] == "z"]
    return found


def test_the_same_movement_seen_between_other_frames_is_the_same() -> None:
    found = summary({"a": moved(), "b": moved(late_s=0.013), "c": moved(late_s=0.021)})
    assert found["repeats"] == 3
    assert found["displacement_rms_m"] < 1e-3  # type: ignore[operator]
    assert found["reason"] is None


def test_levels_apart_are_found_with_an_interval_around() -> None:
    found = summary({"a": moved(), "b": moved(level_m=0.01), "c": moved(level_m=0.02)})
    assert found["displacement_rms_m"] == pytest.approx(0.01)
    assert found["displacement_rms_low_m"] < 0.01 < found["displacement_rms_high_m"]  # type: ignore[operator]
    assert found["displacement_stated_rms_m"] == pytest.approx(0.003)
    assert found["velocity_rms_m_s"] == pytest.approx(0, abs=1e-12)


def test_the_greatest_spread_is_where_movements_differ_most() -> None:
    found = summary({"a": moved(), "b": moved(scale=1.1)}, point=0)
    assert found["displacement_max_time_s"] == pytest.approx(np.pi / 2, abs=1 / 30)
    assert found["displacement_max_m"] == pytest.approx(0.2 / np.sqrt(2), rel=0.01)


def test_an_uncertain_onset_explains_what_moves_fast() -> None:
    table = moved()
    late = table.set_column(
        table.schema.get_field_index("time_std_s"),
        table.schema.field("time_std_s"),
        pa.array(np.full(2 * FRAMES, 0.01)),
    )
    curves = repeatability({"a": late, "b": late}, PARAMS)["repeat_curves"].to_pandas().query("point == 0")
    rest, fast = (curves.iloc[(curves["time_s"] - at).abs().argmin()] for at in (-0.3, np.pi / 4))
    assert rest["dz_stated_m"] == pytest.approx(0.001)
    assert fast["dz_stated_m"] == pytest.approx(np.hypot(0.001, 2 * 0.01), rel=0.01)


def test_a_single_repeat_is_a_reason_and_no_number() -> None:
    made = repeatability({"a": moved()}, PARAMS)
    assert made["repeat_curves"].num_rows == 0
    assert {row["reason"] for row in made["repeatability"].to_pylist()} == {"one_repeat"}
    assert made["repeatability"]["displacement_rms_m"].null_count == 6


def test_a_repeat_without_onset_is_left_out_and_named() -> None:
    with pytest.warns(DataWarning, match="1 of 3 repeats have no onset, first b"):
        found = summary({"a": moved(), "b": moved(has_onset=False), "c": moved(level_m=0.01)})
    assert found["repeats"] == 2


def test_repeats_that_were_never_under_way_together_are_a_reason() -> None:
    assert summary({"a": moved(), "b": moved(late_s=60.0)})["reason"] == "no_common_time"


def test_the_order_of_the_recordings_is_of_no_account() -> None:
    tables = {"a": moved(), "b": moved(level_m=0.01), "c": moved(scale=1.05)}
    backwards = dict(reversed(tables.items()))
    made, again = (repeatability(each, PARAMS) for each in (tables, backwards))
    for name, table in made.items():
        for column in table.column_names:
            ours, other = (each[name][column].to_pylist() for each in (made, again))
            assert ours == other or np.allclose(np.array(ours, float), np.array(other, float), atol=1e-15)
