"""The command ``garment``: parse, call one function, print."""

from __future__ import annotations

import gc
import sys
import warnings
from importlib import import_module

import typer

from garment_dataset.cli import new
from garment_dataset.cli.output import say, show_warning, take_any_text
from garment_dataset.errors import GarmentError

VERBS = {
    "init": "workspace.init",
    "list": "catalog.list_",
    "show": "show.show",
    "lint": "lint.lint_",
    "check": "check.check",
    "build": "build.build",
    "status": "status.status",
    "why": "status.why",
    "dag": "status.dag",
    "verify": "storage.verify",
    "gc": "storage.gc",
    "accept": "history.accept",
    "log": "history.log",
    "diff": "diff.diff",
    "doctor": "doctor.doctor",
    "salvage": "salvage.salvage",
    "record-plan": "record_plan.record_plan",
    "watch": "watch.watch",
    "mask": "mask.mask",
    "simulate": "simulate.simulate",
    "score": "score.score",
    "plot": "plot.plot",
    "report": "report.report",
}
"""Where the function of each verb lies in this package, in the order of ``--help``: one that runs imports no other."""


def application(verb: str | None = None) -> typer.Typer:
    """Return the command with all verbs, or with that one alone, where there is such a verb.

    The group ``new`` is always there, as it is what makes Typer expect a verb.
    """
    app = typer.Typer(
        name="garment",
        help="Robot recordings of moving cloth, turned into features that a parameter estimator can trust.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
    )
    for name in [verb] if verb in VERBS else VERBS:
        module, function = VERBS[name].split(".")
        app.command(name)(getattr(import_module(f"{__name__}.{module}"), function))
    app.add_typer(new.app, name="new")
    return app


def main() -> None:
    """Run the command; what a user caused is one line, a bug keeps its traceback."""
    take_any_text()
    # a plan of thousands of recordings makes a million objects that stay: looking for rubbish among them finds none
    gc.set_threshold(200_000, 20, 100)
    warnings.showwarning = show_warning
    try:
        application(next(iter(sys.argv[1:]), None))()
    except GarmentError as error:
        say(f"garment: {error}")
        sys.exit(error.exit_code)
    except OSError as error:
        if error.errno is None or error.filename is None:
            raise
        # whatever was being done, it is the disk or the permissions that a person has to look at
        say(f"garment: {error.filename}: {error.strerror}")
        sys.exit(1)
