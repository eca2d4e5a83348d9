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
from garment_dataset.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from garment_dataset.catalog import BackgroundSource, Catalog, CatalogRow
    from garment_dataset.catalog.filters import Kind
    from garment_dataset.catalog.lint import Finding
    from garment_dataset.workspace import Workspace

FINDING_KEYS: dict[str, Kind] = {"recording": str, "code": str, "severity": str}
"""What findings can be filtered by."""

_AXES = {"R": "R: along the optical axis", "B": "B: across the optical axis"}

_PICTURES = (".png", ".svg", ".pdf")


def list_(
    filters: FiltersArgument = None,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print CSV: every column, SI units.")] = False,
) -> None:
    """List the recordings of the tables and of the folder, and say which are present, missing or unexpected."""
    catalog = _workspace(workspace).catalog()
    rows = catalog.select(filters or ())
    if as_json:
        print_json([row.record() for row in rows])
    elif as_csv:
        print_csv([*catalog.filter_keys, "path"], [list(row.record().values()) for row in rows])
    else:
        columns = ["recording", "garment", "size [cm]", "weight [g]", "paired", "dvd", "state"]
        print_table(columns, [_listed(row) for row in rows])
    _say_counts(catalog, rows)


def show(
    recording: Annotated[str, typer.Argument(metavar="NAME", help="Name of a recording, or its file.")],
    frame: Annotated[
        int | None, typer.Option("--frame", min=0, help="Draw this image, with what was found in it.")
    ] = None,
    save: Annotated[Path | None, typer.Option("--save", help="Where to: a .png, .svg or .pdf file.")] = None,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show all that is known of one recording, or draw one of its frames."""
    place = _workspace(workspace)
    catalog = place.catalog()
    row = catalog.row(recording)
    if frame is not None or save is not None:
        _draw(place, row, frame, save)
        return
    topics = catalog.topics(row.topics_file)
    if as_json:
        background = catalog.background(row.topics_file).record()
        more = {"topics": topics, "background": background, "holding_description": _holding(catalog, row)}
        print_json({**row.record(), **more})
        return
    facts = [*_facts(catalog, row), *_results(place, row)]
    width = max(len(label) for label, _ in facts)
    for label, value in facts:
        print(f"{label:{width}}  {'-' if value is None else value}")
    for topic in topics or ():
        print(f"{'':{width}}  {topic}")


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


def _draw(place: Workspace, row: CatalogRow, frame: int | None, save: Path | None) -> None:
    from garment_dataset.view.frames import save_frame

    if frame is None or save is None:
        raise UsageError("a picture needs a frame and a file", expected="--frame N --save FILE.png")
    if save.suffix not in _PICTURES:
        raise UsageError("not a kind of picture", where=save, expected=" ".join(_PICTURES), found=repr(save.suffix))
    save_frame(place, row, frame, save)
    say(f"wrote {save}")


def _results(place: Workspace, row: CatalogRow) -> list[tuple[str, object]]:
    """Return what the results say of the recording's images, if it was built."""
    from garment_dataset.features.reading import load_features

    if not (place.features_dir / "frames").is_dir():
        return []
    frames = load_features("frames", folder=place.features_dir, recording=row.recording)
    facts: list[tuple[str, object]] = []
    for stream, images in frames.groupby("stream"):
        faulty = images[images["fault"].notna()]
        text = f"{len(images)} images"
        if len(faulty):
            text += f", {len(faulty)} not used, first {faulty['frame'].iloc[0]}: {faulty['fault'].iloc[0]}"
        facts.append((str(stream), text))
    return facts


def _listed(row: CatalogRow) -> list[object]:
    size = None if row.width_m is None or row.height_m is None else f"{row.width_m * 100:g}×{row.height_m * 100:g}"
    weight = None if row.weight_kg is None else row.weight_kg * 1000
    cloth = " ".join(filter(None, (row.color, row.garment_kind))) or row.garment
    return [row.recording, cloth, size, weight, row.partner is not None, row.dvd, row.state]


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


def _facts(catalog: Catalog, row: CatalogRow) -> list[tuple[str, object]]:
    cloth = " ".join(filter(None, (row.color, row.garment_kind)))
    size = None if row.width_m is None or row.height_m is None else f"{row.width_m:g} × {row.height_m:g} m"
    weight = None if row.weight_kg is None else f"{row.weight_kg:g} kg"
    details = ", ".join(filter(None, (cloth, size, weight)))
    manner = _holding(catalog, row)
    partner = None if row.partner is None else f"{row.partner} ({catalog.row(row.partner).state})"
    return [
        ("recording", row.recording),
        ("state", row.state),
        ("file", row.path),
        ("table", row.table),
        ("dvd", {True: "yes", False: "no", None: None}[row.dvd]),
        ("garment", f"{row.garment} ({details})" if details else row.garment),
        ("holding", f"{row.holding} ({manner})" if manner else row.holding),
        ("repeat", row.repeat),
        ("swing", None if row.swing_rad is None else f"{row.swing_rad:.4g} rad"),
        ("speed", row.speed),
        ("axis", _AXES[row.axis]),
        ("partner", partner),
        ("background", _background(catalog.background(row.topics_file))),
        ("topics file", row.topics_file),
    ]


def _background(background: BackgroundSource) -> str:
    return f"{background} ({'missing' if background.path is None else background.path})"


def _holding(catalog: Catalog, row: CatalogRow) -> str | None:
    """Return how the garment is held, in words: by the letter in the table, else by the word if only one has it."""
    letter = next((listed.holding for listed in catalog.tables.recordings if listed.recording == row.recording), None)
    holdings = catalog.tables.holdings
    found = [holding.description for holding in holdings if holding.letter == letter] or [
        holding.description for holding in holdings if holding.holding == row.holding
    ]
    return found[0] if len(found) == 1 else None


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
