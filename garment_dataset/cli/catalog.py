"""``garment list``, ``show`` and ``lint``: what the catalog knows, and what disagrees with it."""

from __future__ import annotations

import dataclasses
from collections import Counter
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from garment_dataset.cli.output import (
    FiltersArgument,
    JsonOption,
    WorkspaceOption,
    print_csv,
    print_json,
    print_table,
    say,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from garment_dataset.catalog import Catalog, CatalogRow
    from garment_dataset.catalog.filters import Kind
    from garment_dataset.catalog.lint import Finding
    from garment_dataset.features.quality import RecordingQuality
    from garment_dataset.workspace import Workspace

FINDING_KEYS: dict[str, Kind] = {"recording": str, "code": str, "severity": str}
"""What findings can be filtered by."""


def list_(
    filters: FiltersArgument = None,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print CSV: every column, SI units.")] = False,
) -> None:
    """List the recordings of the tables and of the folder, and say which are present, missing or unexpected."""
    from garment_dataset.catalog.filters import compile_filter
    from garment_dataset.features.quality import QUALITY_KEYS, RecordingQuality, read_quality

    place = _workspace(workspace)
    catalog = place.catalog()
    known = read_quality(place.features_dir)
    wanted = compile_filter(filters or (), {**catalog.filter_keys, **QUALITY_KEYS})
    found = [(row, known.get(row.recording, RecordingQuality())) for row in catalog.rows]
    shown = [(row, quality) for row, quality in found if wanted({**row.record(), **quality.record()})]
    if as_json:
        print_json([{**row.record(), **quality.record(), "why": quality.why} for row, quality in shown])
    elif as_csv:
        cells = [[*row.record().values(), *quality.record().values()] for row, quality in shown]
        print_csv([*catalog.filter_keys, "path", *QUALITY_KEYS], cells)
    else:
        columns = ["recording", "garment", "size [cm]", "weight [g]", "paired", "dvd", "state"]
        columns += ["quality", "coverage"] if known else []
        print_table(columns, [_listed(row) + (_judged(quality) if known else []) for row, quality in shown])
    _say_counts(catalog, [row for row, _ in shown])


def lint_(
    filters: Annotated[
        list[str] | None,
        typer.Argument(
            help="Which findings: code=missing,misnamed, severity=error, and globs on the name.", show_default=False
        ),
    ] = None,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Compare names, tables and folder; exit with 1 when anything disagrees."""
    from garment_dataset.catalog import Catalog
    from garment_dataset.catalog.filters import compile_filter
    from garment_dataset.catalog.lint import lint

    place = _workspace(workspace)
    wanted = compile_filter(filters or (), FINDING_KEYS)
    catalog = Catalog.load(place.catalog_dir, strict=False).with_folder(place.recordings_dir)
    findings = [finding for finding in lint(catalog) if wanted(_filterable(finding))]
    counts = Counter(finding.code for finding in findings)
    if as_json:
        print_json({"counts": counts, "findings": [dataclasses.asdict(finding) for finding in findings]})
    else:
        for line in _report(catalog, findings):
            print(line.replace(f"{place.root}/", ""))
        print(", ".join(f"{count} {code}" for code, count in counts.items()) or "names, tables and folder agree")
    if findings:
        raise typer.Exit(1)


def _workspace(path: Path | None) -> Workspace:
    from garment_dataset.workspace import Workspace

    return Workspace.find(path)


def _listed(row: CatalogRow) -> list[object]:
    size = None if row.width_m is None or row.height_m is None else f"{row.width_m * 100:g}×{row.height_m * 100:g}"
    weight = None if row.weight_kg is None else row.weight_kg * 1000
    cloth = " ".join(filter(None, (row.color, row.garment_kind))) or row.garment
    return [row.recording, cloth, size, weight, row.partner is not None, row.dvd, row.state]


def _judged(quality: RecordingQuality) -> list[object]:
    return [quality.quality, None if quality.coverage is None else f"{quality.coverage:.0%}"]


def _say_counts(catalog: Catalog, rows: Sequence[CatalogRow]) -> None:
    """Say how many there are, on stderr; what could not be listed is said, too."""
    states = Counter(row.state for row in rows)
    counts = ", ".join(f"{count} {state}" for state, count in states.items())
    say(f"{len(rows)} recording{'s' * (len(rows) != 1)}{': ' * bool(counts)}{counts}")
    if used := sorted({row.topics_file for row in rows if row.axis == "B" and row.path is not None}):
        found = {number: catalog.background(number) for number in used}
        texts = (f"{number}: {'missing' if bag.path is None else bag}" for number, bag in found.items())
        say(f"backgrounds of the B recordings here, by topics file: {'; '.join(texts)}")
    if catalog.found is not None and (refused := len(catalog.found.refused) + len(catalog.found.unfinished)):
        say(f"{refused} more in {catalog.found.folder} with a wrong name or unfinished: see `garment lint`")


def _filterable(finding: Finding) -> dict[str, object]:
    return {
        "recording": finding.subject.removesuffix(".bag"),
        "code": finding.code,
        "severity": finding.severity,
    }


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
