"""Tables and names in the width that a terminal has: pure functions of texts; nothing is cut.

A table that is too wide is tried in one form after the other, from the one that is read best: headers over several
lines; columns that say the same of many rows in a line above these; text over several lines; and at last every row as a
list of its cells, which fits any width.
"""

from __future__ import annotations

import re
import unicodedata
from itertools import groupby, zip_longest
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_GAP = 2
_INDENT = 2
_LEAST_TEXT = 10
"""Columns that a list of cells leaves for text beside its labels, before it goes below them."""
_PIECES = re.compile(r"\S+?[/,](?=\S)|\S+")


def cell_width(text: str) -> int:
    """Return how many columns of a terminal a text takes: wide letters two, combining marks none."""
    return len(text) if text.isascii() else sum(map(_letter_width, text))


def _letter_width(letter: str) -> int:
    if unicodedata.combining(letter) or unicodedata.category(letter) in {"Mn", "Me", "Cf"}:
        return 0
    return 2 if unicodedata.east_asian_width(letter) in "WF" else 1


def fit_table(
    columns: Sequence[str], rows: Sequence[Sequence[str]], width: int | None, heads: Sequence[str] = ()
) -> list[str]:
    """Return the lines of a table, none wider than a terminal.

    Parameters
    ----------
    columns : sequence of str
        Names of the columns.
    rows : sequence of sequences of str
        Cells, as many a row as there are columns; one line each.
    width : int or None
        Columns of the terminal; None for a pipe or file, where each row is one line.
    heads : sequence of str
        Columns that say the same of many rows that follow each other.
    """
    whole = _block(columns, rows, _natural_widths(columns, rows)).lines
    if width is None or _fits(whole, width):
        return whole
    for attempt in _attempts(columns, rows, width, heads):
        if _fits(attempt, width):
            return attempt
    return list(_records(columns, rows, width))


def fits(columns: Sequence[str], rows: Sequence[Sequence[str]], width: int | None) -> bool:
    """Say whether a table is narrow enough as it is, with each row on one line."""
    return width is None or sum(_natural_widths(columns, rows)) + _GAP * (len(columns) - 1) <= width


def wrap(text: str, width: int, *, hard: bool = True) -> list[str]:
    """Return a text in lines: broken at spaces, else behind a sign as in paths, else, where ``hard``, anywhere.

    All letters but the spaces at which it is broken are there, in their order.
    """
    lines: list[str] = []
    line, end = "", 0
    for match in _PIECES.finditer(text):
        piece, gap = match.group(), text[end : match.start()] if line else ""
        end = match.end()
        if line and cell_width(line + gap + piece) > width:
            lines.append(line)
            line, gap = "", ""
        line += gap + piece
        while hard and cell_width(line) > width:
            head = _head(line, width)
            lines.append(head)
            line = line[len(head) :]
    return [*lines, line] if line or not lines else lines


