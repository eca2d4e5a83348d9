from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.vision.depth.chain import Chain, ChainPoints, divide_chain, link_samples
from garment_dataset.vision.depth.cloud import Cloud, level_spacing_m, select_pixels
from garment_dataset.vision.depth.samples import Samples, sample_windows

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from garment_dataset.vision.depth.cloud import Intrinsics

    FloatArray = NDArray[np.float64]
    Profile = Callable[[FloatArray], FloatArray]
    Hang = Callable[..., "Hanging"]

TOP_M = -0.25
GRIPPER_M = (0.01, TOP_M, 1.065)
LIMITS = {"band_half_width_m": 0.27, "strip_half_width_m": 0.02}
STEP_M = 0.0025
HALF_HEIGHT_M = 0.005
JUMP_M = 0.012
PITCH_M = 1.16 / 569
"""Distance of pixels on the cloth, where it is farthest."""
END_M = STEP_M + PITCH_M
"""The last sample is up to a step above the last pixel, which is up to a pitch above the end of the cloth."""
LENGTH_M = 0.64


class Hanging(NamedTuple):
    """What the method sees of a sheet."""

    chain: Chain
    points: ChainPoints


def trace(cloud: Cloud, intrinsics: Intrinsics, point_count: int = 5) -> Hanging:
    samples = sample_windows(cloud, TOP_M, step_m=STEP_M, half_height_m=HALF_HEIGHT_M)
    chain = link_samples(samples, GRIPPER_M, step_m=STEP_M, max_gap_m=0.03, min_pixels=1, jump_m=JUMP_M)
    window_m = 2 * HALF_HEIGHT_M
    points = divide_chain(chain, intrinsics, point_count=point_count, step_m=STEP_M, window_m=window_m)
    return Hanging(chain, points)


