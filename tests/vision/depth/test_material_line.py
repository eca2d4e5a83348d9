"""The middle of made sheets: known answers, and none where the shape is no sheet of constant width."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from garment_dataset.stages.depth_points import DepthPointsParams
from garment_dataset.vision.depth.cloud import Intrinsics
from garment_dataset.vision.depth.material_line import MaterialLine, smooth_material_lines
from garment_dataset.vision.depth.robust import robust_polynomials
from garment_dataset.vision.depth.trace import trace_profiles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    Image = NDArray[np.uint16]

K = Intrinsics(fx_px=570.3, fy_px=570.3, cx_px=319.5, cy_px=239.5)
SHAPE = (480, 640)
GRIPPER_M = (0.01, -0.35, 1.065)
LENGTH_M, HALF_WIDTH_M = 0.64, 0.18
SHARES = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
PITCH_M = GRIPPER_M[2] / K.fx_px
FRAMES = 6


def sheet(
    *,
    slip_m: float = 0.0,
    sideways: float = 0.0,
    turned: float = 0.0,
    tilted: float = 0.0,
    taper: float = 0.0,
    length_m: float = LENGTH_M,
    half_width_m: float = HALF_WIDTH_M,
) -> FloatArray:
    """Return the exact depth, in millimetres, of a flat sheet before a wall.

    Its middle runs from ``slip_m`` beside the gripper by ``sideways`` per metre downwards; it is turned about the
    vertical by a slope ``turned`` and tilted away by ``tilted``; its half width changes by ``taper`` per metre.
    """
    v, u = np.indices(SHAPE, dtype=np.float64)
    along, down = (u - K.cx_px) / K.fx_px, (v - K.cy_px) / K.fy_px
    z_m = (GRIPPER_M[2] - turned * GRIPPER_M[0] - tilted * GRIPPER_M[1]) / (1 - turned * along - tilted * down)
    below_m = down * z_m - GRIPPER_M[1]
    beside_m = along * z_m - GRIPPER_M[0] - slip_m - sideways * below_m
    there = (below_m >= 0) & (below_m <= length_m) & (np.abs(beside_m) <= half_width_m + taper * below_m)
    return np.where(there, 1000 * z_m, 1800.0)


def material(depth_mm: FloatArray, **knobs: Any) -> list[FloatArray | None]:
    """Return the points on the material line in equal images."""
    image: Image = np.rint(depth_mm).astype(np.uint16)
    traces = trace_profiles(
        [(frame, image) for frame in range(FRAMES)],
        {frame: 33_333_333 * frame for frame in range(FRAMES)},
        K,
        dict.fromkeys(range(FRAMES), GRIPPER_M),
        DepthPointsParams(**knobs).track_settings(),
    )
    assert all(trace.points is not None for trace in traces.values())
    return [trace.material_m for trace in traces.values()]


@pytest.mark.parametrize("slip_m", [0.0, 0.012, -0.02])
@pytest.mark.parametrize("sideways", [0.0, 0.06, -0.1])
@pytest.mark.parametrize("turned", [0.0, 0.1])
@pytest.mark.parametrize("tilted", [0.0, -0.15])
def test_the_middle_of_a_rectangle(slip_m: float, sideways: float, turned: float, tilted: float) -> None:
    """Also where it is turned: the middle in the image would be off by half_width^2 turned / z, 3 mm."""
    depth_mm = sheet(slip_m=slip_m, sideways=sideways, turned=turned, tilted=tilted)
    below_m = LENGTH_M * SHARES
    x_m = GRIPPER_M[0] + slip_m + sideways * below_m
    z_m = GRIPPER_M[2] + turned * (x_m - GRIPPER_M[0]) + tilted * below_m
    for points_m in material(depth_mm):
        assert points_m is not None
        np.testing.assert_allclose(points_m[0], x_m, atol=0.0006)
        np.testing.assert_allclose(points_m[1], GRIPPER_M[1] + below_m, atol=PITCH_M / 2 + 0.0003)
        np.testing.assert_allclose(points_m[2], z_m, atol=0.0006)


def test_missing_pixels_and_a_ruler_that_sticks_out_do_not_move_it() -> None:
    depth_mm = sheet(sideways=0.05)
    rng = np.random.default_rng(3)
    depth_mm[rng.random(SHAPE) < 0.05] = 0
    depth_mm[50:60, 200:560] = 1065
    for points_m in material(depth_mm):
        assert points_m is not None
        np.testing.assert_allclose(points_m[0], GRIPPER_M[0] + 0.05 * LENGTH_M * SHARES, atol=0.001)


def folded() -> FloatArray:
    """Return a sheet whose upper part is half as wide as the lower one."""
    depth_mm = sheet()
    narrow = sheet(half_width_m=HALF_WIDTH_M / 2)
    depth_mm[:200] = narrow[:200]
    return depth_mm


def bulged() -> FloatArray:
    """Return a sheet whose middle stands 6 cm before its borders."""
    depth_mm = sheet()
    u = np.broadcast_to(np.arange(SHAPE[1]), SHAPE)
    near = 60 * np.clip(1 - np.abs(u - 325) / 80, 0, 1)
    return np.where(depth_mm < 1500, depth_mm - near, depth_mm)


def holed() -> FloatArray:
    depth_mm = sheet()
    depth_mm[60:, 340:380] = 1800
    return depth_mm


NONE = {
    "a triangle": sheet(half_width_m=0.06, taper=0.3),
    "a folded sheet": folded(),
    "a bulge": bulged(),
    "a gap between two strips": holed(),
    "a strip narrower than four insets": sheet(half_width_m=0.02),
    "cut by the image on the right": sheet(slip_m=0.45, half_width_m=0.5),
    "cut by the image below": sheet(length_m=0.9),
}


@pytest.mark.parametrize("name", NONE)
def test_none_where_it_cannot_be_had(name: str) -> None:
    assert material(NONE[name]) == [None] * FRAMES


def test_the_number_of_points_is_a_parameter() -> None:
    for points_m in material(sheet(), point_count=2):
        assert points_m is not None
        np.testing.assert_allclose(points_m[1], GRIPPER_M[1] + LENGTH_M * np.array([0.25, 0.75]), atol=0.0015)


def line(x_m: float, width_m: float = 0.36) -> MaterialLine:
    return MaterialLine(np.full(101, x_m), np.zeros(101), width_m)


def test_what_only_some_frames_show_is_no_sheet() -> None:
    stamp_ns = 33_333_333 * np.arange(8)
    some = [line(0.001) if frame < 3 else None for frame in range(8)]
    assert smooth_material_lines(some, stamp_ns, frames=(5,)) == [None] * 8
    widths: list[MaterialLine | None] = [*(line(0.001) for _ in range(7)), line(0.001, width_m=0.2)]
    found = smooth_material_lines(widths, stamp_ns, frames=(5,))
    assert [one is None for one in found] == [False] * 7 + [True]
    assert smooth_material_lines([None, None], stamp_ns[:2], frames=(5,)) == [None, None]


def test_smoothing_follows_the_order_of_the_stamps_and_lowers_noise() -> None:
    rng = np.random.default_rng(1)
    time_s = 0.0333 * np.arange(60)
    truth_m = 0.01 * np.sin(time_s)
    seen: list[MaterialLine | None] = [line(x_m) for x_m in truth_m + rng.normal(0, 0.001, 60)]
    stamp_ns = np.rint(1e9 * time_s).astype(np.int64)
    shuffled = rng.permutation(60)
    mixed: list[MaterialLine | None] = [seen[index] for index in shuffled]
    straight = smooth_material_lines(seen, stamp_ns, frames=(5, 9, 13))
    turned = smooth_material_lines(mixed, stamp_ns[shuffled], frames=(5, 9, 13))
    smooth_m = np.array([one.x_m[0] for one in straight if one is not None])
    assert np.std(smooth_m - truth_m) < 0.0007
    again_m = np.array([one.x_m[0] for one in turned if one is not None])
    np.testing.assert_array_equal(again_m, smooth_m[shuffled])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("degree", [1, 3])
def test_a_line_is_fitted_as_by_orthogonal_least_squares(seed: int, degree: int) -> None:
    rng = np.random.default_rng(seed)
    below_m = np.sort(rng.uniform(0.0, 0.65, int(rng.integers(9, 200))))
    truth = np.polynomial.Polynomial(rng.normal(size=degree + 1) * 0.05)
    values = truth(below_m) + 0.0005 * rng.standard_t(2, below_m.size)
    raster_m = np.linspace(0.0, below_m[-1], 40)
    kept = np.ones(below_m.size, dtype=np.bool_)
    for _ in range(3):
        polynomial = np.polynomial.Polynomial.fit(below_m[kept], values[kept], degree)
        away = np.abs(values - polynomial(below_m))
        kept = away <= 3.0 * 1.4826 * np.median(away) + 1e-9
    expected = polynomial(raster_m)
    # whatever else is fitted along with it
    places, beside = [below_m[:20], below_m, below_m[::-1]], [-values[:20], values, 2 * values[::-1]]
    found = robust_polynomials(places, beside, degree, np.stack([raster_m] * 3))
    np.testing.assert_allclose(found[1:], [expected, 2 * expected], rtol=0, atol=1e-12)
