from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from pydantic import ValidationError

from garment_dataset.stages.decode_tables import GRIPPER
from garment_dataset.stages.depth_tables import POINTS
from garment_dataset.stages.kinematics import KINEMATICS, KinematicsParams, kinematics

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

START_NS = 1391700000033711302
STD_M = {"x_std_m": 0.001, "y_std_m": 0.002, "z_std_m": 0.003}
POINT_COUNT = 3
REST = 8
"""Frame at which the motion begins, the last at rest."""


def stamps_ns(count: int) -> list[int]:
    periods_ns = np.random.default_rng(3).integers(30_000_000, 37_000_000, count)
    return [START_NS + int(sum(periods_ns[:i])) for i in range(count)]


def path_m(stamp_ns: int, start_ns: int, point: int) -> list[float]:
    """Return rest, then constant acceleration, less for lower points: (1, 0.5, 2) / (1 + point) m/s²."""
    moved = max(stamp_ns - start_ns, 0) / 1e9
    half = moved**2 / 2 / (1 + point)
    return [0.01 + half, -0.25 + 0.1 * point + 0.5 * half, 1.065 + 2 * half]


def tables(count: int = 30, *, rest: int = REST, missing: Mapping[int, str] | None = None) -> dict[str, pa.Table]:
    """Return points and gripper of a made recording; ``missing`` are frames without points, by their reason."""
    missing = missing or {}
    stamps = stamps_ns(count)
    start_ns = stamps[rest]
    points: list[dict[str, Any]] = []
    gripper: list[dict[str, Any]] = []
    for frame, stamp in enumerate(stamps):
        place = dict(zip(("x_m", "y_m", "z_m"), path_m(stamp, start_ns, 0), strict=True))
        gripper.append({"stream": "depth", "frame": frame, "stamp_ns": stamp, **place})
        for point in range(1, POINT_COUNT + 1):
            found = dict(zip(("x_m", "y_m", "z_m"), path_m(stamp, start_ns, point), strict=True)) | STD_M
            row = {"reason": missing[frame]} if frame in missing else found
            points.append({"frame": frame, "stamp_ns": stamp, "point": point, "pixels": 9, **row})
    color = [{**row, "stream": "color", "x_m": 9.0, "y_m": 9.0, "z_m": 9.0} for row in gripper]
    return {"points": build(POINTS, points), "gripper": build(GRIPPER, gripper + color)}


