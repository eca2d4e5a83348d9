from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pytest

from garment_dataset.engine.table import Label
from garment_dataset.errors import BagError, DataWarning
from garment_dataset.stages.cameras import CAMERA
from garment_dataset.stages.decode_tables import FRAMES, GRIPPER
from garment_dataset.stages.depth_points import DepthPointsParams, depth_points
from garment_dataset.stages.depth_tables import CHAINS, POINTS
from garment_dataset.stages.stage import IDENTITY
from garment_dataset.vision.depth.cloud import Intrinsics
from garment_dataset.vision.depth.trace import trace_windows

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import pyarrow as pa
    from numpy.typing import NDArray

    Image = NDArray[np.uint16]
    WriteBag = Callable[..., Path]

TOPIC = "/xtion1/depth/image_raw"
K = {"fx_px": 285.0, "fy_px": 284.0, "cx_px": 159.5, "cy_px": 119.5}
SHAPE = (240, 320)
THESIS = DepthPointsParams(method="thesis")
GRIPPER_M = (0.01, -0.25, 1.065)
PITCH_M = 1.065 / 284
LABELS = [
    Label(column, value)
    for column, value in zip(IDENTITY, ("Made_Free_pi16_0.5_R1", "R", 0.5, None, None), strict=True)
]


def vertical(*spans_m: tuple[float, float], z_mm: int = 1065) -> Image:
    """Return an image of cloth at one depth, in spans of distance below the gripper."""
    below_m = (np.arange(SHAPE[0]) - K["cy_px"]) / K["fy_px"] * z_mm / 1000 - GRIPPER_M[1]
    there = np.any([(start <= below_m) & (below_m <= stop) for start, stop in spans_m], axis=0)
    depth_mm = np.zeros(SHAPE, np.uint16)
    depth_mm[there, 100:220] = z_mm
    return depth_mm


@pytest.fixture
def write_bag(recorder: Any, ros: Any) -> WriteBag:
    """Write a bag of these depth images."""

    def write(*images: Image, topic: str = TOPIC) -> Path:
        for frame, depth_mm in enumerate(images):
            recorder.add(topic, ros.image(stamp_ns(frame), "camera", depth_mm, "16UC1"))
        path: Path = recorder.write()
        return path

    return write


def stamp_ns(frame: int) -> int:
    return 1_391_700_000_000_000_000 + 33_333_333 * frame


def table_of(spec: Any, rows: Sequence[dict[str, Any]]) -> pa.Table:
    """Return a table as the engine hands it on, its identity columns in front; columns not given are null."""
    columns = {column.name: [row.get(column.name) for row in rows] for column in spec.columns}
    table: pa.Table = spec.labelled(spec.table(columns), LABELS)
    return table


def frames_table(count: int, faulty: Sequence[int] = (), topic: str = TOPIC) -> pa.Table:
    rows = [
        {
            "stream": stream,
            "frame": frame,
            "stamp_ns": stamp_ns(frame),
            "record_stamp_ns": 0,
            "topic": topic,
            "fault": "torn" if frame in faulty and stream == "depth" else None,
        }
        for stream in ("depth", "color")
        for frame in range(count)
    ]
    return table_of(FRAMES, rows)


def camera_table(height_px: int = SHAPE[0], stream: str = "depth") -> pa.Table:
    size = {"frame_id": "camera", "width_px": SHAPE[1], "height_px": height_px}
    row = {"stream": stream, **size, **K, "distortion_model": "plumb_bob", "distortion": [0.0] * 5, "matrix": "K"}
    return table_of(CAMERA, [{**row, "stream": "color", "fx_px": 1.0}, row])


def gripper_table(count: int, unknown: Sequence[int] = ()) -> pa.Table:
    rows = []
    for frame in range(count):
        place = dict(zip(("x_m", "y_m", "z_m"), GRIPPER_M, strict=True)) if frame not in unknown else {"reason": "past"}
        row = {"frame": frame, "stamp_ns": stamp_ns(frame)}
        rows.append({**row, "stream": "depth", **place})
        rows.append({**row, "stream": "color", "x_m": 9.0, "y_m": 9.0, "z_m": 9.0})
    return table_of(GRIPPER, rows)


