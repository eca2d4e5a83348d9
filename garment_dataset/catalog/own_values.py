"""Columns of one's own joined: each recording has those of its garment, its holding and its camera position."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from garment_dataset.catalog.columns import Value
    from garment_dataset.catalog.reading import Row
    from garment_dataset.catalog.tables import Holding, Recording, Tables


class OwnValues:
    """What columns of one's own say of recordings, garments, holdings and camera positions."""

    def __init__(self, tables: Tables) -> None:
        self._none: dict[str, Value | None] = dict.fromkeys(column.name for column in tables.columns)
        self._garments = {row.garment: row for row in tables.garments}
        self._holdings = tables.holdings
        self._backgrounds = {row.topics_file: row for row in tables.backgrounds}

    def of(
        self, row: Recording | None, garment: str | None, holding: str | None, topics_file: int
    ) -> dict[str, Value | None]:
        """Return all of them for one recording: what is not known is None."""
        if not self._none:
            return {}
        letter = None if row is None else row.holding
        sources: list[Row | None] = [
            self._garments.get(garment) if garment else None,
            holding_of(self._holdings, letter, holding),
            self._backgrounds.get(topics_file),
            row,
        ]
        found = dict(self._none)
        for source in sources:
            found |= {} if source is None else source.model_extra or {}
        return found


def holding_of(holdings: Iterable[Holding], letter: str | None, word: str | None) -> Holding | None:
    """Return how a garment is held: by the letter in recordings.csv, else by the word if only one holding has it."""
    known = tuple(holdings)
    found = [row for row in known if row.letter == letter] or [row for row in known if row.holding == word]
    return found[0] if len(found) == 1 else None
