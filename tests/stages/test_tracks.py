"""The stage ``tracks`` on a small made recording, and ``kinematics`` of its points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset.errors import PipelineError
from garment_dataset.stages.decode import STAGE as DECODE
from garment_dataset.stages.depth_points import DepthPointsParams, depth_points
from garment_dataset.stages.kinematics import KinematicsParams, kinematics
from garment_dataset.stages.tracks import TracksParams, tracks
from tests.conftest import write_recording

if TYPE_CHECKING:
    from pathlib import Path

    import pyarrow as pa


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, pa.Table]]:
    bag = write_recording(tmp_path_factory.mktemp("bags") / "Made_Ruler_pi16_0.5_R1.bag")
    tables = DECODE.function(bag=bag, params=DECODE.params())
    known = {name: tables[name] for name in ("frames", "camera", "gripper")}
    return bag, known | depth_points(bag, **known, params=DepthPointsParams())


def followed(made: tuple[Path, dict[str, pa.Table]], params: TracksParams) -> pa.Table:
    bag, tables = made
    names = ("frames", "camera", "gripper", "points")
    return tracks(bag, **{name: tables[name] for name in names}, params=params)["tracks"]


def test_a_row_per_frame_and_point_with_reasons(made: tuple[Path, dict[str, pa.Table]]) -> None:
    table, points = followed(made, TracksParams()), made[1]["points"]
    assert table["frame"].to_pylist() == points["frame"].to_pylist()
    assert table["point"].to_pylist() == points["point"].to_pylist()
    there = np.isfinite(table["z_m"].to_numpy())
    assert there.any()
    assert [reason is None for reason in table["reason"].to_pylist()] == there.tolist()
    assert [seen is not None for seen in table["visible"].to_pylist()] == there.tolist()


def test_without_a_rest_nothing_is_followed(made: tuple[Path, dict[str, pa.Table]]) -> None:
    table = followed(made, TracksParams(least_rest_frames=1000))
    assert set(table["reason"].to_pylist()) == {"no_rest"}
    assert table["x_m"].null_count == table["visible"].null_count == len(table)


def test_kinematics_takes_its_source_as_a_parameter(made: tuple[Path, dict[str, pa.Table]]) -> None:
    points, gripper = made[1]["points"], made[1]["gripper"]
    own = followed(made, TracksParams())
    usual = kinematics(points, gripper, KinematicsParams())["kinematics"]
    assert kinematics(points, gripper, KinematicsParams(), own)["kinematics"].equals(usual)
    moved = kinematics(points, gripper, KinematicsParams(source="tracks"), own)["kinematics"]
    assert moved.filter(moved["point"].to_numpy() > 0)["x_m"].to_pylist() == own["x_m"].to_pylist()
    with pytest.raises(PipelineError, match="no table tracks"):
        kinematics(points, gripper, KinematicsParams(source="tracks"))
