"""Pipeline files: what they ask for, and what is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from garment_dataset.engine.graph import NodeId
from garment_dataset.errors import PipelineError
from garment_dataset.workspace.graph import draw_graph
from garment_dataset.workspace.known_stages import KnownStages
from garment_dataset.workspace.pipelines import load_pipelines

if TYPE_CHECKING:
    from garment_dataset.engine.graph import Graph
    from garment_dataset.workspace import Workspace


def graph_of(workspace: Workspace) -> Graph:
    catalog = workspace.catalog()
    pipelines = load_pipelines(workspace.pipelines_dir, KnownStages.of(workspace))
    return draw_graph(catalog, pipelines, [row for row in catalog.rows if row.path is not None]).graph


def test_every_depth_recording_gets_every_stage(workspace: Workspace) -> None:
    graph = graph_of(workspace)
    assert {node.subject for node in graph} == {path.stem for path in workspace.recordings_dir.iterdir()}
    assert [node.stage.name for node in graph][:3] == ["decode", "depth_points", "kinematics"]
    node = graph[NodeId("depth_points", "MyScarf_Corner_pi16_0.5_R1")]
    assert node.partition == "garment=MyScarf/holding=Corner"
    assert {label.column.name: label.value for label in node.labels}["speed"] == 0.5
    assert set(node.inputs) == {"frames", "camera", "gripper"}
    assert node.sources["bag"].name == "MyScarf_Corner_pi16_0.5_R1.bag"


def test_two_pipelines_may_share_a_stage_but_not_contradict(workspace: Workspace) -> None:
    other = workspace.pipelines_dir / "towels.toml"
    other.write_text('recordings = ["garment=GreenTowel"]\nstages = ["decode"]\n')
    assert len(graph_of(workspace)) == 9
    other.write_text('stages = ["decode"]\n[params.decode]\ngripper_source = "tf"\n')
    with pytest.raises(PipelineError, match="different parameters"):
        graph_of(workspace)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('stages = ["decode"', "TOML"),
        ('stages = ["decoed"]', "unknown stage 'decoed'"),
        ('stages = ["depth_points"]', "Add 'decode' to its stages"),
        ('stage = ["decode"]', "stage"),
        ('stages = ["decode"]\n[params.decode]\nfoo = 1', "foo"),
        (
            'stagse = ["decode"]',
            r"entry 'stagse' is not .*one of description, .*, found 'stagse'\. Did you mean stages\?",
        ),
        ('stages = ["decode"]\n[params.decode]\ngripper_sorce = "tf"', r"gripper_sorce: .*mean gripper_source\?"),
        (
            'stages = ["decode"]\n[params.decode]\ngripper_source = "tpoic"',
            r"gripper_source: expected one of auto, topic, tf, found 'tpoic'\. Did you mean topic\?",
        ),
        ('stages = ["decode"]\nrecordings = ["axes=R"]', r"recordings: axes=R: no such key: .*Did you mean axis=R\?"),
        ('stages = ["decode"]\nrecordings = ["axis=Q"]', "no such axis: expected one of R, B, found 'Q'"),
        ('stages = ["decode"]\nrecordings = ["garment=GreenTowl"]', r"Did you mean garment=GreenTowel\?"),
        ('stages = ["decode"]\nrecordings = ["MyScarf_Corner_pi16_0.5_B1"]', r"mean MyScarf_Corner_pi16_0\.5_R1\?"),
        ('stages = ["decode"]\n[params.decod]\nfoo = 1', "unknown stage 'decod'"),
        ('stages = ["decode", "depth_points"]\n[params.depth_points]\npoint_count = -1', "point_count"),
    ],
)
def test_mistakes_name_the_file_and_what_is_known(workspace: Workspace, text: str, message: str) -> None:
    (workspace.pipelines_dir / "depth.toml").write_text(text)
    with pytest.raises(PipelineError, match=message) as caught:
        graph_of(workspace)
    assert "depth.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_no_pipeline_at_all_is_said(workspace: Workspace) -> None:
    (workspace.pipelines_dir / "depth.toml").unlink()
    for path in workspace.pipelines_dir.glob("*.toml"):
        path.unlink()
    with pytest.raises(PipelineError, match="no pipeline files"):
        load_pipelines(workspace.pipelines_dir, KnownStages.of(workspace))


def test_two_pipelines_give_one_stage_the_tables_that_each_has(workspace: Workspace) -> None:
    """``quality`` takes what there is; a recording of both pipelines has one row for each of their stages."""
    for name, stages in (("depth", ["decode", "depth_points"]), ("colour", ["decode", "depth_points", "kinematics"])):
        text = f'recordings = ["axis=R"]\nstages = {[*stages, "quality"]}\n'.replace("'", '"')
        (workspace.pipelines_dir / f"{name}.toml").write_text(text)
    (node, *_) = [node for node in graph_of(workspace) if node.stage.name == "quality"]
    assert set(node.inputs) == {"frames", "points", "kinematics"}


def test_a_table_that_a_stage_can_do_without_does_not_block_it(workspace: Workspace) -> None:
    """The empty scene is missing: there is no silhouette, but there is something to say of the images."""
    text = 'recordings = ["axis=R"]\nstages = ["decode", "background", "silhouette", "quality"]\n'
    (workspace.pipelines_dir / "depth.toml").write_text(text)
    graph = graph_of(workspace)
    blocked = {node.stage.name for node in graph if node.blocked is not None}
    assert blocked == {"background", "silhouette"}
    assert all(set(node.inputs) == {"frames"} for node in graph if node.stage.name == "quality")
