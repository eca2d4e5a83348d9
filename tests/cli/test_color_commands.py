"""The colour pipeline as a user meets it: what is missing is said, and a clipping polygon suggested."""

from __future__ import annotations

import json
import tomllib
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest

from garment_dataset.features.reading import load_features

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


def test_a_polygon_is_suggested_for_a_pipeline_file(color_workspace: Workspace, garment: Garment) -> None:
    where = color_workspace.root
    nothing = garment("mask", code=2, cwd=where).err
    assert "no background built" in nothing
    assert "garment build --stage background" in nothing
    garment("build", "--stage", "background", cwd=where)
    assert "--position with one of [1, 2]" in garment("mask", code=2, cwd=where).err
    text = garment("mask", "--position", "1", "--save", "clip.png", cwd=where).out
    assert (where / "clip.png").stat().st_size > 10_000
    polygon = tomllib.loads(text)["params"]["silhouette"]["clip_polygon"]
    assert json.loads(garment("mask", "--position", "1", "--json", cwd=where).out)["clip_polygon"] == polygon
    pipeline = color_workspace.pipelines_dir / "colour.toml"
    pipeline.write_text(pipeline.read_text() + text)
    garment("build", FIRST, cwd=where)
    found = load_features("silhouettes", folder=color_workspace.features_dir, recording=FIRST)
    assert found["reason"].isna().all()


def test_a_polygon_is_taken_from_a_drawn_picture(color_workspace: Workspace, garment: Garment) -> None:
    where = color_workspace.root
    garment("build", "--stage", "background", cwd=where)
    background = load_features("background", folder=color_workspace.features_dir, recording="camera_default_0")
    height_px, width_px = len(background), len(background["mean"].iloc[0]) // 3
    drawn = np.zeros((height_px, width_px), np.uint8)
    drawn[10:41, 20:61] = 255
    cv2.imwrite(str(where / "drawn.png"), drawn)
    ran = garment("mask", "--position", "1", "--from", "drawn.png", "--json", cwd=where)
    corners = {tuple(corner) for corner in json.loads(ran.out)["clip_polygon"]}
    assert corners == {(20, 10), (20, 40), (60, 40), (60, 10)}
    cv2.imwrite(str(where / "small.png"), drawn[:-1])
    wrong = garment("mask", "--position", "1", "--from", "small.png", code=2, cwd=where).err
    assert f"expected {width_px} x {height_px} px, found {width_px} x {height_px - 1} px" in wrong
    assert "not a picture" in garment("mask", "--position", "1", "--from", "none.png", code=2, cwd=where).err


@pytest.mark.parametrize("frame", [0, 5])
def test_a_colour_frame_is_drawn(color_workspace: Workspace, garment: Garment, frame: int) -> None:
    """Frame 0 shows the wall alone."""
    garment("build", OTHER, cwd=color_workspace.root)
    picture = color_workspace.root / "frame.png"
    garment("show", OTHER, "--frame", str(frame), "--save", str(picture), cwd=color_workspace.root)
    image = cv2.imread(str(picture))
    assert image is not None
    yellow = (image[..., 2] > 200) & (image[..., 1] > 200) & (image[..., 0] < 100)
    assert (yellow.sum() > 50) == (frame == 5), "the outline is yellow"
