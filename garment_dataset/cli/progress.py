"""Progress of a build: a bar on a terminal, plain lines elsewhere; always on stderr."""

from __future__ import annotations

import os
import sys
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from garment_dataset.cli.fitting import shorten
from garment_dataset.cli.output import say
from garment_dataset.cli.pace import Pace
from garment_dataset.cli.saying import QUALITY_STAGE
from garment_dataset.cli.streams import is_unicode, legible
from garment_dataset.engine.events import Ending

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from garment_dataset.engine.events import Event
    from garment_dataset.engine.graph import NodeId

_MOST_AT_WORK = 8
_WHOLE = 100
"""Frames per second that are told without decimals."""


@contextmanager
def progress(nodes: Iterable[NodeId]) -> Iterator[tuple[Callable[[NodeId], None], Callable[[Event], None]]]:
    """Yield what is to be told of every beginning, and of every ending.

    Parameters
    ----------
    nodes : iterable of NodeId
        Those that are to end.
    """
    if sys.stderr.isatty() and "CI" not in os.environ and os.environ.get("TERM") != "dumb":
        with _bar(Pace(nodes)) as told:
            yield told
    else:
        yield lambda _: None, _say_line


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
def _bar(pace: Pace) -> Iterator[tuple[Callable[[NodeId], None], Callable[[Event], None]]]:
    """Show how far a build is and, below, what is at work; drawn anew by a thread four times a second."""
    from rich.console import Console, Group
    from rich.live import Live
    from rich.progress_bar import ProgressBar
    from rich.table import Table
    from rich.text import Text

    # a console writes control letters of its own, and only those: all names and messages are made legible before
    console = Console(file=sys.__stderr__)
    lock, began_s = threading.Lock(), time.monotonic()

    def drawn() -> Group:
        now_s = time.monotonic()
        with lock:
            texts, done, total = at_work(pace, now_s, console.width), pace.ended, pace.total
            left = time_left(pace, now_s)
        head = Table.grid(padding=(0, 2))
        head.add_row(
            ProgressBar(max(total, 1), done, width=24), f"{done}/{total}", f"{_clock(now_s - began_s)} so far", left
        )
        return Group(head, *map(Text, texts))

    with Live(console=console, get_renderable=drawn, transient=True) as live:

        def begin(node: NodeId) -> None:
            with lock:
                pace.begin(node, time.monotonic())

        def tell(event: Event) -> None:
            with lock:
                pace.end(event)
            if event.ending is Ending.FAILED or (event.ending is Ending.BUILT and event.notes):
                text = "\n".join(legible(each, sys.stderr) for each in line(event).split("\n"))
                live.console.print(text, markup=False, highlight=False)

        yield begin, tell


def at_work(pace: Pace, now_s: float, width: int = 1000) -> list[str]:
    """Return a line for each result that is being made: stage, recording, since when, and how fast the stage was.

    Names are shortened to what fits a terminal's width, and stay different.
    """
    names, rests = [], []
    for node, began_s in list(pace.running.items())[:_MOST_AT_WORK]:
        speed = pace.frames_per_s(node.stage)
        measured = "" if speed is None else f"  {speed:.1f} frames/s" if speed < _WHOLE else f"  {speed:.0f} frames/s"
        variant = f" ({node.variant})" if node.variant else ""
        names.append(legible(f"{node.stage} {node.subject}{variant}", sys.stderr))
        rests.append(f"  {now_s - began_s:.0f} s{measured}")
    sign = "…" if is_unicode(sys.stderr) else "..."
    room = width - 2 - max(map(len, rests), default=0)
    lines = [f"  {name}{rest}" for name, rest in zip(shorten(names, room, sign), rests, strict=True)]
    more = len(pace.running) - _MOST_AT_WORK
    return lines if more <= 0 else [*lines, f"  and {more} more"]


def time_left(pace: Pace, now_s: float) -> str:
    """Return how long the rest will take by what was measured; empty while nothing was."""
    left = pace.left(now_s)
    if left is None or (left.is_least and left.seconds < 1):  # "more than nothing" says nothing
        return ""
    return f"{'more than' if left.is_least else 'about'} {_clock(left.seconds)} left"


def _clock(seconds: float) -> str:
    minutes, rest = divmod(int(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}" if minutes >= 60 else f"{minutes}:{rest:02}"
