"""Clouds for other estimators: what is written is what was seen, for plain numpy and for Open3D."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset import load_features
from garment_dataset.clouds.rest_mesh import flat_mesh
from garment_dataset.clouds.writing import Form, Written, write_clouds
from garment_dataset.errors import StoreError
from garment_dataset.snapshot.sums import compare, sums_of
from tests.conftest import RECORDINGS, make_workspace

if TYPE_CHECKING:
    from garment_dataset.workspace import Workspace

TOWEL, _, SCARF = RECORDINGS
PAGE = Path(__file__).parents[2] / "docs" / "clouds.md"
SNIPPETS = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory, sample_bags: dict[str, Path]) -> Workspace:
    made = make_workspace(tmp_path_factory.mktemp("clouds") / "ws")
    for name, path in sample_bags.items():
        (made.recordings_dir / f"{name}.bag").symlink_to(path)
    made.build(jobs=0)
    return made


def export(workspace: Workspace, folder: Path, *filters: str, form: Form | None = None) -> Written:
    return write_clouds(workspace.catalog().some(filters), workspace, folder, form or Form())


@pytest.fixture(scope="module")
def exported(built: Workspace, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exported") / "clouds"
    written = export(built, folder)
    assert set(written.recordings) == set(RECORDINGS)
    assert not written.failed
    return folder


def meta(folder: Path, name: str = TOWEL) -> dict[str, Any]:
    said: dict[str, Any] = json.loads((folder / "meta.json").read_text())["recordings"][name]
    return said


def test_points_lie_on_the_rays_of_their_pixels_and_masks_are_these_pixels(exported: Path) -> None:
    said, arrays = meta(exported), np.load(exported / TOWEL / "clouds.npz")
    k = np.array(said["K"])
    assert len(arrays["points_m"]) == arrays["offsets"][-1] > 1000
    homogeneous = np.column_stack([arrays["pixels_uv"], np.ones(len(arrays["pixels_uv"]))])
    rays = homogeneous @ np.linalg.inv(k).T
    np.testing.assert_allclose(arrays["points_m"], rays * arrays["points_m"][:, 2:], rtol=0, atol=1e-6)
    for number, frame in enumerate(arrays["frame"]):
        mask = cv2.imread(str(exported / TOWEL / "masks" / f"{frame:06}.png"), cv2.IMREAD_GRAYSCALE)
        assert mask is not None
        assert list(mask.shape[::-1]) == said["image_size_px"]
        part = slice(*arrays["offsets"][number : number + 2])
        seen = np.zeros(mask.shape, np.bool_)
        seen[arrays["pixels_uv"][part, 1], arrays["pixels_uv"][part, 0]] = True
        np.testing.assert_array_equal(seen, mask > 0)


def test_times_and_gripper_are_those_of_the_tables(built: Workspace, exported: Path) -> None:
    arrays = np.load(exported / TOWEL / "clouds.npz")
    table = load_features("gripper", folder=built.features_dir, recording=TOWEL, stream="depth").set_index("frame")
    rows = table.loc[arrays["frame"]]
    np.testing.assert_array_equal(arrays["stamp_ns"], rows["stamp_ns"])
    np.testing.assert_array_equal(arrays["controller_points"][:, 0], rows[["x_m", "y_m", "z_m"]])
    np.testing.assert_array_equal(arrays["controller_quaternions_xyzw"][:, 0], rows[["qx", "qy", "qz", "qw"]])
    np.testing.assert_allclose(arrays["time_s"], (arrays["stamp_ns"] - meta(exported)["start_stamp_ns"]) / 1e9)


def test_the_chain_lies_in_its_cloud(built: Workspace, exported: Path) -> None:
    """Each measured point of the profile has cloth near it: the two come from one image and one calibration."""
    arrays = np.load(exported / TOWEL / "clouds.npz")
    points = load_features("points", folder=built.features_dir, recording=TOWEL).dropna(subset=["x_m"])
    for number, frame in enumerate(arrays["frame"]):
        cloud_m = arrays["points_m"][slice(*arrays["offsets"][number : number + 2])]
        for point_m in points[points["frame"] == frame][["x_m", "y_m", "z_m"]].to_numpy():
            assert np.linalg.norm(cloud_m - point_m, axis=1).min() < 0.01


def test_open3d_reads_the_same(exported: Path) -> None:
    open3d = pytest.importorskip("open3d", reason="no Open3D, or no libusb-1.0 for it", exc_type=ImportError)
    arrays = np.load(exported / TOWEL / "clouds.npz")
    for number, frame in enumerate(arrays["frame"]):
        cloud = open3d.io.read_point_cloud(str(exported / TOWEL / "clouds" / f"{frame:06}.ply"))
        part = arrays["points_m"][slice(*arrays["offsets"][number : number + 2])]
        np.testing.assert_array_equal(np.asarray(cloud.points, np.float32), part)
    said = meta(exported)
    mesh = open3d.io.read_triangle_mesh(str(exported / said["rest_mesh"]))
    assert mesh.is_edge_manifold(allow_boundary_edges=True)
    assert mesh.is_orientable()
    assert mesh.get_surface_area() == pytest.approx(said["width_m"] * said["height_m"], rel=1e-6)


@pytest.mark.parametrize("snippet", SNIPPETS, ids=["numpy", "open3d"])
def test_the_snippets_of_the_page_run(exported: Path, snippet: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if "open3d" in snippet:
        pytest.importorskip("open3d", reason="no Open3D, or no libusb-1.0 for it", exc_type=ImportError)
    monkeypatch.chdir(exported)
    names: dict[str, Any] = {}
    exec(compile(snippet, str(PAGE), "exec"), names)
    assert len(names["cloud_m"]) > 100


def test_what_is_not_known_of_a_garment_is_null_with_a_reason(exported: Path) -> None:
    towel, scarf = meta(exported), meta(exported, SCARF)
    assert towel["areal_density_kg_m2"] == pytest.approx(towel["weight_kg"] / towel["width_m"] / towel["height_m"])
    assert towel["reason"] is None
    assert (scarf["areal_density_kg_m2"], scarf["rest_mesh"]) == (None, None)
    assert scarf["reason"] == "its size is not in the catalog"
    assert not (exported / SCARF / "rest_mesh.ply").exists()


def test_the_same_recording_gives_the_same_bytes(built: Workspace, exported: Path, tmp_path: Path) -> None:
    export(built, tmp_path / "again")
    assert sums_of(tmp_path / "again") == sums_of(exported)
    assert not compare(exported)
    text = b"".join(path.read_bytes() for path in exported.rglob("*") if path.is_file())
    assert str(built.root).encode() not in text


def test_one_of_so_many_frames(built: Workspace, exported: Path, tmp_path: Path) -> None:
    export(built, tmp_path / "some", TOWEL, form=Form(every=5, ply=False))
    some, all_of_them = (np.load(folder / TOWEL / "clouds.npz") for folder in (tmp_path / "some", exported))
    np.testing.assert_array_equal(some["frame"], all_of_them["frame"][::5])
    assert not (tmp_path / "some" / TOWEL / "clouds").exists()
    assert len(list((tmp_path / "some" / TOWEL / "masks").iterdir())) == len(some["frame"])


def test_a_broken_recording_does_not_stop_the_others(
    built: Workspace, exported: Path, tmp_path: Path, sample_bags: dict[str, Path]
) -> None:
    bag = built.recordings_dir / f"{TOWEL}.bag"
    bag.unlink()
    bag.write_bytes(b"no bag at all")
    try:
        written = export(built, tmp_path / "out")
        with pytest.raises(StoreError, match="nothing to export"):
            export(built, tmp_path / "none", TOWEL)
    finally:
        bag.unlink()
        bag.symlink_to(sample_bags[TOWEL])
    assert set(written.recordings) == set(RECORDINGS) - {TOWEL}
    assert TOWEL in written.failed[TOWEL]
    assert json.loads((tmp_path / "out" / "meta.json").read_text())["left_out"] == written.failed
    assert not (tmp_path / "out" / TOWEL).exists()
    assert not (tmp_path / "none").exists()
    assert not compare(exported), "what was written before is as it was"


@given(width_m=st.floats(0.05, 2), height_m=st.floats(0.05, 2), pitch_m=st.floats(0.02, 0.5))
def test_a_sheet_is_covered_once_all_faces_turned_alike(width_m: float, height_m: float, pitch_m: float) -> None:
    mesh = flat_mesh(width_m, height_m, pitch_m)
    a, b, c = mesh.vertices_m[mesh.faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    assert (normals[:, 2] > 0).all()
    assert normals[:, 2].sum() / 2 == pytest.approx(width_m * height_m)
    assert set(mesh.faces.ravel()) == set(range(len(mesh.vertices_m)))
    edges = np.sort(np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert set(counts) <= {1, 2}
    assert len(mesh.vertices_m) - len(counts) + len(mesh.faces) == 1  # Euler: a disc
