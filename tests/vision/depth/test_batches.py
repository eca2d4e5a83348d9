"""What is computed for many at once is what is computed one by one, by the plain definition."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset.vision.depth.hem_line import edge_row
from garment_dataset.vision.depth.hold import drawn_up_m
from garment_dataset.vision.depth.profile import Profile
from garment_dataset.vision.depth.smoothing import local_fit, middle

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]


def profile_of(y_m: FloatArray, z_m: FloatArray, pieces: int) -> Profile:
    whole, piece = np.ones((1, y_m.size), np.int64), np.arange(y_m.size) * pieces // y_m.size
    return Profile(
        y_m, z_m, piece, whole[0], z_m, z_m, z_m, float(y_m[-1]),
        ends_at_gap=False, window_z_m=z_m[None], window_gain=z_m[None], window_pixels=whole,
    )  # fmt: skip


def test_curves_drawn_up_are_those_of_every_profile_alone() -> None:
    rng = np.random.default_rng(2)
    profiles, gripper_m = [], rng.normal((0, -0.2, 1.0), 0.1, (6, 3))
    for row, (count, pieces) in enumerate(((200, 1), (90, 2), (40, 1), (300, 3), (12, 2), (150, 1))):
        y_m = gripper_m[row, 1] + 0.015 + 0.0018 * np.arange(count)
        profiles.append(profile_of(y_m, gripper_m[row, 2] + 0.02 * rng.normal() + rng.normal(0, 1e-3, count), pieces))
    found = drawn_up_m(profiles, gripper_m)
    for row, profile in enumerate(profiles):
        first = profile.piece == 0
        y_m, z_m = profile.y_m[first] - gripper_m[row, 1], profile.z_m[first] - gripper_m[row, 2]
        for curve, (degree, reach_m) in enumerate(((1, 0.04), (2, 0.04), (2, 0.08), (2, 0.12))):
            near = y_m <= y_m[0] + reach_m
            little = y_m[-1] - y_m[0] < 0.02 or y_m.size < 8
            expected = z_m.mean() if little else np.polynomial.polynomial.polyfit(y_m[near], z_m[near], degree)[0]
            assert found[row, curve] == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("frames", [5, 17, 65])
def test_a_series_is_smoothed_alone_as_among_others(frames: int) -> None:
    rng = np.random.default_rng(frames)
    time_s, values = np.cumsum(rng.uniform(0.02, 0.05, 80)), rng.normal(size=(80, 3))
    together, gain = local_fit(time_s, values, frames, 2)
    alone, own_gain = local_fit(time_s, values[:, 1:2], frames, 2)
    np.testing.assert_allclose(alone[:, 0], together[:, 1], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(gain, own_gain)
    near = slice(40 - frames // 2, 40 - frames // 2 + frames)
    polynomial = np.polynomial.Polynomial.fit(time_s[near], values[near, 1], 2)
    assert alone[40, 0] == pytest.approx(polynomial(time_s[40]), abs=1e-10)


@pytest.mark.parametrize("count", [1, 2, 7, 10])
def test_the_median_of_a_few_values(count: int) -> None:
    values = np.random.default_rng(count).normal(size=count)
    assert middle(values) == np.median(values)


@pytest.mark.parametrize("seed", range(6))
def test_no_line_through_two_ends_costs_less_than_the_edge(seed: int) -> None:
    """Of a straight edge, by all lines one by one; the found one is refined, so it is near the best of them."""
    rng = np.random.default_rng(seed)
    away_px: FloatArray = np.arange(-14, 15, dtype=np.float64) + rng.uniform(-0.5, 0.5)
    lowest = np.rint(200 + rng.uniform(-0.4, 0.4) * away_px)
    highest = lowest + rng.integers(0, 3, away_px.size).astype(np.float64)
    costs = {}
    for i in range(away_px.size):
        for j in range(i + 1, away_px.size):
            if away_px[j] - away_px[i] >= 4:
                slope = (lowest[j] - lowest[i]) / (away_px[j] - away_px[i])
                line = lowest[i] + slope * (away_px - away_px[i])
                off = (line - np.clip(line, lowest, highest)) / 0.5
                unseen = np.clip(line - lowest, 0, highest - lowest)
                costs[lowest[i] - slope * away_px[i]] = np.minimum(off**2 + 0.05 * unseen, 9.0).sum()
    found = edge_row(away_px, lowest, highest)
    assert found is not None
    assert abs(found - min(costs, key=lambda level: costs[level])) < 0.5