@pytest.fixture(params=["exact", "millimetres", "openni"])
def resolution(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def level_m(resolution: str) -> float:
    """Distance of neighbouring depth values, where they are farthest apart on a sheet."""
    return {"exact": 0.0, "millimetres": 0.001, "openni": float(level_spacing_m(1.16)) + 0.001}[resolution]


@pytest.fixture
def hang(
    resolution: str,
    intrinsics: Intrinsics,
    sheet_depth_m: Callable[..., FloatArray],
    image: Callable[..., NDArray[np.uint16]],
    reference_cloud: Callable[..., Cloud],
) -> Hang:
    """Hang a sheet z = f(distance below the gripper) of a given height, seen at one of the resolutions."""

    def hang_sheet(profile: Profile, height_m: float, point_count: int = 5) -> Hanging:
        depth_m = sheet_depth_m(lambda y_m: profile(y_m - TOP_M), TOP_M, TOP_M + height_m)
        if resolution == "exact":
            cloud = reference_cloud(depth_m * 1000, intrinsics, GRIPPER_M, **LIMITS)
        else:
            depth_mm = image(depth_m, openni=resolution == "openni")
            cloud = select_pixels(depth_mm, intrinsics, GRIPPER_M, **LIMITS)
        return trace(cloud, intrinsics, point_count)

    return hang_sheet


def plane(slope: float) -> Profile:
    return lambda below_m: 1.065 + slope * below_m


def steepest_link_m(slope: float, level_m: float) -> float:
    """Return how far z can move from one sample to the next.

    The mean height of the rows in a window moves by a step, give or take a pitch; and of some five rows, two may change
    their level.
    """
    return slope * (STEP_M + PITCH_M) + 0.4 * level_m


def test_a_straight_vertical_garment_has_its_points_where_the_thesis_has_them(hang: Hang, level_m: float) -> None:
    chain, points = hang(plane(0), LENGTH_M)
    # A depth that is off by half a level shifts heights in proportion to the depth, 0.39 m below the axis at most.
    shift_m = 0.39 * level_m / 2 / 1.065
    assert LENGTH_M - END_M - 2 * shift_m <= chain.length_m <= LENGTH_M + 2 * shift_m
    expected_m = np.array([0.064, 0.192, 0.32, 0.448, 0.576])
    below_m = points.position_m[1] - TOP_M
    share = expected_m / LENGTH_M
    assert (below_m <= expected_m + 2 * shift_m).all()
    assert (below_m >= expected_m - share * END_M - 2 * shift_m).all()
    np.testing.assert_allclose(points.arc_length_m, below_m, atol=1e-12)
    np.testing.assert_allclose(points.position_m[2], 1.065, atol=level_m / 2 + 1e-12)
    np.testing.assert_allclose(points.position_m[0], 0.01, atol=PITCH_M / 2)


@pytest.mark.parametrize("slope", [0.05, 0.1, -0.1, 0.15])
def test_a_tilted_plane(hang: Hang, level_m: float, slope: float) -> None:
    """Along a plane z never turns back, and sqrt(dy² + d²) <= dy + d² / (2 dy): bounds without any assumption."""
    height_m = LENGTH_M / np.hypot(1, slope)
    chain, points = hang(lambda below_m: 1.0 + (slope < 0) * 0.1 + slope * below_m, height_m)
    seen_m = chain.position_m[1, -1] - TOP_M
    deep_m = abs(chain.position_m[2, -1] - chain.position_m[2, 0])
    # Windows at the ends hold half of their rows: z is off by the slope times a quarter of a window, at both.
    assert deep_m == pytest.approx(abs(slope) * seen_m, abs=abs(slope) * (HALF_HEIGHT_M + PITCH_M) + level_m)
    longest_m = seen_m + steepest_link_m(abs(slope), level_m) * deep_m / (2 * STEP_M)
    assert np.hypot(seen_m, deep_m) - 1e-12 <= chain.length_m <= longest_m
    assert height_m - END_M - level_m <= seen_m <= height_m + level_m
    middles = (np.arange(5) + 0.5) / 5
    np.testing.assert_allclose(points.arc_length_m, middles * chain.length_m)
    uneven_m = END_M + level_m  # one period of the levels
    np.testing.assert_allclose(points.position_m[1] - TOP_M, middles * height_m, atol=uneven_m)


AMPLITUDE_M, PERIOD_M = 0.015, 0.32
WAVE_RAD_M = 2 * np.pi / PERIOD_M


def sine(below_m: FloatArray) -> FloatArray:
    return 1.05 + AMPLITUDE_M * np.sin(WAVE_RAD_M * below_m)


def complete_elliptic_integral(m: float) -> float:
    """Return E(m), by the arithmetic-geometric mean (Abramowitz and Stegun, 17.6)."""
    a, b, c_squared, weight = 1.0, np.sqrt(1 - m), m, 0.5
    total = weight * c_squared
    for _ in range(8):
        a, b, c_squared = (a + b) / 2, np.sqrt(a * b), ((a - b) / 2) ** 2
        weight *= 2
        total += weight * c_squared
    return float(np.pi / (2 * a) * (1 - total))


def test_a_sine_shaped_sheet(hang: Hang, resolution: str, level_m: float) -> None:
    """Two periods are eight quarter waves: 8 sqrt(1 + s²) / k * E(s² / (1 + s²)), s = A k the steepest slope."""
    slope = AMPLITUDE_M * WAVE_RAD_M
    true_m = 8 * np.hypot(1, slope) / WAVE_RAD_M * complete_elliptic_integral(slope**2 / (1 + slope**2))
    assert true_m > 1.02 * 2 * PERIOD_M
    chain, points = hang(sine, 2 * PERIOD_M)
    # Rows fall into windows unevenly: z is off by the slope times a pitch, uniform. Such noise d lengthens a link by
    # d² / (2 dy) on average; twice that is allowed.
    row_noise_m = np.sqrt(2) * slope / np.sqrt(2) * PITCH_M / np.sqrt(12)
    excess_m = chain.pixels.size * row_noise_m**2 / (2 * STEP_M)
    if resolution == "exact":
        assert true_m - END_M <= chain.length_m <= true_m + 2 * excess_m
    else:  # the longest chain through eight monotone quarter waves, for no link is steeper than the steepest
        link_m = steepest_link_m(slope, level_m)
        steep = (np.hypot(STEP_M, link_m) - STEP_M) / link_m
        longest_m = 2 * PERIOD_M + level_m + 8 * (AMPLITUDE_M + level_m / 2) * steep
        assert true_m - END_M - level_m <= chain.length_m <= longest_m
    np.testing.assert_allclose(points.position_m[2], sine(points.position_m[1] - TOP_M), atol=1.5e-3 + level_m / 2)


def true_points_m(profile: Profile) -> FloatArray:
    """Return where five points on a sheet of the usual height are, (3, 5)."""
    fine_m = np.linspace(0, LENGTH_M, 100_001)
    arc_m = np.append(0, np.cumsum(np.hypot(np.diff(fine_m), np.diff(profile(fine_m)))))
    below_m = np.interp((np.arange(5) + 0.5) / 5 * arc_m[-1], arc_m, fine_m)
    return np.stack([np.full(5, GRIPPER_M[0]), TOP_M + below_m, profile(below_m)])


@pytest.mark.parametrize("profile", [plane(0.1), plane(-0.15), sine])
def test_points_are_within_their_own_uncertainties(hang: Hang, profile: Profile) -> None:
    """Three standard uncertainties, for each coordinate of each point, against where the points truly are."""
    _, points = hang(profile, LENGTH_M)
    assert (np.abs(points.position_m - true_points_m(profile)) <= 3 * points.std_m).all()
    assert (points.std_m < 0.003).all()


@pytest.mark.parametrize("profile", [plane(0), plane(0.15), sine])
def test_uncertainties_are_of_the_size_of_the_errors_under_the_noise_of_a_real_sensor(
    intrinsics: Intrinsics,
    sheet_depth_m: Callable[..., FloatArray],
    noisy: Callable[..., FloatArray],
    image: Callable[..., NDArray[np.uint16]],
    profile: Profile,
) -> None:
    depth_m = sheet_depth_m(lambda y_m: profile(y_m - TOP_M), TOP_M, TOP_M + LENGTH_M)
    true_m = true_points_m(profile)
    rng = np.random.default_rng(5)
    errors_m, stds_m = [], []
    for _ in range(20):
        depth_mm = image(noisy(depth_m, rng), openni=True)
        points = trace(select_pixels(depth_mm, intrinsics, GRIPPER_M, **LIMITS), intrinsics).points
        errors_m.append(points.position_m - true_m)
        stds_m.append(points.std_m)
    ratio = np.sqrt(np.mean(np.square(errors_m), axis=(0, 2)) / np.mean(np.square(stds_m), axis=(0, 2)))
    assert (ratio > 0.5).all(), ratio
    assert (ratio < 1.4).all(), ratio


def points_at(y_m: ArrayLike, z_mm: ArrayLike) -> Cloud:
    heights_m = np.asarray(y_m, dtype=np.float64)
    return Cloud(np.linspace(-0.02, 0.02, heights_m.size), heights_m, np.asarray(z_mm, dtype=np.float64))


def assert_windows(cloud: Cloud, top_m: float, step_m: float, half_height_m: float) -> None:
    """Compare with eqs. (5.9) and (5.10), window by window."""
    samples = sample_windows(cloud, top_m, step_m=step_m, half_height_m=half_height_m)
    count = samples.pixels.size
    assert top_m + (count - 1) * step_m <= cloud.y_m.max() < top_m + count * step_m
    for i in range(count):
        inside = np.abs(cloud.y_m - (top_m + i * step_m)) < half_height_m
        assert samples.pixels[i] == inside.sum()
        assert samples.position_m[1, i] == top_m + i * step_m
        if inside.any():
            means = [cloud.x_m[inside].mean(), cloud.z_mm[inside].mean() / 1000]
            np.testing.assert_allclose(samples.position_m[[0, 2], i], means, rtol=0, atol=1e-12)
        else:
            assert np.isnan(samples.position_m[[0, 2], i]).all()
        if inside.sum() > 1:
            spread_m = cloud.z_mm[inside].std(ddof=1) / 1000
            np.testing.assert_allclose(samples.z_spread_m[i], spread_m, rtol=1e-9, atol=1e-12)
        else:
            assert np.isnan(samples.z_spread_m[i])


@given(
    places=st.lists(st.tuples(st.integers(0, 300), st.integers(800, 1300)), min_size=1, max_size=60),
    top=st.integers(-300, 300),
    step=st.integers(1, 12),
    half_height=st.integers(1, 40),
)
def test_windows_hold_exactly_their_pixels_also_when_these_lie_on_the_edges(
    places: list[tuple[int, int]], top: int, step: int, half_height: int
) -> None:
    """Everything in 1/512 m: sums and differences are exact, and many pixels lie on the edges of windows."""
    cloud = points_at([(top + y) / 512 for y, _ in places], [z for _, z in places])
    assert_windows(cloud, top / 512, step / 512, half_height / 512)


@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.integers(1, 80),
    top_m=st.floats(-0.5, 0.5),
    step_m=st.floats(0.001, 0.02),
    half_height_m=st.floats(0.0005, 0.03),
)
def test_windows_of_any_step_and_height(
    seed: int, size: int, top_m: float, step_m: float, half_height_m: float
) -> None:
    rng = np.random.default_rng(seed)
    cloud = points_at(top_m + rng.uniform(0, 0.3, size), rng.integers(800, 1300, size))
    assert_windows(cloud, top_m, step_m, half_height_m)


