"""Central curves of shapes whose centre line is known, and laws of cutting."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from garment_dataset.vision.color.axes import region_axes
from garment_dataset.vision.color.central_curve import CentralCurves, boundaries, central_curve, central_curves
from garment_dataset.vision.color.masks import borders, largest_component

Mask = NDArray[np.bool_]
Floats = NDArray[np.float64]
Shape = Callable[[Floats, Floats], Mask]

PITCH_PX = 8.0
INNER = slice(2, -2)  # next to the ends a cut meets the outline at a grazing angle
# Angle and centre; in the first, edges run along the pixel grid: the worst case, all of an edge rounded alike
POSES = [(0.0, 120.0, 120.0), (0.1, 119.6, 120.2), (-0.7, 120.3, 120.4), (0.785398, 120.0, 120.0), (1.4, 119.9, 119.7)]
in_all_poses = pytest.mark.parametrize("pose", POSES)


def rendered(shape: Shape, angle_rad: float, u0: float, v0: float) -> Mask:
    """Mark the pixels at least half covered by a shape about (u0, v0), its axis turned counter-clockwise from down."""
    size, fine = 240, 5
    offsets = (np.arange(fine) + 0.5) / fine - 0.5
    line = (np.arange(size)[:, None] + offsets).ravel()
    u, v = line[None, :] - u0, line[:, None] - v0
    along, across = turned(u, v, angle_rad)
    covered = shape(along, across).reshape(size, fine, size, fine).mean(axis=(1, 3))
    return np.asarray(covered >= 0.5)


def turned(u: Floats, v: Floats, angle_rad: float) -> tuple[Floats, Floats]:
    """Return coordinates along an axis that is turned counter-clockwise from straight down, and to its left."""
    sin, cos = math.sin(angle_rad), math.cos(angle_rad)
    return u * sin + v * cos, u * cos - v * sin


def measured(mask: Mask, angle_rad: float, u0: float, v0: float, **options: int) -> tuple[Floats, Floats, Floats]:
    """Cut a rendered shape; return the midpoints in its own coordinates, and the widths."""
    curve = central_curve(borders(mask), region_axes(mask), PITCH_PX, **options)
    along, across = turned(curve.u_px - u0, curve.v_px - v0, angle_rad)
    return along[INNER], across[INNER], curve.width_px[INNER]


def rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def ellipse(along: Floats, across: Floats) -> Mask:
    return np.asarray((along / 95) ** 2 + (across / 30) ** 2 <= 1)


def wave(along: Floats) -> Floats:
    return np.asarray(12 * np.cos(2 * math.pi * along / 190))


def s_shape(along: Floats, across: Floats) -> Mask:
    """A ribbon 24 px wide about one wave; symmetric end to end, so that its axis is that of the wave."""
    return np.asarray((np.abs(along) <= 95) & (np.abs(across - wave(along)) <= 12))


def annulus_sector(along: Floats, across: Floats) -> Mask:
    """Between radii 100 and 130 about (0, -110), 50 degrees to either side."""
    radius, angle = np.hypot(along, across + 110), np.arctan2(along, across + 110)
    return np.asarray((radius >= 100) & (radius <= 130) & (np.abs(angle) <= math.radians(50)))


@pytest.mark.parametrize("lines", [1, 5])
def test_an_upright_rectangle_is_exact(lines: int) -> None:
    mask = np.zeros((120, 80), np.bool_)
    mask[10:110, 40:61] = True
    curve = central_curve(borders(mask), region_axes(mask), 8.0, lines=lines)
    assert len(curve.cut) == 12
    np.testing.assert_array_equal(curve.region, 0)
    np.testing.assert_array_equal(curve.cut, np.arange(12))
    np.testing.assert_allclose(curve.u_px, 50)
    np.testing.assert_allclose(curve.v_px, 9.5 + 4 + 8 * np.arange(12))
    np.testing.assert_allclose(curve.width_px, 21)
    np.testing.assert_allclose(curve.position_px, 4 + 8 * np.arange(12))
    np.testing.assert_allclose(curve.arc_length_px, 8 * np.arange(12), atol=1e-9)
    np.testing.assert_array_equal(curve.parts, 1)


@in_all_poses
def test_a_turned_rectangle(pose: tuple[float, float, float]) -> None:
    mask = rendered(lambda along, across: (np.abs(along) <= 95.3) & (np.abs(across) <= 20.2), *pose)
    along, across, width = measured(mask, *pose)
    assert np.abs(across).max() < 0.5
    assert np.abs(width - 40.4).max() < 1
    assert rms(width - 40.4) < 0.3 or pose[0] == 0
    np.testing.assert_allclose(np.diff(along), math.copysign(PITCH_PX, along[-1] - along[0]), atol=0.05)


@in_all_poses
def test_an_ellipse_has_a_straight_centre_line(pose: tuple[float, float, float]) -> None:
    along, across, width = measured(rendered(ellipse, *pose), *pose)
    assert rms(across) < 0.15
    assert rms(width - 60 * np.sqrt(1 - (along / 95) ** 2)) < 0.4


@in_all_poses
def test_the_curve_of_an_s_is_its_wave(pose: tuple[float, float, float]) -> None:
    along, across, width = measured(rendered(s_shape, *pose), *pose)
    assert rms(across - wave(along)) < 0.15
    assert rms(width - 24) < 0.3


@in_all_poses
def test_the_curve_of_an_annulus_sector_is_half_way_between_its_circles(pose: tuple[float, float, float]) -> None:
    along, across, width = measured(rendered(annulus_sector, *pose), *pose)
    both = np.abs(along) < 100 * math.sin(math.radians(50)) - 5  # there a cut meets both circles
    outer, inner = (np.sqrt(radius**2 - along[both] ** 2) for radius in (130, 100))
    assert both.sum() > 15
    assert rms(across[both] + 110 - (outer + inner) / 2) < 0.15
    assert rms(width[both] - (outer - inner)) < 0.3


def aligned(shape: Shape, pose: Floats) -> Floats:
    """Return the curve of a rendered shape as ``across`` at fixed ``along`` in the shape's own coordinates."""
    mask = rendered(shape, *pose)
    along, across, _ = measured(mask, *pose)
    order = np.argsort(along)
    return np.asarray(np.interp(np.linspace(-65, 65, 30), along[order], across[order]))


