"""What is shown is what there is, and what there is not is said."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset.errors import BagError, StoreError
from garment_dataset.viewers.content import gather
from garment_dataset.viewers.frames import ColorFrame, DepthFrame, Frames
from tests.conftest import START_NS, write_recording
from tests.viewers.conftest import COLOR_NAME, DEPTH_NAME, FRAMES

if TYPE_CHECKING:
    from pathlib import Path

    from garment_dataset.viewers.content import Content
    from garment_dataset.workspace import Workspace


def test_frames_of_both_streams_come_in_the_order_of_their_stamps(depth_content: Content) -> None:
    frames = list(Frames(depth_content))
    assert [type(each) for each in frames] == [DepthFrame, ColorFrame] * FRAMES
    stamps_ns = [each.stamp_ns for each in frames]
    assert stamps_ns == sorted(stamps_ns)
    assert stamps_ns[0] == depth_content.start_ns == START_NS


def test_what_falls_between_two_images_is_on_the_earlier(depth_content: Content) -> None:
    stamps_ns = np.array([START_NS - 1, START_NS, START_NS + 32_999_999, START_NS + 33_000_000, START_NS + 10**12])
    assert depth_content.main_frames(stamps_ns).tolist() == [0, 0, 0, 1, FRAMES - 1]


def test_a_stamp_that_steps_back_ends_no_image(depth_content: Content) -> None:
    frames = depth_content.tables["frames"].copy()
    frames.loc[(frames["stream"] == "depth") & (frames["frame"] == 5), "stamp_ns"] = START_NS
    content = dataclasses.replace(depth_content, tables={**depth_content.tables, "frames": frames})
    at_ns = np.array([START_NS + 33_000_000 * number for number in (3, 4, 6)])
    assert content.main_frames(at_ns).tolist() == [3, 5, 6]  # image 5 came behind image 4
    assert [each.frame for each in Frames(dataclasses.replace(content, bag=None)) if isinstance(each, DepthFrame)] == [
        *range(FRAMES)
    ]


def test_another_bag_under_the_name_is_refused(depth_content: Content, tmp_path: Path) -> None:
    fewer = dataclasses.replace(depth_content, bag=write_recording(tmp_path / "fewer.bag", frames=FRAMES - 2))
    with pytest.raises(BagError, match=r"not the bag that the results are of: found 22 of 24 depth images"):
        list(Frames(fewer))
    stamps = depth_content.tables["frames"].assign(stamp_ns=lambda rows: rows["stamp_ns"] + 1)
    other = dataclasses.replace(depth_content, tables={**depth_content.tables, "frames": stamps})
    with pytest.raises(BagError, match=r"found depth image 0 has another stamp"):
        list(Frames(other))


def test_what_is_missing_is_said_in_a_line_each(shown: Workspace) -> None:
    row = shown.catalog().row(COLOR_NAME)
    assert list(gather(shown, dataclasses.replace(row, path=None)).left_out) == [
        f"left out, as the bag of {COLOR_NAME} is missing: images and cloud; put it into recordings/",
        (
            f"left out, as not built: chains, points, tracks, kinematics; name depth_points, tracks, kinematics in a "
            f"pipeline of {COLOR_NAME}, then `garment build`"
        ),
    ]


def test_images_without_a_camera_are_left_out_with_a_line(
    shown: Workspace, depth_content: Content, monkeypatch: pytest.MonkeyPatch
) -> None:
    depth_only = depth_content.tables["camera"].query("stream == 'depth'")
    read = {**depth_content.tables, "camera": depth_only}
    monkeypatch.setattr("garment_dataset.viewers.content.read_result", lambda path: read[path.parents[2].name])
    content = gather(shown, shown.catalog().row(DEPTH_NAME))
    assert list(content.cameras) == ["depth"]
    assert content.left_out[0] == (
        "left out, as nothing is known of their camera: color images; `garment show` says why"
    )
    assert [type(each) for each in Frames(content)] == [DepthFrame] * FRAMES


def test_without_results_it_says_to_build(shown: Workspace) -> None:
    row = dataclasses.replace(shown.catalog().row(DEPTH_NAME), recording="GreenTowel_Ruler_02_pi16_0.5_R1")
    with pytest.raises(StoreError, match=r"nothing to show: no frames: .*`garment build` makes them"):
        gather(shown, row)
