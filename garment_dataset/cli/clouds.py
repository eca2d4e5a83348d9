"""``garment export clouds``: the garment's points frame by frame, as published estimators of cloth read them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from garment_dataset.cli.output import FiltersArgument, WorkspaceOption, say


def clouds(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="A new folder, or an export that is replaced.", show_default=False)
    ],
    filters: FiltersArgument = None,
    every: Annotated[int, typer.Option("--every", min=1, help="Take one of so many depth frames.")] = 1,
    ply: Annotated[bool, typer.Option("--ply/--no-ply", help="A PLY file for each frame, beside the arrays.")] = True,
    pitch: Annotated[
        float, typer.Option("--mesh-pitch", min=0.001, metavar="M", help="Between vertices of the mesh at rest, m.")
    ] = 0.02,
    variant: Annotated[str, typer.Option("--variant", help="Of this variant of the results.")] = "",
    workspace: WorkspaceOption = None,
) -> None:
    """Write clouds of the garment, masks, what moves it, its mesh at rest: arrays, PLY, one meta.json."""
    from garment_dataset.clouds.writing import Form, write_clouds
    from garment_dataset.workspace import Workspace

    place = Workspace.find(workspace)
    rows = place.catalog().some(filters or ())
    written = write_clouds(rows, place, out, Form(every, ply, pitch, variant), tell=say)
    for name, why in written.failed.items():
        say(f"failed: {name}: {why}")
    if absent := sum(row.path is None for row in rows):
        say(f"left out: {absent} without a bag")
    say(f"{len(written.recordings)} recordings; clouds: {out}")
    if written.failed:
        sys.exit(1)