@pytest.mark.parametrize("shape", [ellipse, s_shape])
def test_turning_and_shifting_a_shape_moves_its_curve_to_a_tenth_of_a_pixel(shape: Shape) -> None:
    poses = np.random.default_rng(11).uniform((-1.5, 119.5, 119.5), (1.5, 120.5, 120.5), (20, 3))
    curves = np.array([aligned(shape, pose) for pose in poses])
    errors = curves - curves.mean(axis=0)
    assert rms(errors) < 0.1
    assert np.abs(errors.mean(axis=1)).max() < 0.1


def test_averaging_over_the_slab_is_what_brings_that_tenth() -> None:
    errors: dict[int, list[float]] = {1: [], 5: []}
    for pose in np.random.default_rng(12).uniform((-1.5, 119.5, 119.5), (1.5, 120.5, 120.5), (10, 3)):
        mask = rendered(ellipse, *pose)
        for lines, found in errors.items():
            found.append(rms(measured(mask, *pose, lines=lines)[1]))
    assert rms(np.array(errors[5])) < 0.1
    assert rms(np.array(errors[5])) < 0.6 * rms(np.array(errors[1]))


def test_widths_are_not_biased_by_the_pixel_grid() -> None:
    true, found = [], []
    for pose in np.random.default_rng(13).uniform((-1.5, 119.5, 119.5), (1.5, 120.5, 120.5), (10, 3)):
        along, _, width = measured(rendered(ellipse, *pose), *pose)
        true.append(60 * np.sqrt(1 - (along / 95) ** 2))
        found.append(width)
    assert abs(np.mean(np.concatenate(found) - np.concatenate(true))) < 0.1  # between pixel centres: -0.9


@in_all_poses
def test_the_slabs_of_a_convex_shape_add_up_to_its_area(pose: tuple[float, float, float]) -> None:
    mask = rendered(ellipse, *pose)
    curve = central_curve(borders(mask), region_axes(mask), 4.0)
    # What is cut off at the lower end is less than a pitch high
    assert 0.985 * mask.sum() < curve.width_px.sum() * 4.0 < 1.005 * mask.sum()


def test_the_first_cut_is_at_the_upper_end() -> None:
    for angle in np.linspace(-1.4, 1.4, 8):
        mask = rendered(s_shape, float(angle), 120.0, 120.0)
        curve = central_curve(borders(mask), region_axes(mask), PITCH_PX)
        assert curve.v_px[0] < curve.v_px[-1]
        assert curve.arc_length_px[0] == 0
        steps = np.hypot(np.diff(curve.u_px), np.diff(curve.v_px))
        np.testing.assert_allclose(np.diff(curve.arc_length_px), steps, atol=1e-9)


def test_a_level_axis_is_followed_to_the_right() -> None:
    mask = np.zeros((40, 120), np.bool_)
    mask[10:21, 10:110] = True
    curve = central_curve(borders(mask), region_axes(mask), 10.0)
    np.testing.assert_allclose(curve.u_px, 9.5 + 5 + 10 * np.arange(10))
    np.testing.assert_allclose(curve.v_px, 15)