def build(spec: Any, rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    table: pa.Table = spec.table({column.name: [row.get(column.name) for row in rows] for column in spec.columns})
    return table


def run(made: Mapping[str, pa.Table], **knobs: Any) -> pd.DataFrame:
    """Return the rows; stamps with nulls among them as objects, since float64 cannot hold them.

    Parabolas through five frames: the made motion is one from its start on.
    """
    params = KinematicsParams(**{"polynomial_frames": 5, "polynomial_degree": 2, **knobs})
    table = kinematics(made["points"], made["gripper"], params)["kinematics"]
    assert table.column_names == [column.name for column in KINEMATICS.columns]
    return table.to_pandas(integer_object_nulls=True)


def test_onset_displacement_velocity_and_acceleration_of_a_made_swing() -> None:
    rows = run(tables())
    assert len(rows) == 30 * (POINT_COUNT + 1)
    assert rows["frame"].tolist() == [frame for frame in range(30) for _ in range(POINT_COUNT + 1)]
    assert rows["point"].tolist() == [0, 1, 2, 3] * 30
    stamps = stamps_ns(30)
    since_s = np.array([(stamps[frame] - stamps[REST]) / 1e9 for frame in rows["frame"]])
    late_s = since_s - rows["time_s"]
    assert late_s.std() < 1e-6
    assert abs(late_s.mean()) < 2 * rows["time_std_s"].iloc[0] < 0.033
    assert (rows["time_std_s"] == rows["time_std_s"].iloc[0]).all()
    assert rows["time_reason"].isna().all()
    for point in range(POINT_COUNT + 1):
        track = rows[rows["point"] == point]
        moved_s = np.maximum(np.array([stamp - stamps[REST] for stamp in stamps]) / 1e9, 0)
        for axis, share in (("x", 1), ("y", 0.5), ("z", 2)):
            acceleration = share / (1 + point)
            np.testing.assert_allclose(track[f"d{axis}_m"], acceleration * moved_s**2 / 2, atol=1e-12)
            inside = slice(REST + 2, None)  # fits with frames from before the motion see no parabola
            velocity = track[f"v{axis}_m_s"].to_numpy()
            np.testing.assert_allclose(velocity[inside], acceleration * moved_s[inside], atol=1e-9)
            np.testing.assert_allclose(velocity[: REST - 2], 0, atol=1e-12)
            np.testing.assert_allclose(track[f"a{axis}_m_s2"].iloc[inside], acceleration, atol=1e-6)
            np.testing.assert_allclose(track[f"a{axis}_m_s2"].iloc[: REST - 2], 0, atol=1e-9)
    assert (rows["velocity_stamp_ns"] == rows["stamp_ns"]).all()
    assert rows["reason"].isna().all()


def test_uncertainties_are_those_of_the_points_and_a_gripper_without_has_none() -> None:
    made = tables()
    names = [name for name in made["gripper"].column_names if not name.endswith("_std_m")]
    rows = run({**made, "gripper": made["gripper"].select(names)})
    stds = [column.uncertainty for column in KINEMATICS.columns if column.uncertainty not in {"", "time_std_s", None}]
    assert len(stds) == 12
    assert rows.loc[rows["point"] == 0, stds].isna().all(axis=None)
    of_points = rows[rows["point"] > 0]
    assert (of_points[stds] > 0).all(axis=None)
    assert (of_points[list(STD_M)] == list(STD_M.values())).all(axis=None)
    rest_frames = REST + (1 if of_points["time_s"].iloc[REST * POINT_COUNT] < 0 else 0)
    np.testing.assert_allclose(of_points["dz_std_m"], 0.003 * np.sqrt(1 + 1.2533**2 / rest_frames))
    np.testing.assert_allclose(of_points["vz_std_m_s"], 3 * of_points["vx_std_m_s"])
    np.testing.assert_allclose(of_points["az_std_m_s2"], 3 * of_points["ax_std_m_s2"])


def test_the_uncertainty_of_the_gripper_is_that_of_its_table_where_that_says_it() -> None:
    made = tables()
    gripper = made["gripper"]
    for name in STD_M:
        value = pa.array([0.0005] * gripper.num_rows)
        index = gripper.schema.get_field_index(name)
        gripper = gripper.append_column(name, value) if index < 0 else gripper.set_column(index, name, value)
    rows = run({**made, "gripper": gripper})
    of_gripper = rows[rows["point"] == 0]
    assert (of_gripper[list(STD_M)] == 0.0005).all(axis=None)
    assert (of_gripper[["dx_std_m", "vx_std_m_s", "ax_std_m_s2"]] > 0).all(axis=None)


def test_pixels_and_bridges_come_with_the_points() -> None:
    made = tables()
    points = made["points"]
    index = points.schema.get_field_index("bridged_m")
    if index >= 0:
        points = points.remove_column(index)
    assert run({**made, "points": points})["bridged_m"].isna().all()
    bridged = pa.array([0.01 * (row % 2) for row in range(points.num_rows)])
    rows = run({**made, "points": points.append_column("bridged_m", bridged)})
    of_points = rows[rows["point"] > 0]
    assert of_points["bridged_m"].tolist() == bridged.to_pylist()
    assert of_points["pixels"].tolist() == [9] * len(of_points)
    assert rows.loc[rows["point"] == 0, ["pixels", "bridged_m"]].isna().all(axis=None)


def test_thesis_velocities_are_differences_at_mid_times() -> None:
    rows = run(tables(), velocity_method="thesis")
    stamps = np.array(stamps_ns(30))
    z_m = rows.loc[rows["point"] == 2, "z_m"].to_numpy()
    track = rows[rows["point"] == 2]
    np.testing.assert_allclose(track["vz_m_s"].iloc[:-1], np.diff(z_m) / (np.diff(stamps) / 1e9), atol=1e-12)
    middles = stamps[:-1] + np.diff(stamps) // 2
    assert track["velocity_stamp_ns"].tolist() == [*middles.tolist(), None]
    assert track.iloc[-1][["velocity_stamp_ns", "vx_m_s", "vz_std_m_s"]].isna().all()
    assert rows["ax_m_s2"].isna().all()


@pytest.mark.parametrize(
    ("count", "rest", "reason"),
    [(30, 29, "no_motion"), (30, 0, "no_rest"), (30, 2, "no_rest"), (4, 2, "no_gripper"), (1, 0, "no_gripper")],
)
def test_without_motion_or_rest_there_is_no_time_and_no_displacement(count: int, rest: int, reason: str) -> None:
    rows = run(tables(count, rest=rest))
    assert (rows["time_reason"] == reason).all()
    assert (
        rows[["time_s", "time_std_s", "dx_m", "dy_m", "dz_m", "dx_std_m", "dy_std_m", "dz_std_m"]].isna().all(axis=None)
    )
    assert rows[["x_m", "y_m", "z_m"]].notna().all(axis=None)
    assert rows[["vx_m_s", "vy_m_s", "vz_m_s"]].notna().all(axis=None) == (count > 2)


def test_missing_points_stay_missing_and_are_passed_over() -> None:
    missing = {2: "gap", 14: "no_pixels", 15: "no_pixels", 16: "no_pixels"}
    rows, whole = run(tables(missing=missing)), run(tables())
    gone = rows["frame"].isin(missing) & (rows["point"] > 0)
    assert rows.loc[gone, "reason"].tolist() == [reason for reason in missing.values() for _ in range(POINT_COUNT)]
    assert rows.loc[~gone, "reason"].isna().all()
    known = ["frame", "stamp_ns", "point", "time_s", "time_std_s", "pixels", "reason", "source"]
    assert rows[gone].drop(columns=known).isna().all(axis=None)
    assert rows["time_s"].equals(whole["time_s"])
    assert rows.loc[gone, "time_s"].notna().all()
    kept = [f"d{axis}_m" for axis in "xyz"]
    np.testing.assert_allclose(rows.loc[~gone, kept], whole.loc[~gone, kept], atol=1e-12)
    # Around 13 and 17 two of five frames are left on one side: parabolas through three are exact still.
    late = ~gone & rows["frame"].isin([12, 13, 17, 18])
    np.testing.assert_allclose(rows.loc[late, "vz_m_s"], whole.loc[late, "vz_m_s"], atol=1e-9)


def test_an_unknown_gripper_is_told_apart() -> None:
    made = tables()
    gripper = made["gripper"].to_pylist()
    for row in gripper[3:5]:
        row |= {"x_m": None, "y_m": None, "z_m": None, "reason": "topic: gap"}
    del gripper[6]
    rows = run({"points": made["points"], "gripper": build(GRIPPER, gripper)})
    of_gripper = rows[rows["point"] == 0].set_index("frame")
    assert of_gripper.loc[[3, 4, 6], "reason"].tolist() == ["topic: gap", "topic: gap", "no_gripper"]
    assert of_gripper.loc[[3, 4, 6], ["x_m", "dx_m", "vx_m_s"]].isna().all(axis=None)
    points = rows["point"] > 0
    whole = run(made)
    assert (rows["time_s"] - whole["time_s"]).abs().max() < rows["time_std_s"].iloc[0]
    others = ["reason", "velocity_stamp_ns", "time_s", "time_std_s"]  # nulls in one of the two; one error for all
    assert rows[points].drop(columns=others).equals(whole[points].drop(columns=others))


def test_the_order_of_rows_does_not_matter() -> None:
    made = tables(missing={4: "gap"})
    order = np.random.default_rng(1)
    shuffled = {name: table.take(order.permutation(table.num_rows)) for name, table in made.items()}
    assert run(shuffled).equals(run(made))


@pytest.mark.parametrize("shift", [0, -1, -1_000_000_000, 10_000_000_000])
@pytest.mark.parametrize("method", ["local_polynomial", "thesis"])
def test_a_stamp_that_does_not_fit_in_changes_no_other_row(shift: int, method: str) -> None:
    """Frame 15 is given the stamp of frame 14, an earlier one, or one far ahead; or it is not there at all."""
    whole, wrong_frame = tables(), 15
    wrong_ns = stamps_ns(30)[14] + shift
    specs = {"points": POINTS, "gripper": GRIPPER}
    rows = {name: whole[name].to_pylist() for name in specs}
    wrong = {
        name: build(spec, [row | ({"stamp_ns": wrong_ns} if row["frame"] == wrong_frame else {}) for row in rows[name]])
        for name, spec in specs.items()
    }
    without = {
        name: build(spec, [row for row in rows[name] if row["frame"] != wrong_frame]) for name, spec in specs.items()
    }
    found = run(wrong, velocity_method=method)
    at_fault = found["frame"] == wrong_frame
    expected = run(without, velocity_method=method)
    pd.testing.assert_frame_equal(found[~at_fault].reset_index(drop=True), expected, check_dtype=False)
    assert (found.loc[at_fault, "time_reason"] == "stamp").all()
    assert found.loc[at_fault, ["time_s", "dx_m", "velocity_stamp_ns", "vx_m_s", "ax_m_s2"]].isna().all(axis=None)
    assert found.loc[at_fault, ["x_m", "y_m", "z_m"]].notna().all(axis=None)


def test_no_frames_no_rows() -> None:
    assert len(run({"points": build(POINTS, []), "gripper": build(GRIPPER, [])})) == 0


@pytest.mark.parametrize("knobs", [{"polynomial_frames": 4}, {"polynomial_frames": 3, "polynomial_degree": 3}])
def test_a_fit_that_is_not_determined_is_refused(knobs: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="polynomial_frames must be odd and larger than polynomial_degree"):
        KinematicsParams(**knobs)
