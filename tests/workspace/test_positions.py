"""Stages of a camera position: once for all its recordings, of the bag that shows its empty scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from garment_dataset.engine.events import Ending
from garment_dataset.engine.graph import NodeId
from garment_dataset.errors import GarmentError
from garment_dataset.features.reading import load_features
from garment_dataset.workspace.session import Session
from tests.conftest import COLOR_RECORDINGS
from tests.workspace.conftest import built, put_stages, run, small_stage

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace

INTERVAL = "from_s: float | None = None\n    to_s: float | None = None"


def with_stages(workspace: Workspace, **stages: str) -> Workspace:
    names = ["decode", "background", *stages]
    text = f'recordings = ["axis=B"]\nstages = {names}\n'.replace("'", '"')
    (workspace.pipelines_dir / "colour.toml").write_text(text)
    return put_stages(workspace, *stages, **stages)


def values(workspace: Workspace, table: str) -> dict[str, float]:
    """Return the one value of every file of a table, by the recording that it is of."""
    frame = load_features(table, folder=workspace.features_dir)
    return dict(zip(frame["recording"], frame["value"], strict=True))


@pytest.mark.parametrize("jobs", [0, 2])
def test_a_stage_of_a_position_reads_what_was_made_of_it(color_workspace: Workspace, jobs: int) -> None:
    """The second position is an interval of a recording: 3 frames; the first a bag of its own: 6."""
    text = small_stage("used", "background, params", value='background["frame_count"][0].as_py()', per='"position"')
    found = with_stages(color_workspace, used=text)
    assert "used" in built(found.build(jobs=jobs))
    assert values(found, "used") == {"camera_default_0": 6, COLOR_RECORDINGS[2]: 3}
    assert (found.features_dir / "used" / "position_1.parquet").is_file()
    assert len(list((found.features_dir / "background").glob("**/*.parquet"))) == 2
    assert "used:position_2: fresh" in run(found, "why", "position_2")


def test_recordings_read_the_table_of_their_position(color_workspace: Workspace) -> None:
    used = small_stage("used", "background, params", value='background["frame_count"][0].as_py()', per='"position"')
    twice = small_stage("twice", "used, params", value='2 * used["value"][0].as_py()')
    found = with_stages(color_workspace, used=used, twice=twice)
    found.build(jobs=0)
    assert values(found, "twice") == dict(zip(COLOR_RECORDINGS, (12, 12, 6), strict=True))


@pytest.mark.parametrize("arguments", ["bag, params", "frames, params", "background, frames, params"])
def test_a_stage_that_would_take_frames_of_a_garment_is_refused(color_workspace: Workspace, arguments: str) -> None:
    found = with_stages(color_workspace, whole=small_stage("whole", arguments, per='"position"'))
    with pytest.raises(
        GarmentError, match=r"whole: the empty scene of topics file 2 is an interval of MyScarf.*from_s"
    ):
        Session(found)
    (color_workspace.catalog_dir / "backgrounds.csv").unlink()
    Session(found).store.close()


def test_the_interval_is_given_to_whoever_takes_it(color_workspace: Workspace) -> None:
    text = small_stage("end", "frames, params", value="params.to_s or 9", per='"position"', knobs=INTERVAL)
    found = with_stages(color_workspace, end=text)
    found.build(jobs=0)
    assert values(found, "end") == {"camera_default_0": 9, COLOR_RECORDINGS[2]: 0.09}


def test_without_its_empty_scene_a_position_is_blocked(color_workspace: Workspace) -> None:
    (color_workspace.recordings_dir / "camera_default_0.bag").unlink()
    used = small_stage("used", "background, params", per='"position"')
    twice = small_stage("twice", "used, params")
    found = with_stages(color_workspace, used=used, twice=twice)
    events = found.build(jobs=0).events
    for node in (NodeId("used", "position_1"), NodeId("twice", COLOR_RECORDINGS[0])):
        assert events[node].ending is Ending.BLOCKED
        assert events[node].message.startswith("no background: recordings/camera_default_0.bag")
    assert events[NodeId("twice", COLOR_RECORDINGS[2])].ending is Ending.BUILT


def test_the_scene_of_one_position_may_be_a_recording_of_another(color_workspace: Workspace) -> None:
    """What is read of that recording is then made with its own position's background."""
    lines = "topics_file,source,from_s,to_s\n1,camera_default_0,,\n2,GreenTowel_Corner_01_pi16_0.5_B1,0,0.1\n"
    (color_workspace.catalog_dir / "backgrounds.csv").write_text(lines)
    masks = small_stage("masks", "frames, background, params")
    odd = small_stage("odd", "masks, params", per='"position"', knobs=INTERVAL)
    found = with_stages(color_workspace, masks=masks, odd=odd)
    with Session(found, ["topics_file=2"]) as session:
        assert session.graph[NodeId("masks", COLOR_RECORDINGS[0])].inputs["background"].subject == "position_1"
        assert session.graph[NodeId("masks", COLOR_RECORDINGS[2])].inputs["background"].subject == "position_2"


def test_what_all_can_do_without_is_left_out_with_its_empty_scene(color_workspace: Workspace) -> None:
    """A position that shows no empty scene is no obstacle to those that only could use it."""
    (color_workspace.recordings_dir / "camera_default_0.bag").unlink()
    used = small_stage("used", "frames, params", per='"position"', knobs=INTERVAL)
    twice = small_stage("twice", "frames, params, used=None", value='used["value"][0].as_py() if used else 7')
    found = put_stages(color_workspace, "used", "twice", used=used, twice=twice)
    (found.pipelines_dir / "colour.toml").write_text('recordings = ["axis=B"]\nstages = ["decode", "used", "twice"]\n')
    events = found.build(jobs=0).events
    assert NodeId("used", "position_1") not in events
    assert events[NodeId("used", "position_2")].ending is Ending.BUILT
    assert [values(found, "twice")[name] for name in COLOR_RECORDINGS[:2]] == [7, 7]
    assert values(found, "twice")[COLOR_RECORDINGS[2]] != 7