def trousers() -> Mask:
    mask = np.zeros((120, 60), np.bool_)
    mask[10:110, 10:51] = True
    mask[50:110, 24:37] = False
    return mask


def test_where_a_cut_meets_several_parts_the_outermost_pair_is_taken() -> None:
    mask = trousers()
    curve = central_curve(borders(mask), region_axes(mask), 10.0)
    np.testing.assert_array_equal(curve.parts, [1] * 4 + [2] * 6)
    np.testing.assert_allclose(curve.u_px, 30)
    np.testing.assert_allclose(curve.width_px, 41)


def test_a_hole_makes_two_parts() -> None:
    mask = trousers()
    mask[100:110] = mask[10]
    curve = central_curve(borders(mask), region_axes(mask), 10.0)
    np.testing.assert_array_equal(curve.parts, [1] * 4 + [2] * 5 + [1])


def random_region(seed: int, blur_px: float) -> Mask:
    noise = np.random.default_rng(seed).normal(0, 1, (40, 50))
    marked = (cv2.GaussianBlur(noise, (0, 0), blur_px) > 0).astype(np.uint8)
    return largest_component(marked).view(np.bool_)


regions = st.builds(random_region, st.integers(0, 2**32 - 1), st.floats(0.3, 3.0))


@given(regions)
def test_the_boundary_passes_each_pixel_edge_once(mask: Mask) -> None:
    outlines = boundaries([borders(mask)])
    padded = np.pad(mask, 1)
    rows, columns = (np.argwhere(np.diff(padded, axis=axis)) for axis in (0, 1))
    upright = np.stack([columns[:, 1] - 0.5, columns[:, 0] - 1.0], axis=1)
    level = np.stack([rows[:, 1] - 1.0, rows[:, 0] - 0.5], axis=1)
    expected = np.concatenate([upright, level])
    assert sorted(map(tuple, outlines.points)) == sorted(map(tuple, expected))
    steps = outlines.points[outlines.following] - outlines.points
    assert np.isin(np.abs(steps).sum(axis=1), 1.0).all()  # to the next edge of one pixel or of its neighbour


@given(regions, st.floats(1.0, 12.0), st.sampled_from([1, 2, 5]))
def test_cuts_of_any_region_meet_it(mask: Mask, pitch_px: float, lines: int) -> None:
    axes = region_axes(mask)
    curve = central_curve(borders(mask), axes, pitch_px, lines=lines)
    assert (curve.parts >= 1).all()
    assert (curve.width_px > 0).all()
    du, dv = axes.downward
    along = (curve.u_px - axes.centroid_u_px) * du + (curve.v_px - axes.centroid_v_px) * dv
    np.testing.assert_allclose(np.diff(along), pitch_px, atol=1e-6)


@settings(max_examples=30)
@given(st.lists(regions | st.just(np.zeros((40, 50), np.bool_)), min_size=1, max_size=5))
def test_many_regions_at_once_are_many_one_by_one(masks: list[Mask]) -> None:
    outlines, axes = [borders(mask) for mask in masks], [region_axes(mask) for mask in masks]
    together = central_curves(outlines, axes, 5.0)
    for number, (outline, axis) in enumerate(zip(outlines, axes, strict=True)):
        alone = central_curve(outline, axis, 5.0)
        chosen = together.region == number
        for name, values in alone._asdict().items():
            if name != "region":
                np.testing.assert_allclose(together._asdict()[name][chosen], values, atol=1e-8)


def test_nothing_has_no_cuts() -> None:
    empty = np.zeros((5, 5), np.bool_)
    curve = central_curve(borders(empty), region_axes(empty), 5.0)
    assert [len(values) for values in curve] == [0] * len(CentralCurves._fields)
    speck = empty.copy()
    speck[2, 2] = True
    assert len(central_curve(borders(speck), region_axes(speck), 5.0).cut) == 0


def test_a_region_in_two_pieces_is_refused() -> None:
    mask = np.zeros((60, 20), np.bool_)
    mask[5:20, 5:15] = mask[40:55, 5:15] = True
    with pytest.raises(ValueError, match="not connected"):
        central_curve(borders(mask), region_axes(mask), 5.0)


def test_axes_may_come_from_elsewhere() -> None:
    mask = np.zeros((120, 60), np.bool_)
    mask[10:110, 10:51] = True
    level = dataclasses.replace(region_axes(mask), orientation_rad=0.0)
    curve = central_curve(borders(mask), level, 10.0)
    np.testing.assert_allclose(curve.u_px, 9.5 + 5 + 10 * np.arange(4))
    np.testing.assert_allclose(curve.v_px, 59.5)
    np.testing.assert_allclose(curve.width_px, 100)
