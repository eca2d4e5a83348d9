"""The command ``garment``: parse, call one function, print."""

from __future__ import annotations

import gc
import os
import re
import sys
import warnings
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from garment_dataset.cli import export, new
from garment_dataset.cli.output import say, show_warning
from garment_dataset.cli.streams import make_streams_safe
from garment_dataset.errors import GarmentError

if TYPE_CHECKING:
    from collections.abc import Sequence

PROGRAM = "garment"
"""What the command is called in its own words, however it was started."""

_WRONG_USE: type[typer.BadParameter] = typer.BadParameter.__bases__[0]
"""What Typer raises for all that is wrong with a command: it has no public name."""

_ROOM = 60
"""Letters beside a verb in the list of all, in 80 columns."""

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
    "view": "view.view",
    "report": "report.report",
}
"""Where the function of each verb lies in this package, in the order of ``--help``: one that runs imports no other."""


def application(verb: str | None = None) -> typer.Typer:
    """Return the command with all verbs, or with that one alone, where there is such a verb.

    The groups ``new`` and ``export`` are always there: a group is what makes Typer expect a verb.
    """
    app = typer.Typer(
        name=PROGRAM,
        no_args_is_help=True,
        context_settings={"color": False},  # a stream writes control letters as escapes, ours too
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
    )
    for name in [verb] if verb in VERBS else VERBS:
        module, function = VERBS[name].split(".")
        run = getattr(import_module(f"{__name__}.{module}"), function)
        app.command(name, short_help=_first_words(run.__doc__ or ""))(run)
    app.add_typer(new.app, name="new")
    app.add_typer(export.app, name="export", short_help=export.SHORT)
    app.callback()(_options)
    return app


def _first_words(text: str) -> str:
    """Return as many whole clauses of a verb's description as there is room for in the list of all."""
    text = " ".join(text.partition("\n\n")[0].split())
    words = re.split(r"[:;] ", text)[0] if len(text) > _ROOM else text
    while len(words) > _ROOM and "," in words:
        words = words.rpartition(",")[0]
    return words.rstrip(".") + "."


def _say_version(is_wanted: bool) -> None:
    if is_wanted:
        from garment_dataset.doctor.software import DISTRIBUTION, installed

        version, python = installed(DISTRIBUTION) or "(not installed)", ".".join(map(str, sys.version_info[:3]))
        print(f"{DISTRIBUTION} {version}, Python {python}, {Path(__file__).parents[1]}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_say_version, is_eager=True, help="Print version, Python and folder, and exit."
        ),
    ] = False,
) -> None:
    """Robot recordings of moving cloth, turned into features that a parameter estimator can trust."""


def _verb() -> str | None:
    """Return the first argument; of a line that a shell asks to complete, the one that is complete."""
    words = sys.argv[1:]
    if f"_{PROGRAM.upper()}_COMPLETE" in os.environ:
        words = (os.environ.get("COMP_WORDS") or os.environ.get("_TYPER_COMPLETE_ARGS") or "").split()[1:-1]
    return next(iter(words), None)


def main() -> None:
    """Run the command; what a user caused is one line, a bug keeps its traceback."""
    make_streams_safe()
    # a plan of thousands of recordings makes a million objects that stay: looking for rubbish among them finds none
    gc.set_threshold(200_000, 20, 100)
    warnings.showwarning = show_warning
    try:
        try:
            code = application(_verb())(prog_name=PROGRAM, standalone_mode=False)
        finally:
            sys.stdout.flush()  # a disk that is full is to be told of while it can
    except _WRONG_USE as error:
        say(_in_a_line(error))
        sys.exit(error.exit_code)
    except GarmentError as error:
        say(f"garment: {error}")
        sys.exit(error.exit_code)
    except OSError as error:
        if error.errno is None or error.filename is None:
            raise
        # whatever was being done, it is the disk or the permissions that a person has to look at
        say(f"garment: {error.filename}: {error.strerror}")
        sys.exit(1)
    sys.exit(code if isinstance(code, int) else 0)


def _in_a_line(error: typer.BadParameter) -> str:
    """Return what was wrong with a command, in the form of our own messages; or the help that it asks for."""
    text = error.format_message()
    if error.ctx is None or "\n" in text:
        return text
    # what pydantic says of a value does not name it
    text = text.replace("Value error, ", "").replace("Input should be", "expected").partition(", unable")[0]
    if ": expected " in text and (given := _given_for(getattr(getattr(error, "param", None), "opts", ()))) is not None:
        text += f", found {given!r}"
    end = "" if text.endswith((".", "?")) else "."
    path = error.ctx.command_path
    return f"{path}: {text[0].lower()}{text[1:]}{end} `{path} --help` says what there is."


def _given_for(options: Sequence[str]) -> str | None:
    """Return what stands behind an option in the arguments."""
    for option, value in pairwise([*sys.argv, ""]):
        name, sign, joined = option.partition("=")
        if name in options:
            return joined if sign else value
    return None
