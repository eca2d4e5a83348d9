"""What a catalog shows of itself in a notebook."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from garment_dataset.engine.showing import counts_text, html_table

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from garment_dataset.catalog.rows import CatalogRow
    from garment_dataset.catalog.tables import Tables

_COLUMNS = ("recording", "garment", "holding", "repeat", "speed", "axis", "state")


def summary(rows: Sequence[CatalogRow], tables: Tables) -> str:
    """Return how many recordings there are and in which state, in one line."""
    states = Counter(row.state for row in rows if row.state is not None)
    text = f"{len(rows)} recording{'s' * (len(rows) != 1)}"
    if tables.problems:
        text += f", {len(tables.problems)} problems in the tables"
    return f"{text}: {counts_text(states)}" if states else text


def as_html(folder: Path, rows: Sequence[CatalogRow], tables: Tables) -> str:
    """Return the first recordings as a table of HTML, with columns of one's own."""
    own = [column.name for column in tables.columns]
    cells = [[*(getattr(row, name) for name in _COLUMNS), *row.own.values()] for row in rows]
    title = f"Catalog {folder}: {summary(rows, tables)}"
    return html_table([*_COLUMNS, *own], cells, title=title, more="recordings: catalog.query() gives all of them")
