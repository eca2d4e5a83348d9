"""Where an axis goes: every value is within, and no single band presses the curves flat."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.view.curves import Curve, value_limits

TIME_S = np.arange(100) / 30


def swing(std: float = 0.01, *, worst: float | None = None, missing: int = 0) -> Curve:
    value, stds = np.sin(3 * TIME_S), np.full(100, std)
    if worst is not None:
        stds[50] = worst
    value[:missing] = np.nan
    return Curve(1, TIME_S, value, stds)


def test_a_frame_that_says_nothing_moves_no_limit() -> None:
    assert value_limits([swing(worst=50.0)]) == value_limits([swing()])


def test_bands_that_are_all_wide_are_shown_whole() -> None:
    limits = value_limits([swing(0.5)])
    assert limits is not None
    assert limits[0] < -2
    assert limits[1] > 2


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=20, unique=True), st.floats(0, 1e3))
def test_every_value_is_within(values: list[float], std: float) -> None:
    value = np.array(values)
    limits = value_limits([Curve(None, np.arange(len(value)) / 30, value, np.full(len(value), std))])
    assert limits is not None
    assert limits[0] <= value.min()
    assert value.max() <= limits[1]


@pytest.mark.parametrize("curves", [[], [swing(missing=100)], [Curve(0, TIME_S, np.ones(100))]])
def test_what_has_no_height_leaves_the_axis_open(curves: list[Curve]) -> None:
    assert value_limits(curves) is None
