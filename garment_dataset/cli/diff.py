"""``garment diff``: how much two variants of results differ."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from garment_dataset.cli import completion
from garment_dataset.cli.output import FiltersArgument, JsonOption, WorkspaceOption, print_json, print_table, say
from garment_dataset.cli.saying import results_text, say_partial
from garment_dataset.cli.status import open_session
from garment_dataset.errors import FilterError, StoreError, UsageError, did_you_mean, one_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from garment_dataset.engine.table import TableSpec
    from garment_dataset.features.comparison import ColumnDifference, TableDifference
    from garment_dataset.workspace.session import Session

_SHOWN = 10


def diff(
    variant_a: Annotated[
        str,
        typer.Argument(
            metavar="VARIANT_A",
            help="A variant; `default`: the one without a name.",
            autocompletion=completion.variants,
        ),
    ],
    variant_b: Annotated[str, typer.Argument(metavar="VARIANT_B", help="Another.", autocompletion=completion.variants)],
    filters: FiltersArgument = None,
    table: Annotated[
        list[str] | None,
        typer.Option("--table", "-t", help="Only this table; may be repeated.", autocompletion=completion.tables),
    ] = None,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Say per table and column how much two variants differ, also in units of the stated uncertainty."""
    from garment_dataset.features.comparison import compare_variants

    with open_session(workspace, filters or (), ()) as session:
        names = (_unnamed(session, variant_a), _unnamed(session, variant_b))
        specs = _specs(session, names, table or ())
        folders = (session.store.folder(names[0]), session.store.folder(names[1]))
        found = list(compare_variants(folders, specs, _selected(session) if filters else None))
        if not found:
            raise _nothing(session, filters or ())
        if not table:
            _say_unknown(folders, specs)
        _say_open(session, names, specs)
        say_partial(session)
    if as_json:
        print_json({"a": variant_a, "b": variant_b, "tables": [one.record() for one in found]})
        return
    _print(found, variant_a, variant_b)


def _unnamed(session: Session, variant: str) -> str:
    """Return the name of a variant in files and pipelines, where the usual one has none."""
    from garment_dataset.features.reading import variants_of
    from garment_dataset.workspace.pipelines import DEFAULT_VARIANT

    if variant == DEFAULT_VARIANT:
        return ""
    features_dir = session.layout.features_dir
    known = sorted({*(pipeline.file.variant for pipeline in session.pipelines), *variants_of(features_dir)} - {""})
    if variant not in known:
        known = [DEFAULT_VARIANT, *known]
        raise UsageError(
            f"no variant {variant!r}",
            where=session.layout.root,
            expected=one_of(known),
            hint=did_you_mean(variant, known) or "A pipeline file with `variant` makes one.",
        )
    return variant


def _specs(
    session: Session, variants: tuple[str, str], tables: Sequence[str]
) -> dict[str, tuple[TableSpec, TableSpec]]:
    """Return what each variant's stages say of their tables; of one that no pipeline makes there, what another says."""
    known = {output.name: output for stage in session.stages for output in stage.outputs}
    if unknown := [name for name in tables if name not in known]:
        hint = did_you_mean(unknown[0], known)
        raise UsageError(f"no table {unknown[0]!r}", expected=one_of(known), hint=hint)
    own_a, own_b = (
        {
            output.name: output
            for pipeline in session.pipelines
            if pipeline.file.variant == variant
            for stage in pipeline.stages
            for output in stage.outputs
        }
        for variant in variants
    )
    return {
        name: (own_a.get(name) or own_b.get(name, spec), own_b.get(name) or own_a.get(name, spec))
        for name, spec in known.items()
        if not tables or name in tables
    }


def _selected(session: Session) -> set[str]:
    """Return the names of the files that the filters select: of a recording without a bag, too."""
    rows = (*session.selection.rows, *session.selection.absent)
    return {row.recording for row in rows} | {node.subject for node in session.graph}


