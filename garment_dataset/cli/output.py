"""How commands speak: results on stdout, all else on stderr; tables by rich on a terminal, plain text elsewhere."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

WorkspaceOption = Annotated[
    Path | None,
    typer.Option(
        "--workspace",
        "-w",
        envvar="GARMENT_WORKSPACE",
        help="Folder with catalog/ and pipelines/; by default the nearest one upward.",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON, and nothing else, on stdout.")]
FiltersArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="FILTERS", help="Which recordings: key=value[,value] terms and name globs.", show_default=False
    ),
]


def take_any_text() -> None:
    """Let what the terminal's encoding has no letters for be written as escapes: file names may hold any bytes."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def print_json(value: object) -> None:
    """Print ``value`` as JSON on stdout."""
    sys.stdout.write(json.dumps(value, indent=2, ensure_ascii=False, default=str) + "\n")


def print_csv(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print rows as CSV on stdout; a missing value is an empty cell."""
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(["" if cell is None else cell for cell in row] for row in rows)


def print_table(columns: Sequence[str], rows: Iterable[Sequence[object]], *, title: str | None = None) -> None:
    """Print rows aligned: a rich table on a terminal, plain text in a pipe or file."""
    cells = [[_cell(cell) for cell in row] for row in rows]
    if sys.stdout.isatty():
        _print_rich(columns, cells, title)
        return
    if title:
        sys.stdout.write(title + "\n")
    widths = [max(len(row[i]) for row in [list(columns), *cells]) for i in range(len(columns))]
    for row in [list(columns), *cells]:
        line = "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        sys.stdout.write(line.rstrip() + "\n")


def say(text: str) -> None:
    """Print one line for the person at the terminal, on stderr."""
    sys.stderr.write(text + "\n")


def show_warning(message: Warning | str, *_: object, **__: object) -> None:
    """Print a warning as one line, in place of :func:`warnings.showwarning`."""
    say(f"garment: warning: {' '.join(str(message).split())}")


@contextlib.contextmanager
def noting_warnings() -> Iterator[list[str]]:
    """Yield a list that takes down every warning that is shown."""
    before, shown = warnings.showwarning, list[str]()

    def show(message: Warning | str, *about: Any, **more: Any) -> None:  # noqa: ANN401 - whatever the protocol gives
        shown.append(str(message))
        before(message, *about, **more)

    warnings.showwarning = show
    try:
        yield shown
    finally:
        warnings.showwarning = before


def _cell(value: object) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}"
    return str(value)


def _print_rich(columns: Sequence[str], cells: list[list[str]], title: str | None) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(*columns, title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for row in cells:
        table.add_row(*(Text(cell) for cell in row))
    Console().print(table)
