"""Names, tables and folder compared in both directions: what disagrees, for which recording, and what would mend it."""

from __future__ import annotations

import difflib
import re
from collections import Counter
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

from garment_dataset.catalog.folder import SALVAGED
from garment_dataset.catalog.names import BackgroundName, RecordingName, plain_stem
from garment_dataset.catalog.schemes import PatternName
from garment_dataset.catalog.suffixes import WHOLE, appended_to

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from garment_dataset.catalog import Catalog
    from garment_dataset.catalog.folder import FolderScan
    from garment_dataset.catalog.schemes import Scheme
    from garment_dataset.catalog.suffixes import Appended

Code = Literal[
    "table-error",
    "misnamed",
    "duplicate",
    "damaged",
    "copied",
    "axis-contradicted",
    "swing-contradicted",
    "speed-contradicted",
    "colour-contradicted",
    "length-contradicted",
    "differs-from-repeats",
    "repeats-reversed",
    "unindexed",
    "unfinished",
    "unexpected",
    "missing",
    "no-background",
    "orphaned",
    "unpaired",
    "salvaged",
    "unmeasured",
]
Severity = Literal["error", "warning", "note"]

SEVERITIES: dict[Code, Severity] = {
    "table-error": "error",
    "misnamed": "error",
    "duplicate": "error",
    "damaged": "error",
    "copied": "error",
    "axis-contradicted": "error",
    "swing-contradicted": "error",
    "speed-contradicted": "error",
    "colour-contradicted": "warning",
    "length-contradicted": "warning",
    "differs-from-repeats": "warning",
    "repeats-reversed": "warning",
    "unindexed": "warning",
    "unfinished": "warning",
    "unexpected": "warning",
    "missing": "warning",
    "no-background": "warning",
    "orphaned": "warning",
    "unpaired": "note",
    "salvaged": "note",
    "unmeasured": "note",
}
"""All codes, in the order of a report; the codes are stable.

Whoever knows the results finds what is ``orphaned``; whoever opens bags, which are ``damaged`` or ``unindexed``; and
whoever reads them, what contradicts their names.
"""

_MAX_COMPARISONS = 50_000
"""How many pairs of names may be compared letter by letter: about a second's worth."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One disagreement.

    Parameters
    ----------
    code : str
        Which kind, a key of :data:`SEVERITIES`.
    severity : {"error", "warning", "note"}
        error: something will be left out or taken for something else; warning: something is not there or not known;
        note: a fact about the data set.
    subject : str
        The recording, or the file when it names none.
    where : str or None
        The file, with line and column for a table.
    message : str
        What is wrong.
    hint : str or None
        What to do about it.
    target : str or None
        The file name that the bag at ``where`` should have; None where nothing says it.
    """

    code: Code
    severity: Severity
    subject: str
    where: str | None
    message: str
    hint: str | None
    target: str | None = None


def lint(catalog: Catalog, folder: Path | None = None) -> tuple[Finding, ...]:
    """Compare names, tables and a folder of bags.

    Parameters
    ----------
    catalog : Catalog
        Loaded with ``strict=False``, or its first table error is raised there and never found here.
    folder : Path, optional
        Folder of bags; by default the one that the catalog has looked at, if any.

    Returns
    -------
    tuple of Finding
        By code in the order of :data:`SEVERITIES`, then in the order of tables and names.
    """
    if folder is not None:
        catalog = catalog.with_folder(folder)
    known = _Known(catalog)
    checks = (_table_errors(catalog), _files(catalog, known), _rows(catalog, known))
    findings = _with_conflicts([finding for check in checks for finding in check])
    order = list(SEVERITIES)
    return tuple(sorted(findings, key=lambda finding: order.index(finding.code)))


def _finding(code: Code, subject: str, where: object, message: str, hint: str | None = None) -> Finding:
    return Finding(code, SEVERITIES[code], subject, None if where is None else str(where), message, hint)


