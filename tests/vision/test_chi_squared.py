"""Quantiles against printed tables, and intervals that hold as often as they say."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garment_dataset.vision.chi_squared import chi_squared_quantile, chi_squared_share, std_interval


# scipy.stats.chi2.ppf
@pytest.mark.parametrize(
    ("share", "degrees", "value"),
    [
        (0.025, 1, 0.0009820691),
        (0.975, 1, 5.0238861873),
        (0.5, 2, 1.3862943611),
        (0.025, 4, 0.4844185571),
        (0.975, 4, 11.1432867819),
        (0.95, 10, 18.3070380533),
        (0.025, 100, 74.2219274749),
    ],
)
def test_quantiles_are_those_of_printed_tables(share: float, degrees: float, value: float) -> None:
    assert chi_squared_quantile(share, degrees) == pytest.approx(value, rel=1e-4)


@given(st.floats(0.001, 0.999), st.floats(0.5, 2000))
def test_the_share_below_a_quantile_is_that_share(share: float, degrees: float) -> None:
    assert chi_squared_share(chi_squared_quantile(share, degrees), degrees) == pytest.approx(share, abs=1e-9)


@pytest.mark.parametrize("count", [2, 5, 30])
def test_intervals_hold_as_often_as_they_say(count: int) -> None:
    rng = np.random.default_rng(count)
    stds = rng.normal(0, 3.0, (4000, count)).std(axis=1, ddof=1)
    low, high = std_interval(1.0, count - 1)
    assert np.mean((stds * low <= 3) & (stds * high >= 3)) == pytest.approx(0.95, abs=0.015)
