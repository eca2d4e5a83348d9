"""The command ``garment``: parse, call one function, print."""

from __future__ import annotations

import gc
import sys
import warnings

import typer

from garment_dataset.cli import (
    build,
    catalog,
    check,
    diff,
    doctor,
    history,
    lint,
    mask,
    new,
    record_plan,
    salvage,
    score,
    show,
    simulate,
    status,
    storage,
    watch,
    workspace,
)
from garment_dataset.cli.output import say, show_warning, take_any_text
from garment_dataset.errors import GarmentError

app = typer.Typer(
    name="garment",
    help="Robot recordings of moving cloth, turned into features that a parameter estimator can trust.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.command("init")(workspace.init)
app.command("list")(catalog.list_)
app.command("show")(show.show)
app.command("lint")(lint.lint_)
app.command("check")(check.check)
app.command("build")(build.build)
app.command("status")(status.status)
app.command("why")(status.why)
app.command("dag")(status.dag)
app.command("verify")(storage.verify)
app.command("gc")(storage.gc)
app.command("accept")(history.accept)
app.command("log")(history.log)
app.command("diff")(diff.diff)
app.command("doctor")(doctor.doctor)
app.command("salvage")(salvage.salvage)
app.command("record-plan")(record_plan.record_plan)
app.command("watch")(watch.watch)
app.command("mask")(mask.mask)
app.command("simulate")(simulate.simulate)
app.command("score")(score.score)
app.add_typer(new.app, name="new")


def main() -> None:
    """Run the command; what a user caused is one line, a bug keeps its traceback."""
    take_any_text()
    # a plan of thousands of recordings makes a million objects that stay: looking for rubbish among them finds none
    gc.set_threshold(200_000, 20, 100)
    warnings.showwarning = show_warning
    _prepare_only(sys.argv[1:2])
    try:
        app()
    except GarmentError as error:
        say(f"garment: {error}")
        sys.exit(error.exit_code)
    except OSError as error:
        if error.errno is None or error.filename is None:
            raise
        # whatever was being done, it is the disk or the permissions that a person has to look at
        say(f"garment: {error.filename}: {error.strerror}")
        sys.exit(1)


def _prepare_only(words: list[str]) -> None:
    """Leave out all verbs but the one that is asked for: Typer would take the signatures of all apart first.

    The group ``new`` stays, as it is what makes Typer expect a verb.
    """
    asked = [command for command in app.registered_commands if command.name in words]
    if asked:
        app.registered_commands = asked
