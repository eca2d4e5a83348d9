"""The tables of docs/viewers.md name what is in the files, all of it and nothing else."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from garment_dataset.viewers.mcap_file import save_mcap
from garment_dataset.viewers.rerun_log import save_rrd

if TYPE_CHECKING:
    from garment_dataset.viewers.content import Content

PAGE = (Path(__file__).parents[2] / "docs" / "viewers.md").read_text("utf-8")
RERUN, MCAP = (PAGE.partition(f"## What is in {name}")[2].partition("\n## ")[0] for name in ("Rerun", "MCAP"))
NAMES = {
    r"xtion1_depth_optical_frame": "DEPTH",
    r"xtion1_rgb_optical_frame": "COLOR",
    r"(?<=^z_m/)(gripper|point_\d)": "POINT",
    r"(?<=^vz_m_s/)(gripper|point_\d)": "POINT",
    r"(?<=^gripper_m/)[xyz]": "AXIS",
    r"(?<=^joints_rad/).*": "JOINT",
}


def named(entity: str) -> str:
    for pattern, name in NAMES.items():
        entity = re.sub(pattern, name, entity.lstrip("/"))
    return entity


def test_every_entity_is_on_the_page_and_in_a_file(
    turning_content: Content, color_content: Content, tracked_content: Content, tmp_path: Path
) -> None:
    pytest.importorskip("rerun", reason="Rerun's files need the extra rerun")
    from rerun.chunk import RrdReader

    found = set()
    for number, content in enumerate((turning_content, color_content, tracked_content)):
        save_rrd(content, tmp_path / f"{number}.rrd")
        found |= {named(str(chunk.entity_path)) for chunk in RrdReader(tmp_path / f"{number}.rrd").stream()}
    documented = set(re.findall(r"^\| `([^`]+)` \|", RERUN, re.MULTILINE))
    assert found - {"DEPTH", "COLOR", "__properties"} == documented


def test_every_topic_is_on_the_page_and_in_a_file(
    turning_content: Content, color_content: Content, tracked_content: Content, tmp_path: Path
) -> None:
    pytest.importorskip("mcap", reason="MCAP files need the extra mcap")
    from mcap.reader import make_reader

    found = set()
    for content in (turning_content, color_content, tracked_content):
        save_mcap(content, tmp_path / "a.mcap")
        with (tmp_path / "a.mcap").open("rb") as file:
            summary = make_reader(file).get_summary()
        assert summary is not None
        kinds = {number: schema.name.replace("/msg/", "/") for number, schema in summary.schemas.items()}
        found |= {(channel.topic, kinds[channel.schema_id]) for channel in summary.channels.values()}
    rows = set(re.findall(r"^\| `(/[^`]+)` \| `([^`]+)` \|", MCAP, re.MULTILINE))
    of_cameras = {row for row in found if row[0].startswith("/xtion1/")}
    assert found - of_cameras == rows
    assert of_cameras == {
        ("/xtion1/depth/image_raw", "sensor_msgs/Image"),
        ("/xtion1/rgb/image_raw/compressed", "sensor_msgs/CompressedImage"),
        ("/xtion1/depth/camera_info", "sensor_msgs/CameraInfo"),
        ("/xtion1/rgb/camera_info", "sensor_msgs/CameraInfo"),
    }
