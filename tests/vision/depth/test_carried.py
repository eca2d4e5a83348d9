"""No point in mid-air: the law, on made frames with holes, occluders in front and second surfaces behind."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset.stages.depth_points import DepthPointsParams
from garment_dataset.vision.depth.cloud import Intrinsics, level_spacing_m
from garment_dataset.vision.depth.hem import doubt_hem
from garment_dataset.vision.depth.trace import Trace, trace_profiles, trace_windows

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Image = NDArray[np.uint16]
    FloatArray = NDArray[np.float64]

K = Intrinsics(fx_px=570.3, fy_px=570.3, cx_px=319.5, cy_px=239.5)
SHAPE = (480, 640)
GRIPPER_M = (0.01, -0.35, 1.065)
V, U = np.indices(SHAPE)
BELOW_M = (V - K.cy_px) / K.fy_px * GRIPPER_M[2] - GRIPPER_M[1]
MANY = 16
METHODS = ["profile", "thesis"]


def towel() -> FloatArray:
    """Return whole millimetres of a towel of 64 cm that leans and waves a little, before a wall."""
    z_mm = 1065 + 60 * BELOW_M + 8 * np.sin(2 * np.pi * BELOW_M / 0.4)
    there = (BELOW_M >= 0) & (BELOW_M <= 0.64) & (np.abs(U - 325) < 80)
    return np.where(there, z_mm, 1800.0)


def hole(start_m: float, stop_m: float, depth_mm: float = 0.0) -> Callable[[FloatArray], FloatArray]:
    """Put something else into the towel between two heights, over its whole width."""
    return lambda z_mm: np.where((start_m < BELOW_M) & (stop_m > BELOW_M), depth_mm, z_mm)


def speckled(z_mm: FloatArray) -> FloatArray:
    return np.where(np.random.default_rng(1).random(SHAPE) < 0.6, 0, z_mm)


def folded(z_mm: FloatArray) -> FloatArray:
    """Bring the lower half 6 cm nearer; its upper edge throws a shadow."""
    nearer = np.where((BELOW_M > 0.3) & (z_mm < 1500), z_mm - 60, z_mm)
    return hole(0.28, 0.3)(nearer)


def behind(z_mm: FloatArray) -> FloatArray:
    """Put a second surface 8 cm behind, which is seen through a hole and goes on below the towel."""
    seen = (z_mm == 1800) | ((BELOW_M > 0.2) & (BELOW_M < 0.26))
    return np.where(seen & (BELOW_M > 0.1), 1150 + 50 * BELOW_M, z_mm)


PLANTS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "nothing": lambda z_mm: z_mm,
    "hole of 2 cm": hole(0.215, 0.235),
    "hole of 5 cm": hole(0.2, 0.25),
    "hole of 12 cm": hole(0.2, 0.32),
    "hole of 25 cm": hole(0.2, 0.45),
    "hole at the gripper": hole(-0.1, 0.05),
    "occluder in front": hole(0.3, 0.34, 500.0),
    "occluder in the band": hole(0.3, 0.34, 900.0),
    "seen through to the wall": hole(0.3, 0.34, 1800.0),
    "fold": folded,
    "surface behind": behind,
    "speckled": speckled,
}


def traced(image: Image, method: str, count: int = MANY, **knobs: float) -> Trace:
    params = DepthPointsParams.model_validate({"method": method, "point_count": count, **knobs})
    if method == "thesis":
        return trace_windows(image, K, GRIPPER_M, params.window_settings())
    return trace_profiles([(0, image)], {0: 0}, K, {0: GRIPPER_M}, params.track_settings())[0]


def planted(name: str) -> Image:
    return np.rint(PLANTS[name](towel())).astype(np.uint16)


def distance_m(position_m: FloatArray, image: Image) -> FloatArray:
    """Return how far points, (3, r), are from the nearest pixel, by brute force."""
    z_m = image[image > 0] / 1000
    cloud_m = np.stack([(U[image > 0] - K.cx_px) / K.fx_px * z_m, (V[image > 0] - K.cy_px) / K.fy_px * z_m, z_m])
    return np.array([np.sqrt(((cloud_m - point_m[:, None]) ** 2).sum(axis=0)).min() for point_m in position_m.T])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", PLANTS)
def test_no_point_is_farther_from_measured_depth_than_it_admits(name: str, method: str) -> None:
    image = planted(name)
    points = traced(image, method).points
    if points is None:
        assert name in ("hole at the gripper", "hole of 25 cm")
        return
    there = np.array([reason is None for reason in points.reasons])
    assert there.any()
    assert (np.isfinite(points.position_m).all(axis=0) == there).all()
    assert (np.isfinite(points.bridged_m) == there).all()
    away_m = distance_m(points.position_m[:, there], image)
    bound_m = 3 * np.sqrt((points.std_m[:, there] ** 2).sum(axis=0)) + level_spacing_m(points.position_m[2, there])
    assert (away_m <= bound_m).all()
    assert (away_m[points.bridged_m[there] == 0] <= 0.012).all()
    assert (points.pixels[~there] == 0).all()


@pytest.mark.parametrize(("method", "bridge_m"), [("profile", 0.02), ("thesis", 0.0125)])
def test_a_small_hole_is_bridged_and_says_so(method: str, bridge_m: float) -> None:
    """Windows of the thesis' method reach 5 mm into the hole from either side; bridges run from sample to sample."""
    points = traced(planted("hole of 2 cm"), method).points
    assert points is not None
    assert set(points.reasons) == {None}
    below_m = points.position_m[1] - GRIPPER_M[1]
    on_it = (below_m > 0.22) & (below_m < 0.23)
    assert on_it.any()
    np.testing.assert_allclose(points.bridged_m[on_it], bridge_m, atol=0.005)
    assert (points.pixels[on_it] == 0).all()
    away = (np.abs(below_m - 0.225) > 0.03) & (below_m > 0.02)
    assert (points.bridged_m[away] == 0).all()
    assert points.std_m[2, on_it].min() > points.std_m[2, away].max()


