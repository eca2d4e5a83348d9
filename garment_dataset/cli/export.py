"""``garment export``: recordings and results for other programs.

Every form is a command of this group; without the name of one, a snapshot is written.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from garment_dataset.cli.clouds import clouds
from garment_dataset.cli.output import WorkspaceOption, say
from garment_dataset.cli.snapshot import snapshot
from garment_dataset.cli.writing import refuse_file

_USUAL = "snapshot"
SHORT = "Write results for others: a snapshot, clouds, MCAP."
_HELP = """Write results for others: `garment export OUT` a snapshot, or what one of the commands says.

A snapshot into a folder that is called like a command: `garment export ./mcap`.
"""


class _Forms(TyperGroup):
    """A group that takes what is no command of its for the arguments of the usual one."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401 - Typer hides its type
        """Put the usual command in front where none is named."""
        if args and args[0] not in {*self.commands, "--help"}:
            args = [_USUAL, *args]
        return super().parse_args(ctx, args)


app = typer.Typer(cls=_Forms, help=_HELP, no_args_is_help=True, rich_markup_mode=None)
app.command(_USUAL, short_help="Parquet for every reader, described, with sums and a data card.")(snapshot)
app.command("clouds", short_help="Points of the garment frame by frame, its gripper, its mesh.")(clouds)


@app.callback(help=_HELP)
def export() -> None:
    """Write results for others."""


@app.command("mcap", short_help="ROS 2 messages for Foxglove and the like.")
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