def run(bag: Path, count: int, params: DepthPointsParams | None = None) -> dict[str, pa.Table]:
    """Run the stage on a bag without faults."""
    return depth_points(bag, frames_table(count), camera_table(), gripper_table(count), params or THESIS)


def test_a_vertical_towel_of_64_cm(write_bag: WriteBag) -> None:
    """The last sample is up to a step above the last row, and that up to a pitch above the end of the cloth."""
    tables = run(write_bag(vertical((0, 0.64))), 1)
    points = tables["points"].to_pandas()
    assert points["point"].tolist() == [1, 2, 3, 4, 5]
    below_m = points["y_m"] - GRIPPER_M[1]
    share = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
    short_m = 0.64 * share - below_m
    assert (short_m >= -1e-9).all()
    assert (short_m <= share * (0.0025 + PITCH_M)).all()
    np.testing.assert_allclose(points["z_m"], 1.065)
    np.testing.assert_allclose(points["garment_length_m"], points["arc_length_m"].iloc[-1] / 0.9)
    chains = tables["chains"].to_pandas()
    assert chains["sample"].tolist() == list(range(len(chains)))
    np.testing.assert_allclose(np.diff(chains["y_m"]), 0.0025)
    assert chains["arc_length_m"].iloc[-1] == points["garment_length_m"].iloc[0]
    assert chains["z_spread_m"].tolist() == [0] * len(chains)


def test_frames_that_cannot_be_used_have_rows_with_a_reason_or_none(write_bag: WriteBag) -> None:
    images = [
        vertical((0, 0.64)),
        vertical((0, 0.64)),  # faulty by the table
        vertical((0, 0.64)),  # gripper unknown
        vertical(),
        vertical((0.1, 0.64)),
        vertical((0, 0.03)),
        np.ascontiguousarray(vertical((0, 0.64))[:-1]),
        vertical((0, 0.64)),
    ]
    bag = write_bag(*images)
    tables = depth_points(bag, frames_table(8, faulty=[1]), camera_table(), gripper_table(8, unknown=[2]), THESIS)
    points = tables["points"].to_pandas()
    assert points["frame"].tolist() == [frame for frame in (0, 2, 3, 4, 5, 6, 7) for _ in range(5)]
    assert points["stamp_ns"].tolist() == [stamp_ns(frame) for frame in points["frame"]]
    reasons = points.groupby("frame")["reason"].first()
    assert reasons[[2, 3, 4, 5, 6]].tolist() == ["no_gripper", "no_pixels", "gap", "short", "image_size"]
    assert reasons[[0, 7]].isna().all()
    material = [f"material_{axis}_m" for axis in "xyz"]
    assert points[material].isna().all(axis=None)
    numbers = points.drop(columns=["frame", "stamp_ns", "point", "reason", "length_reason", "pixels", *material])
    assert numbers[points["reason"].notna()].isna().all(axis=None)
    assert numbers[points["reason"].isna()].notna().all(axis=None)
    assert (points.loc[points["reason"].notna(), "pixels"] == 0).all()
    assert numbers[points["frame"] == 0].equals(numbers[points["frame"] == 7].set_axis(range(5)))
    assert tables["chains"]["frame"].unique().to_pylist() == [0, 5, 7]