@pytest.mark.parametrize(
    ("name", "reason"),
    [("hole of 12 cm", "gap"), ("fold", "between_layers"), ("occluder in the band", "between_layers")],
)
def test_what_is_not_one_surface_or_too_long_carries_no_point(name: str, reason: str) -> None:
    points = traced(planted(name), "profile", count=60).points
    assert points is not None
    assert set(points.reasons) == {None, reason}


def test_cloth_far_from_the_gripper_is_not_held() -> None:
    image = np.where((BELOW_M > -0.1) & (BELOW_M < 0.64), 915, 1800).astype(np.uint16)
    for method in METHODS:
        assert traced(image, method).reason == "not_held"
        wide = traced(image, method, hold_reach_m=0.2).points
        assert wide is not None
        assert set(wide.reasons) == {None}


def test_the_length_is_not_known_where_the_hem_is_not_seen() -> None:
    """Hidden by something nearer, at the edge of the image, above a gap, or where the band ends."""
    z_mm = towel()
    assert traced(planted("nothing"), "profile").length_reason is None
    hidden = np.where(BELOW_M > 0.5, 500, z_mm).astype(np.uint16)
    long = np.where((np.abs(U - 325) < 80) & (BELOW_M > 0), 1065, 1800).astype(np.uint16)
    for method in METHODS:
        assert traced(hidden, method).length_reason == "occluded"
        assert traced(long, method).length_reason == "image_edge"
        assert traced(planted("hole of 25 cm"), method).length_reason == "gap"
        sloping = np.where(z_mm < 1500, 1065 + 700 * BELOW_M, 1800).astype(np.uint16)
        assert traced(sloping, method).length_reason == "beyond_band"


def test_a_hem_above_a_gap_is_seen_where_the_background_is() -> None:
    image = np.full(SHAPE, 1800, np.uint16)
    image[:200] = 1065
    image[400:] = 1065
    limits = {"band_half_width_m": 0.27, "jump_m": 0.012}
    end_m = (0.0, (199 - K.cy_px) / K.fy_px * 1.065, 1.065)
    assert doubt_hem(image, K, end_m, 1.065, ends_at_gap=True, **limits) is None
    image[200:400] = 0
    assert doubt_hem(image, K, end_m, 1.065, ends_at_gap=True, **limits) == "gap"
    assert doubt_hem(image, K, end_m, 1.065, ends_at_gap=False, **limits) is None
    assert doubt_hem(image, K, (9.0, *end_m[1:]), 1.065, ends_at_gap=True, **limits) is None
