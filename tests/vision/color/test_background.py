"""The background model is exact, its bounds are eq. (5.3) bit by bit, and drift is found under a garment."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from garment_dataset.errors import PictureError
from garment_dataset.vision.color.background import Background, BackgroundAccumulator, Bounds, DriftEstimator, lattice

Frames = NDArray[np.uint8]
STEADY = np.zeros(3, np.int16)


def model(frames: Frames) -> Background:
    accumulator = BackgroundAccumulator()
    for frame in frames:
        accumulator.add(frame)
    return accumulator.finish()


def variance(levels: list[int]) -> Fraction:
    """Eq. (5.2) squared, in rational numbers."""
    mean = Fraction(sum(levels), len(levels))
    return sum(((level - mean) ** 2 for level in levels), Fraction(0)) / (len(levels) - 1)


@given(hnp.arrays(np.uint8, st.tuples(st.integers(2, 9), st.just(2), st.just(3), st.just(3))))
def test_mean_and_deviation_are_the_rational_ones_rounded_once(frames: Frames) -> None:
    background = model(frames)
    assert background.count == len(frames)
    for place in np.ndindex(*frames.shape[1:]):
        levels = [int(level) for level in frames[(slice(None), *place)]]
        assert background.mean[place] == float(Fraction(sum(levels), len(levels)))
        assert background.std[place] == math.sqrt(variance(levels))


@pytest.mark.parametrize("count", [257, 258, 259, 516, 700])
def test_any_number_of_frames_is_summed_exactly(count: int) -> None:
    frames = np.random.default_rng(count).integers(200, 256, (count, 3, 4, 3), np.uint8)
    frames[:, 0] = 255
    background = model(frames)
    np.testing.assert_array_equal(background.mean, frames.mean(axis=0, dtype=np.float64))
    assert not background.std[0].any()
    for channel in range(3):
        expected = math.sqrt(variance([int(level) for level in frames[:, 1, 2, channel]]))
        assert background.std[1, 2, channel] == expected


def test_finishing_early_does_not_end_the_sum() -> None:
    frames = np.random.default_rng(1).integers(0, 256, (6, 3, 4, 3), np.uint8)
    accumulator = BackgroundAccumulator()
    for frame in frames[:4]:
        accumulator.add(frame)
    accumulator.finish()
    for frame in frames[4:]:
        accumulator.add(frame)
    np.testing.assert_array_equal(accumulator.finish().std, model(frames).std)


def test_views_of_a_bag_are_accepted_and_left_alone() -> None:
    frames = np.random.default_rng(2).integers(0, 256, (3, 6, 8, 3), np.uint8)
    frames.flags.writeable = False
    cut = frames[:, 1:5, 2:7]
    np.testing.assert_array_equal(model(cut).mean, cut.mean(axis=0))


@pytest.mark.parametrize("count", [0, 1])
def test_one_frame_is_no_background(count: int) -> None:
    with pytest.raises(PictureError, match=f"at least 2, found {count}"):
        model(np.zeros((count, 3, 4, 3), np.uint8))


@pytest.mark.parametrize("shape", [(3, 4), (3, 4, 1), (3, 4, 4)])
def test_a_grey_image_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(PictureError, match="not a colour image"):
        BackgroundAccumulator().add(np.zeros(shape, np.uint8))


def test_frames_of_unequal_size_are_refused() -> None:
    accumulator = BackgroundAccumulator()
    accumulator.add(np.zeros((3, 4, 3), np.uint8))
    with pytest.raises(PictureError, match="unequal size"):
        accumulator.add(np.zeros((4, 3, 3), np.uint8))


def columns(mean: list[float], std: list[float]) -> tuple[Background, Frames]:
    """Return a background with one model per column, the same in every row, and a frame with level i in row i."""
    shape = (256, len(mean), 3)
    means, stds = (np.broadcast_to(np.array(values)[:, None], shape).copy() for values in (mean, std))
    levels = np.broadcast_to(np.arange(256, dtype=np.uint8)[:, None, None], shape).copy()
    return Background(means, stds, 2), levels


@st.composite
def borderline(draw: st.DrawFn) -> tuple[float, float, float]:
    """A mean, a deviation and an alpha of which the product is within two roundings of a level's difference."""
    count = draw(st.integers(2, 300))
    mean = draw(st.integers(0, 255 * count)) / count
    alpha = draw(st.floats(1.0, 8.0))
    std = abs(draw(st.integers(0, 255)) - mean) / alpha
    for _ in range(draw(st.integers(0, 2))):
        std = math.nextafter(std, draw(st.sampled_from([0.0, 1000.0])))
    return mean, std, alpha


@given(st.lists(borderline(), min_size=1, max_size=8))
def test_bounds_are_the_float_definition_bit_by_bit(cases: list[tuple[float, float, float]]) -> None:
    alpha = cases[0][2]
    background, frame = columns([mean for mean, _, _ in cases], [std * a / alpha for _, std, a in cases])
    for min_sigma in (0.0, 2.0):
        expected = (np.abs(frame - background.mean) > alpha * np.maximum(background.std, min_sigma)).any(axis=2)
        marked = Bounds.of(background, alpha=alpha, min_sigma=min_sigma).outside(frame, STEADY)
        np.testing.assert_array_equal(marked, np.where(expected, 255, 0))


