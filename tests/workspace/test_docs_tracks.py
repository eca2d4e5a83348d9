"""The pipeline that docs/tracks.md tells to write can stand beside the package's own."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from garment_dataset.workspace.known_stages import KnownStages
from garment_dataset.workspace.pipelines import load_pipelines

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace

DOCS = Path(__file__).parents[2] / "docs"


def test_the_pipeline_of_tracks_is_one(workspace: Workspace) -> None:
    found = re.search(r"```toml\n(.*?)```", (DOCS / "tracks.md").read_text("utf-8"), re.DOTALL)
    assert found is not None
    (workspace.pipelines_dir / "tracks.toml").write_text(found[1], "utf-8")
    pipelines = {each.name: each for each in load_pipelines(workspace.pipelines_dir, KnownStages.of(workspace))}
    tracks = pipelines["tracks"]
    assert tracks.file.variant == "tracks"
    assert tracks.params["kinematics"].model_dump()["source"] == "tracks"
    assert {"tracks", "kinematics"} <= tracks.makers.keys()
