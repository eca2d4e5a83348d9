"""Axes equal scikit-image's, with MATLAB's 1/12 added."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from skimage import measure

from garment_dataset.vision.color.axes import region_axes

Mask = NDArray[np.bool_]

masks = hnp.arrays(np.bool_, hnp.array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=40))


def half_turn_apart(first_rad: float, second_rad: float) -> float:
    """Return the angle between two axes without direction."""
    return abs((first_rad - second_rad + math.pi / 2) % math.pi - math.pi / 2)


@given(masks)
def test_axes_are_those_of_scikit_image(mask: Mask) -> None:
    assume(mask.any())
    found = region_axes(mask)
    (region,) = measure.regionprops(mask.astype(np.uint8))  # type: ignore[no-untyped-call]
    large, small = (eigenvalue + 1 / 12 for eigenvalue in region.inertia_tensor_eigvals)
    assert found.area_px == region.area
    assert (found.centroid_v_px, found.centroid_u_px) == pytest.approx(region.centroid, abs=1e-9)
    assert found.major_px == pytest.approx(4 * math.sqrt(large), abs=1e-6)
    assert found.minor_px == pytest.approx(4 * math.sqrt(small), abs=1e-6)
    if large - small > 1e-6:  # else there is no direction to compare
        # theirs is counter-clockwise from the downward v axis
        assert half_turn_apart(found.orientation_rad, region.orientation + math.pi / 2) < 1e-6


@given(masks, st.integers(0, 30), st.integers(0, 30))
def test_a_shift_moves_the_centroid_and_nothing_else(mask: Mask, down: int, right: int) -> None:
    assume(mask.any())
    before = region_axes(mask)
    after = region_axes(np.pad(mask, ((down, 3), (right, 5))))
    moved = dataclasses.replace(
        after, centroid_u_px=after.centroid_u_px - right, centroid_v_px=after.centroid_v_px - down
    )
    assert dataclasses.astuple(moved) == pytest.approx(dataclasses.astuple(before), abs=1e-9)
    assert (after.major_px, after.minor_px, after.orientation_rad) == (
        before.major_px,
        before.minor_px,
        before.orientation_rad,
    )


@given(masks)
def test_a_quarter_turn_turns_the_axis(mask: Mask) -> None:
    assume(mask.any())
    before, after = region_axes(mask), region_axes(np.rot90(mask).copy())
    assert (after.major_px, after.minor_px) == pytest.approx((before.major_px, before.minor_px), abs=1e-9)
    if before.major_px - before.minor_px > 1e-6:
        assert half_turn_apart(after.orientation_rad, before.orientation_rad + math.pi / 2) < 1e-6


@pytest.mark.parametrize(("height", "width"), [(300, 8), (1, 1), (1, 7), (480, 640)])
def test_a_rectangle_has_the_moments_of_its_area_not_of_its_pixel_centres(height: int, width: int) -> None:
    found = region_axes(np.ones((height, width), np.bool_))
    lengths = sorted((4 * width / math.sqrt(12), 4 * height / math.sqrt(12)), reverse=True)
    assert (found.major_px, found.minor_px) == pytest.approx(tuple(lengths), rel=1e-12)
    assert (found.centroid_u_px, found.centroid_v_px) == ((width - 1) / 2, (height - 1) / 2)


@pytest.mark.parametrize(
    ("pixels", "degrees"),
    [
        ([(0, 0), (1, 0), (2, 0)], 0),
        ([(0, 0), (0, 1), (0, 2)], 90),
        ([(0, 2), (1, 1), (2, 0)], 45),  # up to the right as displayed
        ([(0, 0), (1, 1), (2, 2)], -45),
        ([(0, 0), (1, 0), (0, 1), (1, 1)], 0),  # no direction: MATLAB says 0
    ],
)
def test_orientation_is_counter_clockwise_from_the_u_axis(pixels: list[tuple[int, int]], degrees: float) -> None:
    mask = np.zeros((4, 4), np.bool_)
    columns, rows = zip(*pixels, strict=True)
    mask[rows, columns] = True
    found = region_axes(mask)
    assert math.degrees(found.orientation_rad) == pytest.approx(degrees)
    u, v = found.downward
    assert math.hypot(u, v) == pytest.approx(1)
    assert v >= -1e-15
    assert math.tan(math.radians(degrees)) * u == pytest.approx(-v) or degrees == 90


def test_nothing_has_no_axes() -> None:
    found = region_axes(np.zeros((4, 5), np.bool_))
    assert found.area_px == 0
    assert all(math.isnan(value) for value in dataclasses.astuple(found)[1:])
