"""The figures of docs/accuracy.md must not get worse unnoticed: one short simulated recording."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import pandas as pd
import pytest

from garment_dataset.score.points import PointScore, point_errors, score_errors
from garment_dataset.stages.decode import DecodeParams, decode
from garment_dataset.stages.depth_points import DepthPointsParams, depth_points
from garment_dataset.stages.kinematics import KinematicsParams, kinematics

if TYPE_CHECKING:
    from pathlib import Path

NAME = "GreenTowel_Ruler_01_pi16_0.5_R1"


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::garment_dataset.errors.DataWarning")
def test_the_default_beats_the_thesis_on_a_towel_on_a_ruler(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    from garment_dataset.simulate.recording import simulate_recording

    bag = simulate_recording(NAME, tmp_path, seed=5, scale="small", frames=60)
    truth = pd.read_parquet(bag.with_suffix(".truth") / "points.parquet")
    tables = decode(bag, DecodeParams())

    def score(method: Literal["profile", "thesis"]) -> PointScore:
        params = DepthPointsParams(method=method)
        points = depth_points(bag, tables["frames"], tables["camera"], tables["gripper"], params)["points"]
        moving = kinematics(points, tables["gripper"], KinematicsParams())["kinematics"]
        return score_errors(point_errors(points.to_pandas(), moving.to_pandas(), truth), NAME, "surface")[0]

    new, old = score("profile"), score("thesis")
    for row in (new, old):
        assert None not in (row.rmse_m, row.p95_m, row.z_rmse_m, row.vz_rmse_m_s, row.z_variance)
    assert new.coverage == 1
    assert (new.rmse_m or 1) < 0.6 * (old.rmse_m or 0)
    assert (new.rmse_m or 1) < 0.001
    assert (new.p95_m or 1) < 0.0015
    assert (new.z_rmse_m or 1) < 0.0006
    assert (new.vz_rmse_m_s or 1) < 0.007
    assert 0.1 < (new.z_variance or 0) < 2
