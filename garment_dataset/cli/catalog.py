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
from garment_dataset.errors import GarmentError, printable

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
    from garment_dataset.features.quality import QUALITY_KEYS, RecordingQuality, read_quality

    place = _workspace(workspace)
    catalog = place.catalog()
    known = read_quality(place.features_dir)
    found = [(row, known.get(row.recording, RecordingQuality())) for row in catalog.rows]
    shown = _wanted(catalog, found, filters or ())
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


def _wanted(
    catalog: Catalog, found: Sequence[tuple[CatalogRow, RecordingQuality]], filters: Sequence[str]
) -> list[tuple[CatalogRow, RecordingQuality]]:
    """Return what the filters want, and say what in them finds nothing."""
    from garment_dataset.catalog.filters import compile_filter
    from garment_dataset.catalog.hints import idle_globs, why_nothing
    from garment_dataset.features.quality import QUALITY_KEYS, QUALITY_UNITS, QUALITY_WORDS

    keys: dict[str, Kind] = {**catalog.filter_keys, **QUALITY_KEYS}
    words = {**catalog.words, **QUALITY_WORDS}
    wanted = compile_filter(filters, keys, words)
    records = [{**row.record(), **quality.record()} for row, quality in found]
    shown = [pair for pair, record in zip(found, records, strict=True) if wanted(record)]
    units = {**catalog.units, **QUALITY_UNITS}
    for text in idle_globs(filters, keys, words) if shown else why_nothing(filters, records, keys, words, units):
        say(text)
    return shown


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
    from garment_dataset.catalog.hints import idle_globs
    from garment_dataset.catalog.lint import SEVERITIES, lint

    place = _workspace(workspace)
    catalog = Catalog.load(place.catalog_dir, strict=False).with_folder(place.recordings_dir)
    everything = (*lint(catalog), *_orphaned(place))
    words = {
        "recording": _names(catalog, everything),
        "code": tuple(SEVERITIES),
        "severity": tuple(dict.fromkeys(SEVERITIES.values())),
    }
    wanted = compile_filter(filters or (), FINDING_KEYS, words)
    findings = [finding for finding in everything if wanted(_filterable(finding))]
    for text in idle_globs(filters or (), FINDING_KEYS, words):
        say(text)
    counts = Counter(finding.code for finding in findings)
    if as_json:
        print_json({"counts": counts, "findings": [dataclasses.asdict(finding) for finding in findings]})
    else:
        for line in _report(catalog, findings):
            print(printable(line.replace(f"{place.root}/", "")))
        agreed = f"no such finding among {len(everything)}" if everything else "names, tables and folder agree"
        print(", ".join(f"{count} {code}" for code, count in counts.items()) or agreed)
    if findings:
        raise typer.Exit(1)


def _orphaned(place: Workspace) -> Iterator[Finding]:
    """Yield whose results lie in the features folder and are asked for by nothing any more."""
    from garment_dataset.catalog.lint import Finding
    from garment_dataset.workspace.session import Session

    if not place.features_dir.is_dir():
        return
    try:
        with Session(place) as session:
            found = session.orphaned_files()
    except GarmentError:
        return  # what stands in the way is found above, or said by `garment status`
    files: dict[tuple[str, str], list[Path]] = {}
    for path, why in found.items():
        files.setdefault((path.stem, why), []).append(path)
    for (subject, why), paths in files.items():
        message = f"{len(paths)} files of results that nothing asks for: {why}"
        hint = "`garment gc --delete` removes them; of a renamed bag, `garment build` moves them first."
        yield Finding("orphaned", "warning", subject, str(paths[0]), message, hint)


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
