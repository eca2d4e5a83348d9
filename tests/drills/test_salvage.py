"""The drill of damage: small bags cut, flipped, overwritten, and with bytes removed or inserted at seeded places."""

from __future__ import annotations

from collections import Counter
from random import Random
from typing import TYPE_CHECKING

import pytest

from tests.drills.salvage_law import KINDS, Whole, judge, make_damage, make_whole

if TYPE_CHECKING:
    from pathlib import Path

QUICK, SLOW = 60, 1500


@pytest.fixture(scope="module", params=KINDS)
def whole(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Whole:
    return make_whole(request.param, tmp_path_factory.mktemp("whole"))


def drill(whole: Whole, numbers: range, folder: Path) -> Counter[str]:
    counts: Counter[str] = Counter()
    for number in numbers:
        here = folder / str(number)
        here.mkdir()
        damage = make_damage(whole, Random(f"{whole.kind} {number}"))
        try:
            counts[judge(whole, damage, here)] += 1
        except Exception as error:
            error.add_note(f"{whole.kind} {number}: {damage.what} at byte {damage.start}")
            raise
    return counts


def test_a_damaged_bag_gives_all_that_it_holds_and_nothing_else(whole: Whole, tmp_path: Path) -> None:
    counts = drill(whole, range(QUICK), tmp_path)
    assert counts["saved"] > QUICK // 3


@pytest.mark.slow
def test_thousands_of_damaged_bags(whole: Whole, tmp_path: Path) -> None:
    counts = drill(whole, range(QUICK, QUICK + SLOW), tmp_path)
    assert counts["saved"] > SLOW // 3
