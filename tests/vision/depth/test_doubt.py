"""What neighbouring frames tell of a profile's doubts: known answers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from garment_dataset.vision.depth.chain import Chain, Track
from garment_dataset.vision.depth.cloud import Intrinsics
from garment_dataset.vision.depth.doubt import ISLAND_SHARE, length_std_m, missing_m, unrest_m
from garment_dataset.vision.depth.hem import hem_row
from garment_dataset.vision.depth.pattern import FixedPattern
from garment_dataset.vision.depth.pieces import doubtful_islands, without_islands
from garment_dataset.vision.depth.support import Support
from garment_dataset.vision.depth.surfaces import ProfileRows
from garment_dataset.vision.depth.tracking import divide_track
from garment_dataset.vision.depth.uncertainty import ErrorSources

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

TOP_M = (0.0, -0.3, 1.0)
K = Intrinsics(fx_px=570.0, fy_px=570.0, cx_px=319.5, cy_px=239.5)
EXACT = ErrorSources(np.zeros(640), FixedPattern(np.array([1.0, 10000.0]), np.zeros(2)), (0.0, 0.0, 0.0), (70, 20))
SHARES = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
STAMPS_NS = 33_000_000 * np.arange(90)


def straight(top_std_m: float = 0.0) -> Track:
    """Return 60 cm of cloth that hangs straight down."""
    y_m: FloatArray = np.linspace(0, 0.6, 241)
    position_m = np.stack([0 * y_m, TOP_M[1] + y_m, TOP_M[2] + 0 * y_m])
    chain = Chain(position_m, y_m, np.full(241, 5781), np.full(241, np.nan), False, Support.full(241))
    return Track(chain, np.zeros(241), 0.0, top_std_m, np.zeros(241))


def length_doubt_m(islands_m: list[list[float]], below_m: float = 0.0) -> FloatArray:
    track = straight()
    points = divide_track(track, TOP_M, K, point_count=5, sources=EXACT)
    return length_std_m(np.array(islands_m).reshape(2, -1), below_m, track, TOP_M, points)


def test_the_way_past_the_gripper_is_shared_by_the_rest() -> None:
    """2 mm of doubt beside the hem's row of pixels: above the points nothing else is uncertain."""
    found_m = divide_track(straight(0.002), TOP_M, K, point_count=5, sources=EXACT).std_m
    np.testing.assert_allclose(found_m[1], np.hypot((1 - SHARES) * 0.002, SHARES / K.fy_px), rtol=1e-6)


def test_an_island_moves_points_above_it_down_and_those_below_up() -> None:
    """Half of 10 cm there and back, 35 cm below the end point; points take their share of it, or the rest."""
    found_m = length_doubt_m([[0.05], [0.1]])
    np.testing.assert_allclose(found_m[1, [0, 1, 3, 4]], ISLAND_SHARE * 0.1 * np.array([0.1, 0.3, 0.3, 0.1]))
    assert (found_m[[0, 2]] == 0).all()
    np.testing.assert_allclose(length_doubt_m([[0.05, 0.05], [0.1, 0.1]])[1, 1], np.sqrt(2) * found_m[1, 1])


def test_what_is_missing_below_moves_points_by_their_shares() -> None:
    found_m = length_doubt_m([[], []], 0.02)[1]
    np.testing.assert_allclose(found_m[:4], 0.02 * SHARES[:4])
    assert (length_doubt_m([[], []]) == 0).all()


def test_a_hidden_hem_lacks_what_there_was_before_and_afterwards() -> None:
    stamps_ns = np.array([3, 0, 2, 1]) * 1_000_000_000
    length_m, whole = np.array([0.6, 0.63, 0.55, 0.64]), np.array([True, True, False, False])
    np.testing.assert_allclose(missing_m(stamps_ns, length_m, whole), [0, 0, 0.06, 0], atol=1e-12)
    assert (missing_m(stamps_ns, length_m, np.zeros(4, np.bool_)) == 0).all()
    assert (missing_m(stamps_ns, length_m, np.ones(4, np.bool_)) == 0).all()


def test_points_that_swing_are_no_less_certain_and_points_that_jump_are() -> None:
    rng = np.random.default_rng(1)
    time_s = STAMPS_NS / 1e9
    swing_m = 0.1 * np.sin(2 * time_s)[:, None, None] + rng.normal(0, 3e-4, (90, 3, 5))
    assert np.median(unrest_m(STAMPS_NS, swing_m)) == 0
    assert unrest_m(STAMPS_NS, swing_m).max() < 6e-4
    jumping_m = swing_m.copy()
    jumping_m[40:43, 1, 2] += 0.03
    found_m = unrest_m(STAMPS_NS, jumping_m)
    assert (found_m[37:46, 1, 2] > 0.01).all()
    assert found_m[:25].max() < 6e-4
    mixed = rng.permutation(90)
    np.testing.assert_allclose(unrest_m(STAMPS_NS[mixed], jumping_m[mixed]), found_m[mixed], atol=1e-12)


@pytest.mark.parametrize(("rows", "doubtful"), [(4, True), (9, True), (11, False)])
def test_islands_left_out_and_those_hardly_higher_are_in_doubt(rows: int, doubtful: bool) -> None:
    index = np.arange(40)
    middle_m = np.where((index >= 10) & (index < 10 + rows), 0.95, 1.0)
    row, way_m = doubtful_islands(index, without_islands(index, middle_m, 0.012), middle_m, 0.012)
    assert row.tolist() == [10] * doubtful
    np.testing.assert_allclose(way_m, [0.1] * doubtful)


def test_a_fold_to_another_layer_is_no_island() -> None:
    index = np.arange(40)
    middle_m = np.where(index < 10, 1.0, np.where(index < 13, 0.95, 1.05))
    assert doubtful_islands(index, index, middle_m, 0.012)[0].size == 0


@pytest.mark.parametrize("unseen", [0, 6])
def test_the_hem_is_as_uncertain_as_rows_below_it_are_unseen(unseen: int) -> None:
    block = np.full((60, 41), 2000, np.uint16)
    block[:40] = 1000
    block[40 : 40 + unseen] = 0
    weight = (block[:, 6:35] == 1000).astype(np.float64)
    height = np.arange(60.0)
    cloth = height < 40
    rows = ProfileRows(height, weight, weight, height * 0, height * 0 + 20, np.where(cloth, 1.0, np.nan), cloth)
    found = hem_row(block, rows, 39, 0.012)
    assert found is not None
    assert found[0] == pytest.approx(39.5)
    assert found[1] == pytest.approx(unseen / np.sqrt(12))
