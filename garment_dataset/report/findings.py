"""What ``garment lint`` and ``garment check`` find, for a report; a bag is checked again when something has changed."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, NamedTuple

from garment_dataset.catalog.lint import SEVERITIES, lint
from garment_dataset.catalog.names import BackgroundName
from garment_dataset.checks.contract import Contract, contract_of
from garment_dataset.checks.damaged import damaged_bags
from garment_dataset.engine.canonical import digest
from garment_dataset.errors import GarmentError, printable
from garment_dataset.report.code import room_digest
from garment_dataset.report.facts import FindingFact
from garment_dataset.workspace.orphaned import orphaned_results

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    from garment_dataset.catalog import CatalogRow
    from garment_dataset.workspace.session import Session

_TAG = "report-check/1"


class _Subject(NamedTuple):
    """A bag to be checked, and what to provide for the empty scene, if it is missing."""

    name: str
    path: Path
    axis: str | None = None
    background: str | None = None
    shows_empty_scene: bool = False


class Findings:
    """Collects findings.

    Parameters
    ----------
    session : Session
        The workspace.
    plain : callable
        Takes folders of this machine out of a text.
    known : mapping
        What :attr:`remembered` was after an earlier report.
    """

    def __init__(self, session: Session, plain: Callable[[str], str], known: Mapping[str, Any]) -> None:
        self._session, self._plain, self._known = session, plain, known
        self.remembered: dict[str, Any] = {}

    def of(self, rows: Sequence[CatalogRow], digest_of: Callable[[Path], str | None]) -> list[FindingFact]:
        """Return all findings, the gravest first; of a selection of recordings only those about them.

        Parameters
        ----------
        rows : sequence of CatalogRow
            The recordings of the report.
        digest_of : callable
            Returns the digest of a bag; None where it cannot be read.
        """
        found = [*self._lint(rows), *self._checks(rows, digest_of)]
        order = ("error", "warning", "note")
        return sorted(found, key=lambda each: order.index(each.severity))

    def _lint(self, rows: Sequence[CatalogRow]) -> list[FindingFact]:
        catalog = self._session.catalog
        found = [*lint(catalog), *damaged_bags(catalog), *orphaned_results(self._session)]
        codes = list(SEVERITIES)
        found.sort(key=lambda each: codes.index(each.code))
        is_whole = len(rows) == len(catalog.rows)
        names = {row.recording for row in rows}
        return [
            FindingFact(
                "lint",
                each.severity,
                each.code,
                printable(each.subject),
                self._plain(each.message),
                None if each.hint is None else self._plain(each.hint),
            )
            for each in found
            if is_whole or each.subject.removesuffix(".bag") in names
        ]

    def _checks(self, rows: Sequence[CatalogRow], digest_of: Callable[[Path], str | None]) -> list[FindingFact]:
        try:
            contract = contract_of(self._session.layout.catalog_dir)
        except GarmentError as error:
            return [FindingFact("check", "error", "contract", "contract.toml", self._plain(str(error)))]
        found: list[FindingFact] = []
        for subject in self._subjects(rows):
            found += self._checked(subject, digest_of(subject.path), contract)
        return found

    def _subjects(self, rows: Sequence[CatalogRow]) -> Iterator[_Subject]:
        """Yield the bags to be checked; empty scenes, too, where the report is of everything."""
        catalog = self._session.catalog
        for row in rows:
            if row.path is not None:
                background = catalog.background(row.topics_file)
                needed = self._plain(background.missing) if background.path is None else None
                yield _Subject(row.recording, row.path, row.axis, needed)
        is_whole = len(rows) == len(catalog.rows)
        for bag in catalog.found.bags if is_whole and catalog.found is not None else ():
            if isinstance(bag.name, BackgroundName):
                yield _Subject(str(bag.name), bag.path, shows_empty_scene=True)

    def _checked(self, subject: _Subject, bag: str | None, contract: Contract) -> list[FindingFact]:
        from garment_dataset.checks.runner import check_bag

        name = printable(subject.name)
        own = contract.of_empty_scene() if subject.shows_empty_scene else contract
        code = room_digest("checks", "bags")
        key = digest(_TAG, [bag, own.model_dump(mode="json"), subject.axis, subject.background, code])
        known = self._known.get(name, {})
        if bag is not None and known.get("key") == key:
            found = [FindingFact(**each) for each in known["findings"]]
        else:
            checked = check_bag(
                subject.path, own, recording=subject.name, axis=subject.axis, background=subject.background
            )
            found = [self._fact(name, each) for each in checked]
        self.remembered[name] = {"key": key, "findings": [dataclasses.asdict(each) for each in found]}
        return found

    def _fact(self, name: str, each: Any) -> FindingFact:  # noqa: ANN401 - a CheckFinding
        at = "" if each.time_s is None else f" at {each.time_s:.2f} s"
        where = f"{each.topic}{at}: " if each.topic is not None else (f"{at.strip()}: " if at else "")
        hint = None if each.hint is None else self._plain(each.hint)
        return FindingFact("check", each.severity, each.code, name, self._plain(f"{where}{each.message}"), hint)
