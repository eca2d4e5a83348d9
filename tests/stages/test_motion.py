"""The stage ``motion``: what it says of a made recording, and of recordings that lack something."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from garment_dataset.stages.decode_tables import GRIPPER
from garment_dataset.stages.depth_tables import POINTS
from garment_dataset.stages.kinematics import KinematicsParams, kinematics
from garment_dataset.stages.motion import MotionParams, motion
from garment_dataset.vision.correlation import effective_frames, lag1_autocorrelation

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pyarrow as pa

START_NS = 1391700000033711302
PERIOD_NS = 33_000_000
COUNT, REST, LENGTH_M = 4, 20, 0.6


def build(spec: Any, rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    table: pa.Table = spec.table({column.name: [row.get(column.name) for row in rows] for column in spec.columns})
    return table


def recorded(frames: int = 60, rest: int = REST, *, found: bool = True) -> dict[str, pa.Table]:
    """Return kinematics and points of a garment that hangs along y, tilted by 1 in 10, and moves on as one."""
    rng = np.random.default_rng(0)
    points: list[dict[str, Any]] = []
    gripper: list[dict[str, Any]] = []
    for frame in range(frames):
        stamp_ns = START_NS + frame * PERIOD_NS
        moved_m = 0.5 * max(frame - rest, 0) ** 2 * (PERIOD_NS / 1e9) ** 2
        place = {"x_m": 0.0, "y_m": -0.3, "z_m": 1.0 - moved_m}
        gripper.append({"stream": "depth", "frame": frame, "stamp_ns": stamp_ns, **place})
        for point in range(1, COUNT + 1):
            below_m = (point - 0.5) / COUNT * LENGTH_M
            noise_m = rng.normal(0, 0.0005, 2)
            at = {"x_m": 0.0, "y_m": -0.3 + below_m + noise_m[0], "z_m": 1.0 - moved_m + below_m / 10 + noise_m[1]}
            stds = {"x_std_m": 0.0005, "y_std_m": 0.001, "z_std_m": 0.0005}
            values = {**at, **stds, "garment_length_m": LENGTH_M} if found else {"reason": "no_pixels"}
            row = {"frame": frame, "stamp_ns": stamp_ns, "point": point, "pixels": 9, "bridged_m": 0.0}
            points.append({**row, **values})
    tables = {"points": build(POINTS, points), "gripper": build(GRIPPER, gripper)}
    moving = kinematics(tables["points"], tables["gripper"], KinematicsParams())["kinematics"]
    return {"kinematics": moving, "points": tables["points"]}


def the_row(tables: Mapping[str, pa.Table], **inputs: Any) -> dict[str, Any]:
    found = motion(tables["kinematics"], tables["points"], MotionParams(), **inputs)["motion"].to_pylist()
    assert len(found) == 1
    return found[0]


def test_what_is_said_of_a_whole_recording() -> None:
    row = the_row(recorded())
    start_ns = START_NS + REST * PERIOD_NS
    assert abs(row["onset_stamp_ns"] - start_ns) < max(2 * row["onset_std_ns"], 5e6)
    assert row["onset_std_ns"] < PERIOD_NS
    assert row["onset_reason"] is None
    assert row["rest_frames"] + row["moving_frames"] == 60
    assert abs(row["rest_frames"] - REST) <= 1
    assert row["rest_noise_m"] == pytest.approx(0.0005 * np.sqrt(2 / 3), rel=0.15)  # x is without
    assert row["moving_noise_m"] == pytest.approx(0.0005 * np.sqrt(2 / 3), rel=0.15)
    assert row["point_count"] == COUNT
    assert row["garment_length_m"] == LENGTH_M
    assert row["segment_length_m"] == LENGTH_M / COUNT
    assert row["garment_length_std_m"] == pytest.approx(0.001 * np.sqrt(2 / (0.125**2 + 0.875**2)))
    assert row["segment_length_std_m"] == row["garment_length_std_m"] / COUNT
    assert row["rest_reason"] is None


def test_gravity_is_that_of_the_world_else_along_the_garment() -> None:
    from garment_dataset.stages.decode_tables import WORLD

    tables = recorded()
    hanging = the_row(tables)
    gravity = [hanging[f"gravity_{axis}_m_s2"] for axis in "xyz"]
    np.testing.assert_allclose(gravity, 9.81 * np.array([0, 1, 0.1]) / np.sqrt(1.01), atol=0.03)
    assert hanging["gravity_source"] == "hanging"
    known: dict[str, Any] = {"stream": "depth", "gravity_x": 0.0, "gravity_y": 0.8, "gravity_z": -0.6}
    other = {**known, "stream": "color", "gravity_y": -0.8}
    row = the_row(tables, world=build(WORLD, [other, known]))
    assert [row[f"gravity_{axis}_m_s2"] for axis in "xyz"] == pytest.approx([0, 7.848, -5.886])
    assert row["gravity_source"] == "world"
    unknown = {"stream": "depth", "reason": "no transforms"}
    assert the_row(tables, world=build(WORLD, [unknown])) == hanging


def test_a_gripper_that_never_moves_rests_all_the_time() -> None:
    row = the_row(recorded(rest=60))
    assert row["onset_reason"] == "no_motion"
    assert (row["onset_stamp_ns"], row["onset_std_ns"]) == (None, None)
    assert (row["rest_frames"], row["moving_frames"]) == (60, 0)
    assert row["garment_length_m"] == LENGTH_M
    assert row["moving_noise_m"] is None


def test_what_is_not_known_is_null_with_a_reason() -> None:
    without_rest = the_row(recorded(rest=1))
    assert without_rest["onset_reason"] == without_rest["rest_reason"] == "no_rest"
    empty = the_row(recorded(found=False))
    assert empty["onset_reason"] is None
    assert empty["rest_reason"] == "no_points"
    nothing = the_row(recorded(frames=0))
    assert nothing["onset_reason"] == nothing["rest_reason"] == "no_gripper"
    assert nothing["point_count"] == 0
    for row in (without_rest, empty, nothing):
        names = ("garment_length_m", "segment_length_m", "gravity_y_m_s2", "gravity_source", "rest_noise_m")
        assert [row[name] for name in names] == [None] * 5
    assert [without_rest[name] for name in ("onset_stamp_ns", "rest_frames", "moving_frames")] == [None] * 3


def test_errors_of_every_point_and_quantity_hang_together() -> None:
    tables = recorded()
    rows = motion(tables["kinematics"], tables["points"], MotionParams())["correlations"].to_pylist()
    found = {(row["point"], row["quantity"]): row for row in rows}
    assert len(found) == len(rows) == COUNT * 9
    assert found[1, "x_m"]["standing_share"] == 1
    assert found[1, "x_m"]["effective_frames"] == pytest.approx(1)
    of_gripper = (0.875 * 0.0005 / 0.001) ** 2
    assert found[1, "y_m"]["standing_share"] == pytest.approx(of_gripper + 0.25 * (1 - of_gripper))
    assert found[4, "y_m"]["standing_share"] < found[1, "y_m"]["standing_share"]
    z = found[2, "z_m"]
    assert (z["standing_share"], z["moving_lag1"], z["next_point"]) == (0.25, 0.8, 0.25)
    assert z["lag1"] == pytest.approx(0.85)
    assert z["effective_frames"] == pytest.approx(effective_frames(60, 0.25, 0.8))
    assert abs(z["rest_lag1"]) < 0.5  # the noise here is white
    assert found[4, "z_m"]["next_point"] is None
    assert found[2, "vz_m_s"]["rest_lag1"] is None


@pytest.mark.parametrize(("frames", "standing", "lag1"), [(1, 0.3, 0.8), (7, 0.3, 0.8), (50, 0.0, 0.5), (50, 1.0, 0.9)])
def test_effective_frames_are_the_variance_of_a_mean(frames: int, standing: float, lag1: float) -> None:
    steps = np.abs(np.arange(frames)[:, None] - np.arange(frames))
    variance = (standing + (1 - standing) * lag1**steps).mean()
    assert effective_frames(frames, standing, lag1) == pytest.approx(1 / variance)


def test_intervals_of_means_hold_as_often_as_they_say() -> None:
    """Errors made as they are said to be: s standing, the rest autoregressive; means over 40 frames."""
    rng, frames, standing, rho = np.random.default_rng(2), 40, 0.25, 0.8
    moving = rng.normal(size=(frames, 4000))
    for i in range(1, frames):
        moving[i] = rho * moving[i - 1] + np.sqrt(1 - rho**2) * moving[i]
    errors = np.sqrt(standing) * rng.normal(size=4000) + np.sqrt(1 - standing) * moving
    held = np.abs(errors.mean(axis=0)) < 1.96 / np.sqrt(effective_frames(frames, standing, rho))
    assert held.mean() == pytest.approx(0.95, abs=0.01)
    as_if_independent = np.abs(errors.mean(axis=0)) < 1.96 / np.sqrt(frames)
    assert as_if_independent.mean() < 0.5


def test_autocorrelation_of_known_series() -> None:
    waves = np.stack([np.tile([1.0, -1.0], 50), np.ones(100), np.sin(np.arange(100) * 0.1)], axis=1)
    alternating, constant, slow = lag1_autocorrelation(waves)
    assert alternating == pytest.approx(-1)
    assert np.isnan(constant)
    assert slow > 0.95
    assert np.isnan(lag1_autocorrelation(waves[:3])).all()