def test_one_channel_outside_is_enough() -> None:
    background = Background(np.full((1, 4, 3), 100.0), np.full((1, 4, 3), 2.0), 9)
    frame = np.full((1, 4, 3), 100, np.uint8)
    frame[0, 0, 0], frame[0, 1, 1], frame[0, 2, 2] = 107, 93, 107
    marked = Bounds.of(background, alpha=3.0, min_sigma=0.0).outside(frame, STEADY)
    assert marked.tolist() == [[255, 255, 255, 0]]


@given(
    st.lists(st.tuples(st.floats(0, 255), st.floats(0.5, 40)), min_size=1, max_size=6),
    st.tuples(*[st.integers(-60, 60)] * 3),
)
def test_bounds_drift_as_the_background_does_until_the_camera_saturates(
    cases: list[tuple[float, float]], drift: tuple[int, int, int]
) -> None:
    background, frame = columns([mean for mean, _ in cases], [std for _, std in cases])
    levels = np.arange(-300, 600)
    expected = np.zeros(frame.shape[:2], np.bool_)
    for column, (mean, std) in enumerate(cases):
        background_levels = levels[np.abs(levels - mean) <= std]
        for change in drift:
            seen = np.clip(background_levels + change, 0, 255)
            expected[:, column] |= (np.arange(256) < seen.min()) | (np.arange(256) > seen.max())
    marked = Bounds.of(background, alpha=1.0, min_sigma=0.0).outside(frame, np.array(drift, np.int16))
    np.testing.assert_array_equal(marked > 0, expected)


def test_nothing_is_outside_beyond_the_clipping_mask() -> None:
    background = Background(np.full((2, 4, 3), 100.0), np.ones((2, 4, 3)), 9)
    clip = np.array([[True, False, True, False]] * 2)
    bounds = Bounds.of(background, alpha=3.0, min_sigma=0.0, clip=clip)
    for level in (0, 255):
        for change in (-60, 0, 60):
            marked = bounds.outside(np.full((2, 4, 3), level, np.uint8), np.full(3, change, np.int16))
            np.testing.assert_array_equal(marked > 0, clip)


@given(st.integers(1, 7), st.integers(7, 40), st.integers(7, 40))
def test_runs_hold_their_share_of_lattice_points(pitch: int, height: int, width: int) -> None:
    numbers = np.arange(height * width, dtype=np.int16).reshape(height, width)
    chosen = np.isin(numbers, lattice(numbers, pitch))
    rows, cols = np.asarray(chosen.any(axis=1)), np.asarray(chosen.any(axis=0))
    np.testing.assert_array_equal(chosen, rows[:, None] & cols)
    for line in (rows, cols):
        for blocks in range(1, len(line) // pitch + 1):
            runs = np.lib.stride_tricks.sliding_window_view(line, blocks * pitch)
            assert (runs.sum(axis=1) == blocks).all()


def scene(rng: np.random.Generator, noise: float) -> tuple[Background, NDArray[np.float64]]:
    truth = np.array([70.0, 120.0, 90.0]) + np.linspace(-20, 20, 160)[:, None]
    truth = np.broadcast_to(truth, (120, 160, 3)).copy()
    return Background(truth, np.full(truth.shape, noise), 90), truth + rng.normal(0, noise, truth.shape)


@pytest.mark.parametrize("noise", [1.0, 2.5, 6.0])
def test_drift_is_found_though_the_garment_covers_most_of_the_view(noise: float) -> None:
    rng = np.random.default_rng(3)
    for drift in ((0.0, 0.0, 0.0), (3.3, -4.6, 1.2), (-12.0, 9.5, 14.0)):
        background, empty = scene(rng, noise)
        frame = empty + drift
        frame[:, :96] = rng.normal((150, 60, 110), 12, (120, 96, 3))
        found = DriftEstimator(background, pitch_px=4)(np.clip(np.rint(frame), 0, 255).astype(np.uint8))
        np.testing.assert_allclose(found, drift, atol=0.15 * noise + 0.1)


def test_drift_is_looked_for_inside_the_clipping_mask_only() -> None:
    rng = np.random.default_rng(4)
    background, empty = scene(rng, 2.0)
    frame = np.rint(empty + 5).astype(np.uint8)
    frame[:, :120] -= 12
    clip = np.zeros((120, 160), np.bool_)
    clip[:, 120:] = True
    np.testing.assert_allclose(DriftEstimator(background, clip, pitch_px=4)(frame), 5, atol=0.4)


def test_drift_is_unknown_when_no_background_is_seen() -> None:
    background, _ = scene(np.random.default_rng(5), 2.0)
    assert np.isnan(DriftEstimator(background)(np.full((120, 160, 3), 255, np.uint8))).all()
