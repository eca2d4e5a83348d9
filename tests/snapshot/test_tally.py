"""What is counted of a snapshot, whatever the columns hold."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa
import pytest

from garment_dataset.snapshot.contents import Piece
from garment_dataset.snapshot.tally import Certainty, Tally

if TYPE_CHECKING:
    from collections.abc import Sequence

COLUMNS = [
    {"name": "x_m", "unit": "m", "uncertainty": "x_std_m"},
    {"name": "x_std_m", "unit": "m", "uncertainty": None},
]
PROVENANCE = {"key": "k", "content": "c", "facts": {"stage": "s", "code": "f", "libraries": {}, "params": {}}}


def tallied(values: Sequence[object], stds: Sequence[object]) -> Certainty:
    table = pa.table({"x_m": values, "x_std_m": stds}).replace_schema_metadata({"provenance": json.dumps(PROVENANCE)})
    tally = Tally({"rows": {"columns": COLUMNS}})
    tally.add(Piece("rows", "a", Path(), "", {}), table)
    (found,) = tally.certainties("rows")
    return found


@pytest.mark.parametrize(
    ("values", "stds", "median", "share"),
    [
        ([1.0, None, 3.0], [0.1, None, 0.3], 0.2, 1 / 3),
        ([[1.0, 2.0], None], [[0.1, 0.3], None], 0.2, 0.5),  # a row of an image
        ([[1.0, None], [2.0]], [[0.1, None], [0.5]], 0.3, 0.0),
        ([None, None], [None, None], None, 1.0),
    ],
)
def test_certainty_is_the_median_of_all_stated(
    values: Sequence[object], stds: Sequence[object], median: float | None, share: float
) -> None:
    found = tallied(values, stds)
    assert found.median_std == (None if median is None else pytest.approx(median))
    assert found.null_share == pytest.approx(share)
