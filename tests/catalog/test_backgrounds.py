"""One background serves many recordings: a node of its own, blocked when missing, and rebuilding exactly its users."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow.dataset as ds
import pytest

from garment_dataset.engine.events import Ending
from garment_dataset.engine.graph import NodeId
from garment_dataset.engine.plan import State
from garment_dataset.errors import PipelineError
from garment_dataset.features.reading import load_features
from garment_dataset.stages.background import background_model
from garment_dataset.workspace.graph import draw_graph
from garment_dataset.workspace.known_stages import KnownStages
from garment_dataset.workspace.pipelines import load_pipelines

if TYPE_CHECKING:
    from garment_dataset.engine.events import Report
    from garment_dataset.engine.graph import Graph
    from garment_dataset.workspace import Workspace
    from tests.conftest import MakeColorRecording

FIRST, SECOND, OTHER = (
    "GreenTowel_Corner_01_pi16_0.5_B1",
    "GreenTowel_Corner_02_pi16_0.5_B1",
    "MyScarf_Free_pi16_0.5_B2",
)


def graph_of(workspace: Workspace) -> Graph:
    catalog = workspace.catalog()
    pipelines = load_pipelines(workspace.pipelines_dir, KnownStages.of(workspace))
    return draw_graph(catalog, pipelines, [row for row in catalog.rows if row.path is not None]).graph


def endings(report: Report, ending: Ending) -> list[str]:
    return sorted(str(event.node) for event in report.of(ending))


def test_recordings_of_one_position_share_one_background(color_workspace: Workspace) -> None:
    graph = graph_of(color_workspace)
    backgrounds = [node for node in graph if node.stage.name == "background"]
    assert [node.subject for node in backgrounds] == ["position_1", "position_2"]
    for name, position in ((FIRST, 1), (SECOND, 1), (OTHER, 2)):
        assert graph[NodeId("silhouette", name)].inputs["background"] == NodeId("background", f"position_{position}")
    shared, interval = backgrounds
    assert shared.inputs == {"frames": NodeId("decode", "camera_default_0")}
    assert interval.inputs == {"frames": NodeId("decode", OTHER)}
    assert interval.sources["bag"].stem == OTHER
    assert (interval.params.model_dump()["from_s"], interval.params.model_dump()["to_s"]) == (0.0, 0.09)
    assert (shared.partition, shared.labels[0].value) == ("", "camera_default_0")
    assert len(graph) == 4 + 2 + 3 * 2


def test_every_reader_reads_the_background_back(color_workspace: Workspace) -> None:
    report = color_workspace.build(jobs=0)
    assert endings(report, Ending.FAILED) == endings(report, Ending.BLOCKED) == []
    path = color_workspace.features_dir / "background" / "position_1.parquet"
    frame = load_features("background", folder=color_workspace.features_dir, recording="camera_default_0")
    mean = np.stack(frame["mean"].to_list()).reshape(len(frame), -1, 3)
    assert mean.shape == (120, 160, 3)
    assert abs(mean.mean() - 190) < 0.1
    assert set(frame["frame_count"]) == {6}
    table = ds.dataset(path).to_table()
    np.testing.assert_array_equal(background_model(table).mean, mean)
    assert frame.attrs["units"]["mean"] == "level"
    readings: list[Any] = [
        pd.read_parquet(path)["mean"],
        pl.read_parquet(path)["mean"].to_list(),
        duckdb.execute(f"select mean from '{path}' order by v_px").fetchnumpy()["mean"],
    ]
    for rows in readings:
        np.testing.assert_array_equal(np.stack(list(rows)).reshape(120, -1, 3), mean)
    both = load_features("background", folder=color_workspace.features_dir)
    assert both.groupby("recording").size().to_dict() == {"camera_default_0": 120, OTHER: 120}
    assert "garment" not in both.columns
    schema = json.loads((color_workspace.features_dir / "schemas.json").read_text())["background"]
    assert schema["partitions"] == []


def test_the_interval_holds_the_frames_of_the_empty_scene_alone(color_workspace: Workspace) -> None:
    """Frames 0, 1 and 2 begin before 0.09 s; the sheet is in frame 3, and three of its pixels are near the gripper."""
    color_workspace.build("MyScarf_*", jobs=0)
    model = load_features("background", folder=color_workspace.features_dir)
    assert set(model["frame_count"]) == {3}
    assert abs(np.stack(model["mean"].to_list()) - 190).max() <= 3
    found = load_features("silhouettes", folder=color_workspace.features_dir)
    assert found["reason"].tolist()[:3] == ["no_garment"] * 3
    assert found["area_px2"].tolist()[3:] == [1800 - 3] * 3


def test_a_changed_background_rebuilds_exactly_its_users(
    color_workspace: Workspace, make_color_recording: MakeColorRecording
) -> None:
    color_workspace.build(jobs=0)
    assert color_workspace.build(jobs=0).of(Ending.FRESH)
    scene = color_workspace.recordings_dir / "camera_default_0.bag"
    make_color_recording(scene, empty_frames=6, seed=10)
    report = color_workspace.build(jobs=0)
    assert endings(report, Ending.BUILT) == [
        "background:position_1",
        f"central_curve:{FIRST}",
        f"central_curve:{SECOND}",
        "decode:camera_default_0",
        f"silhouette:{FIRST}",
        f"silhouette:{SECOND}",
    ]
    others = ["background:position_2", *(f"{stage}:{OTHER}" for stage in ("central_curve", "decode", "silhouette"))]
    assert endings(report, Ending.FRESH) == sorted([*others, f"decode:{FIRST}", f"decode:{SECOND}"])


def test_an_unchanged_background_stops_the_wave(
    color_workspace: Workspace, make_color_recording: MakeColorRecording
) -> None:
    color_workspace.build(jobs=0)
    make_color_recording(color_workspace.recordings_dir / "camera_default_0.bag", frames=7, empty_frames=7, seed=9)
    table = color_workspace.catalog_dir / "backgrounds.csv"
    table.write_text(table.read_text().replace("camera_default_0,,", "camera_default_0,,0.19"))
    report = color_workspace.build(jobs=0)
    assert endings(report, Ending.BUILT) == ["background:position_1", "decode:camera_default_0"]


def test_without_the_table_the_position_decides(color_workspace: Workspace) -> None:
    (color_workspace.catalog_dir / "backgrounds.csv").unlink()
    graph = graph_of(color_workspace)
    assert graph[NodeId("background", "position_1")].blocked is None
    missing = graph[NodeId("silhouette", OTHER)].blocked
    assert missing == (
        "no background: recordings/camera_default_1.bag, or a row for topics file 2 in catalog/backgrounds.csv"
    )
    assert missing == graph[NodeId("central_curve", OTHER)].blocked


def test_two_pipelines_that_need_other_backgrounds_contradict(color_workspace: Workspace) -> None:
    text = (color_workspace.pipelines_dir / "colour.toml").read_text()
    (color_workspace.pipelines_dir / "more.toml").write_text(text + "[params.background]\nfrom_s = 0.1\n")
    with pytest.raises(PipelineError, match="'background' of position_1 with different parameters"):
        graph_of(color_workspace)


def test_the_background_is_planned_once_and_with_its_users(color_workspace: Workspace) -> None:
    from garment_dataset.workspace.session import Session

    with Session(color_workspace, [SECOND]) as session:
        plan = session.plan()
    assert {str(decision.node) for decision in plan} == {
        "decode:camera_default_0",
        "background:position_1",
        *(f"{stage}:{SECOND}" for stage in ("decode", "silhouette", "central_curve")),
    }
    assert {decision.state for decision in plan} == {State.MISSING}
