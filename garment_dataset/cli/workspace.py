"""``garment init``."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from garment_dataset.cli.output import say


def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to make; must not be a workspace yet.")],
    empty: Annotated[
        bool, typer.Option("--empty", help="Tables with only their headers, for a data set of your own.")
    ] = False,
) -> None:
    """Write a new workspace: the thesis' catalog and pipelines, and a folder for the bags."""
    from garment_dataset.layout import Layout

    workspace = Layout.create(folder, empty=empty)
    say(f"wrote {workspace.root}: catalog/ pipelines/ recordings/")
    where = f"Put bags (or links to them) into {workspace.recordings_dir}"
    enter = f"cd {shlex.quote(str(folder))}"
    if empty:
        tables = "what you know of them into catalog/garments.csv, holdings.csv and recordings.csv"
        say(f"{where}, and {tables}, then: {enter} && garment lint")
    else:
        say(f"{where}, then: {enter} && garment list")
