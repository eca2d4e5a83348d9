"""What a frame is compared by: medians that are exact, and halves that round nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from garment_dataset.vision.color.seen import Seen, half, middle

Values = NDArray[np.float32]


def values(seed: int, size: int, levels: int) -> Values:
    """Sorted in part, and with ties when there are few levels: what a sample does not show."""
    rng = np.random.default_rng(seed)
    drawn = np.asarray(np.floor(rng.exponential(1, size) * levels) / levels, np.float32)
    drawn[: size // 2] = np.sort(drawn[: size // 2])
    return drawn


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 20_000), st.sampled_from([1, 3, 1000]))
def test_the_middle_is_the_median(seed: int, size: int, levels: int) -> None:
    drawn = values(seed, size, levels)
    assert middle(drawn, size) == np.median(drawn)


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 20_000), st.floats(0.01, 1))
def test_the_middle_of_the_smallest_is_their_median(seed: int, size: int, share: float) -> None:
    drawn, count = values(seed, size, 1000), max(1, int(share * size))
    assert middle(drawn, count) == np.median(np.sort(drawn)[:count])


def test_the_middle_is_found_where_every_sample_misses_it() -> None:
    drawn = np.zeros(31 * 1000, np.float32)
    drawn[::31] = 9  # all that a sample at each 31st place sees
    assert middle(drawn, drawn.size) == 0


@pytest.mark.parametrize(("height", "width"), [(48, 64), (49, 65), (131, 30)])
def test_bytes_are_halved_as_the_same_levels_of_a_mean_are(height: int, width: int) -> None:
    image = np.random.default_rng(height).integers(0, 256, (height, width, 3), np.uint8)
    for ours, mean in zip(half(image), half(image.astype(np.float64)), strict=True):
        assert ours.shape == (height // 2, width // 2)
        np.testing.assert_array_equal(ours, mean)


def test_the_typical_change_is_the_median_of_each_channel() -> None:
    rng = np.random.default_rng(3)
    scene = rng.integers(60, 200, (80, 100, 3), np.uint8)
    frame = np.clip(scene.astype(np.int64) + rng.integers(-20, 40, scene.shape), 0, 255).astype(np.uint8)
    seen = Seen.of(frame, half(scene), np.ones(3))
    box, pixels = (slice(5, 30), slice(10, 41)), rng.random((25, 31)) > 0.4
    change = np.stack([(image - bare)[box][pixels] for image, bare in zip(seen.image, seen.expected, strict=True)])
    np.testing.assert_array_equal(seen.typical_change(box, pixels), np.median(change, axis=1))
