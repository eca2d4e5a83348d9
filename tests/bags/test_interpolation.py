"""The path between two samples: exact where it must be, and within its stated bound."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.bags.interpolation import Knot, path_at, standard_uncertainty_m

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

START = 1_391_700_000_000_000_000
MS = 1_000_000


def knots(position_m: Callable[[float], tuple[float, float, float]], times_ms: tuple[int, ...]) -> list[Knot]:
    return [Knot(START + ms * MS, np.array(position_m(ms / 1000))) for ms in times_ms]


@given(st.lists(st.integers(10, 30), min_size=3, max_size=3), st.integers(0, 100), st.floats(-3, 3))
def test_a_path_of_even_acceleration_is_met_exactly(spans_ms: list[int], percent: int, acceleration: float) -> None:
    def at(time_s: float) -> tuple[float, float, float]:
        return 1.0, 0.3 * time_s, 0.5 * acceleration * time_s**2

    times_ms = (0, spans_ms[0], sum(spans_ms[:2]), sum(spans_ms))
    asked_ms = times_ms[1] + spans_ms[1] * percent // 100
    earlier, before, after, later = knots(at, times_ms)
    found = path_at(earlier, before, after, later, START + asked_ms * MS)
    np.testing.assert_allclose(found.position_m, at(asked_ms / 1000), rtol=0, atol=1e-12)
    assert found.bound_m.max() < 1e-11


def circle(time_s: float) -> tuple[float, float, float]:
    return 0.47 * float(np.cos(2 * time_s)), 0.47 * float(np.sin(2 * time_s)), 1.0


def test_a_chord_is_within_its_bound_and_a_cubic_is_nearer() -> None:
    earlier, before, after, later = knots(circle, (0, 33, 66, 99))
    truth = circle(0.05)
    chord = path_at(None, before, after, later, START + 50 * MS)
    cubic = path_at(earlier, before, after, later, START + 50 * MS)
    chord_error_m, cubic_error_m = (np.abs(each.position_m - truth) for each in (chord, cubic))
    assert chord_error_m.max() == pytest.approx(0.47 * 4 * 0.0165**2 / 2, rel=0.1)
    assert (chord_error_m <= 1.1 * chord.bound_m).all()
    assert cubic_error_m.max() < chord_error_m.max() / 100
    assert (cubic_error_m <= cubic.bound_m + 1e-9).all()


def test_samples_too_uneven_for_a_cubic_are_joined_by_a_chord() -> None:
    earlier, before, after, later = knots(circle, (0, 33, 66, 200))
    found = path_at(earlier, before, after, later, START + 44 * MS)
    np.testing.assert_allclose(found.position_m, (2 * before.position_m + after.position_m) / 3)
    assert (found.bound_m > 0).tolist() == [True, True, False], "its third coordinate stands still"


def test_two_samples_alone_bound_nothing() -> None:
    _, before, after, _ = knots(circle, (0, 33, 66, 99))
    found = path_at(None, before, after, None, START + 50 * MS)
    assert np.isfinite(found.position_m).all()
    assert np.isnan(found.bound_m).all()


def test_the_standard_uncertainty_has_a_floor() -> None:
    bound_m: NDArray[np.float64] = np.array([0.0, 0.003, np.nan])
    found = standard_uncertainty_m(bound_m, 0.001)
    np.testing.assert_allclose(found, [0.001, 0.002, np.nan])
