"""What is written for Rerun is what the tables say, read back with Rerun's own reader."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest

from garment_dataset.bags import open_bag
from garment_dataset.errors import UsageError
from garment_dataset.features.reading import load_features
from garment_dataset.viewers import rerun_log
from garment_dataset.viewers.content import gather
from garment_dataset.viewers.rerun_log import save_rrd
from tests.conftest import START_NS
from tests.viewers.conftest import COLOR_NAME, DEPTH_NAME, FRAMES

if TYPE_CHECKING:
    from garment_dataset.viewers.content import Content
    from garment_dataset.workspace import Workspace

pytest.importorskip("rerun", reason="Rerun's files need the extra rerun")

DEPTH, COLOR = "/xtion1_depth_optical_frame", "/xtion1_rgb_optical_frame"


class Read:
    """What a file holds, by entity: rows of its own data, static ones apart."""

    def __init__(self, path: Path) -> None:
        from rerun.chunk import RrdReader

        reader = RrdReader(path)
        (self.recording,) = (entry.recording_id for entry in reader.recordings())
        self.blueprints = len(reader.blueprints())
        self.rows: dict[str, list[dict[str, Any]]] = {}
        self.static: dict[str, dict[str, Any]] = {}
        for chunk in reader.stream():
            rows = chunk.to_record_batch().to_pylist()
            if chunk.is_static:
                self.static.setdefault(str(chunk.entity_path), {}).update(rows[0])
            else:
                self.rows.setdefault(str(chunk.entity_path), []).extend(rows)
        for rows in self.rows.values():
            rows.sort(key=lambda row: row["time"])

    def at(self, entity: str, timeline: str, value: object) -> dict[str, Any]:
        (found,) = (row for row in self.rows[entity] if row[timeline] == value)
        return found


@pytest.fixture(scope="module")
def depth_read(depth_content: Content, tmp_path_factory: pytest.TempPathFactory) -> Read:
    path = tmp_path_factory.mktemp("rrd") / "depth.rrd"
    save_rrd(depth_content, path)
    assert [each.name for each in path.parent.iterdir()] == ["depth.rrd"]
    return Read(path)


@pytest.fixture(scope="module")
def color_read(color_content: Content, tmp_path_factory: pytest.TempPathFactory) -> Read:
    path = tmp_path_factory.mktemp("rrd") / "color.rrd"
    save_rrd(color_content, path)
    return Read(path)


def test_every_frame_of_every_entity_is_there(depth_read: Read) -> None:
    assert depth_read.recording == DEPTH_NAME
    (start,) = depth_read.static["/__properties"]["RecordingInfo:start_time"]
    assert start == START_NS
    assert depth_read.blueprints == 1
    per_frame = {
        *(f"{DEPTH}/depth_image/{name}" for name in ("depth_mm", "garment_mm")),
        *(f"{DEPTH}/{name}" for name in ("chain_m", "points_m", "points_2_std_m")),
        f"{DEPTH}/depth_gripper/end_point_m",
        f"{COLOR}/color_image/rgb",
    }
    assert {name: len(depth_read.rows[name]) for name in per_frame} == dict.fromkeys(per_frame, FRAMES)
    curves = {f"/{column}/{name}" for column in ("z_m", "vz_m_s") for name in ("gripper", "point_1", "point_5")}
    assert curves | {f"{name}/2_std" for name in curves} <= depth_read.rows.keys()
    assert {"/gripper_m/x", "/gripper_m/y", "/gripper_m/z", "/joints_rad/r2_joint_b"} <= depth_read.rows.keys()


def test_a_point_is_where_and_when_the_table_says(depth_read: Read, shown: Workspace) -> None:
    points = load_features("points", folder=shown.features_dir, recording=DEPTH_NAME)
    for frame in (0, 17):
        rows = points.query("frame == @frame").sort_values("point")
        logged = depth_read.at(f"{DEPTH}/points_m", "depth_frame", frame)
        assert START_NS + logged["time"].value == rows["stamp_ns"].iloc[0]
        assert logged["Points3D:labels"] == [str(number) for number in rows["point"]]
        np.testing.assert_allclose(logged["Points3D:positions"], rows[["x_m", "y_m", "z_m"]], atol=1e-7)
        around = depth_read.at(f"{DEPTH}/points_2_std_m", "depth_frame", frame)
        np.testing.assert_allclose(
            around["Ellipsoids3D:half_sizes"], 2 * rows[["x_std_m", "y_std_m", "z_std_m"]], atol=1e-7
        )


def test_time_counts_from_the_first_image(depth_read: Read, shown: Workspace) -> None:
    frames = load_features("frames", folder=shown.features_dir, recording=DEPTH_NAME)
    for stream, entity in {"depth": f"{DEPTH}/depth_image/depth_mm", "color": f"{COLOR}/color_image/rgb"}.items():
        stamps_ns = frames.loc[frames["stream"] == stream, "stamp_ns"].to_numpy(np.int64)
        assert _times_ns(depth_read.rows[entity]) == (stamps_ns - START_NS).tolist()
        # colour images follow the depth image of the same number by 2 ms
        assert [row["depth_frame"] for row in depth_read.rows[entity]] == list(range(FRAMES))


def test_curves_hold_when_and_what_the_table_says(depth_read: Read, shown: Workspace) -> None:
    rows = load_features("kinematics", folder=shown.features_dir, recording=DEPTH_NAME, point=3)
    for column, stamp in (("z_m", "stamp_ns"), ("vz_m_s", "velocity_stamp_ns")):
        kept = rows.dropna(subset=[stamp])
        logged = depth_read.rows[f"/{column}/point_3"]
        assert _times_ns(logged) == (kept[stamp].to_numpy(np.int64) - START_NS).tolist()
        values = np.array([row["Scalars:scalars"] for row in logged])
        np.testing.assert_array_equal(values[:, 0], kept[column])
        band = np.array([row["Scalars:scalars"] for row in depth_read.rows[f"/{column}/point_3/2_std"]])
        std = kept[f"{column.split('_')[0]}_std_{column.split('_', 1)[1]}"]
        np.testing.assert_allclose(np.diff(band, axis=1)[:, 0], 4 * std, atol=1e-12)


def test_depth_loses_nothing_and_the_garment_is_cut_out_of_it(depth_read: Read, sample_bags: dict[str, Path]) -> None:
    with open_bag(sample_bags[DEPTH_NAME]) as bag:
        pixels = [image.pixels().copy() for image in bag.images("/xtion1/depth/image_raw", "depth")]
    for number in (0, FRAMES - 1):
        logged = depth_read.at(f"{DEPTH}/depth_image/depth_mm", "depth_frame", number)
        np.testing.assert_array_equal(_image(logged["EncodedDepthImage:blob"]), pixels[number])
        seen = _image(depth_read.at(f"{DEPTH}/depth_image/garment_mm", "depth_frame", number)["EncodedDepthImage:blob"])
        np.testing.assert_array_equal(seen, np.where(pixels[number] < 2000, pixels[number], 0))


def test_pixels_are_counted_as_rerun_counts_them(depth_read: Read, color_read: Read, shown: Workspace) -> None:
    k = depth_read.static[f"{DEPTH}/depth_image"]["Pinhole:image_from_camera"][0]
    assert k[6:8] == [80.5, 60.5]  # column by column; the centre of the first pixel is at a half
    curve = load_features("central_curves", folder=shown.features_dir, recording=COLOR_NAME, frame=2)
    logged = color_read.at(f"{COLOR}/color_image/central_curve_px", "color_frame", 2)
    np.testing.assert_allclose(logged["LineStrips2D:strips"][0], curve[["u_px", "v_px"]] + 0.5, atol=1e-4)


def test_silhouettes_are_logged_as_they_are(color_read: Read, shown: Workspace) -> None:
    masks = load_features("silhouettes", folder=shown.features_dir, recording=COLOR_NAME)
    logged = color_read.rows[f"{COLOR}/color_image/mask"]
    assert [bytes(row["EncodedImage:blob"][0]) for row in logged] == masks["mask"].tolist()
    outline = color_read.rows[f"{COLOR}/color_image/outline_px"][0]["LineStrips2D:strips"][0]
    assert outline[0] == outline[-1]
    assert len(outline) == len(masks["outline_u_px"][0]) + 1


def test_the_gripper_has_a_frame_where_it_is_known_how_it_is_turned(turning_content: Content, tmp_path: Path) -> None:
    save_rrd(turning_content, tmp_path / "turning.rrd")
    read = Read(tmp_path / "turning.rrd")
    rows = turning_content.tables["gripper"].query("stream == 'depth' and frame == 9").iloc[0]
    logged = read.at(f"{DEPTH}/depth_gripper/frame", "depth_frame", 9)
    np.testing.assert_allclose(logged["Transform3D:translation"][0], rows[["x_m", "y_m", "z_m"]].tolist(), atol=1e-7)
    turn = rows[["qx", "qy", "qz", "qw"]].tolist()
    np.testing.assert_allclose(logged["Transform3D:quaternion"][0], turn, atol=1e-7)
    unknown = read.at(f"{DEPTH}/depth_gripper/frame", "depth_frame", 4)
    assert unknown["Clear:is_recursive"] == [False]
    assert not unknown.get("Transform3D:quaternion")
    np.testing.assert_allclose(read.static[COLOR]["Transform3D:translation"][0], [0.025, 0, 0], atol=1e-9)


def test_names_of_frames_may_be_odd_and_alike(odd_content: Content, tmp_path: Path) -> None:
    save_rrd(odd_content, tmp_path / "odd.rrd")
    read = Read(tmp_path / "odd.rrd")
    (root,) = (name.removesuffix("/points_m") for name in read.rows if name.endswith("/points_m"))
    assert root.replace("\\", "") == "/rig/cam (1) optical"
    assert root.count("/") == 2
    assert len(read.rows[f"{root}/color_image/rgb"]) == len(read.rows[f"{root}/depth_image/depth_mm"]) == FRAMES
    assert "Transform3D:translation" not in read.static[root]  # it is not beside itself


def test_without_the_bag_there_are_features_only(shown: Workspace, tmp_path: Path) -> None:
    row = shown.catalog().row(DEPTH_NAME)
    content = gather(shown, dataclasses.replace(row, path=None))
    assert "the bag of" in content.left_out[0]
    save_rrd(content, tmp_path / "features.rrd")
    read = Read(tmp_path / "features.rrd")
    assert len(read.rows[f"{DEPTH}/points_m"]) == FRAMES
    assert not any("depth_mm" in name or "rgb" in name.rpartition("/")[2] for name in read.rows)


def test_the_viewer_is_given_a_whole_file_that_is_gone_when_it_closes(
    depth_content: Content, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = (
        f"import shutil, sys; shutil.copy(sys.argv[-1], {str(tmp_path)!r}); "
        f"open({str(tmp_path / 'where')!r}, 'w').write(sys.argv[-1])"
    )
    monkeypatch.setattr(rerun_log, "VIEWER", (sys.executable, "-c", copy))
    rerun_log.open_viewer(depth_content)
    assert len(Read(tmp_path / f"{DEPTH_NAME}.rrd").rows[f"{DEPTH}/points_m"]) == FRAMES
    assert not Path((tmp_path / "where").read_text()).parent.exists()


def test_a_viewer_that_does_not_start_is_one_line(depth_content: Content, monkeypatch: pytest.MonkeyPatch) -> None:
    fail = "import sys; sys.stderr.write('INFO: begin\\nError: no X server\\n'); sys.exit(1)"
    monkeypatch.setattr(rerun_log, "VIEWER", (sys.executable, "-c", fail))
    with pytest.raises(UsageError, match=r"^the viewer does not start: found Error: no X server\. --save"):
        rerun_log.open_viewer(depth_content)


def _times_ns(rows: list[dict[str, Any]]) -> list[int]:
    return [row["time"].value for row in rows]


def _image(blob: Any) -> Any:
    return cv2.imdecode(np.frombuffer(bytes(blob[0]), np.uint8), cv2.IMREAD_UNCHANGED)
