"""``garment record-plan``: how a recording of the catalog is made."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Annotated

import typer

from garment_dataset.cli import completion
from garment_dataset.cli.output import JsonOption, WorkspaceOption, print_json
from garment_dataset.errors import printable

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from garment_dataset.catalog.record_plan import RecordPlan

_WIDTH = 100
"""Letters of a line of a command."""


def record_plan(
    recording: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="A recording of the catalog, or an empty scene (camera_default_0).",
            autocompletion=completion.recordings_and_scenes,
        ),
    ],
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print the commands that record NAME, and what to see to before and afterwards; nothing is recorded."""
    from garment_dataset.catalog.record_plan import plan_recording
    from garment_dataset.workspace import Workspace

    plan = plan_recording(Workspace.find(workspace).catalog(), recording)
    if as_json:
        print_json(plan.record())
    else:
        for line in _report(plan):
            print(line)
    if plan.in_the_way:
        raise typer.Exit(1)


def _report(plan: RecordPlan) -> Iterator[str]:
    yield f"recording  {plan.recording}"
    yield f"file       {plan.path}"
    yield f"topics     {len(plan.topics)}, of {printable(str(plan.topics_path))}"
    yield f"duration   {plan.duration_s} s"
    yield from (f"note       {note}" for note in plan.notes)
    if plan.in_the_way:
        yield ""
        yield from (f"already there: {printable(str(path))}" for path in plan.in_the_way)
        yield "A recorder would overwrite it, so there are no commands here. Move it out of the folder to record anew."
    else:
        yield from _how(plan)
    yield ""
    yield "Afterwards:"
    yield from (f"  {step}" for step in plan.afterwards)


def _how(plan: RecordPlan) -> Iterator[str]:
    yield ""
    yield "Before:"
    yield from (f"  - {step}" for step in plan.before)
    yield ""
    yield "ROS 1 (run it once: rosbag overwrites a bag of this name without asking):"
    yield from _wrapped(plan.ros1)
    yield ""
    yield "ROS 2 (into a folder; its first second may go by before every topic is found):"
    yield from _wrapped(plan.ros2)


def _wrapped(words: Sequence[str]) -> Iterator[str]:
    """Yield the lines of a command that a shell takes for one."""
    line = ""
    for word in map(shlex.quote, words):
        if line and len(line) + len(word) > _WIDTH:
            yield f"{line} \\"
            line = "   "
        line = f"{line} {word}" if line else f"  {word}"
    yield line