def test_the_thesis_windows_on_a_frame(
    intrinsics: Intrinsics, sheet_depth_m: Callable[..., FloatArray], image: Callable[..., NDArray[np.uint16]]
) -> None:
    depth_mm = image(sheet_depth_m(lambda y_m: 1.05 + 0.1 * y_m, TOP_M, 0.3), openni=True)
    cloud = select_pixels(depth_mm, intrinsics, GRIPPER_M, **LIMITS)
    assert_windows(cloud, TOP_M, STEP_M, HALF_HEIGHT_M)


def test_no_pixels_no_samples_no_chain() -> None:
    samples = sample_windows(points_at([], []), 0.0, step_m=STEP_M, half_height_m=HALF_HEIGHT_M)
    chain = link_samples(samples, (0, 0, 1), step_m=STEP_M, max_gap_m=0.03, min_pixels=1, jump_m=JUMP_M)
    assert chain.pixels.size == 0
    assert chain.length_m == 0
    assert not chain.ends_at_gap


def samples_with(pixels: list[int], step_m: float = 0.5) -> Samples:
    """Samples at y = 0, 0.5, 1, …, x = 2 y, z = 1 + y; empty where there are no pixels."""
    count = np.array(pixels)
    y_m = step_m * np.arange(count.size)
    there = np.where(count > 0, 1.0, np.nan)
    return Samples(np.stack([2 * y_m * there, y_m, (1 + y_m) * there]), count, 0.01 * there)


