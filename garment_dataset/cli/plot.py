"""``garment plot``: displacement and velocity over time, of a recording or of repeats; or any column."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from garment_dataset.cli import completion
from garment_dataset.cli.output import FiltersArgument, WorkspaceOption, say
from garment_dataset.cli.show import refuse_picture
from garment_dataset.errors import DataWarning, StoreError, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.catalog import CatalogRow
    from garment_dataset.view.curves import Panel
    from garment_dataset.view.over_time import Drawn, Quantity, Results
    from garment_dataset.workspace import Workspace

_MOST_ROWS = 8


def plot(
    filters: FiltersArgument = None,
    save: Annotated[Path | None, typer.Option("--save", help="Where to: a .png, .svg or .pdf file.")] = None,
    repeats: Annotated[
        bool, typer.Option("--repeats", help="Lay repeats of one movement over each other, aligned at the onset.")
    ] = False,
    coordinate: Annotated[
        Literal["x", "y", "z"], typer.Option("--coordinate", help="x: right, y: down, z: along the optical axis.")
    ] = "z",
    table: Annotated[
        list[str] | None,
        typer.Option(
            "--table",
            metavar="TABLE.COLUMN",
            help="This column instead; may be given again.",
            autocompletion=completion.columns,
        ),
    ] = None,
    point: Annotated[
        list[int] | None, typer.Option("--point", min=0, help="Only this point, 0: gripper; may be given again.")
    ] = None,
    variant: Annotated[
        str, typer.Option("--variant", help="Of this variant of the results.", autocompletion=completion.variants)
    ] = "",
    workspace: WorkspaceOption = None,
) -> None:
    """Draw displacement and velocity over time, of gripper and points."""
    from garment_dataset.view.curves import save_curves
    from garment_dataset.view.over_time import SINCE_FIRST, SINCE_ONSET, Quantity, Results
    from garment_dataset.workspace import Workspace

    if save is None:
        raise UsageError("a picture needs a file", expected="--save FILE.png")
    refuse_picture(save)
    place = Workspace.find(workspace)
    rows = _chosen(place, filters or (), is_motion=not table)
    named = table or [f"kinematics.d{coordinate}_m", f"kinematics.v{coordinate}_m_s"]
    quantities = [Quantity.of(text, point or ()) for text in named]
    groups = _groups(rows) if repeats else [(row.recording, [row]) for row in rows]
    if len(groups) > _MOST_ROWS:
        what = "movements" if repeats else "recordings"
        hint = "Choose with a filter, or lay repeats over each other with --repeats."
        raise UsageError(
            f"too many {what} for one picture", expected=f"at most {_MOST_ROWS}", found=len(groups), hint=hint
        )
    results = Results([row.recording for row in rows], folder=place.features_dir, variant=variant)
    panels, is_since_onset = _panels(results, groups, quantities, repeats=repeats)
    save_curves(panels, SINCE_ONSET if is_since_onset else SINCE_FIRST, save)
    say(f"wrote {save}")


def _chosen(place: Workspace, filters: Sequence[str], *, is_motion: bool) -> list[CatalogRow]:
    """Return the recordings that a filter wants and that have a bag; of motion, those along the optical axis."""
    rows = place.catalog().some(filters)
    there = [row for row in rows if row.path is not None and (row.axis == "R" or not is_motion)]
    if not there:
        expected = "recordings with a bag" + (" and motion along the optical axis (axis=R)" if is_motion else "")
        raise UsageError("nothing to draw", expected=expected, found=f"{len(rows)} others")
    return there


def _groups(rows: Sequence[CatalogRow]) -> list[tuple[str, list[CatalogRow]]]:
    """Put the repeats of each movement together."""
    from garment_dataset.stages import REPEATS
    from garment_dataset.workspace.groups import groups_of

    return [
        (f"{group.name}, {len(group.rows)} repeats", list(group.rows)) for group in groups_of(rows, REPEATS, "plot")
    ]


def _panels(
    results: Results,
    groups: Sequence[tuple[str, list[CatalogRow]]],
    quantities: Sequence[Quantity],
    *,
    repeats: bool,
) -> tuple[list[list[Panel]], bool]:
    """Read what is to be drawn; return it with whether time counts from the onset."""
    from garment_dataset.view.over_time import panel

    found = [[_read(results, rows, quantity) for quantity in quantities] for _, rows in groups]
    since = {each.is_since_onset for row in found for drawn in row for each in drawn}
    if len(since) > 1 or (repeats and since == {False}):
        raise UsageError(
            "without a common beginning, nothing can be laid side by side",
            expected="recordings of which the onset is known",
            hint="`garment show NAME` says why there is none; draw recordings without onset by themselves.",
        )
    panels = [
        [panel(title if column == 0 else "", drawn, with_bands=not repeats) for column, drawn in enumerate(row)]
        for (title, _), row in zip(groups, found, strict=True)
    ]
    return panels, since == {True}


def _read(results: Results, rows: Sequence[CatalogRow], quantity: Quantity) -> list[Drawn]:
    """Read one quantity of some recordings; those of several that have no results are named and left out."""
    read = {row.recording: results.read(quantity, row.recording) for row in rows}
    found = [drawn for drawn in read.values() if drawn is not None]
    missing = [name for name, drawn in read.items() if drawn is None]
    if not found:
        raise StoreError(f"no results of {quantity.table}", where=missing[0], hint="`garment build` makes them.")
    if missing:
        text = f"{len(missing)} of {len(rows)} repeats have no {quantity.table}, first {missing[0]}; they are left out"
        warnings.warn(text, DataWarning, stacklevel=2)
    return found
