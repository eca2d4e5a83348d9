"""How often a wrong name is found, and the right one proposed: ``python benchmarks/names.py [--recordings FOLDER]``.

The thesis' recordings are simulated (some ten minutes; or taken from a folder that ``garment simulate --set thesis``
filled), and a few of another swing or speed. Each bag is read once; then one name at a time is made wrong, and the
whole set compared. Found is what has a finding of a code that is expected, on every recording whose name is wrong.
"""

from __future__ import annotations

import argparse
import dataclasses
import tempfile
from collections import defaultdict
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.catalog import Catalog
from garment_dataset.catalog.names import RecordingName, parse_bag_name
from garment_dataset.checks.content import read_content
from garment_dataset.checks.contract import contract_of
from garment_dataset.checks.names import compare
from garment_dataset.checks.naming import Change, Measured, changed
from garment_dataset.layout import packaged_workspace
from garment_dataset.simulate.orders import Order, names_of, run_orders

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.catalog import CatalogRow
    from garment_dataset.checks.content import Content

FOLDER = packaged_workspace() / "catalog"
CATALOG = Catalog.load(FOLDER)
OTHERS = (
    *("GreenTowel_Ruler_03_pi16_0.25_R1", "RedSkirt_Belt_pi16_0.25_R1", "BlueShirt_Free_pi16_0.3_B1"),
    *("GreenTowel_Ruler_04_pi24_0.5_R1", "BlackShorts_Belt_pi8_0.5_R1", "FelShirt_Collar_pi12_0.5_B1"),
)
"""Recordings that are put in the place of those that are called the same but for swing and speed."""


GARMENT = ("colour-contradicted", "length-contradicted", "differs-from-repeats")


class Trial(NamedTuple):
    """A data set with one thing wrong."""

    kind: str
    codes: tuple[str, ...]
    wrong: tuple[str, ...]
    """The names that are wrong."""
    right: dict[str, str | None]
    """What they should be; None where nothing can say it."""
    measured: list[Measured]


def renamed(row: CatalogRow, name: RecordingName) -> CatalogRow:
    """Return a row as the catalog would have it of a bag of another name."""
    garment = next((each for each in CATALOG.tables.garments if each.garment == name.garment), None)
    return dataclasses.replace(
        row,
        recording=str(name),
        name=name,
        garment=name.garment,
        axis=name.axis,
        repeat=name.repeat,
        speed=float(name.speed),
        swing_rad=name.swing_rad,
        color=None if garment is None else garment.color,
    )


def trials(measured: list[Measured], others: dict[str, Content]) -> Iterator[Trial]:
    """Yield every wrong name that is tried."""
    yield Trial("nothing", (), (), {}, measured)
    garments = [each.garment for each in CATALOG.tables.garments]
    for each in measured:
        yield from _other_axis(each, measured)
        yield from _other_garments(each, measured, garments)
        yield _copy(each, measured)
    yield from _swapped(measured)
    for name, content in others.items():
        yield _other_motion(name, content, measured)


def _with(each: Measured, change: Change, measured: list[Measured]) -> tuple[str, list[Measured]] | None:
    """Return the data set in which one bag has another name; one that has that name already leaves."""
    if (name := changed(each.row.name, change)) is None:
        return None
    rest = [other for other in measured if other is not each and other.row.recording != str(name)]
    return str(name), [*rest, Measured(renamed(each.row, name), each.content)]


def _other_axis(each: Measured, measured: list[Measured]) -> Iterator[Trial]:
    if (made := _with(each, Change(axis="B" if each.row.axis == "R" else "R"), measured)) is not None:
        yield Trial("axis letter", ("axis-contradicted",), (made[0],), {made[0]: each.row.recording}, made[1])


def _other_garments(each: Measured, measured: list[Measured], garments: list[str]) -> Iterator[Trial]:
    for garment in garments:
        if (made := _with(each, Change(garment=garment), measured)) is not None:
            name, rest = made
            yield Trial("garment", GARMENT, (name,), {name: each.row.recording}, rest)


def _copy(each: Measured, measured: list[Measured]) -> Trial:
    other = next(m for m in measured if m is not each)
    rest = [m for m in measured if m is not other]
    names = (each.row.recording, other.row.recording)
    return Trial(
        "a copy of another", ("copied",), names, dict.fromkeys(names), [*rest, Measured(other.row, each.content)]
    )


def _swapped(measured: list[Measured]) -> Iterator[Trial]:
    groups: dict[object, list[Measured]] = defaultdict(list)
    for each in measured:
        if each.row.repeat is not None:
            groups[each.row.garment, each.row.holding, each.row.axis].append(each)
    for group in groups.values():
        for one, other in pairwise(group):
            rest = [each for each in measured if each not in (one, other)]
            names = (one.row.recording, other.row.recording)
            right: dict[str, str | None] = {names[0]: names[1], names[1]: names[0]}
            swapped = [Measured(one.row, other.content), Measured(other.row, one.content)]
            yield Trial("repeats swapped", ("repeats-reversed",), names, right, rest + swapped)


def _other_motion(name: str, content: Content, measured: list[Measured]) -> Trial:
    right = parse_bag_name(name)
    assert isinstance(right, RecordingName)
    wrong = changed(right, Change(swing_divisor=16, speed="0.5"))
    kind = "swing" if right.swing_divisor != 16 else "speed"
    rest = [Measured(m.row, content) if m.row.recording == str(wrong) else m for m in measured]
    return Trial(kind, (f"{kind}-contradicted",), (str(wrong),), {str(wrong): name}, rest)


class Tally:
    """What became of the trials of one kind."""

    def __init__(self) -> None:
        self.tried = self.found = self.right = self.wrong = self.beside = 0

    def add(self, trial: Trial) -> None:
        """Compare one data set."""
        found = [each for each in compare(trial.measured, CATALOG.tables.garments) if each.code != "unmeasured"]
        own = [each for each in found if each.subject in trial.wrong]
        targets = {each.subject: each.target for each in own if each.target is not None}
        self.tried += 1
        self.found += {each.subject for each in own if each.code in trial.codes} == set(trial.wrong)
        self.right += bool(targets) and all(target == f"{trial.right[name]}.bag" for name, target in targets.items())
        self.wrong += any(target != f"{trial.right[name]}.bag" for name, target in targets.items())
        self.beside += len({each.subject for each in found} - set(trial.wrong))


def main() -> None:
    """Simulate, read, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--recordings", type=Path)
    folder = parser.parse_args().recordings
    with tempfile.TemporaryDirectory() as made:
        wanted = [*([] if folder else names_of([], "thesis")), *OTHERS]
        list(run_orders([Order(name, Path(made), 0, "xtion", "small", "none", None) for name in wanted], 2))
        where, contract = folder or Path(made), contract_of(FOLDER)
        measured = [
            Measured(dataclasses.replace(row, path=path), read_content(path, contract))
            for row in CATALOG.rows
            if (path := where / f"{row.recording}.bag").exists()
        ]
        others = {name: read_content(Path(made) / f"{name}.bag", contract) for name in OTHERS}
    tallies: dict[str, Tally] = defaultdict(Tally)
    for trial in trials(measured, others):
        tallies[trial.kind].add(trial)
    print("| what is wrong | tried | found | right name proposed | a wrong one | other recordings named |")
    print("|---|---|---|---|---|---|")
    for kind, each in tallies.items():
        cells = (kind, each.tried, each.found if kind != "nothing" else "-", each.right, each.wrong, each.beside)
        print(f"| {' | '.join(map(str, cells))} |")


if __name__ == "__main__":
    main()