def link(pixels: list[int], max_gap_m: float = 1.0, min_pixels: int = 1) -> Chain:
    limits = {"max_gap_m": max_gap_m, "jump_m": JUMP_M}
    return link_samples(samples_with(pixels), (0, 0, 1), step_m=0.5, min_pixels=min_pixels, **limits)


@pytest.mark.parametrize("pixels", [[4, 4, 4, 4, 4], [4, 0, 4, 4, 4], [4, 4, 0, 0, 4], [0, 0, 4, 0, 4]])
def test_a_gap_in_a_straight_chain_changes_nothing_but_the_count(pixels: list[int]) -> None:
    """The gripper's end point lies on the line, and stands in for a first sample that is missing."""
    chain = link(pixels)
    y_m = 0.5 * np.arange(5)
    np.testing.assert_allclose(chain.position_m, [2 * y_m, y_m, 1 + y_m])
    np.testing.assert_allclose(chain.arc_length_m, np.sqrt(6) * y_m)
    assert chain.pixels.tolist() == pixels
    assert np.isnan(chain.z_spread_m).tolist() == [count == 0 for count in pixels]
    assert not chain.ends_at_gap


def test_a_chain_begins_at_the_gripper_only_where_the_first_sample_is_missing() -> None:
    gripper_m = (0.5, 0, 2)
    kept = link_samples(samples_with([4, 4]), gripper_m, step_m=0.5, max_gap_m=1, min_pixels=1, jump_m=JUMP_M)
    assert kept.position_m[:, 0].tolist() == [0, 0, 1]
    bridged = link_samples(samples_with([0, 4]), gripper_m, step_m=0.5, max_gap_m=1, min_pixels=1, jump_m=JUMP_M)
    assert bridged.position_m[:, 0].tolist() == [0.5, 0, 2]


def test_a_long_gap_ends_the_chain_and_says_so() -> None:
    chain = link([4, 4, 0, 4, 0, 0, 0, 4, 4])
    assert chain.pixels.tolist() == [4, 4, 0, 4]
    assert chain.ends_at_gap
    assert link([4, 4, 0, 4, 0, 0, 0, 4, 4], max_gap_m=1.5).pixels.size == 9


def test_a_long_gap_below_the_gripper_leaves_no_chain() -> None:
    assert link([0, 0, 0, 4]).pixels.size == 0
    assert link([0, 0, 0, 4]).ends_at_gap
    assert link([0, 4], max_gap_m=0).pixels.size == 0


def test_samples_of_too_few_pixels_are_gaps() -> None:
    assert link([4, 2, 4, 1, 1, 2], min_pixels=3).pixels.tolist() == [4, 0, 4]
    nothing = link([2, 1, 2], min_pixels=3)
    assert nothing.pixels.size == 0
    assert not nothing.ends_at_gap


