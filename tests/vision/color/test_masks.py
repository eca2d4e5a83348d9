"""Masks survive storage, and their operations equal scikit-image's."""

from __future__ import annotations

import struct

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from skimage import measure, morphology

from garment_dataset.errors import PictureError, TableError
from garment_dataset.vision.color.background import Background
from garment_dataset.vision.color.masks import (
    borders,
    decode_mask,
    encode_mask,
    largest_component,
    open_close,
    polygon_mask,
    suggest_clip_mask,
)

Mask = NDArray[np.bool_]

masks = hnp.arrays(np.bool_, hnp.array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=24))


def blobs(seed: int, height: int, width: int, blur_px: float) -> Mask:
    """A random mask whose regions are about as large as the blur."""
    noise = np.random.default_rng(seed).normal(0, 1, (height, width))
    return np.asarray(cv2.GaussianBlur(noise, (0, 0), blur_px) > 0)


random_blobs = st.builds(
    blobs, st.integers(0, 2**32 - 1), st.integers(12, 48), st.integers(12, 48), st.floats(0.3, 3.0)
)


@given(masks)
def test_a_mask_survives_writing_and_reading(mask: Mask) -> None:
    png = encode_mask(mask)
    np.testing.assert_array_equal(decode_mask(png), mask)
    assert png == encode_mask(mask.copy(order="F"))


def test_the_file_is_a_png_of_one_bit_that_others_read() -> None:
    mask = polygon_mask([(250, 40), (390, 60), (370, 400), (260, 380)], 480, 640)
    png = encode_mask(mask)
    assert struct.unpack(">IIBB", png[16:26]) == (640, 480, 1, 0)
    assert len(png) < 1000
    read = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    assert read is not None
    np.testing.assert_array_equal(read, np.where(mask, 255, 0))


def test_a_drawn_image_is_read_as_a_mask() -> None:
    drawn = np.full((4, 5, 3), 20, np.uint8)
    drawn[1:3, 2:4] = 240
    np.testing.assert_array_equal(decode_mask(cv2.imencode(".png", drawn)[1].tobytes()), drawn[..., 0] > 127)


@pytest.mark.parametrize("png", [b"", b"no image", encode_mask(np.ones((9, 9), np.bool_))[:20]])
def test_what_is_no_image_is_refused(png: bytes) -> None:
    with pytest.raises(TableError, match=f"found {len(png)} bytes"):
        decode_mask(png)


def test_a_polygon_holds_its_border_and_ends_at_the_image() -> None:
    mask = polygon_mask([(3, 2), (7.2, 2), (7, 5.4), (3, 5)], 8, 10)
    assert mask[2:6, 3:8].all()
    assert mask.sum() == 20
    assert polygon_mask([(-9, -9), (99, -9), (99, 99), (-9, 99)], 8, 10).all()


def test_two_corners_are_no_polygon() -> None:
    with pytest.raises(PictureError, match="at least 3, found 2"):
        polygon_mask([(0, 0), (5, 5)], 8, 10)


@given(random_blobs, st.sampled_from([1, 3, 5, 9]), st.sampled_from([1, 3, 7]))
def test_opening_and_closing_are_those_of_an_endless_background(mask: Mask, open_px: int, close_px: int) -> None:
    room = 12
    padded = np.pad(mask, room)
    opened = morphology.opening(padded, np.ones((open_px, open_px), np.bool_))
    expected = morphology.closing(opened, np.ones((close_px, close_px), np.bool_))[room:-room, room:-room]
    np.testing.assert_array_equal(open_close(mask.view(np.uint8), open_px, close_px), expected)


