"""The profile method on made sheets: known answers, and less error than the thesis' method where there is noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest

from garment_dataset.stages.depth_points import DepthPointsParams
from garment_dataset.vision.depth.cloud import LEVEL_SPACING_PER_M, Intrinsics
from garment_dataset.vision.depth.flat_field import (
    column_offsets,
    column_std_per_m,
    inverse_depth_table,
    ladder_per_m,
)
from garment_dataset.vision.depth.smoothing import adaptive_mean
from garment_dataset.vision.depth.trace import trace_profiles, trace_windows

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Image = NDArray[np.uint16]
    FloatArray = NDArray[np.float64]

K = Intrinsics(fx_px=570.3, fy_px=570.3, cx_px=319.5, cy_px=239.5)
SHAPE = (480, 640)
GRIPPER_M = (0.01, -0.35, 1.065)
LENGTH_M = 0.64
SHARES = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
WALL_M = 1.8
LADDER = ladder_per_m()
LEVELS_MM = np.flatnonzero(LADDER)
PITCH_M = 1.065 / 570.3

SHEETS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "straight": np.zeros_like,
    "tilted": lambda below_m: 0.1 * below_m,
    "sine": lambda below_m: 0.02 * np.sin(2 * np.pi * below_m / 0.5),
}


def depth_m(
    sheet: Callable[[FloatArray], FloatArray], lean: float = 0.0, gripper_x_m: float = GRIPPER_M[0]
) -> FloatArray:
    """Return the exact depth of a sheet that hangs from the gripper, 0.3 m wide, before a wall."""
    v, u = np.indices(SHAPE, dtype=np.float64)
    z_m = np.full(SHAPE, GRIPPER_M[2])
    for _ in range(30):
        x_m, y_m = (u - K.cx_px) / K.fx_px * z_m, (v - K.cy_px) / K.fy_px * z_m
        z_m = GRIPPER_M[2] + sheet(y_m - GRIPPER_M[1]) + lean * (x_m - gripper_x_m)
    end_m = profile_end_m(sheet)
    there = (y_m >= GRIPPER_M[1]) & (y_m <= GRIPPER_M[1] + end_m) & (np.abs(x_m - gripper_x_m) < 0.15)
    return np.where(there, z_m, WALL_M)


def fine_line(sheet: Callable[[FloatArray], FloatArray]) -> tuple[FloatArray, FloatArray]:
    below_m = np.linspace(0, 0.7, 7001)
    z_m = sheet(below_m)
    return below_m, np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(below_m), np.diff(z_m)))])


def profile_end_m(sheet: Callable[[FloatArray], FloatArray]) -> float:
    """Return how far below the gripper a sheet of 64 cm ends."""
    below_m, arc_m = fine_line(sheet)
    return float(np.interp(LENGTH_M, arc_m, below_m))


def true_points_m(sheet: Callable[[FloatArray], FloatArray]) -> FloatArray:
    below_m, arc_m = fine_line(sheet)
    y_m = np.interp(SHARES * LENGTH_M, arc_m, below_m)
    return np.stack([np.full(5, GRIPPER_M[0]), GRIPPER_M[1] + y_m, GRIPPER_M[2] + sheet(y_m)])


def seen(exact_m: FloatArray, rng: np.random.Generator | None = None, bands: FloatArray | None = None) -> Image:
    """Return whole millimetres; with a generator, levels of a sensor with noise in blobs and fixed bands."""
    if rng is None:
        return np.rint(1000 * exact_m).astype(np.uint16)
    white = cv2.GaussianBlur(rng.standard_normal(SHAPE), (0, 0), 1.5)
    noise = 0.5 * white / white.std() * LEVEL_SPACING_PER_M
    inverse = 1 / exact_m + noise + (0 if bands is None else bands * LEVEL_SPACING_PER_M)
    rising = LADDER[LEVELS_MM][::-1]
    nearest = np.clip(np.searchsorted((rising[1:] + rising[:-1]) / 2, inverse), 0, rising.size - 1)
    levels: Image = LEVELS_MM[::-1][nearest].astype(np.uint16)
    return levels


def both(images: Sequence[Image]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return points of the profile and of the thesis' method, and the former's uncertainties, (T, 3, 5)."""
    stamps = {frame: 33_000_000 * frame for frame in range(len(images))}
    grippers = dict.fromkeys(stamps, GRIPPER_M)
    traces = trace_profiles(list(enumerate(images)), stamps, K, grippers, DepthPointsParams().track_settings())
    thesis = [
        trace_windows(image, K, GRIPPER_M, DepthPointsParams(method="thesis").window_settings()) for image in images
    ]
    found = [trace.points for trace in traces.values()]
    old = [trace.points for trace in thesis]
    return (
        np.stack([points.position_m for points in found if points is not None]),
        np.stack([points.position_m for points in old if points is not None]),
        np.stack([points.std_m for points in found if points is not None]),
    )