def _with_conflicts(findings: Sequence[Finding]) -> list[Finding]:
    """Say of bags that should get one name that they cannot all have it; some disks know no case."""
    places: dict[str, set[str | None]] = {}
    for finding in findings:
        if finding.target is not None:
            places.setdefault(_wanted(finding.target), set()).add(finding.where)
    counts = {name: len(found) for name, found in places.items() if len(found) > 1}
    return [
        replace(finding, hint=f"{count} bags would get that name: keep one, or give each a name of its own.")
        if finding.target is not None and (count := counts.get(_wanted(finding.target)))
        else finding
        for finding in findings
    ]


def _wanted(target: str) -> str:
    return target.removesuffix(".bag").casefold()


def _table_errors(catalog: Catalog) -> Iterator[Finding]:
    for problem in catalog.tables.problems:
        message = f"{problem.what}: expected {problem.expected}, found {problem.found}"
        yield _finding("table-error", problem.subject, problem.where, message, problem.hint)


def _files(catalog: Catalog, known: _Known) -> Iterator[Finding]:
    """Report what is wrong with files whatever the tables hold."""
    if (found := catalog.found) is None:
        return
    for bag in found.bags:
        if not bag.is_canonical:
            yield known.misnamed(bag.path, str(bag.name), "not the written form")
    yield from _refused(found, known)
    for duplicate in found.duplicates:
        message = f"the same recording is also {duplicate.used.path}, which is the one used"
        hint = "Keep one, or give the other a name of its own."
        yield _finding("duplicate", str(duplicate.bag.name), duplicate.bag.path, message, hint)
    for path in found.unfinished:
        yield _unfinished(path, catalog.scheme)
    for path in found.salvaged:
        name = path.name[: -len(SALVAGED)]
        hint = f"To use it, move the damaged one out of the folder and rename this to {name}.bag."
        yield _finding("salvaged", name, path, "what was saved of a damaged bag, not used under this name", hint)


def _refused(found: FolderScan, known: _Known) -> Iterator[Finding]:
    """Report the bags whose names are none, with those they should have."""
    parts = Counter(appended.given for path, _ in found.refused if (appended := _part(path)) is not None)
    for path, error in found.refused:
        appended, meant = _part(path), known.meant_by_file(path.name)
        whole = None if appended is None else known.meant_by_file(appended.given)
        if appended is not None and whole is not None and (appended.part or parts[appended.given] > 1):
            hint = f"{WHOLE} `rosbags-convert --src PARTS --dst {whole}.bag`."
            yield _finding("misnamed", path.name, path, error.what, hint)
        elif meant is not None:
            yield known.misnamed(path, meant, error.what)
        else:
            nearest = known.nearest(path.name)
            hint = f"Expected {error.expected}." if nearest is None else f"Did you mean {nearest}?"
            yield _finding("misnamed", path.name, path, error.what, hint)


def _part(path: Path) -> Appended | None:
    """Take the name of a part of a recording apart; None for any other."""
    appended = appended_to(plain_stem(path.name))
    return None if appended is None or appended.part is None else appended


def _rows(catalog: Catalog, known: _Known) -> Iterator[Finding]:
    """Compare tables and folder, and the two axes."""
    tables_read = "recordings.csv" not in catalog.tables.unread
    for row in catalog.rows:
        if row.state == "missing":
            yield _finding("missing", row.recording, None, "in recordings.csv, but there is no such bag in the folder")
        elif row.path is not None and row.state == "unexpected" and tables_read:
            if (meant := known.meant_by(row.name)) is not None:
                yield known.misnamed(row.path, meant, "in no table")
                continue
            message = "there is such a bag in the folder, but not in recordings.csv"
            hint = f"If it belongs to the data set, add a row to {catalog.folder / 'recordings.csv'}."
            yield _finding("unexpected", row.recording, row.path, message, hint)
        if (
            row.axis == "B"
            and row.path is not None
            and (background := catalog.background(row.topics_file)).path is None
        ):
            message = f"nothing shows its scene without the garment: {background} is missing"
            yield _finding("no-background", row.recording, row.path, message, f"Provide {background.missing}.")
        if row.partner is None:
            other = "B" if row.axis == "R" else "R"
            message = f"no {other} recording of the same garment, holding, repeat, swing and speed"
            yield _finding("unpaired", row.recording, row.path, message)