def _nothing(session: Session, filters: Sequence[str]) -> FilterError | StoreError:
    if filters:
        return FilterError("no results of what is selected", where=session.layout.features_dir, found=" ".join(filters))
    return StoreError("no results to compare", where=session.layout.features_dir, hint="`garment build` makes them.")


def _say_unknown(folders: tuple[Path, Path], specs: Mapping[str, object]) -> None:
    """Say which tables there are that nothing is known of: a stage made them that no pipeline names any more."""
    from garment_dataset.features.reading import tables_in

    if unknown := sorted({name for folder in folders for name in tables_in(folder)} - specs.keys()):
        say(f"not compared, since no pipeline makes them: {', '.join(unknown)}")


def _say_open(session: Session, variants: tuple[str, str], tables: Mapping[str, object]) -> None:
    """Say which results are not what the pipelines ask for."""
    from garment_dataset.workspace.pipelines import DEFAULT_VARIANT

    session.graph = session.graph.restricted_to(
        node.id
        for node in session.graph
        if node.variant in variants and any(output.name in tables for output in node.stage.outputs)
    )
    decisions = list(session.plan())
    for variant in dict.fromkeys(variants):
        counts = Counter(one.state.value for one in decisions if one.node.variant == variant and one.state != "fresh")
        if counts:
            text = ", ".join(f"{count} {state}" for state, count in counts.items())
            say(f"{variant or DEFAULT_VARIANT}: {text}; compared is what was built last (`garment status` says why)")


def _print(found: Sequence[TableDifference], a: str, b: str) -> None:
    if all(one.is_none for one in found):
        results, rows = sum(one.results for one in found), sum(one.rows for one in found)
        print(f"no difference between {a} and {b}: {len(found)} tables, {results_text(results)}, {rows} rows")
        return
    only = [f"only {a}", f"only {b}"]
    print_table(["table", "results", *only, "rows", *only, "columns that differ"], [_table_cells(one) for one in found])
    if cells := [_column_cells(one, column) for one in found for column in one.differing]:
        print()
        print_table(
            ["table", "column", "differ", *only, "rms", "largest", "unit", "rms / std"], cells, heads=("table",)
        )
    _print_alone(a, {one.table: (one.results, one.results_only_a, one.columns_only_a) for one in found})
    _print_alone(b, {one.table: (one.results, one.results_only_b, one.columns_only_b) for one in found})


def _print_alone(variant: str, alone: Mapping[str, tuple[int, Sequence[str], Sequence[str]]]) -> None:
    """Print the tables, columns and results that one variant has and the other has not."""
    whole = [table for table, (common, results, _) in alone.items() if results and not common]
    if whole:
        print(f"only {variant}: all of {', '.join(whole)}")
    tables: dict[str, list[str]] = {}
    for table, (_, results, columns) in alone.items():
        if columns:
            print(f"only {variant}: columns {', '.join(columns)} of {table}")
        for name in () if table in whole else results:
            tables.setdefault(name, []).append(table)
    for name, own in list(tables.items())[:_SHOWN]:
        print(f"only {variant}: {name} ({', '.join(own)})")
    if len(tables) > _SHOWN:
        print(f"only {variant}: {len(tables) - _SHOWN} more (--json names them)")


def _table_cells(one: TableDifference) -> list[object]:
    alone = (len(one.results_only_a), len(one.results_only_b))
    differ = f"{len(one.differing)} of {len(one.columns)}" if one.results else None
    return [one.table, one.results, *alone, one.rows, one.rows_only_a, one.rows_only_b, differ]


def _column_cells(one: TableDifference, column: ColumnDifference) -> list[object]:
    numbers = [None if value is None else f"{value:.3g}" for value in (column.rms, column.largest)]
    in_std = None if column.rms_in_std is None else f"{column.rms_in_std:.2f}"
    counts = [column.differing, column.only_a, column.only_b]
    return [one.table, column.column, *counts, *numbers, column.unit or None, in_std]