@given(random_blobs)
def test_the_largest_component_is_the_largest_label(mask: Mask) -> None:
    found = largest_component(np.where(mask, np.uint8(255), np.uint8(0)))
    labels = measure.label(mask, connectivity=2)  # type: ignore[no-untyped-call]
    if not mask.any():
        assert not found.any()
        return
    regions = measure.regionprops(labels)  # type: ignore[no-untyped-call]
    best = min(regions, key=lambda region: (-region.area, region.bbox[0], region.bbox[1]))
    rank = (best.area, *best.bbox[:2])
    ties = [labels == region.label for region in regions if (region.area, *region.bbox[:2]) == rank]
    assert any(np.array_equal(found, tie) for tie in ties)


def test_an_island_in_a_hole_is_another_region() -> None:
    mask = np.ones((11, 11), np.uint8)
    mask[1:10, 1:10] = 0
    mask[2:9, 2:9] = 1
    found = largest_component(mask)
    assert found.sum() == 49
    assert found[2:9, 2:9].all()


def test_of_equal_regions_the_upper_is_kept() -> None:
    mask = np.zeros((9, 9), np.uint8)
    mask[6:8, 0:2] = mask[1:3, 5:7] = 1
    assert np.argwhere(largest_component(mask)).tolist() == [[1, 5], [1, 6], [2, 5], [2, 6]]


def connected(mask: Mask) -> Mask:
    return largest_component(mask.view(np.uint8)).view(np.bool_)


@given(random_blobs)
def test_borders_hold_the_pixels_with_a_background_neighbour(mask: Mask) -> None:
    region = connected(mask)
    padded = np.pad(region, 1)
    inside = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    followed = np.zeros_like(region)
    for border in borders(region):
        followed[border[:, 1], border[:, 0]] = True
        step = np.abs(np.diff(border, axis=0, append=border[:1])).max(axis=1)
        assert (step <= 1).all()
    np.testing.assert_array_equal(followed, region & ~inside)


@settings(max_examples=50)
@given(random_blobs)
def test_the_outer_border_comes_first_and_counter_clockwise(mask: Mask) -> None:
    region = connected(mask)
    found = borders(region)
    holes = 1 - measure.euler_number(region, connectivity=2)  # type: ignore[no-untyped-call]
    assert len(found) == (1 + holes if mask.any() else 0)
    for number, border in enumerate(found):
        u, v = border.astype(np.int64).T
        area_as_displayed = -(u * np.roll(v, -1) - v * np.roll(u, -1)).sum()
        assert area_as_displayed >= 0 if number == 0 else area_as_displayed <= 0


def room_with_a_cloth() -> tuple[Background, Mask]:
    """A shaded green cloth with a mark on it, before a cluttered room."""
    rng = np.random.default_rng(7)
    v, u = np.indices((240, 320))
    coarse = rng.uniform(0, 255, (30, 40, 3))
    mean = np.asarray(cv2.resize(coarse, (320, 240), interpolation=cv2.INTER_LINEAR), np.float64)
    cloth = (u >= 60) & (u < 260) & (v >= 30) & (v < 220)
    mean[cloth] = ((1 - ((u - 160) / 400) ** 2)[..., None] * (60.0, 130.0, 80.0))[cloth]
    mean[100:104, 150:154] = 255
    return Background(np.asarray(mean + rng.normal(0, 0.3, mean.shape)), rng.uniform(2, 4, (240, 320, 3)), 90), cloth


def test_the_suggested_mask_is_the_monochrome_part() -> None:
    background, cloth = room_with_a_cloth()
    suggested = suggest_clip_mask(background)
    assert not (suggested & ~cloth).any()
    assert suggested.sum() > 0.8 * cloth.sum()
    assert suggested[95:110, 145:160].all()


def test_what_flickers_is_not_suggested() -> None:
    background, _ = room_with_a_cloth()
    background.std[:, :160] = 30
    assert not suggest_clip_mask(background)[:, :160].any()


def test_a_cluttered_scene_has_nothing_to_suggest() -> None:
    noise = np.random.default_rng(8).uniform(0, 255, (60, 80, 3))
    assert not suggest_clip_mask(Background(noise, np.ones(noise.shape), 9)).any()
