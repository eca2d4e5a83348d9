"""``garment diff``: how much two variants of results differ."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from garment_dataset.cli.output import FiltersArgument, JsonOption, WorkspaceOption, print_json, print_table, say
from garment_dataset.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.features.comparison import ColumnDifference, TableDifference
    from garment_dataset.workspace.session import Session

_COLUMNS = ["table", "column", "rows", "differ", "only A", "only B", "rms", "largest", "unit", "rms / std"]


def diff(
    variant_a: Annotated[
        str, typer.Argument(metavar="VARIANT_A", help="A variant; `default`: the one without a name.")
    ],
    variant_b: Annotated[str, typer.Argument(metavar="VARIANT_B", help="Another.")],
    filters: FiltersArgument = None,
    table: Annotated[list[str] | None, typer.Option("--table", help="Only this table; may be repeated.")] = None,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Say per table and column how much two variants differ, also in units of the stated uncertainty."""
    from garment_dataset.layout import Layout
    from garment_dataset.workspace.session import Session

    with Session(Layout.find(workspace), filters or ()) as session:
        stale = [str(one.node) for one in session.plan() if one.state != "fresh"]
        found = list(_compare(session, (variant_a, variant_b), table or []))
    if stale:
        say(f"{len(stale)} results are not fresh (`garment status`): what is compared is what was built last")
    if as_json:
        print_json([_record(one) for one in found])
        return
    rows = [_cells(column) for one in found for column in one.columns if column.differing]
    for one in found:
        if one.rows_only_a or one.rows_only_b:
            say(f"{one.table}: {one.rows_only_a} rows in {variant_a} alone, {one.rows_only_b} in {variant_b} alone")
    if rows:
        print_table(_COLUMNS, rows)
    elif found and all(one.is_none for one in found):
        print("no difference")
        return
    equal = [one.table for one in found if one.is_none]
    if equal:
        print(f"equal in both: {', '.join(equal)}")


def _compare(session: Session, variants: tuple[str, str], tables: list[str]) -> Iterator[TableDifference]:
    from garment_dataset.features.comparison import compare_tables
    from garment_dataset.features.reading import load_features, tables_in, variant_folder, variants_of
    from garment_dataset.workspace.pipelines import DEFAULT_VARIANT

    folder = session.layout.features_dir
    names = ["" if variant == DEFAULT_VARIANT else variant for variant in variants]
    for name in names:
        if name and name not in variants_of(folder):
            known = ", ".join([DEFAULT_VARIANT, *variants_of(folder)])
            raise UsageError(f"no variant {name!r}", where=folder, expected=f"one of {known}")
    built = [set(tables_in(variant_folder(folder, name))) for name in names]
    specs = {output.name: (stage, output) for stage in session.stages for output in stage.outputs}
    if unknown := [name for name in tables if name not in specs]:
        raise UsageError(f"no table {unknown[0]!r}", expected=f"one of {', '.join(specs)}")
    selected = {node.subject for node in session.graph}
    for name, (stage, spec) in specs.items():
        if (tables and name not in tables) or name not in built[0] | built[1]:
            continue
        if missing := [variant for variant, there in zip(variants, built, strict=True) if name not in there]:
            say(f"{name}: nothing in {missing[0]}")
            continue
        subject = stage.identity[0].name
        a, b = (load_features(name, folder=folder, variant=variant) for variant in names)
        if stage.per != "position":  # its rows are named by the bag that shows the empty scene
            a, b = (frame[frame[subject].isin(selected)] for frame in (a, b))
        yield compare_tables(spec, a, b, subject)


def _record(found: TableDifference) -> dict[str, object]:
    return {
        "table": found.table,
        "rows_only_a": found.rows_only_a,
        "rows_only_b": found.rows_only_b,
        "columns": [column.record() for column in found.columns],
    }


def _cells(column: ColumnDifference) -> list[object]:
    in_std = None if column.rms_in_std is None else f"{column.rms_in_std:.2f}"
    numbers = [None if value is None else f"{value:.3g}" for value in (column.rms, column.largest)]
    counts = [column.rows, column.differing, column.only_a, column.only_b]
    return [column.table, column.column, *counts, *numbers, column.unit, in_std]
