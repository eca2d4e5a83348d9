"""The stage ``sensor``: what a made recording says of its noise, its pattern and the gripper."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from garment_dataset.stages.cameras import CAMERA
from garment_dataset.stages.decode_tables import FRAMES, GRIPPER
from garment_dataset.stages.depth_images import known_sensor, pattern_image
from garment_dataset.stages.pixel_pattern import PixelPatternParams, pixel_pattern
from garment_dataset.stages.sensor import SensorParams, sensor

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pyarrow as pa
    from numpy.typing import NDArray

    Image = NDArray[np.uint16]

TOPIC = "/xtion1/depth/image_raw"
SHAPE = (240, 320)
K = {"fx_px": 285.0, "fy_px": 284.0, "cx_px": 159.5, "cy_px": 119.5}
GRIPPER_M = (0.01, -0.25, 1.065)
NOISE_M, PATTERN_M = 0.004, 0.003


def scene(rng: np.random.Generator, fixed: NDArray[np.float64], *, wall: bool = True) -> Image:
    """Return a sheet before a wall, in whole millimetres, with white noise and a fixed pattern."""
    depth_m = np.full(SHAPE, 1.8 if wall else 0.0)
    depth_m[40:180, 120:200] = 1.065
    noisy_m = depth_m + (NOISE_M * rng.standard_normal(SHAPE) + PATTERN_M * fixed) * (depth_m / 1.065) ** 2
    image: Image = np.where(depth_m > 0, np.rint(1000 * noisy_m), 0).astype(np.uint16)
    return image


def build(spec: Any, rows: Sequence[dict[str, Any]]) -> pa.Table:
    table: pa.Table = spec.table({column.name: [row.get(column.name) for row in rows] for column in spec.columns})
    return table


def another(recorder: Any) -> Any:
    """Return a recorder of another bag."""
    number = len(list(recorder.path.parent.iterdir()))
    return type(recorder)(recorder.path.with_stem(f"Test_Free_{number:02}_pi16_0.5_R1"))


def run(
    recorder: Any,
    ros: Any,
    images: Sequence[Image],
    apart_m: tuple[float | None, ...] = (None,) * 3,
    moves: int = 99,
    empty: pa.Table | None = None,
) -> dict[str, Any]:
    """Return the row of a recording whose gripper rests up to frame ``moves``."""
    recorder = another(recorder)
    rows: list[dict[str, Any]] = [
        {"stream": "depth", "frame": frame, "stamp_ns": 33_333_333 * (frame + 1)} for frame in range(len(images))
    ]
    for row, image in zip(rows, images, strict=True):
        recorder.add(TOPIC, ros.image(row["stamp_ns"], "camera", image, "16UC1"))
    x_m, y_m, z_m = GRIPPER_M
    held = [{**row, "x_m": x_m, "y_m": y_m, "z_m": z_m - 0.01 * (row["frame"] >= moves)} for row in rows]
    size = {"frame_id": "camera", "width_px": SHAPE[1], "height_px": SHAPE[0]}
    camera = {"stream": "depth", **size, **K, "distortion_model": "plumb_bob", "distortion": [0.0] * 5, "matrix": "K"}
    table = sensor(
        recorder.write(),
        build(FRAMES, [{**row, "record_stamp_ns": 0, "topic": TOPIC} for row in rows]),
        build(CAMERA, [camera]),
        build(
            GRIPPER, [row | dict(zip(("apart_x_m", "apart_y_m", "apart_z_m"), apart_m, strict=True)) for row in held]
        ),
        SensorParams(),
        empty,
    )["sensor"]
    known = known_sensor(table, empty, SHAPE)  # what it says can be read
    (row,) = table.to_pylist()
    assert (known.pixels_per_m is None) == (row["pixel_share"] is None)
    assert (row["pixel_share"] is None) == (row["pixel_share_reason"] is not None)
    return row


def test_noise_and_pattern_are_measured(recorder: Any, ros: Any) -> None:
    rng = np.random.default_rng(0)
    fixed = rng.standard_normal(SHAPE)
    row = run(recorder, ros, [scene(rng, fixed) for _ in range(12)], moves=8)
    assert not row["openni_levels"]
    for name in ("noise_per_m", "noise_far_per_m"):
        assert row[name] == pytest.approx(NOISE_M / 1.065**2, rel=0.1)
    assert row["noise_correlation"] == pytest.approx(0, abs=0.05)
    assert row["pattern_pixels"][0] == 1
    assert row["pattern_per_m"][0] == pytest.approx(PATTERN_M / 1.065**2, rel=0.1)
    assert row["pattern_per_m"][-1] < 0.1 * row["pattern_per_m"][0]
    assert row["noise_reason"] is None
    assert row["gripper_x_error_m"] is None


def test_what_cannot_be_seen_is_null_with_a_reason(recorder: Any, ros: Any) -> None:
    rng = np.random.default_rng(1)
    images = [scene(rng, np.zeros(SHAPE), wall=False) for _ in range(4)]
    row = run(recorder, ros, images, moves=2)
    assert (row["noise_per_m"], row["noise_reason"]) == (None, "few_frames")
    assert (row["pattern_per_m"], row["pattern_reason"]) == (None, "no_plane")


def test_sources_that_disagree_make_the_gripper_uncertain(recorder: Any, ros: Any) -> None:
    """Two that err alike share the square of their distance evenly."""
    images = [scene(np.random.default_rng(2), np.zeros(SHAPE))] * 3
    row = run(recorder, ros, images, apart_m=(0.005, 0.0, 0.0))
    found_m = np.array([row[f"gripper_{axis}_error_m"] for axis in "xyz"])
    assert (found_m**2).sum() == pytest.approx(0.005**2 / 2)
    assert found_m[0] > found_m[1] == found_m[2] > 0


def empty_scene(
    recorder: Any, ros: Any, fixed: NDArray[np.float64], params: PixelPatternParams | None = None
) -> pa.Table:
    """Return the pattern of a wall, seen ten times."""
    recorder = another(recorder)
    rng = np.random.default_rng(5)
    rows = [{"stream": "depth", "frame": frame, "stamp_ns": 33_333_333 * (frame + 1)} for frame in range(10)]
    for row in rows:
        noise = NOISE_M * rng.standard_normal(SHAPE) + PATTERN_M * fixed
        image = np.rint(1000 * (1.8 + noise * (1.8 / 1.065) ** 2)).astype(np.uint16)
        recorder.add(TOPIC, ros.image(row["stamp_ns"], "camera", image, "16UC1"))
    size = {"frame_id": "camera", "width_px": SHAPE[1], "height_px": SHAPE[0]}
    camera = {"stream": "depth", **size, **K, "distortion_model": "plumb_bob", "distortion": [0.0] * 5, "matrix": "K"}
    frames = build(FRAMES, [{**row, "record_stamp_ns": 0, "topic": TOPIC} for row in rows])
    chosen = PixelPatternParams() if params is None else params
    return pixel_pattern(recorder.write(), frames, build(CAMERA, [camera]), chosen)["pixel_pattern"]


def test_the_pattern_of_the_empty_scene_is_used_as_far_as_the_garment_shows_it(recorder: Any, ros: Any) -> None:
    rng = np.random.default_rng(3)
    fixed = rng.standard_normal(SHAPE)
    empty = empty_scene(recorder, ros, fixed)
    image = pattern_image(empty)
    assert image.shape == SHAPE
    assert np.isfinite(image).mean() > 0.6
    scenes = [scene(rng, fixed) for _ in range(6)]
    plain, helped = (run(recorder, ros, scenes, empty=table) for table in (None, empty))
    assert plain["pixel_share_reason"] == "no_empty_scene"
    assert helped["pixel_share"] == pytest.approx(1, abs=0.06)
    assert helped["pattern_per_m"][0] < 0.6 * plain["pattern_per_m"][0]


def test_an_empty_scene_that_is_no_help_says_why(recorder: Any, ros: Any) -> None:
    """That of another camera; of images of another size; without two images."""
    rng = np.random.default_rng(4)
    scenes = [scene(rng, rng.standard_normal(SHAPE)) for _ in range(4)]
    other = empty_scene(recorder, ros, rng.standard_normal(SHAPE))
    late = empty_scene(recorder, ros, np.zeros(SHAPE), PixelPatternParams(from_s=5))
    assert late.num_rows == 0
    tables = {"not_predictive": other, "image_size": other.slice(1), "no_empty_scene": late}
    for reason, table in tables.items():
        assert run(recorder, ros, scenes, empty=table)["pixel_share_reason"] == reason