@given(
    depths_m=st.lists(st.floats(0.8, 1.3), min_size=2, max_size=60),
    point_count=st.integers(1, 12),
)
def test_points_lie_on_the_chain_in_the_middles_of_equal_segments(
    intrinsics: Intrinsics, depths_m: list[float], point_count: int
) -> None:
    z_m = np.array(depths_m)
    y_m = 0.01 * np.arange(z_m.size)
    samples = Samples(np.stack([0 * y_m, y_m, z_m]), np.full(z_m.size, 9), np.zeros(z_m.size))
    chain = link_samples(samples, GRIPPER_M, step_m=0.01, max_gap_m=0, min_pixels=1, jump_m=JUMP_M)
    assert chain.length_m == pytest.approx(np.hypot(np.diff(y_m), np.diff(z_m)).sum())
    points = divide_chain(chain, intrinsics, point_count=point_count, step_m=0.01, window_m=0.02)
    expected_m = (2 * np.arange(1, point_count + 1) - 1) / (2 * point_count) * chain.length_m
    np.testing.assert_allclose(points.arc_length_m, expected_m)
    for axis in range(3):
        on_chain_m = np.interp(expected_m, chain.arc_length_m, chain.position_m[axis])
        np.testing.assert_allclose(points.position_m[axis], on_chain_m, atol=1e-12)
    assert np.isfinite(points.std_m).all()
    assert (points.std_m > 0).all()


def test_a_point_on_a_bridge_rests_on_no_pixel_and_is_less_certain(intrinsics: Intrinsics) -> None:
    y_m = STEP_M * np.arange(101)
    samples = Samples(np.stack([0 * y_m, y_m, 1 + 0 * y_m]), np.full(101, 100), np.zeros(101))
    samples.pixels[45:55] = 0
    chain = link_samples(samples, GRIPPER_M, step_m=STEP_M, max_gap_m=0.03, min_pixels=1, jump_m=JUMP_M)
    points = divide_chain(chain, intrinsics, point_count=3, step_m=STEP_M, window_m=2 * HALF_HEIGHT_M)
    assert points.pixels.tolist() == [100, 0, 100]
    assert points.std_m[2, 1] > points.std_m[2, 2] == points.std_m[2, 0]


def rough(rough_samples: int) -> Chain:
    """81 samples; up to the one of this number z jumps by a step to and fro, so that its links are sqrt(2) too long."""
    index = np.arange(81)
    z_m = 1 + STEP_M * ((index % 2 == 1) & (index < rough_samples))
    samples = Samples(np.stack([0 * z_m, STEP_M * index, z_m]), np.full(81, 100), np.zeros(81))
    return link_samples(samples, GRIPPER_M, step_m=STEP_M, max_gap_m=0, min_pixels=1, jump_m=JUMP_M)


def test_uneven_roughness_makes_a_point_uncertain_along_the_cloth(intrinsics: Intrinsics) -> None:
    """Half of the cloth looks sqrt(2) too long: its middle is found that much too high, all rough or none it is not."""
    std_m = []
    for rough_samples in (0, 40, 80):
        chain = rough(rough_samples)
        assert chain.length_m == pytest.approx(STEP_M * (80 + rough_samples * (np.sqrt(2) - 1)))
        points = divide_chain(chain, intrinsics, point_count=1, step_m=STEP_M, window_m=2 * STEP_M)
        std_m.append(points.std_m[1, 0])
    middle = (40 * np.sqrt(2) + 40) / 2  # in steps along the chain, whose rough part saves 1 - sqrt(1/2) of each
    moved_m = STEP_M * (middle * (1 - np.sqrt(0.5)) - 40 * (np.sqrt(2) - 1) / 2)
    assert np.sqrt(std_m[1] ** 2 - std_m[2] ** 2) == pytest.approx(moved_m * np.sqrt(0.5), rel=0.01)
    assert std_m[0] < 0.003


def test_a_point_counts_the_pixels_of_its_nearest_sample(intrinsics: Intrinsics) -> None:
    samples = Samples(np.array([[0, 0], [0, 1], [1.0, 1.0]]), np.array([10, 20]), np.zeros(2))
    chain = link_samples(samples, GRIPPER_M, step_m=1, max_gap_m=0, min_pixels=1, jump_m=JUMP_M)
    points = divide_chain(chain, intrinsics, point_count=4, step_m=1, window_m=2)
    assert points.pixels.tolist() == [10, 10, 20, 20]
