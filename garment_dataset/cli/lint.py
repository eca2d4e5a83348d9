"""``garment lint``: names, tables, folder and results held against each other."""

from __future__ import annotations

import dataclasses
from collections import Counter
from itertools import groupby
from typing import TYPE_CHECKING, Annotated

import typer

from garment_dataset.cli import completion
from garment_dataset.cli.output import (
    JsonOption,
    WorkspaceOption,
    print_json,
    say,
)
from garment_dataset.errors import BagError, GarmentError, SourceError, UsageError, printable

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from garment_dataset.catalog import Catalog
    from garment_dataset.catalog.filters import Kind
    from garment_dataset.catalog.lint import Finding
    from garment_dataset.workspace import Workspace

FINDING_KEYS: dict[str, Kind] = {"recording": str, "code": str, "severity": str}
"""What findings can be filtered by."""


def lint_(
    filters: Annotated[
        list[str] | None,
        typer.Argument(
            help="Which findings: code=missing,misnamed, severity=error, and globs on the name.",
            show_default=False,
            autocompletion=completion.findings,
        ),
    ] = None,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
    to_read: Annotated[
        bool, typer.Option("--content", help="Read the bags, and hold their names against what they show.")
    ] = False,
    to_rename: Annotated[
        bool, typer.Option("--rename", help="Print the renames that findings propose, instead of the findings.")
    ] = False,
    to_apply: Annotated[bool, typer.Option("--apply", help="With --rename: do them.")] = False,
) -> None:
    """Compare names, tables and folder; exit with 1 when anything disagrees."""
    from garment_dataset.catalog import Catalog
    from garment_dataset.catalog.lint import lint
    from garment_dataset.checks.damaged import damaged_bags
    from garment_dataset.cli.renaming import ready_to_rename, rename
    from garment_dataset.workspace import Workspace

    if to_apply and not to_rename:
        raise UsageError("--apply does what --rename proposes", hint="Add --rename; without --apply, nothing is done.")
    place = Workspace.find(workspace)
    with ready_to_rename(place, to_apply=to_apply):
        catalog = Catalog.of(place, strict=False)
        content = _contradicted(place, catalog) if to_read else ()
        everything = _in_order((*lint(catalog), *damaged_bags(catalog), *_orphaned(place), *content))
        findings = _selected(filters or (), catalog, everything)
        if to_rename:
            rename(place, catalog, findings, to_apply=to_apply, as_json=as_json)
            return
    _print(place, catalog, findings, everything, as_json=as_json)
    if findings:
        raise typer.Exit(1)


def _selected(filters: Sequence[str], catalog: Catalog, everything: Sequence[Finding]) -> list[Finding]:
    """Return the findings that the filters want; say which globs nothing looks like."""
    from garment_dataset.catalog.filters import compile_filter
    from garment_dataset.catalog.hints import idle_globs
    from garment_dataset.catalog.lint import SEVERITIES

    words = {
        "recording": _names(catalog, everything),
        "code": tuple(SEVERITIES),
        "severity": tuple(dict.fromkeys(SEVERITIES.values())),
    }
    wanted = compile_filter(filters, FINDING_KEYS, words)
    for text in idle_globs(filters, FINDING_KEYS, words):
        say(text)
    return [finding for finding in everything if wanted(_filterable(finding))]


def _print(
    place: Workspace, catalog: Catalog, findings: Sequence[Finding], everything: Sequence[Finding], *, as_json: bool
) -> None:
    counts = Counter(finding.code for finding in findings)
    if as_json:
        print_json({"counts": counts, "findings": [dataclasses.asdict(finding) for finding in findings]})
    else:
        for line in _report(catalog, findings):
            print(printable(line.replace(f"{place.root}/", "")))
        agreed = f"no such finding among {len(everything)}" if everything else "names, tables and folder agree"
        print(", ".join(f"{count} {code}" for code, count in counts.items()) or agreed)


def _in_order(findings: Sequence[Finding]) -> list[Finding]:
    from garment_dataset.catalog.lint import SEVERITIES

    order = list(SEVERITIES)
    return sorted(findings, key=lambda finding: order.index(finding.code))


def _contradicted(place: Workspace, catalog: Catalog) -> Iterator[Finding]:
    """Yield where bags do not show what their names say; all are read, as some are known by comparison only."""
    from garment_dataset.catalog.lint import SEVERITIES, Finding
    from garment_dataset.checks.content import read_content
    from garment_dataset.checks.contract import contract_of
    from garment_dataset.checks.names import compare
    from garment_dataset.checks.naming import Measured

    contract, measured = contract_of(place.catalog_dir), []
    rows = [row for row in catalog.rows if row.path is not None]
    say(f"reading {len(rows)} bags")
    for row in rows:
        assert row.path is not None
        try:
            measured.append(Measured(row, read_content(row.path, contract)))
        except (BagError, SourceError) as error:
            text = f"not held against its content: it cannot be read ({error.what})"
            yield Finding("unmeasured", SEVERITIES["unmeasured"], row.recording, str(row.path), text, None)
    yield from compare(measured, catalog.tables.garments)


def _orphaned(place: Workspace) -> Iterator[Finding]:
    """Yield whose results nothing asks for any more, where that can be known."""
    from garment_dataset.workspace.orphaned import orphaned_results
    from garment_dataset.workspace.session import Session

    if not place.features_dir.is_dir():
        return
    try:
        with Session(place) as session:
            yield from orphaned_results(session)
    except GarmentError:
        return  # what stands in the way is found above, or said by `garment status`


def _filterable(finding: Finding) -> dict[str, str]:
    return {
        "recording": finding.subject.removesuffix(".bag"),
        "code": finding.code,
        "severity": finding.severity,
    }


def _names(catalog: Catalog, findings: Sequence[Finding]) -> tuple[str, ...]:
    """Return all that there might be a finding of: recordings, empty scenes, and the files of findings."""
    bags = () if catalog.found is None else catalog.found.bags
    names = [*catalog.words["recording"], *(str(bag.name) for bag in bags)]
    return tuple(dict.fromkeys([*names, *(_filterable(finding)["recording"] for finding in findings)]))


def _report(catalog: Catalog, findings: Sequence[Finding]) -> Iterator[str]:
    """Yield the lines of a report: equal messages once, over all whom they concern."""
    for (code, message, hint), group in groupby(findings, key=lambda found: (found.code, found.message, found.hint)):
        concerned = list(group)
        yield f"{code}: {message}" + (f". {hint}" if hint else "")
        if code == "missing" and catalog.found is not None and catalog.found.is_empty:
            yield f"    {len(concerned)} recordings: {catalog.found.folder} holds no bag at all (--json lists them)"
            continue
        for finding in concerned:
            yield f"    {finding.where or finding.subject}"
