"""Painted sheets and cylinders that move: where the material goes is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset.vision.cloth.lattice import Lattice, normal_matrix, normal_vector
from garment_dataset.vision.cloth.patch import patch_at_rest
from garment_dataset.vision.cloth.relief import fold_std_m, relief_m
from garment_dataset.vision.cloth.sight import Reading, look, sample, trimmed
from garment_dataset.vision.cloth.solve import second_differences
from garment_dataset.vision.cloth.tracks import follow, frames_at_rest
from garment_dataset.vision.cloth.warp import WarpSettings
from garment_dataset.vision.depth.cloud import Intrinsics
from garment_dataset.vision.depth.flat_field import plain_per_m

if TYPE_CHECKING:
    from garment_dataset.arrays import DepthImage, FloatArray, IntArray
    from garment_dataset.vision.cloth.tracks import Tracks

K = Intrinsics(fx_px=570.3, fy_px=570.3, cx_px=319.5, cy_px=239.5)
READING = Reading(plain_per_m(), None, 0.27, 0.25)
GRIPPER_M = np.array([0.01, -0.35, 1.065])
FRAMES, REST = 24, np.arange(4)
TIME_S = np.arange(FRAMES) / 30
START_M = np.stack([np.full(5, 0.02), 0.4 * np.array([0.1, 0.3, 0.5, 0.7, 0.9]), np.zeros(5)], axis=1)
SWING_RAD = 0.2 * np.sin(np.pi * np.maximum(TIME_S - TIME_S[4], 0)) ** 2


def sheet(tilt_rad: float, side_m: float = 0.0, *, length_m: float = 0.4, half_m: float = 0.1) -> DepthImage:
    """Return a flat sheet that hangs from the gripper, tilted away from the vertical and shifted sideways."""
    v, u = np.indices((480, 640), dtype=np.float64)
    along, down = (u - K.cx_px) / K.fx_px, (v - K.cy_px) / K.fy_px
    slope = np.tan(tilt_rad)
    z_m = (GRIPPER_M[2] - slope * GRIPPER_M[1]) / (1 - slope * down)
    below_m = (down * z_m - GRIPPER_M[1]) / np.cos(tilt_rad)
    beside_m = along * z_m - GRIPPER_M[0] - side_m * below_m
    there = (below_m >= 0) & (below_m <= length_m) & (np.abs(beside_m) <= half_m)
    image: DepthImage = np.rint(np.where(there, 1000 * z_m, 1800)).astype(np.uint16)
    return image


def swung(tilt_rad: FloatArray) -> FloatArray:
    """Return where the points of such a sheet are, (T, r, 3)."""
    x_m, y_m, _ = START_M.T
    turned = [np.stack([x_m, y_m * np.cos(tilt), y_m * np.sin(tilt)], axis=1) for tilt in tilt_rad]
    places_m: FloatArray = GRIPPER_M + np.stack(turned)
    return places_m


def cylinder(shift_m: float, radius_m: float = 0.06) -> DepthImage:
    """Return a standing cylinder beside a gripper that moves with it."""
    u = np.arange(640, dtype=np.float64)
    along = (u - K.cx_px) / K.fx_px
    x_m, z_m = GRIPPER_M[0] + shift_m, GRIPPER_M[2] + radius_m
    a, b, c = 1 + along**2, -(x_m * along + z_m), x_m**2 + z_m**2 - radius_m**2
    inside = b**2 - a * c
    depth_m = np.where(inside > 0, (-b - np.sqrt(np.maximum(inside, 0))) / a, 1.8)
    image = np.tile(np.rint(1000 * depth_m).astype(np.uint16), (480, 1))
    image[430:] = 1800
    return image


def tracked(
    images: list[DepthImage],
    grippers_m: FloatArray | None = None,
    *,
    time_s: FloatArray = TIME_S,
    rest: IntArray = REST,
    start_m: FloatArray = START_M,
) -> Tracks:
    ends_m = np.tile(GRIPPER_M, (len(images), 1)) if grippers_m is None else grippers_m
    found = follow(images, time_s, ends_m, rest, start_m, np.zeros_like(start_m), K, READING, WarpSettings())
    assert found is not None
    return found


@pytest.fixture(scope="module")
def swing() -> Tracks:
    return tracked([sheet(tilt) for tilt in SWING_RAD])


def test_a_sheet_that_swings(swing: Tracks) -> None:
    """By 11 degrees, 8 cm at its lower end: the points follow it to 2 mm, also up and down, where depth says little."""
    np.testing.assert_allclose(swing.position_m, swung(SWING_RAD), atol=0.002)
    assert swing.visible.all()


def test_lengths_are_kept(swing: Tracks) -> None:
    length_m = np.linalg.norm(np.diff(swing.position_m, axis=1), axis=2)
    np.testing.assert_allclose(length_m, 0.08, rtol=0.02)


def test_a_cylinder_that_moves_with_the_gripper_stays_on_its_material() -> None:
    """Which goes 10 cm sideways; what is left is perspective: its outline is not always the same part of it."""
    shift_m = 0.5 * SWING_RAD
    ends_m = GRIPPER_M + np.stack([shift_m, 0 * shift_m, 0 * shift_m], axis=1)
    start_m = START_M - np.array([0.02, 0, 0])
    found = tracked([cylinder(shift) for shift in shift_m], ends_m, start_m=start_m)
    np.testing.assert_allclose(found.position_m, start_m + ends_m[:, None], atol=0.003)


def test_a_sheet_that_goes_sideways_beside_the_plane_of_the_gripper() -> None:
    """Its profile in the plane x = x_gripper would stay there; the material does not."""
    found = tracked([sheet(0.0, 0.5 * swing) for swing in SWING_RAD])
    x_m = GRIPPER_M[0] + START_M[:, 0] + 0.5 * SWING_RAD[:, None] * START_M[:, 1]
    np.testing.assert_allclose(found.position_m[..., 0], x_m, atol=0.003)


def test_where_a_sheet_is_cut_off_by_the_crop_is_no_edge_of_it() -> None:
    still = [look(sheet(0.0, half_m=half_m), K, GRIPPER_M, READING) for half_m in (0.1, 0.4)]
    narrow, wide = (patch_at_rest([sight] * 3, GRIPPER_M, K, reach_m=0.25) for sight in still)
    assert narrow is not None
    assert wide is not None
    assert set(narrow.edge_side.tolist()) == {-1.0, 1.0}
    assert wide.edge_side.size == 0


def test_time_can_run_backwards(swing: Tracks) -> None:
    back = tracked(
        [sheet(tilt) for tilt in SWING_RAD[::-1]], time_s=TIME_S[-1] - TIME_S[::-1], rest=FRAMES - 1 - REST[::-1]
    )
    np.testing.assert_allclose(back.position_m[::-1], swing.position_m, atol=1e-5)


def test_equal_images_give_equal_bytes(swing: Tracks) -> None:
    again = tracked([sheet(tilt) for tilt in SWING_RAD])
    assert again.position_m.tobytes() == swing.position_m.tobytes()
    assert again.std_m.tobytes() == swing.std_m.tobytes()


def test_what_is_covered_is_carried_and_less_certain(swing: Tracks) -> None:
    images = [sheet(tilt) for tilt in SWING_RAD]
    covered = slice(8, 16)
    for image in images[covered]:
        image[190:] = 0  # the last two points are below that
    found = tracked(images)
    np.testing.assert_allclose(found.position_m[covered, -1], swung(SWING_RAD)[covered, -1], atol=0.015)
    assert not found.visible[covered, -1].any()
    assert (found.std_m[covered, -1, 2] > 2 * swing.std_m[covered, -1, 2]).all()


def test_a_point_without_a_start_has_no_track(swing: Tracks) -> None:
    start_m = START_M.copy()
    start_m[2] = np.nan
    found = tracked([sheet(tilt) for tilt in SWING_RAD], start_m=start_m)
    assert np.isnan(found.position_m[:, 2]).all()
    assert not found.visible[:, 2].any()
    np.testing.assert_allclose(found.position_m[:, 3], swing.position_m[:, 3], atol=1e-9)


def test_no_garment_no_tracks() -> None:
    wall = [np.full((480, 640), 1800, np.uint16)] * 6
    ends_m, start_m = np.tile(GRIPPER_M, (6, 1)), np.zeros((1, 3))
    assert follow(wall, TIME_S[:6], ends_m, REST, start_m, start_m, K, READING, WarpSettings()) is None


def test_the_rest_ends_before_the_gripper_moves() -> None:
    moved_m = np.zeros((20, 3))
    moved_m[10:, 2] = 0.1
    taken = frames_at_rest(moved_m, threshold_m=0.002, margin=2, most=5, least=3)
    assert taken is not None
    assert taken.tolist() == [3, 4, 5, 6, 7]
    assert frames_at_rest(moved_m[7:], threshold_m=0.002, margin=2, most=5, least=3) is None
    assert frames_at_rest(moved_m[:0], threshold_m=0.002, margin=2, most=5, least=3) is None


def test_bending_costs_nothing_where_values_are_linear() -> None:
    lattice = Lattice.over(np.array([-0.1, 0.0]), np.array([0.1, 0.4]), (0.05, 0.05))
    x_m, y_m = np.meshgrid(lattice.x_m, lattice.y_m)
    linear = (1 + 2 * x_m - 3 * y_m).ravel()
    assert linear @ lattice.bending() @ linear == pytest.approx(0, abs=1e-12)
    places_m = np.random.default_rng(0).uniform([-0.2, -0.1], [0.2, 0.6], (50, 2))
    blended = lattice.blend(places_m).apply(np.repeat(linear[:, None], 3, axis=1))
    np.testing.assert_allclose(blended[:, 0], 1 + 2 * places_m[:, 0] - 3 * places_m[:, 1], atol=1e-12)


@pytest.mark.parametrize("count", [0, 1, 7, 200])
def test_normal_equations_are_those_of_the_dense_rows(count: int) -> None:
    lattice = Lattice.over(np.zeros(2), np.ones(2), (0.5, 0.5))
    rng = np.random.default_rng(1)
    blend = lattice.blend(rng.uniform(0, 1, (count, 2)))
    weight, direction = rng.uniform(1, 2, count), rng.standard_normal((count, 3))
    dense = np.zeros((count, lattice.size))
    np.put_along_axis(dense, blend.index, blend.weight, axis=1)
    rows = np.einsum("ma,mc->mac", direction, dense).reshape(count, 3 * lattice.size)
    np.testing.assert_allclose(
        normal_matrix(blend, weight, direction, lattice.size), rows.T @ (weight[:, None] * rows), atol=1e-12
    )
    np.testing.assert_allclose(normal_vector(blend, weight, direction, lattice.size), rows.T @ weight, atol=1e-12)


def test_accelerations_are_exact_for_parabolas() -> None:
    time_s = np.array([0.0, 0.03, 0.07, 0.1, 0.2])
    weights = second_differences(time_s)
    values = 1 + 2 * time_s + 1.5 * time_s**2
    found = weights[:, 0] * values[:-2] + weights[:, 1] * values[1:-1] + weights[:, 2] * values[2:]
    np.testing.assert_allclose(found, 3.0)


def test_folds_make_places_uncertain_as_they_move_and_flat_sheets_do_not() -> None:
    x_m, y_m = (values.ravel() for values in np.meshgrid(np.linspace(-0.1, 0.1, 21), np.linspace(0, 0.4, 41)))
    start_m = np.array([[0.0, 0.2, 0.0], [np.nan] * 3])
    moved_m = np.zeros((3, 2, 3))
    moved_m[1:, :, 2] = [[0.02], [0.08]]
    still = np.zeros(3)
    flat, folded = (
        fold_std_m(*relief_m(np.column_stack([x_m, y_m, z_m]), start_m), moved_m, still, 0.2)
        for z_m in (0.1 + 0.3 * x_m - 0.2 * y_m, 0.01 * np.sqrt(2) * np.sin(40 * np.pi * x_m))
    )
    np.testing.assert_allclose(flat, 0, atol=1e-8)
    np.testing.assert_allclose(folded[:, 0, 0], 0.2 * np.sqrt(0.01 * np.array([0, 0.02, 0.08])), rtol=0.05)
    assert (folded[1:, 0, 2] < folded[1:, 0, 0]).all()
    assert (folded[:, 1] == 0).all()


def test_a_flat_place_beside_folds_is_as_uncertain_along_z_as_one_that_slides_over_them() -> None:
    deep, flat = 0.01, 0.0
    std_m = fold_std_m(np.array([deep, deep]), np.array([0.5, flat]), np.full((2, 2, 3), 0.02), np.zeros(2), 0.2)
    np.testing.assert_allclose(std_m[..., 2], 0.5 * std_m[..., 0])


def test_cloth_that_fits_worse_than_at_rest_is_less_certain() -> None:
    worse = fold_std_m(np.zeros(1), np.zeros(1), np.zeros((2, 1, 3)), np.array([0.0, 0.003]), 0.2)
    assert worse[0, 0, 0] == 0
    assert worse[1, 0, 0] == pytest.approx(0.006)


def test_a_trimmed_sight_shows_the_same() -> None:
    rng = np.random.default_rng(1)
    whole = look(sheet(0.1), K, GRIPPER_M, READING)
    part = trimmed(whole)
    assert part.z_m.size < 0.8 * whole.z_m.size
    du, dv = np.array(part.corner_px) - whole.corner_px
    u, v = rng.uniform(0, whole.z_m.shape[1], 500), rng.uniform(0, whole.z_m.shape[0], 500)
    np.testing.assert_array_equal(sample(whole.z_m, u, v), sample(part.z_m, u - du, v - dv))
    j, i = np.nonzero(np.isfinite(part.z_m))
    for before, after in ((whole.before_px, part.before_px), (whole.after_px, part.after_px)):
        np.testing.assert_array_equal(before[j + dv, i + du] - du, after[j, i])