def test_a_long_gap_ends_the_garment_and_is_announced(write_bag: WriteBag) -> None:
    bag = write_bag(vertical((0, 0.64)), vertical((0, 0.3), (0.4, 0.64)))
    with pytest.warns(DataWarning, match=r"\.bag: in 1 of 2 depth frames the chain ends at a gap, first in frame 1"):
        tables = run(bag, 2)
    lengths_m = tables["points"]["garment_length_m"].to_numpy()[::5]
    assert 0.64 - 0.0025 - PITCH_M <= lengths_m[0] <= 0.64
    assert np.isnan(lengths_m[1])
    assert tables["points"]["length_reason"].to_pylist() == [None] * 5 + ["gap"] * 5
    seen_m = tables["points"]["arc_length_m"].to_numpy()[-1] / 0.9
    assert 0.3 - 0.0025 - PITCH_M <= seen_m <= 0.3 + 0.005  # the last window reaches past the last row
    bridged = run(bag, 2, DepthPointsParams(method="thesis", max_gap_m=0.1))
    lengths_m = bridged["points"]["garment_length_m"].to_numpy()[::5]
    assert lengths_m[0] == pytest.approx(lengths_m[1], abs=1e-12)
    chains = bridged["chains"].to_pandas()
    assert (chains.loc[chains["frame"] == 1, "pixels"] == 0).sum() == pytest.approx(0.09 / 0.0025, abs=4)
    assert chains["z_spread_m"].isna().equals(chains["pixels"] == 0)


def test_what_is_outside_band_and_strip_and_above_the_gripper_changes_no_number(write_bag: WriteBag) -> None:
    bare = vertical((0, 0.64))
    crowded = np.where(bare == 0, np.uint16(2500), bare)
    crowded[:, :130] = 1065
    crowded[:, 200:] = 900
    crowded[:30] = 1065
    tables = run(write_bag(bare, crowded), 2)
    for table in tables.values():
        rows = table.to_pandas().drop(columns=["frame", "stamp_ns"])
        half = len(rows) // 2
        assert half > 0
        assert rows[:half].equals(rows[half:].set_axis(range(half)))


def test_the_number_of_points_is_a_parameter(write_bag: WriteBag) -> None:
    points = run(write_bag(vertical((0, 0.64))), 1, DepthPointsParams(method="thesis", point_count=2))["points"]
    assert points["point"].to_pylist() == [1, 2]
    assert points["y_m"].to_numpy() - GRIPPER_M[1] == pytest.approx([0.16, 0.48], abs=0.0025 + PITCH_M)


def test_few_pixels() -> None:
    depth_mm = vertical((0, 0.64))
    depth_mm[:, ::4] = 0
    trace = trace_windows(
        depth_mm, Intrinsics(**K), GRIPPER_M, DepthPointsParams(method="thesis", min_pixels=1000).window_settings()
    )
    assert (trace.chain, trace.points, trace.reason) == (None, None, "few_pixels")


def test_no_usable_depth_frame_gives_empty_tables_without_opening_the_bag(tmp_path: Path) -> None:
    frames = frames_table(2, faulty=[0, 1])
    tables = depth_points(tmp_path / "none.bag", frames, camera_table(), gripper_table(0), THESIS)
    assert {name: table.num_rows for name, table in tables.items()} == {"chains": 0, "points": 0}
    for spec in (CHAINS, POINTS):
        spec.labelled(tables[spec.name], LABELS)


def test_images_come_from_the_topic_that_decode_found_and_a_missing_camera_is_said(write_bag: WriteBag) -> None:
    bag = write_bag(vertical((0, 0.64)), topic="/other")
    with pytest.raises(BagError, match="no camera for the depth images"):
        depth_points(bag, frames_table(1), camera_table(stream="infra"), gripper_table(1), THESIS)
    tables = depth_points(bag, frames_table(1, topic="/other"), camera_table(), gripper_table(1), THESIS)
    assert tables["points"].num_rows == 5


