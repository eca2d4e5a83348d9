"""The stage by its default method: rows, reasons and tables, as for the thesis' method."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from pydantic import ValidationError

from garment_dataset.stages.cameras import CAMERA
from garment_dataset.stages.decode_tables import FRAMES, GRIPPER
from garment_dataset.stages.depth_points import DepthPointsParams, depth_points

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import pyarrow as pa
    from numpy.typing import NDArray

    Image = NDArray[np.uint16]

TOPIC = "/xtion1/depth/image_raw"
K = {"fx_px": 285.0, "fy_px": 284.0, "cx_px": 159.5, "cy_px": 119.5}
SHAPE = (240, 320)
GRIPPER_M = (0.01, -0.25, 1.065)
PITCH_M = 1.065 / 284


def vertical(length_m: float, *, missing: slice | None = None) -> Image:
    """Return an image of cloth straight below the gripper, with rows that the sensor did not see."""
    below_m = (np.arange(SHAPE[0]) - K["cy_px"]) / K["fy_px"] * 1.065 - GRIPPER_M[1]
    depth_mm = np.zeros(SHAPE, np.uint16)
    depth_mm[(below_m >= 0) & (below_m <= length_m), 100:220] = 1065
    if missing is not None:
        depth_mm[missing] = 0
    return depth_mm


def stamp_ns(frame: int) -> int:
    return 1_391_700_000_000_000_000 + 33_333_333 * frame


def build(spec: Any, rows: Sequence[dict[str, Any]]) -> pa.Table:
    table: pa.Table = spec.table({column.name: [row.get(column.name) for row in rows] for column in spec.columns})
    return table


def run(recorder: Any, ros: Any, images: Sequence[Image], **knobs: Any) -> dict[str, pa.Table]:
    for frame, depth_mm in enumerate(images):
        recorder.add(TOPIC, ros.image(stamp_ns(frame), "camera", depth_mm, "16UC1"))
    bag: Path = recorder.write()
    rows = [{"stream": "depth", "frame": frame, "stamp_ns": stamp_ns(frame)} for frame in range(len(images))]
    place = dict(zip(("x_m", "y_m", "z_m"), GRIPPER_M, strict=True))
    size = {"frame_id": "camera", "width_px": SHAPE[1], "height_px": SHAPE[0]}
    camera = {"stream": "depth", **size, **K, "distortion_model": "plumb_bob", "distortion": [0.0] * 5, "matrix": "K"}
    return depth_points(
        bag,
        build(FRAMES, [{**row, "record_stamp_ns": 0, "topic": TOPIC} for row in rows]),
        build(CAMERA, [camera]),
        build(GRIPPER, [{**row, **place} for row in rows]),
        DepthPointsParams(**knobs),
    )


def test_it_is_the_default_and_finds_a_towel_of_64_cm(recorder: Any, ros: Any) -> None:
    """Every number is right to half a row of pixels at the end; the chain runs from the gripper to the hem."""
    tables = run(recorder, ros, [vertical(0.64)] * 6)
    assert DepthPointsParams().method == "profile"
    points = tables["points"].to_pandas()
    assert points["reason"].isna().all()
    shares = np.tile([0.1, 0.3, 0.5, 0.7, 0.9], 6)
    assert (np.abs(points["y_m"] - GRIPPER_M[1] - 0.64 * shares) <= shares * PITCH_M / 2 + 1e-9).all()
    np.testing.assert_allclose(points["x_m"], GRIPPER_M[0])
    np.testing.assert_allclose(points["z_m"], 1.065)
    np.testing.assert_allclose(points["arc_length_m"], shares * points["garment_length_m"])
    assert (points[["x_std_m", "y_std_m", "z_std_m"]] > 0).all(axis=None)
    middle_m = (159.5 - K["cx_px"]) / K["fx_px"] * 1.065
    np.testing.assert_allclose(points["material_x_m"], middle_m, atol=1e-9)
    np.testing.assert_allclose(points["material_y_m"], points["y_m"], atol=1e-9)
    np.testing.assert_allclose(points["material_z_m"], 1.065)
    chains = tables["chains"].to_pandas()
    first = chains[chains["frame"] == 0]
    assert first["y_m"].iloc[0] == GRIPPER_M[1]
    np.testing.assert_allclose(np.diff(first["y_m"])[:-1], 0.0025)
    assert first["arc_length_m"].iloc[-1] == points["garment_length_m"].iloc[0]
    assert (first["z_spread_m"].dropna() < 1e-9).all()


def test_frames_that_cannot_be_used_have_rows_with_a_reason(recorder: Any, ros: Any) -> None:
    tables = run(recorder, ros, [vertical(0.64), vertical(0.0), vertical(0.03), vertical(0.64)])
    points = tables["points"].to_pandas()
    reasons = points.groupby("frame")["reason"].first()
    assert reasons[[1, 2]].tolist() == ["no_pixels", "few_pixels"]
    assert reasons[[0, 3]].isna().all()
    numbers = points.drop(columns=["frame", "stamp_ns", "point", "reason", "length_reason", "pixels"])
    assert numbers[points["reason"].notna()].isna().all(axis=None)
    assert numbers[points["reason"].isna()].notna().all(axis=None)
    assert tables["chains"]["frame"].unique().to_pylist() == [0, 3]


def test_rows_that_are_missing_are_bridged(recorder: Any, ros: Any) -> None:
    whole = run(recorder, ros, [vertical(0.64)])["points"].to_pandas()
    recorder.rows.clear()
    tables = run(recorder, ros, [vertical(0.64, missing=slice(110, 122))])
    np.testing.assert_allclose(tables["points"].to_pandas()["y_m"], whole["y_m"], atol=1e-9)
    assert (tables["chains"]["pixels"].to_numpy() == 0).sum() == pytest.approx(12 * PITCH_M / 0.0025 + 5, abs=4)
    bridges_m = tables["chains"]["bridged_m"].to_numpy()
    assert bridges_m.max() == pytest.approx(13 * PITCH_M, abs=0.006)
    assert ((bridges_m > 0) == (tables["chains"]["pixels"].to_numpy() == 0)).all()
    assert bridges_m[:4] == pytest.approx(0.012, abs=0.006)  # the gripper's fingers can be in the way there


def test_parameters_that_cannot_be_are_refused() -> None:
    with pytest.raises(ValidationError, match="smoothing_frames"):
        DepthPointsParams(smoothing_frames=(3,))
    with pytest.raises(ValidationError, match="windows_px"):
        DepthPointsParams(windows_px=())
