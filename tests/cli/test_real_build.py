"""The whole road on real recordings: from their folder to Parquet, by the command."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd
import pytest

from garment_dataset.features.reading import load_features
from garment_dataset.workspace import Workspace
from garment_dataset.workspace.session import Session

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import Garment

pytestmark = pytest.mark.real

NEED_AN_EMPTY_SCENE = {"background", "silhouette", "central_curve", "pixel_pattern"}


@pytest.fixture
def real_workspace(tmp_path: Path, real_data: Path) -> Workspace:
    made = Workspace.create(tmp_path / "ws")
    made.recordings_dir.rmdir()
    made.recordings_dir.symlink_to(real_data / "recordings")
    return made


@pytest.mark.parametrize("method", ["thesis", "profile"])
def test_real_recordings_are_built_to_the_end(real_workspace: Workspace, garment: Garment, method: str) -> None:
    pipeline = real_workspace.pipelines_dir / "depth.toml"
    pipeline.write_text(pipeline.read_text() + f'\n[params.depth_points]\nmethod = "{method}"\n')
    bags = sorted(path.stem for path in real_workspace.recordings_dir.glob("*.bag"))
    assert bags
    stages = len(Session(real_workspace).stages) - len(NEED_AN_EMPTY_SCENE)
    assert f"{stages * len(bags)} built" in garment("build", cwd=real_workspace.root).err
    frames = load_features("frames", folder=real_workspace.features_dir)
    points = load_features("points", folder=real_workspace.features_dir)
    for bag in bags:
        expected = pd.read_csv(real_workspace.recordings_dir / f"{bag}.frames.csv")
        made = frames[frames["recording"] == bag]
        assert sorted(made["stamp_ns"]) == sorted(expected["stamp_ns"])
        assert made["fault"].isna().all()
    counts = points.groupby("recording")["z_m"].count()
    assert counts["RealGarments_Floor_01_pi16_0.1_R1"] > 0  # over the desk the gripper holds nothing
    assert points.loc[points["z_m"].isna(), "reason"].notna().all()
    assert "nothing to do" in garment("build", cwd=real_workspace.root).err


@pytest.mark.parametrize("source", ["topic", "tf"])
def test_the_gripper_is_where_it_was(real_workspace: Workspace, garment: Garment, source: str) -> None:
    pipeline = real_workspace.pipelines_dir / "depth.toml"
    pipeline.write_text(pipeline.read_text() + f'\n[params.decode]\ngripper_source = "{source}"\n')
    garment("build", "--stage", "decode", cwd=real_workspace.root)
    gripper = load_features("gripper", folder=real_workspace.features_dir, stream="depth")
    assert set(gripper["source"]) == {source}
    for name, rows in gripper.groupby("recording"):
        truth = pd.read_csv(real_workspace.recordings_dir / f"{name}.ee.csv")
        both = rows.merge(truth, on="stamp_ns", how="inner")
        assert len(both) == len(truth)
        for axis in "xyz":
            assert both[f"{axis}_m"].to_numpy() == pytest.approx(both[axis].to_numpy(), abs=1e-4)
