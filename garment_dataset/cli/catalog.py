"""``garment list``: what the catalog knows."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Annotated

import typer

from garment_dataset.cli import completion
from garment_dataset.cli.output import (
    JsonOption,
    WorkspaceOption,
    print_csv,
    print_json,
    print_table,
    say,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from garment_dataset.catalog import Catalog, CatalogRow
    from garment_dataset.catalog.columns import Column
    from garment_dataset.catalog.filters import Kind
    from garment_dataset.features.quality import RecordingQuality


def list_(
    filters: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="FILTERS",
            help="Which recordings: key=value[,value] terms and name globs.",
            show_default=False,
            autocompletion=completion.list_filters,
        ),
    ] = None,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print CSV: every column, SI units.")] = False,
) -> None:
    """List the recordings of the tables and of the folder, and say which are present, missing or unexpected."""
    from garment_dataset.features.quality import QUALITY_KEYS, RecordingQuality, read_quality
    from garment_dataset.workspace import Workspace

    place = Workspace.find(workspace)
    catalog = place.catalog()
    known = read_quality(place.features_dir)
    found = [(row, known.get(row.recording, RecordingQuality())) for row in catalog.rows]
    shown = _wanted(catalog, found, filters or ())
    damage = {row.recording: kind for row, _ in shown if (kind := _damage(row)) is not None}
    if as_json:
        records = [{**row.record(), **quality.record(), "why": quality.why} for row, quality in shown]
        print_json([{**record, "damage": damage.get(str(record["recording"]))} for record in records])
    elif as_csv:
        cells = [[*row.record().values(), *quality.record().values()] for row, quality in shown]
        print_csv([*catalog.filter_keys, "path", *QUALITY_KEYS], cells)
    else:
        columns = ["recording", "garment", "size [cm]", "weight [g]", "paired", "dvd", "state"]
        columns += [_headed(column) for column in catalog.tables.columns]
        columns += ["quality", "coverage"] if known else []
        rows = [_listed(row, damage) + (_judged(quality) if known else []) for row, quality in shown]
        print_table(columns, rows, heads=("garment", "size [cm]", "weight [g]"))
    _say_counts(catalog, [row for row, _ in shown], damage)


def _damage(row: CatalogRow) -> str | None:
    """Return what is wrong with the bag of a recording, as far as its first and last bytes tell."""
    if row.path is None:
        return None
    from garment_dataset.bags.condition import look

    condition = look(row.path)
    return None if condition is None else condition.kind


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


def _listed(row: CatalogRow, damage: Mapping[str, str]) -> list[object]:
    size = None if row.width_m is None or row.height_m is None else f"{row.width_m * 100:g}×{row.height_m * 100:g}"
    weight = None if row.weight_kg is None else row.weight_kg * 1000
    cloth = " ".join(filter(None, (row.color, row.garment_kind))) or row.garment
    return [
        row.recording,
        cloth,
        size,
        weight,
        row.partner is not None,
        row.dvd,
        _state(row, damage),
        *row.own.values(),
    ]


def _headed(column: Column) -> str:
    return column.name if column.unit in (None, "1") else f"{column.name} [{column.unit}]"


def _state(row: CatalogRow, damage: Mapping[str, str]) -> str | None:
    return f"{row.state}, {damage[row.recording]}" if row.recording in damage else row.state


def _judged(quality: RecordingQuality) -> list[object]:
    return [quality.quality, None if quality.coverage is None else f"{quality.coverage:.0%}"]


def _say_counts(catalog: Catalog, rows: Sequence[CatalogRow], damage: Mapping[str, str]) -> None:
    """Say how many there are, on stderr; what could not be listed is said, too."""
    from garment_dataset.catalog.ignoring import IGNORE_FILE

    states = Counter(row.state for row in rows)
    counts = ", ".join(f"{count} {state}" for state, count in states.items())
    say(f"{len(rows)} recording{'s' * (len(rows) != 1)}{': ' * bool(counts)}{counts}")
    if damage:
        counts = ", ".join(f"{count} {kind}" for kind, count in Counter(damage.values()).items())
        say(f"of these bags, {counts}: see `garment lint code=damaged,unindexed`")
    if used := sorted({row.topics_file for row in rows if row.axis == "B" and row.path is not None}):
        found = {number: catalog.background(number) for number in used}
        texts = (f"{number}: {'missing' if bag.path is None else bag}" for number, bag in found.items())
        say(f"backgrounds of the B recordings here, by topics file: {'; '.join(texts)}")
    if catalog.found is not None and (refused := len(catalog.found.refused) + len(catalog.found.unfinished)):
        say(f"{refused} more in {catalog.found.folder} with a wrong name or unfinished: see `garment lint`")
    if catalog.found is not None and (ignored := len(catalog.found.ignored)):
        say(f"{ignored} bag{'s' * (ignored > 1)} or folders left out by {catalog.found.folder / IGNORE_FILE}")
