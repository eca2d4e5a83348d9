"""``garment score`` as a user meets it: a stage of one's own, its truth beside the bags, and a variant."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset import load_features
from tests.conftest import DEPTH_PIPELINE, RECORDINGS

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace
    from tests.cli.conftest import Garment


OWN = """
from garment_dataset.stages import FRAME, Column, Stage, StageParams, TableSpec

REACH = TableSpec("reach", 1, "one depth frame",
                  (FRAME, Column("reach_m", "float64", "m", "how far the lowest point is below the gripper", True)),
                  keys=("frame",))


class ReachParams(StageParams):
    factor: float = 1.0


def reach(points, params):
    rows = points.filter(points["point"].to_numpy() == 1)
    reach_m = rows["garment_length_m"].to_numpy() * params.factor
    return {"reach": REACH.table({"frame": rows["frame"], "reach_m": reach_m})}


STAGE = Stage(reach, params=ReachParams, outputs=(REACH,))
"""


@pytest.fixture
def reaching(workspace: Workspace, garment: Garment) -> Workspace:
    """A workspace with a stage of its own, a variant in which all lengths are double, and truth that is 3 mm longer."""
    workspace.stages_dir.mkdir()
    (workspace.stages_dir / "reach.py").write_text(OWN)
    (workspace.root / "garment.toml").write_text('[stages]\nmodules = ["reach"]\n')
    usual = DEPTH_PIPELINE.replace('"kinematics"', '"reach"')
    (workspace.pipelines_dir / "depth.toml").write_text(usual)
    (workspace.pipelines_dir / "double.toml").write_text(f'variant = "double"\n{usual}[params.reach]\nfactor = 2.0\n')
    garment("build", "-j", "0", cwd=workspace.root)
    for name in RECORDINGS:
        truth = workspace.recordings_dir / f"{name}.truth"
        truth.mkdir()
        rows = load_features("reach", folder=workspace.features_dir, recording=name)
        rows[["frame", "reach_m"]].assign(reach_m=rows["reach_m"] + 0.003).to_parquet(truth / "reach.parquet")
    return workspace


def test_a_table_of_ones_own_is_scored(reaching: Workspace, garment: Garment) -> None:
    text = garment("score", ".", "recordings", "--json", cwd=reaching.root).out
    answer = json.loads(text)
    assert (answer["points"], answer["silhouettes"]) == ([], [])
    names = [(row["recording"], row["table"], row["column"]) for row in answer["tables"]]
    assert names == [(name, "reach", "reach_m") for name in [*sorted(RECORDINGS), "all"]]
    assert [row["rms"] for row in answer["tables"]] == pytest.approx([0.003] * 4)
    assert garment("score", ".", "recordings", "--variant", "default", "--json", cwd=reaching.root).out == text


def test_a_variant_is_scored(reaching: Workspace, garment: Garment) -> None:
    ran = garment("score", "features", "recordings", "--variant", "double", cwd=reaching.root)
    title, head, *rows = ran.out.splitlines()
    assert title == "Other tables"
    assert head.split()[:4] == ["recording", "table", "column", "coverage"]
    assert rows[-1].split()[:4] == ["all", "reach", "reach_m", "100.0"]
    reach_m = load_features("reach", folder=reaching.features_dir)["reach_m"]
    expected = np.sqrt(np.mean((reach_m - 0.003) ** 2))
    assert float(rows[-1].split()[4]) == pytest.approx(expected, rel=1e-2)
    wrong = garment("score", ".", "recordings", "--variant", "duble", code=2, cwd=reaching.root)
    assert "no variant 'duble': expected one of double. Did you mean double?" in wrong.err
    assert wrong.err.count("\n") == 1