@pytest.mark.real
@pytest.mark.skipif("GARMENT_REAL_DATA" not in os.environ, reason="GARMENT_REAL_DATA names no folder of recordings")
@pytest.mark.parametrize("method", ["thesis", "profile"])
def test_points_lie_on_real_cloth(method: Literal["thesis", "profile"]) -> None:
    """In every frame of garments on a floor: the depth image around a point's pixel agrees with the point."""
    from garment_dataset.bags import open_bag
    from garment_dataset.stages.decode import DecodeParams, decode

    bag = Path(os.environ["GARMENT_REAL_DATA"]) / "recordings" / "RealGarments_Floor_01_pi16_0.1_R1.bag"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        decoded = decode(bag, DecodeParams())
    params = DepthPointsParams(method=method, hold_reach_m=0.2)  # the end point sweeps over the floor, up to 15 cm off
    tables = depth_points(bag, decoded["frames"], decoded["camera"], decoded["gripper"], params)
    camera = decoded["camera"].to_pylist()[0]
    points = tables["points"].to_pandas()
    assert len(points) == 15
    assert points["reason"].isna().all()
    u_px = (camera["cx_px"] + camera["fx_px"] * points["x_m"] / points["z_m"]).round().astype(int)
    v_px = (camera["cy_px"] + camera["fy_px"] * points["y_m"] / points["z_m"]).round().astype(int)
    with open_bag(bag) as opened:
        for image in opened.images(TOPIC, "depth"):
            depth_m = image.pixels() / 1000
            for row in np.flatnonzero(points["frame"] == image.index):
                around_m = depth_m[v_px[row] - 2 : v_px[row] + 3, u_px[row] - 10 : u_px[row] + 11]
                # between its neighbours, by a step of the sensor: on a fold, a median is no better known than the point
                low_m, high_m = np.quantile(around_m[around_m > 0], [0.1, 0.9])
                assert low_m - 0.0034 <= points["z_m"][row] <= high_m + 0.0034


@pytest.mark.real
@pytest.mark.skipif("GARMENT_REAL_DATA" not in os.environ, reason="GARMENT_REAL_DATA names no folder of recordings")
@pytest.mark.parametrize("hold_reach_m", [None, 0.5])
@pytest.mark.parametrize("method", ["thesis", "profile"])
@pytest.mark.parametrize("name", ["RealGarments_Floor_01_pi16_0.1_R1", "RealGrabber_Desk_01_pi16_0.1_R1"])
def test_no_point_in_mid_air_in_real_scenes(name: str, method: str, hold_reach_m: float | None) -> None:
    """Near every point there is measured depth, or its uncertainty says how far; also where nothing is held."""
    from garment_dataset.bags import open_bag
    from garment_dataset.stages.decode import DecodeParams, decode

    bag = Path(os.environ["GARMENT_REAL_DATA"]) / "recordings" / f"{name}.bag"
    knobs = {} if hold_reach_m is None else {"hold_reach_m": hold_reach_m}
    params = DepthPointsParams.model_validate({"method": method, "point_count": 20, **knobs})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        decoded = decode(bag, DecodeParams())
        tables = depth_points(bag, decoded["frames"], decoded["camera"], decoded["gripper"], params)
    camera = decoded["camera"].to_pylist()[0]
    points = tables["points"].to_pandas()
    assert (points["z_m"].isna() == points["reason"].notna()).all()
    with open_bag(bag) as opened:
        for image in opened.images(TOPIC, "depth"):
            depth_m = image.pixels().astype(np.float64) / 1000
            v_px, u_px = np.nonzero(depth_m)
            z_m = depth_m[v_px, u_px]
            rays = np.stack([(u_px - camera["cx_px"]) / camera["fx_px"], (v_px - camera["cy_px"]) / camera["fy_px"]])
            cloud_m = np.concatenate([rays * z_m, z_m[None]])
            found = points[(points["frame"] == image.index) & points["z_m"].notna()]
            places_m, stds_m = (found[[f"{axis}{kind}_m" for axis in "xyz"]].to_numpy() for kind in ("", "_std"))
            for place_m, std_m in zip(places_m, stds_m, strict=True):
                away_m = np.sqrt(((cloud_m - place_m[:, None]) ** 2).sum(axis=0)).min()
                assert away_m <= 3 * np.sqrt((std_m**2).sum()) + place_m[2] ** 2 / 342.205
