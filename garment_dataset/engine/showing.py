"""What objects show of themselves in a notebook: a few words, and small tables of HTML with everything escaped."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, TypeVar

from garment_dataset.engine.errors import printable

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

Name = TypeVar("Name", bound=str)

MOST_ROWS = 20
"""Rows of a table that are shown; how many there are is said below."""


def counts_text(counts: Mapping[Name, int], nothing: str = "nothing") -> str:
    """Return counts in words, those of nothing left out."""
    return ", ".join(f"{count} {name}" for name, count in counts.items() if count) or nothing


def html_text(text: object) -> str:
    """Return a text for HTML: control letters as escapes, signs of HTML as references, letters of no encoding too."""
    return html.escape(printable(str(text)))


def html_table(
    columns: Sequence[str], rows: Collection[Sequence[object]], *, title: str = "", more: str = "rows"
) -> str:
    """Return a table of HTML, its first rows if there are many.

    Parameters
    ----------
    columns : sequence of str
        Names of the columns.
    rows : collection of sequences
        Cells; None stands for what is not known.
    title : str
        A line above.
    more : str
        What the rows are, where some are not shown.
    """
    shown = list(rows)[:MOST_ROWS]
    head = "".join(f'<th style="text-align: left">{html_text(column)}</th>' for column in columns)
    lines = ["<div>"]
    lines += [f"<p>{html_text(title)}</p>"] if title else []
    lines += ["<table>", f"<thead><tr>{head}</tr></thead>", "<tbody>", *map(_row, shown), "</tbody>", "</table>"]
    if len(rows) > len(shown):
        lines.append(f"<p>the first {len(shown)} of {len(rows)} {html_text(more)}</p>")
    return "\n".join([*lines, "</div>"])


def _row(cells: Iterable[object]) -> str:
    texts = ("-" if cell is None else html_text(_text(cell)) for cell in cells)
    return "<tr>" + "".join(f'<td style="text-align: left">{text}</td>' for text in texts) + "</tr>"


def _text(cell: object) -> str:
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    return f"{cell:g}" if isinstance(cell, float) else str(cell)
