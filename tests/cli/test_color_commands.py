"""The colour pipeline as a user meets it: what is missing is said, and a clipping polygon suggested."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.features import load_features

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace
    from tests.cli.conftest import Garment
    from tests.conftest import MakeColorRecording

FIRST, OTHER = "GreenTowel_Corner_01_pi16_0.5_B1", "MyScarf_Free_pi16_0.5_B2"


def test_a_recording_without_a_background_is_blocked_and_says_what_to_provide(
    color_workspace: Workspace, make_color_recording: MakeColorRecording, garment: Garment
) -> None:
    (color_workspace.recordings_dir / "camera_default_0.bag").unlink()
    wanted = "recordings/camera_default_0.bag, or a row for topics file 1 in catalog/backgrounds.csv"
    why = garment("why", FIRST, cwd=color_workspace.root).out
    assert f"silhouette:{FIRST}: blocked\n    absent no background: {wanted}\n" in why
    built = garment("build", cwd=color_workspace.root)
    assert f"blocked: no background: {wanted}\n" in built.err
    assert "blocked: " not in built.err.replace(f"blocked: no background: {wanted}\n", "", 1)
    made = load_features("silhouettes", folder=color_workspace.features_dir)
    assert set(made["recording"]) == {OTHER}
    assert wanted in garment("lint", "code=no-background", code=1, cwd=color_workspace.root).out
    assert "1: missing; 2: MyScarf" in garment("list", cwd=color_workspace.root).err
    make_color_recording(color_workspace.recordings_dir / "camera_default_0.bag", empty_frames=6)
    assert "6 built" in garment("build", cwd=color_workspace.root).err
