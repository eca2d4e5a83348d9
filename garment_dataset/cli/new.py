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
    per: Annotated[
        Literal["recording", "position", "repeats"],
        typer.Option("--per", help="What one run covers: a recording, a camera position, the repeats of a movement."),
    ] = "recording",
    workspace: WorkspaceOption = None,
) -> None:
    """Write a stage, with a table and a test, into the workspace's folder stages/."""
    from garment_dataset.layout import Layout
    from garment_dataset.workspace.new_stage import write_stage

    layout = Layout.find(workspace)
    written = write_stage(layout, name, per)
    say("wrote " + " and ".join(str(path) for path in written.files))
    if written.settings_line is not None:
        say(f"Next: under [stages] of {layout.root / 'garment.toml'} write\n    {written.settings_line}")
    say(f"Next: in {written.pipeline} write\n    {written.pipeline_line}")
    say(f"Then: `garment build`. Its test runs with: python -m pytest {layout.stages_dir}")
