"""How commands speak: results on stdout, all else on stderr; tables fit a terminal, and are whole elsewhere."""

from __future__ import annotations

import contextlib
import csv
import json
import shutil
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from garment_dataset.cli import completion
from garment_dataset.cli.fitting import fit_table
from garment_dataset.cli.streams import is_unicode, legible

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
        metavar="FILTERS",
        help="Which recordings: key=value[,value] terms and name globs.",
        show_default=False,
        autocompletion=completion.filters,
    ),
]


def terminal_width() -> int | None:
    """Return how many columns the terminal behind stdout has, as ``COLUMNS`` or itself says; None where it is none."""
    return max(1, shutil.get_terminal_size().columns) if sys.stdout.isatty() else None


def print_json(value: object) -> None:
    """Print ``value`` as JSON on stdout: letters that the stream has not, and control letters, as JSON's escapes."""
    text = json.dumps(value, indent=2, ensure_ascii=not is_unicode(), default=str)
    if not text.isprintable():
        text = "".join(each if each == "\n" or each.isprintable() else json.dumps(each)[1:-1] for each in text)
    sys.stdout.write(text + "\n")


def print_csv(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print rows as CSV on stdout; a missing value is an empty cell."""
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(["" if cell is None else cell for cell in row] for row in rows)


def print_table(
    columns: Sequence[str],
    rows: Iterable[Sequence[object]],
    *,
    title: str | None = None,
    heads: Sequence[str] = (),
) -> None:
    """Print rows aligned, in the width of the terminal; in a pipe or file, a line each.

    Parameters
    ----------
    columns : sequence of str
        Names of the columns.
    rows : iterable of sequences
        Cells; None stands for what is not known.
    title : str, optional
        A line above.
    heads : sequence of str
        Columns that say the same of many rows that follow each other: said once, where the terminal is narrow.
    """
    lines = fit_table([legible(column) for column in columns], cells_of(rows), terminal_width(), heads)
    sys.stdout.write("\n".join([*([] if title is None else [title]), *lines]) + "\n")


def cells_of(rows: Iterable[Sequence[object]]) -> list[list[str]]:
    """Return rows as the texts that are printed of them."""
    return [[legible(_cell(cell)) for cell in row] for row in rows]


def say(text: str) -> None:
    """Print a line for the person at the terminal, on stderr."""
    sys.stderr.write("\n".join(legible(line, sys.stderr) for line in text.split("\n")) + "\n")


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
