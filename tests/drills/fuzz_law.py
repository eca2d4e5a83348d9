"""The law of damaged recordings: equal rows, or an error in one line, or other rows and a warning that says so."""

from __future__ import annotations

import hashlib
import re
import signal
import warnings
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from garment_dataset.bags import open_bag
from garment_dataset.errors import DataWarning, GarmentError
from garment_dataset.stages.decode import DecodeParams, decode
from garment_dataset.stages.depth_points import DepthPointsParams, depth_points
from garment_dataset.stages.inputs import usable_images

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from types import FrameType

MOST_SECONDS = 20
PLACES = ("offset_bytes",)  # where an image lies may change with the file


@dataclass
class Outcome:
    """What came of reading a recording: its rows and notes, or the line that refuses it."""

    rows: dict[str, str] = field(default_factory=dict)
    notes: set[str] = field(default_factory=set)
    refused: str | None = None


class HangError(Exception):
    """Reading took too long."""


@contextmanager
def no_longer_than(seconds: int) -> Iterator[None]:
    def stop(_: int, __: FrameType | None) -> None:
        raise HangError

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def read(path: Path) -> Outcome:
    """Read a recording all the way through decode and depth_points, and every pixel."""
    with no_longer_than(MOST_SECONDS), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            rows = _rows(path)
        except GarmentError as error:
            return Outcome(refused=str(error))
    notes = {str(each.message) for each in caught if issubclass(each.category, DataWarning)}
    others = [each for each in caught if not issubclass(each.category, DataWarning)]
    assert not others, f"{others[0].category.__name__}: {others[0].message} ({others[0].filename})"
    return Outcome(rows, notes)


def _rows(path: Path) -> dict[str, str]:
    tables = decode(path, DecodeParams())
    params = DepthPointsParams(windows_px=((1, 3),), band_half_width_m=0.1)
    tables |= depth_points(path, tables["frames"], tables["camera"], tables["gripper"], params)
    rows = {name: repr([_row(row) for row in table.to_pylist()]) for name, table in tables.items()}
    with open_bag(path) as bag:
        for stream in ("depth", "color"):
            images = usable_images(bag, tables["frames"], stream)
            digests = [(each.index, hashlib.sha256(each.pixels().tobytes()).hexdigest()) for each in images]
            rows[f"{stream} pixels"] = repr(digests)
    return rows


def _row(row: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in row.items() if name not in PLACES}


def judge(damaged: Outcome, whole: Outcome) -> str:
    """Return ``equal``, ``refused``, ``said``, or ``silent``: other rows without a word, or no one-line error."""
    if damaged.refused is not None:
        return "refused" if "\n" not in damaged.refused and len(damaged.refused) < 2000 else "silent"
    if damaged.rows == whole.rows:
        return "equal"
    # Of what a whole recording says anyway, other numbers are no new word
    return "said" if _shapes(damaged.notes) - _shapes(whole.notes) else "silent"


def _shapes(notes: set[str]) -> set[str]:
    return {re.sub(r"\d+", "#", note) for note in notes}
