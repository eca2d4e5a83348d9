"""Where cloth ends: lines, tips, torn columns and missing pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset.vision.depth.hem import column_ends
from garment_dataset.vision.depth.hem_line import edge_row
from garment_dataset.vision.depth.surfaces import ProfileRows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

AWAY = np.arange(-14.0, 15.0)


def row_of(ends: FloatArray, missing: FloatArray | None = None, away_px: FloatArray = AWAY) -> float:
    found = edge_row(away_px, ends, ends if missing is None else ends + missing)
    assert found is not None
    return found


@pytest.mark.parametrize("slope", [0.0, 0.1, -0.7])
def test_a_slanted_hem_is_found_to_a_fraction_of_a_row(slope: float) -> None:
    """A column whose edge is at e has its last pixel in row floor(e): half a row above, on average."""
    edge = 300.3 + slope * AWAY
    assert row_of(np.floor(edge)) + 0.5 == pytest.approx(300.3, abs=0.35)


@pytest.mark.parametrize("tip_px", [-6.0, 0.0, 5.0])
def test_a_tip_is_no_line(tip_px: float) -> None:
    """Sides of 45 degrees: one line through both would end up to 7 rows above the tip."""
    edge = 300 - np.abs(AWAY - tip_px)
    assert row_of(np.floor(edge)) + 0.5 == pytest.approx(300 - abs(tip_px), abs=0.6)


def test_a_step_beside_the_profile_does_not_move_its_hem() -> None:
    assert row_of(np.where(AWAY < 6, 400.0, 380.0)) == pytest.approx(400)
    assert row_of(np.where(AWAY < -6, 380.0, 400.0)) == pytest.approx(400)


def test_torn_columns_do_not_count() -> None:
    ends = np.full(AWAY.size, 300.0)
    ends[[3, 4, 5, 12, 20, 21]] -= [2, 3, 2, 8, 5, 4]
    assert row_of(ends) == pytest.approx(300)


def test_a_column_ends_anywhere_among_its_missing_pixels() -> None:
    """Half of the columns miss their last three pixels, the profile's own too, and the wall is seen below."""
    ends = np.where(np.abs(AWAY) < 8, 297.0, 300.0)
    assert row_of(ends, np.where(np.abs(AWAY) < 8, 3.0, 0.0)) == pytest.approx(300)
    assert row_of(ends, np.where(np.abs(AWAY) < 8, 40.0, 0.0)) == pytest.approx(300)


def test_where_nothing_is_seen_below_cloth_ends_where_it_is_seen_last() -> None:
    ends = np.full(AWAY.size, 300.0)
    assert row_of(ends, np.full(AWAY.size, 50.0)) == pytest.approx(300)


def test_too_few_columns_are_no_line() -> None:
    assert edge_row(AWAY[:4], AWAY[:4], AWAY[:4]) is None


def test_the_ends_of_columns_of_an_image() -> None:
    """Cloth of 1 m before a wall of 2 m; one column with a hole, one with missing ends, one that is torn."""
    block = np.full((60, 41), 2000, np.uint16)
    block[:40] = 1000
    block[20:25, 18] = 0
    block[37:42, 22] = 0
    block[30:, 24] = 2000
    weight = (block[:, 20 - 14 : 20 + 15] == 1000).astype(np.float64)
    height = np.arange(60.0)
    rows = ProfileRows(
        height, weight, weight, height * 0, height * 0 + 20, np.where(height < 40, 1.0, np.nan), height < 40
    )
    away_px, lowest, highest = column_ends(block, rows, 39, 0.012)
    assert away_px.tolist() == AWAY.tolist()
    by_column = {int(away): (low, high) for away, low, high in zip(away_px, lowest, highest, strict=True)}
    assert by_column[-2] == (39, 39)
    assert by_column[2] == (36, 41)
    assert by_column[4] == (29, 29)
    assert by_column[0] == (39, 39)