def rms_m(points_m: FloatArray, sheet: Callable[[FloatArray], FloatArray]) -> float:
    errors_m = np.linalg.norm(points_m - true_points_m(sheet), axis=1)
    return float(np.sqrt((errors_m**2).mean()))


@pytest.mark.parametrize("lean", [0.0, 0.3])
@pytest.mark.parametrize("name", SHEETS)
def test_exact_sheets(name: str, lean: float) -> None:
    """Depth is right to half a millimetre of rounding, the end to half a row, of which a point takes its share.

    A window of half height h = 34 mm flattens the sine, whose second derivative is at most 3.2 / m, by 3.2 h^2 / 6.
    """
    found, _, _ = both([seen(depth_m(SHEETS[name], lean))])
    true_m = true_points_m(SHEETS[name])
    np.testing.assert_allclose(found[0, 0], true_m[0], atol=1e-12)
    flattened_m = 0.0006 if name == "sine" else 0.0
    np.testing.assert_allclose(found[0, 2], true_m[2], atol=0.0005 + flattened_m)
    assert (np.abs(found[0, 1] - true_m[1]) <= SHARES * PITCH_M / 2 + 0.0005 + flattened_m).all()


@pytest.mark.parametrize("name", SHEETS)
def test_noise_and_levels_hurt_less_than_in_the_thesis(name: str) -> None:
    rng = np.random.default_rng(7)
    exact = depth_m(SHEETS[name])
    found, thesis, std_m = both([seen(exact, rng) for _ in range(12)])
    assert rms_m(found, SHEETS[name]) < 0.001
    assert rms_m(found, SHEETS[name]) < 0.6 * rms_m(thesis, SHEETS[name])
    errors_m = found - true_points_m(SHEETS[name])
    assert ((errors_m[:, 2] / std_m[:, 2]) ** 2).mean() < 2


@pytest.mark.parametrize("lean", [-0.3, 0.3])
def test_a_leaning_sheet_far_from_the_optical_axis(lean: float) -> None:
    """The profile's column moves with depth, by 11 px from top to bottom, and the sheet leans to the side."""
    gripper_m = (0.3, GRIPPER_M[1], GRIPPER_M[2])
    image = seen(depth_m(SHEETS["tilted"], lean, gripper_m[0]))
    points = trace_profiles([(0, image)], {0: 0}, K, {0: gripper_m}, DepthPointsParams().track_settings())[0].points
    assert points is not None
    np.testing.assert_allclose(points.position_m[2], true_points_m(SHEETS["tilted"])[2], atol=0.0005)
    assert (points.position_m[0] == gripper_m[0]).all()


def test_missing_pixels_at_the_hem_do_not_shorten_the_garment() -> None:
    """Seven of 21 columns end early, by 2.1 rows on average: their mean would be 0.7 rows off."""
    image = seen(depth_m(SHEETS["straight"]))
    last = np.flatnonzero(image[:, 325] < 1200)[-1]
    torn = image.copy()
    torn[last - 2 : last + 1, 318:322] = 0
    torn[last, 330:333] = 0
    whole, torn_m = (both([each])[0][0] for each in (image, torn))
    np.testing.assert_allclose(torn_m, whole, atol=0.2 * PITCH_M)


def test_bands_are_measured_on_the_wall_and_taken_off() -> None:
    rng = np.random.default_rng(3)
    bands = np.repeat(rng.normal(0, 0.43, 12), 56)[: SHAPE[1]]
    images = [seen(depth_m(SHEETS["straight"]), rng, bands) for _ in range(8)]
    table, on_ladder = inverse_depth_table(images)
    assert on_ladder
    offset = column_offsets(images, table, beyond_m=1.4)
    assert offset is not None
    column = np.arange(SHAPE[1], dtype=np.float64)
    detrended = bands - np.polynomial.Polynomial.fit(column, bands, 1)(column)
    np.testing.assert_allclose(offset / LEVEL_SPACING_PER_M, detrended, atol=0.1)
    # no mean is left when all columns were seen, and what the trend may have taken is smallest in their middle
    levels = column_std_per_m(offset, 72, SHAPE[1], measured=False) / LEVEL_SPACING_PER_M
    assert levels[319:321] == pytest.approx(0, abs=0.001)
    assert levels[0] == pytest.approx(0.43 * np.sqrt(3 * 56 / 640), rel=0.01)
    half = column_std_per_m(np.where(column < 320, offset, 0), 72, SHAPE[1], measured=False) / LEVEL_SPACING_PER_M
    assert half[160] == pytest.approx(0.43 * np.sqrt(56 / 320 - 56 / 640), rel=0.01)
    assert half[320:] == pytest.approx(0.43 * np.sqrt(56 / 72 - 56 / 640))
    own = column_std_per_m(offset, 72, SHAPE[1], measured=True)
    assert own[0] == pytest.approx(offset.std() * np.sqrt(3 * 56 / 640), rel=0.01)
    found, _, _ = both(images)
    true_z_m = true_points_m(SHEETS["straight"])[2]
    common_m = (bands - detrended)[325] * LEVEL_SPACING_PER_M * GRIPPER_M[2] ** 2
    np.testing.assert_allclose(found[:, 2] - true_z_m, -common_m, atol=0.0007)


