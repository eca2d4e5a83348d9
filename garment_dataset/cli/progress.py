"""Progress of a build: a bar on a terminal, plain lines elsewhere; always on stderr."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

from garment_dataset.cli.output import say
from garment_dataset.cli.saying import QUALITY_STAGE
from garment_dataset.engine.events import Ending

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from garment_dataset.engine.events import Event


@contextmanager
def progress(total: int) -> Iterator[Callable[[Event], None]]:
    """Yield what is to be told of every ending.

    Parameters
    ----------
    total : int
        Number of endings to come.
    """
    if sys.stderr.isatty() and "CI" not in os.environ and os.environ.get("TERM") != "dumb":
        with _bar(total) as tell:
            yield tell
    else:
        yield _say_line


def _say_line(event: Event) -> None:
    """Print an ending; what was blocked is said once, at the end, with the reason."""
    if event.ending is not Ending.BLOCKED:
        say(line(event))


def line(event: Event) -> str:
    """Return one ending as a plain line."""
    variant = f" ({event.node.variant})" if event.node.variant else ""
    text = f"{event.ending.value:8}{event.node.stage} {event.node.subject}{variant}"
    if event.ending is Ending.BUILT:
        text += f"  {event.seconds:.2f} s"
    if event.message:
        text += f"  {event.message}"
    if event.is_repeated:
        text += " (as before; `garment build --failed` tries again)"
    # what the stage quality says is said once more, of all recordings, at the end
    notes = event.notes if event.ending is Ending.BUILT and event.node.stage != QUALITY_STAGE else ()
    return "\n".join([text, *(f"        note: {note}" for note in notes)])


@contextmanager
def _bar(total: int) -> Iterator[Callable[[Event], None]]:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("building", total=total)

        def tell(event: Event) -> None:
            bar.update(task, advance=1, description=f"{event.node.stage} {event.node.subject}")
            if event.ending is Ending.FAILED or (event.ending is Ending.BUILT and event.notes):
                bar.console.print(line(event), markup=False, highlight=False)

        yield tell
