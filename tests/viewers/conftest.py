"""Recordings that are built once, to be shown in every way."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset.bags import Transform
from garment_dataset.engine.events import Ending
from garment_dataset.viewers.content import Content, gather
from tests.conftest import COLOR_RECORDINGS, make_workspace, write_color_recording

if TYPE_CHECKING:
    from pathlib import Path

    from garment_dataset.workspace import Workspace

DEPTH_NAME, COLOR_NAME = "GreenTowel_Ruler_01_pi16_0.5_R1", COLOR_RECORDINGS[0]
FRAMES = 24


@pytest.fixture(scope="session")
def shown(tmp_path_factory: pytest.TempPathFactory, sample_bags: dict[str, Path]) -> Workspace:
    """A workspace that is only read: a recording along the axis, and one across it with its empty scene."""
    made = make_workspace(tmp_path_factory.mktemp("shown") / "workspace")
    (made.recordings_dir / f"{DEPTH_NAME}.bag").symlink_to(sample_bags[DEPTH_NAME])
    write_color_recording(made.recordings_dir / f"{COLOR_NAME}.bag")
    write_color_recording(made.recordings_dir / "camera_default_0.bag", empty_frames=6, seed=9)
    (made.catalog_dir / "backgrounds.csv").write_text("topics_file,source,from_s,to_s\n1,camera_default_0,,\n")
    assert not made.build(jobs=0).of(Ending.FAILED)
    return made


@pytest.fixture(scope="session")
def depth_content(shown: Workspace) -> Content:
    return gather(shown, shown.catalog().row(DEPTH_NAME))


@pytest.fixture(scope="session")
def color_content(shown: Workspace) -> Content:
    return gather(shown, shown.catalog().row(COLOR_NAME))


@pytest.fixture(scope="session")
def turning_content(depth_content: Content) -> Content:
    """The same with a gripper that turns, unknown in frame 4; with a camera that is level, and the other beside it."""
    gripper, world = depth_content.tables["gripper"].copy(), depth_content.tables["world"].copy()
    angle = 0.02 * gripper["frame"].to_numpy(np.float64)
    gripper["qx"], gripper["qy"] = np.sin(angle), 0.0
    gripper["qz"], gripper["qw"] = 0.0, np.cos(angle)
    gripper.loc[gripper["frame"] == 4, ["qx", "qy", "qz", "qw"]] = np.nan
    world["gravity_x"], world["gravity_y"], world["gravity_z"] = 0.0, 1.0, 0.0
    beside = Transform(np.array([0.025, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]), 0, 0)
    tables = {**depth_content.tables, "gripper": gripper, "world": world}
    return dataclasses.replace(depth_content, tables=tables, other_in_main=beside)


@pytest.fixture(scope="session")
def tracked_content(depth_content: Content) -> Content:
    """The same with tracks, a centimetre beside the points."""
    tracks = depth_content.tables["points"].assign(x_m=depth_content.tables["points"]["x_m"] + 0.01)
    return dataclasses.replace(depth_content, tables={**depth_content.tables, "tracks": tracks})


@pytest.fixture(scope="session")
def odd_content(turning_content: Content) -> Content:
    """The same with one frame of an odd name for both cameras: depth that is registered to colour."""
    cameras = {
        stream: dataclasses.replace(camera, frame_id="rig/cam (1) optical")
        for stream, camera in turning_content.cameras.items()
    }
    return dataclasses.replace(turning_content, cameras=cameras)