def _unfinished(path: Path, scheme: Scheme) -> Finding:
    stem = re.sub(r"\.bag\.active$", "", path.name, flags=re.IGNORECASE)
    subject = scheme.repair(stem) or path.name
    if path.suffix.lower() == ".active":
        hint = "If no recorder is at work on it, `garment salvage` makes a whole bag of it."
        return _finding("unfinished", subject, path, "the recorder did not finish this bag", hint)
    hint = "If no recorder is at work on it, `ros2 bag reindex` on a copy of its folder writes one."
    return _finding("unfinished", subject, path, "rosbag2 storage without its metadata.yaml", hint)


class _Known:
    """The names that tables and folder know, and which of them an unknown one stands for.

    Either the two differ only in case, hyphens, underscores, leading zeros or the way the speed is written; or the
    listed one has no bag and they differ in words that no table knows, but that are much like words they know.
    """

    def __init__(self, catalog: Catalog) -> None:
        self._scheme = catalog.scheme
        bags = () if catalog.found is None else catalog.found.bags
        self._taken = {str(bag.name): bag.path for bag in bags}
        self._garments = tuple(row.garment for row in catalog.tables.garments)
        self._holdings = tuple(row.holding for row in catalog.tables.holdings)
        listed = [row for row in catalog.rows if row.in_tables]
        self._names = [row.recording for row in listed]
        self._missing = {row.recording for row in listed if row.state == "missing"}
        self._folded = {_folded(row.name): row.recording for row in reversed(listed)}
        refused = () if catalog.found is None else catalog.found.refused
        self._few = len(listed) * len(refused) <= _MAX_COMPARISONS

    def misnamed(self, path: Path, meant: str, message: str) -> Finding:
        """Report a file that should have another name."""
        target = f"{meant}.bag" if path.name.lower().endswith(".bag") else meant
        other = self._taken.get(meant, path)
        hint = f"Rename it to {target}." if other == path else f"{other} has that name already: keep one of the two."
        found = _finding("misnamed", path.name, path, f"{message}: should be {target}", hint)
        return replace(found, target=target)

    def meant_by(self, name: RecordingName) -> str | None:
        """Find what a readable name in no table stands for."""
        if (same := self._folded.get(_folded(name))) is not None:
            return same
        if name.garment is None or name.holding is None or isinstance(name, PatternName):
            return None
        rest = name.name.removeprefix(f"{name.garment}_{name.holding}")
        garment, holding = _like(name.garment, self._garments), _like(name.holding, self._holdings)
        meant = f"{garment}_{holding}{rest}{str(name).removeprefix(name.name)}"
        return meant if meant in self._missing else None

    def meant_by_file(self, file_name: str) -> str | None:
        """Find what a refused name stands for."""
        if (repaired := self._scheme.repair(file_name)) is None:
            return None
        name = self._scheme.parse(repaired)
        return repaired if isinstance(name, BackgroundName) else self.meant_by(name) or repaired

    def nearest(self, file_name: str) -> str | None:
        """Find the listed name that looks most like one that cannot be repaired."""
        names = self._names if self._few else []
        nearest = difflib.get_close_matches(file_name.removesuffix(".bag"), names, n=1)
        return nearest[0] if nearest else None


def _folded(name: RecordingName) -> tuple[object, ...]:
    if isinstance(name, PatternName):
        return (str(name).casefold(),)
    tokens = (f"#{int(token)}" if token.isdecimal() else token for token in name.name.lower().split("_"))
    words = "".join(tokens).replace("-", "")
    return words, float(name.speed), name.counter, name.axis, name.topics_file


@lru_cache
def _like(word: str, known: tuple[str, ...]) -> str:
    nearest = difflib.get_close_matches(word, known, n=1, cutoff=0.8)
    return word if word in known or not nearest else nearest[0]
