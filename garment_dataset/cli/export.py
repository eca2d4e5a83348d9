"""``garment export``: recordings and results for other programs; every form of them is a command of this group."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from garment_dataset.cli.output import WorkspaceOption, say
from garment_dataset.cli.writing import refuse_file

app = typer.Typer(help="Write recordings for other programs.", no_args_is_help=True, rich_markup_mode=None)


@app.callback()
def export() -> None:
    """Write recordings for other programs."""


@app.command("mcap")
def mcap(
    recording: Annotated[str, typer.Argument(metavar="NAME", help="Name of a recording, or its file.")],
    out: Annotated[Path, typer.Option("--out", help="The .mcap file; one that is there is replaced.")],
    variant: Annotated[str, typer.Option("--variant", help="Of this variant of the results.")] = "",
    workspace: WorkspaceOption = None,
) -> None:
    """Write images, cloud, markers and transforms of a recording as ROS 2 messages, for Foxglove and the like."""
    from garment_dataset.viewers.content import gather
    from garment_dataset.viewers.mcap_file import import_mcap, save_mcap
    from garment_dataset.workspace import Workspace

    import_mcap()
    refuse_file(out, ".mcap")
    place = Workspace.find(workspace)
    content = gather(place, place.catalog().row(recording), variant)
    for line in content.left_out:
        say(line)
    save_mcap(content, out)
    say(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB)")
