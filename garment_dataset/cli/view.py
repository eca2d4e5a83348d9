"""``garment view``: a recording with all that was found in it, on one timeline, in Rerun."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from garment_dataset.cli.output import WorkspaceOption, say
from garment_dataset.cli.writing import refuse_file
from garment_dataset.errors import UsageError


def view(
    recording: Annotated[str, typer.Argument(metavar="NAME", help="Name of a recording, or its file.")],
    save: Annotated[
        Path | None, typer.Option("--save", help="Write a .rrd file to look at later; needs no screen.")
    ] = None,
    variant: Annotated[str, typer.Option("--variant", help="Of this variant of the results.")] = "",
    workspace: WorkspaceOption = None,
) -> None:
    """Show images, cloud, chain, points, gripper and curves of a recording in Rerun's viewer, or save them for it."""
    from garment_dataset.viewers.content import gather
    from garment_dataset.viewers.rerun_log import import_rerun, open_viewer, save_rrd
    from garment_dataset.workspace import Workspace

    import_rerun()
    if save is None:
        _refuse_no_screen()
    else:
        refuse_file(save, ".rrd")
    place = Workspace.find(workspace)
    content = gather(place, place.catalog().row(recording), variant)
    for line in content.left_out:
        say(line)
    if save is None:
        open_viewer(content)
    else:
        save_rrd(content, save)
        say(f"wrote {save} ({save.stat().st_size / 1e6:.1f} MB); look at it with: rerun {save}")


def _refuse_no_screen() -> None:
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        hint = "--save FILE.rrd writes what can be looked at on another machine."
        raise UsageError("no screen to show it on", hint=hint)