def test_without_a_plane_or_without_the_sensors_levels_nothing_is_taken_off() -> None:
    rng = np.random.default_rng(1)
    rough = [np.where(rng.random(SHAPE) < 0.5, 1804, 2598).astype(np.uint16) * (np.arange(640) < 100) for _ in range(2)]
    table, _ = inverse_depth_table(rough)
    assert column_offsets(rough, table, beyond_m=1.4) is None
    assert column_offsets([np.zeros(SHAPE, np.uint16)], table, beyond_m=1.4) is None
    plain, on_ladder = inverse_depth_table([seen(depth_m(SHEETS["tilted"]))])
    assert not on_ladder
    assert plain[1000] == 1
    usual = 0.43 * LEVEL_SPACING_PER_M * np.sqrt(1 - 56 / 640)
    assert column_std_per_m(None, 56, 640, measured=False) == pytest.approx(usual)


def test_what_is_no_error_of_columns_is_not_taken_off() -> None:
    """Noise alone: what the upper half of the wall says of its columns, the lower does not."""
    rng = np.random.default_rng(5)
    images = [seen(depth_m(SHEETS["straight"]), rng, np.zeros(SHAPE[1])) for _ in range(4)]
    table, _ = inverse_depth_table(images)
    offset = column_offsets(images, table, beyond_m=1.4)
    assert offset is not None
    assert offset.std() < 0.02 * LEVEL_SPACING_PER_M


def test_the_ladder_holds_what_real_sensors_report() -> None:
    real_mm = [1050, 1054, 1057, 1060, 1063, 1067, 1070, 1073, 1077, 1080, 1084, 1087, 1090]
    assert [mm for mm in range(1050, 1091) if LADDER[mm] > 0] == real_mm
    np.testing.assert_allclose(np.diff(LADDER[real_mm]), -LEVEL_SPACING_PER_M, rtol=1e-9)
    below_mm = 1000 / LADDER[LEVELS_MM] - LEVELS_MM
    assert ((below_mm >= 0) & (below_mm < 1)).all()


def test_a_fold_stays_a_step() -> None:
    """The lower half is 4 cm nearer along its rays: the step counts as length, and no depth lies between.

    It is 5 cm above the optical axis, so the rays come down by 4 / 106.5 of that on their way: counted once.
    """
    exact = depth_m(SHEETS["straight"])
    lower = (np.indices(SHAPE)[0] - K.cy_px) / K.fy_px * GRIPPER_M[2] > GRIPPER_M[1] + 0.3
    exact = np.where(lower & (exact < WALL_M), exact - 0.04, exact)
    stamps = {0: 0}
    trace = trace_profiles([(0, seen(exact))], stamps, K, {0: GRIPPER_M}, DepthPointsParams().track_settings())[0]
    assert trace.chain is not None
    z_m = trace.chain.position_m[2] - GRIPPER_M[2]
    assert ((np.abs(z_m) < 0.001) | (np.abs(z_m + 0.04) < 0.001)).mean() > 0.99
    end_m = trace.chain.position_m[1, -1] - GRIPPER_M[1]
    assert trace.chain.length_m == pytest.approx(end_m + 0.04, abs=0.003)


def test_smoothing_is_exact_for_parabolas_and_leaves_steps() -> None:
    time_s = np.cumsum(np.random.default_rng(2).uniform(0.02, 0.05, 60))
    parabola = 1 + 2 * time_s - 3 * time_s**2
    step = np.where(np.arange(60) < 30, 0.0, 1.0)
    noise = np.random.default_rng(5).normal(0, 0.01, 60)
    smooth, _ = adaptive_mean(time_s, np.stack([parabola, step + noise, noise], axis=1), (5, 9, 13), degree=2)
    np.testing.assert_allclose(smooth[:, 0], parabola, atol=1e-9)
    assert np.abs(smooth[:, 1] - step).max() < 0.1
    assert smooth[:, 2].std() < 0.6 * noise.std()
    assert adaptive_mean(time_s, noise[:, None], (), degree=2)[0].tolist() == noise[:, None].tolist()


def test_frames_without_use_have_their_reason() -> None:
    good = seen(depth_m(SHEETS["straight"]))
    images = [(0, good), (1, None), (2, good), (3, np.zeros_like(good))]
    stamps = {frame: 33_000_000 * frame for frame in range(4)}
    grippers = {0: GRIPPER_M, 1: GRIPPER_M, 3: GRIPPER_M}
    traces = trace_profiles(images, stamps, K, grippers, DepthPointsParams().track_settings())
    assert [trace.reason for trace in traces.values()] == [None, "image_size", "no_gripper", "no_pixels"]
    assert [trace.points is None for trace in traces.values()] == [False, True, True, True]