def name_lines(names: Sequence[str], width: int) -> list[str]:
    """Return names side by side in columns, indented; one that is too long for a line takes several."""
    widest = max(map(cell_width, names), default=0)
    per_line = max(1, (width - _INDENT + _GAP) // (widest + _GAP))
    if per_line == 1:
        return [f"{'':{_INDENT}}{line}" for name in names for line in wrap(name, max(1, width - _INDENT))]
    padded = [name + " " * (widest - cell_width(name)) for name in names]
    rows = [padded[start : start + per_line] for start in range(0, len(padded), per_line)]
    return [f"{'':{_INDENT}}{(' ' * _GAP).join(row)}".rstrip() for row in rows]


def shorten(names: Sequence[str], width: int, sign: str = "…") -> list[str]:
    """Return names that each fit on one line, with a sign where something is left out.

    Different names stay different. Where that cannot be had, all are returned whole.

    Parameters
    ----------
    names : sequence of str
        What is shown together.
    width : int
        Columns of a line.
    sign : str
        Stands where something is left out.
    """
    kept = width - cell_width(sign)
    if all(cell_width(name) <= width for name in names) or kept < 2:
        return list(names)
    different = len(set(names))
    # the ends of names tell recordings apart: as much of them as of the beginnings first
    for tail in sorted(range(kept + 1), key=lambda tail: abs(2 * tail - kept)):
        found = [
            name if cell_width(name) <= width else _head(name, kept - tail) + sign + _head(name[::-1], tail)[::-1]
            for name in names
        ]
        if len(set(found)) == different:
            return found
    return list(names)


def _head(text: str, width: int) -> str:
    """Return as much of the beginning as fits, and at least a letter where a width is given."""
    taken = 0
    for index, letter in enumerate(text):
        taken += _letter_width(letter)
        if taken > width:
            return text[: max(index, 1 if width else 0)]
    return text


class _Block(NamedTuple):
    """A table that is laid out: lines of its header, and of each row."""

    header: list[str]
    bodies: list[list[str]]

    @property
    def lines(self) -> list[str]:
        return [*self.header, *(line for body in self.bodies for line in body)]


def _attempts(
    columns: Sequence[str], rows: Sequence[Sequence[str]], width: int, heads: Sequence[str]
) -> Iterator[list[str]]:
    """Yield the forms of a table that can be had in a width, best first."""
    yield _block(columns, rows, _folded_widths(columns, rows)).lines
    usual = [index for index, column in enumerate(columns) if column in heads]
    forms = [usual, [], [0], [0, *usual]] if usual else [[], [0]]
    if any(cell_width(row[0]) > width for row in rows):
        forms = [chosen for chosen in forms if 0 not in chosen]
    for chosen in forms:
        rest = [index for index in range(len(columns)) if index not in chosen]
        names, cells = [columns[index] for index in rest], [[row[index] for index in rest] for row in rows]
        room = width - _INDENT if chosen else width
        for widths in (_folded_widths(names, cells), _wrapped_widths(names, cells, room)):
            if rest and widths is not None:
                block = _block(names, cells, widths)
                titles = [", ".join(row[index] for index in chosen) for row in (columns, *rows)]
                yield _under_titles(block, titles, width) if chosen else block.lines


def _under_titles(block: _Block, titles: Sequence[str], width: int) -> list[str]:
    """Return a table whose rows stand under titles, the header's first; equal ones that follow each other once."""
    lines = []
    for title, members in groupby(zip(titles, (block.header, *block.bodies), strict=True), key=lambda pair: pair[0]):
        lines += wrap(title, width)
        lines += [f"{'':{_INDENT}}{line}" for _, body in members for line in body]
    return lines


def _natural_widths(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> list[int]:
    return [max(map(cell_width, cells)) for cells in zip(columns, *rows, strict=True)]


def _folded_widths(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> list[int]:
    """Return the widths where headers, and they alone, take several lines."""
    return [
        max([*map(cell_width, header.split()), *map(cell_width, cells)], default=0)
        for header, *cells in zip(columns, *rows, strict=True)
    ]


def _wrapped_widths(columns: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> list[int] | None:
    """Return the widths where text takes several lines, the widest columns giving most; None if words are too long."""
    most = _folded_widths(columns, rows)
    least = [
        max((cell_width(piece) for cell in cells for piece in _PIECES.findall(cell)), default=0)
        for cells in zip(columns, *rows, strict=True)
    ]
    # what a row is called is not broken: its parts would stand among those of other cells
    least[:1] = most[:1]
    room = width - _GAP * (len(columns) - 1)
    if sum(least) > room:
        return None
    widths = list(most)
    for _ in range(sum(widths) - room):
        narrowable = [index for index in range(len(widths)) if widths[index] > least[index]]
        widths[max(narrowable, key=widths.__getitem__)] -= 1
    return widths


def _block(columns: Sequence[str], rows: Sequence[Sequence[str]], widths: Sequence[int]) -> _Block:
    return _Block(_lines_of(columns, widths), [_lines_of(row, widths) for row in rows])


def _lines_of(cells: Sequence[str], widths: Sequence[int]) -> list[str]:
    """Return the lines of one row; a cell that is too wide takes several."""
    parts = [
        [cell] if cell_width(cell) <= width else wrap(cell, width, hard=False)
        for cell, width in zip(cells, widths, strict=True)
    ]
    lines = []
    for texts in zip_longest(*parts, fillvalue=""):
        padded = [text + " " * (width - cell_width(text)) for text, width in zip(texts, widths, strict=True)]
        lines.append((" " * _GAP).join(padded).rstrip())
    return lines


def _records(columns: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> Iterator[str]:
    """Yield every row as a list of its cells, beside their names or, where there is no room, below them."""
    label = max(map(cell_width, columns), default=0)
    room = width - label - _GAP
    for number, row in enumerate(rows):
        if number:
            yield ""
        for column, cell in zip(columns, row, strict=True):
            if room >= _LEAST_TEXT:
                first, *more = wrap(cell, room)
                yield f"{column}{' ' * (label - cell_width(column) + _GAP)}{first}".rstrip()
                yield from (f"{'':{label + _GAP}}{line}" for line in more)
            else:
                yield from wrap(column, width)
                yield from (f"{'':{_INDENT}}{line}".rstrip() for line in wrap(cell, max(1, width - _INDENT)))


def _fits(lines: Sequence[str], width: int) -> bool:
    return all(cell_width(line) <= width for line in lines)
