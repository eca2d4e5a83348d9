"""``garment init``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from garment_dataset.cli.output import say


def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to make; must not be a workspace yet.")],
) -> None:
    """Write a new workspace: the thesis' catalog and pipelines, and a folder for the bags."""
    from garment_dataset.layout import Layout

    workspace = Layout.create(folder)
    say(f"wrote {workspace.root}: catalog/ pipelines/ recordings/")
    say(f"Put bags (or links to them) into {workspace.recordings_dir}, then: cd {folder} && garment list")
