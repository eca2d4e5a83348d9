"""Surfaces of second order, their windows, and the pieces they are fitted to: known answers."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset.vision.depth.cloud import LEVEL_SPACING_PER_M, NOISE_LEVELS, Intrinsics
from garment_dataset.vision.depth.pattern import FixedPattern
from garment_dataset.vision.depth.pieces import breaks, pieces, without_islands
from garment_dataset.vision.depth.profile import Profile
from garment_dataset.vision.depth.support import HIDDEN_CURVATURE_PER_M
from garment_dataset.vision.depth.surfaces import ProfileRows, Surfaces, cloth_of, fit_surfaces, joined
from garment_dataset.vision.depth.windows import choose_windows

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

K = Intrinsics(fx_px=570.0, fy_px=570.0, cx_px=320.0, cy_px=240.0)
ROWS, HALF = 90, 40
NOISE_PER_M = 3.2 * LEVEL_SPACING_PER_M


def blobs_of(levels: float) -> FixedPattern:
    """Return a pattern in blobs of 113 pixels."""
    sizes = 113.0 * np.array([1.0, 4.0, 16.0, 64.0, 256.0])
    return FixedPattern(sizes, levels * LEVEL_SPACING_PER_M * np.sqrt(113 / sizes))


PATTERN = blobs_of(0.25)


def rows_of(inverse: Callable[[FloatArray, FloatArray], FloatArray], weight: FloatArray | None = None) -> ProfileRows:
    """Return rows whose pixels have the inverse depth of a function of u, from the profile, and v, from the middle."""
    v = np.arange(ROWS, dtype=np.float64) + 200
    u, down = np.meshgrid(np.arange(-HALF, HALF + 1, dtype=np.float64), v - v.mean())
    weight = np.ones_like(u) if weight is None else weight
    middle_m = 1 / inverse(np.zeros(ROWS), v - v.mean())
    return ProfileRows(
        v, weight, weight * inverse(u, down), np.zeros(ROWS), np.full(ROWS, 320.0), middle_m, np.ones(ROWS, np.bool_)
    )


def fitted(rows: ProfileRows, *windows_px: tuple[int, int], piece: NDArray[np.int64] | None = None) -> Surfaces:
    piece = np.zeros(ROWS, np.int64) if piece is None else piece
    return fit_surfaces(cloth_of(rows, np.arange(ROWS), piece, 0.0, windows_px), K, windows_px)


def level(u: FloatArray, v: FloatArray) -> FloatArray:
    return 0.95 + 0 * (u + v)


def paraboloid(u: FloatArray, v: FloatArray) -> FloatArray:
    return 0.95 + 2e-4 * u - 3e-4 * v + 2e-6 * u**2 + 3e-6 * u * v - 4e-6 * v**2


def cylinder(u: FloatArray, v: FloatArray) -> FloatArray:
    """A fold of 5 cm radius down the middle, 1.05 m away at its front."""
    del v
    x_m = np.clip(u / 570 * 1.07, -0.0499, 0.0499)
    return 1 / (1.1 - np.sqrt(0.05**2 - x_m**2))


@pytest.mark.parametrize("window_px", [(12, 12), (36, 24)])
def test_a_surface_of_second_order_is_found_exactly_at_its_ends_too(window_px: tuple[int, int]) -> None:
    """What is known beforehand weighs little: it takes away hundredths of a level, most at the ends."""
    rows = rows_of(paraboloid)
    found = fitted(rows, window_px)
    down = rows.v - rows.v.mean()
    off = np.abs(found.inverse[0] - paraboloid(np.zeros(ROWS), down)) / LEVEL_SPACING_PER_M
    assert off.max() < 0.05
    assert off[window_px[1] : -window_px[1]].max() < 0.02
    inner = slice(window_px[1], -window_px[1])
    np.testing.assert_allclose(found.down[0, inner], (-3e-4 - 8e-6 * down)[inner], atol=2e-6)


def test_a_plane_through_a_ridge_is_off_by_what_a_surface_of_second_order_is_not() -> None:
    """The mean of x² / 2 r over a window 47 mm wide, 1.8 mm, against what is left of fourth order."""
    rows = rows_of(cylinder)
    true = cylinder(np.zeros(ROWS), np.zeros(ROWS))
    second, plane = fitted(rows, (12, 12)).inverse - true
    assert np.abs(second).max() < 0.1 * LEVEL_SPACING_PER_M
    assert np.abs(plane).min() > 0.5 * LEVEL_SPACING_PER_M


def test_a_leaning_plane_off_the_axis_is_cut_where_the_gripper_is() -> None:
    """z = 1 + 0.3 (x - x_g) has the depth 1 on the profile, however far the pixels around it are off."""
    x_m = 0.3
    v = np.arange(ROWS, dtype=np.float64) + 200
    column = 320 + 570 * x_m / 1.02  # not quite where the profile is: that is found by the fit
    u = column + np.arange(-HALF, HALF + 1)
    inverse = np.tile((1 - 0.3 * (u - 320) / 570) / (1 - 0.3 * x_m), (ROWS, 1))
    rows = ProfileRows(
        v, np.ones_like(inverse), inverse, np.zeros(ROWS), np.full(ROWS, column), np.full(ROWS, 1.02), v > 0
    )
    cloth = cloth_of(rows, np.arange(ROWS), np.zeros(ROWS, np.int64), x_m, ((12, 12),))
    found = fit_surfaces(cloth, K, ((12, 12),))
    np.testing.assert_allclose(found.inverse, 1.0, atol=2e-5)
    np.testing.assert_allclose(found.lean, 0.3, atol=2e-3)


def test_no_window_reaches_into_another_piece() -> None:
    def stepped(u: FloatArray, v: FloatArray) -> FloatArray:
        return np.where(v < 0, 0.95, 0.99) + 0 * u

    rows = rows_of(stepped)
    piece = (rows.v > rows.v.mean()).astype(np.int64)
    found = fitted(rows, (12, 12), (36, 24), piece=piece)
    np.testing.assert_allclose(found.inverse, np.tile(np.where(piece == 0, 0.95, 0.99), (3, 1)), atol=1e-6)


def test_the_gain_is_the_variance_that_white_noise_leaves() -> None:
    rng = np.random.default_rng(4)
    noise = rng.normal(0, 1e-3, (200, ROWS, 2 * HALF + 1))
    found = []
    for each in noise:
        rows = rows_of(level)
        rows = replace(rows, inverse=rows.inverse + each)
        found.append(fitted(rows, (12, 12)))
    variance = np.var([each.inverse[:, ROWS // 2] for each in found], axis=0)
    np.testing.assert_allclose(variance, 1e-6 * found[0].gain[:, ROWS // 2], rtol=0.4)


def test_few_pixels_are_no_reason_to_fail() -> None:
    weight = np.zeros((ROWS, 2 * HALF + 1))
    weight[:, HALF - 1 : HALF + 2] = 1
    found = fitted(rows_of(paraboloid, weight), (12, 12), piece=np.arange(ROWS) // 2)
    true = paraboloid(np.zeros(ROWS), np.arange(ROWS, dtype=np.float64) - 44.5)
    np.testing.assert_allclose(found.inverse[0], true, atol=2e-3)


def test_steps_that_stand_alone_break_and_slopes_do_not() -> None:
    assert breaks(np.array([0.0, 0.007, 0.0, 0.013, 0.007, 0.008, 0.007]), 0.012).tolist() == [
        False, True, False, True, False, False, False,
    ]  # fmt: skip
    assert pieces(np.array([1.0, 1.0, 1.05, 1.05, 1.0]), 0.012).tolist() == [0, 0, 1, 1, 2]


def test_an_edge_that_grazes_the_plane_is_left_out_and_a_fold_is_not() -> None:
    index = np.arange(30)
    for rows, left in ((4, 26), (9, 30)):
        middle_m = np.where((index >= 10) & (index < 10 + rows), 0.95, 1.0)
        assert without_islands(index, middle_m, 0.012).size == left
    other_side_m = np.where(index < 10, 1.0, np.where(index < 13, 0.95, 1.05))
    assert without_islands(index, other_side_m, 0.012).size == 30


def profiles_of(window_z_m: FloatArray, gain: tuple[float, ...] = (0.01, 0.001)) -> list[Profile]:
    """Return profiles, (T, w, n) depths, straight down from the gripper."""
    count = window_z_m.shape[2]
    y_m = np.linspace(0.02, 0.6, count)
    ones = np.ones((len(gain), count))
    return [
        Profile(
            y_m, z_m[0], np.zeros(count, np.int64), np.ones(count, np.int64), y_m * 0, y_m * 0, z_m[0], float(y_m[-1]),
            ends_at_gap=False, window_z_m=z_m, window_gain=ones * np.array(gain)[:, None],
            window_pixels=(ones * np.array([[600], [3000]])).astype(np.int64),
        )
        for z_m in window_z_m
    ]  # fmt: skip


def test_noise_lets_the_large_window_be_and_a_bend_does_not() -> None:
    """In single frames both differ alike; over time noise averages out. In between lies a fade."""
    rng = np.random.default_rng(1)
    z_m = np.full((40, 2, 120), 1.0)
    z_m[:, 0] += rng.normal(0, 0.002, (40, 1)) * np.ones(120)
    bent = z_m.copy()
    bent[:, 1] += 0.004
    gripper_m = np.zeros((40, 3))
    chosen = choose_windows(profiles_of(z_m), gripper_m, PATTERN, NOISE_PER_M)
    assert all(np.allclose(profile.z_m, 1.0, atol=1e-4) and (profile.pixels > 2900).all() for profile in chosen)
    kept = choose_windows(profiles_of(bent), gripper_m, PATTERN, NOISE_PER_M)
    np.testing.assert_allclose([profile.z_m for profile in kept], bent[:, 0], atol=1e-9)


def test_the_stronger_the_pattern_the_more_a_difference_is_taken_for_it() -> None:
    z_m = np.full((20, 2, 120), 1.0)
    z_m[:, 1] += 0.0015
    weak, strong = (
        choose_windows(profiles_of(z_m), np.zeros((20, 3)), blobs_of(levels), NOISE_PER_M)[5].z_m
        for levels in (0.05, 0.5)
    )
    np.testing.assert_allclose(weak, 1.0)
    np.testing.assert_allclose(strong, 1.0015)


def test_several_images_at_once_get_the_surfaces_that_least_squares_gives_each() -> None:
    """Window by window with all of its pixels, as defined: no running sums, and another solver."""
    rng = np.random.default_rng(7)
    windows_px = ((4, 3), (10, 8))
    cloths, expected = [], []
    for count in (40, 25):
        weight = (rng.random((count, 25)) < 0.7).astype(np.float64)
        q = 0.95 + rng.normal(0, 1e-3, weight.shape)
        v, shift_px = np.arange(count, dtype=np.float64) + 180, rng.uniform(-0.5, 0.5, count)
        rows = ProfileRows(v, weight, weight * q, shift_px, v * 0 + 320, rng.uniform(1.0, 1.1, count), v > 0)
        index = np.flatnonzero(rng.random(count) < 0.9)
        piece = (index > count // 2).astype(np.int64)
        cloths.append(cloth_of(rows, index, piece, 0.0, windows_px))
        expected.append([plain_levels(rows, index, piece, window_px) for window_px in windows_px])
    together = fit_surfaces(joined(cloths), K, windows_px)
    np.testing.assert_allclose(together.inverse[:2], np.concatenate(expected, axis=1), rtol=0, atol=1e-10)
    alone = np.concatenate([fit_surfaces(cloth, K, windows_px).inverse for cloth in cloths], axis=1)
    np.testing.assert_allclose(together.inverse, alone, rtol=0, atol=1e-13)


def plain_levels(
    rows: ProfileRows, index: NDArray[np.int64], piece: NDArray[np.int64], window_px: tuple[int, int]
) -> list[float]:
    """Return the level of the surface around each row, by the singular values of all its pixels and of the priors."""
    (half_width, half_height), reach = window_px, rows.weight.shape[1] // 2
    levels = []
    for place, row in enumerate(index):
        near = index[(piece == piece[place]) & (np.abs(index - row) <= half_height)]
        u = np.arange(-half_width, half_width + 1) + rows.shift_px[near, None]
        used = rows.weight[near, reach - half_width : reach + half_width + 1] > 0
        q = rows.inverse[near, reach - half_width : reach + half_width + 1][used]
        across, down = (u / half_width)[used], np.broadcast_to((near - row)[:, None] / half_height, u.shape)[used]
        terms = np.stack([across**0, across, down, across**2, across * down, down**2])
        half_m = np.array(window_px) * rows.middle_m[row] / 570
        bend = HIDDEN_CURVATURE_PER_M * np.array([half_m[0] ** 2 / 2, half_m[0] * half_m[1], half_m[1] ** 2 / 2])
        usual = np.array([half_m[0], half_m[1], *bend]) / rows.middle_m[row] ** 2
        prior = 5 * NOISE_LEVELS * LEVEL_SPACING_PER_M / usual
        design = np.concatenate([terms.T, np.diag([0, *prior])])
        levels.append(float(np.linalg.lstsq(design, np.append(q, np.zeros(6)), rcond=None)[0][0]))
    return levels
