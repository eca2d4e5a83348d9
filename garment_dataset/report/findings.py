"""What ``garment lint`` and ``garment check`` find, for a report; a bag is checked again when something has changed."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from garment_dataset.catalog.lint import SEVERITIES, lint
from garment_dataset.checks.contract import Contract, contract_of
from garment_dataset.checks.damaged import damaged_bags
from garment_dataset.engine.canonical import digest
from garment_dataset.errors import GarmentError, printable
from garment_dataset.report.code import room_digest
from garment_dataset.report.facts import FindingFact
from garment_dataset.workspace.orphaned import orphaned_results

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from garment_dataset.catalog import CatalogRow
    from garment_dataset.workspace.session import Session

_TAG = "report-check/1"


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

    def of(self, rows: Sequence[CatalogRow], digests: Mapping[str, str | None]) -> list[FindingFact]:
        """Return all findings, the gravest first; of a selection of recordings only those about them.

        Parameters
        ----------
        rows : sequence of CatalogRow
            The recordings of the report.
        digests : mapping of str to str or None
            Digests of their bags.
        """
        found = [*self._lint(rows), *self._checks(rows, digests)]
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

    def _checks(self, rows: Sequence[CatalogRow], digests: Mapping[str, str | None]) -> list[FindingFact]:
        try:
            contract = contract_of(self._session.layout.catalog_dir)
        except GarmentError as error:
            return [FindingFact("check", "error", "contract", "contract.toml", self._plain(str(error)))]
        code = room_digest("checks", "bags")
        found: list[FindingFact] = []
        for row in rows:
            if row.path is not None:
                found += self._checked(row, digests[row.recording], contract, code)
        return found

    def _checked(self, row: CatalogRow, bag: str | None, contract: Contract, code: str) -> list[FindingFact]:
        from garment_dataset.checks.runner import check_bag

        assert row.path is not None
        name = printable(row.recording)
        background = self._session.catalog.background(row.topics_file)
        needed = self._plain(background.missing) if background.path is None else None
        key = digest(_TAG, [bag, contract.model_dump(mode="json"), row.axis, needed, code])
        known = self._known.get(name, {})
        if bag is not None and known.get("key") == key:
            found = [FindingFact(**each) for each in known["findings"]]
        else:
            checked = check_bag(row.path, contract, recording=row.recording, axis=row.axis, background=needed)
            found = [self._fact(name, each) for each in checked]
        self.remembered[name] = {"key": key, "findings": [dataclasses.asdict(each) for each in found]}
        return found

    def _fact(self, name: str, each: Any) -> FindingFact:  # noqa: ANN401 - a CheckFinding
        at = "" if each.time_s is None else f" at {each.time_s:.2f} s"
        where = f"{each.topic}{at}: " if each.topic is not None else (f"{at.strip()}: " if at else "")
        hint = None if each.hint is None else self._plain(each.hint)
        return FindingFact("check", each.severity, each.code, name, self._plain(f"{where}{each.message}"), hint)
