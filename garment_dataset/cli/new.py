"""``garment new stage``: the beginning of a stage of one's own."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from garment_dataset.cli.output import WorkspaceOption, say

app = typer.Typer(help="Write the beginning of something of your own.", no_args_is_help=True, rich_markup_mode=None)


@app.callback()
def new() -> None:
    """Write the beginning of something of your own."""


@app.command("stage")
def stage(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Of the stage, its file and its table.")],
    per: Annotated[Literal["recording", "repeats"], typer.Option("--per", help="What one run covers.")] = "recording",
    workspace: WorkspaceOption = None,
) -> None:
    """Write a stage, with a table and a test, into the workspace's folder stages/."""
    from garment_dataset.layout import Layout
    from garment_dataset.workspace.new_stage import write_stage

    layout = Layout.find(workspace)
    written, to_add = write_stage(layout, name, per)
    say("wrote " + " and ".join(str(path) for path in written))
    if to_add is not None:
        say(f"Add to {to_add}")
    say(f'Next: add "{name}" to the stages of a file in {layout.pipelines_dir}, then `garment build`')
    say(f"Test it with: python -m pytest {layout.stages_dir}")
