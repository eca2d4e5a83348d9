"""What is counted of a snapshot while it is written: rows, what is missing, how certain it says it is."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from garment_dataset.engine.artifacts import PROVENANCE_KEY

if TYPE_CHECKING:
    from collections.abc import Mapping

    from garment_dataset.arrays import FloatArray
    from garment_dataset.snapshot.contents import Piece


class Certainty(NamedTuple):
    """Of one column: its unit, the median of its stated standard uncertainty, and the share of rows without a value."""

    column: str
    unit: str
    median_std: float | None
    null_share: float


@dataclass
class Tally:
    """Counts over the files of a snapshot.

    Parameters
    ----------
    schemas : mapping of str to dict
        Descriptions of all tables.
    """

    schemas: Mapping[str, dict[str, Any]]
    rows: Counter[str] = field(default_factory=Counter)
    files: dict[str, list[str]] = field(default_factory=dict)
    empty: list[str] = field(default_factory=list)
    verdicts: dict[str, str] = field(default_factory=dict)
    made: dict[str, dict[str, Any]] = field(default_factory=dict)
    _nulls: Counter[tuple[str, str]] = field(default_factory=Counter)
    _stds: dict[tuple[str, str], list[FloatArray]] = field(default_factory=dict)

    def add(self, piece: Piece, table: pa.Table) -> None:
        """Count one file, and note what it was made with; one without rows is noted as such."""
        if not table.num_rows:
            self.empty.append(piece.name)
            return
        self.rows[piece.table] += table.num_rows
        self.files.setdefault(piece.table, []).append(piece.name)
        provenance = json.loads((table.schema.metadata or {})[PROVENANCE_KEY])
        facts = provenance["facts"]
        self.made[piece.name] = {
            "stage": facts["stage"],
            "key": provenance["key"],
            "content": provenance["content"],
            "code": facts["code"],
            "libraries": facts["libraries"],
            "params": facts["params"],
        }
        for column in self.schemas[piece.table]["columns"]:
            if std := column.get("uncertainty"):
                about = piece.table, column["name"]
                self._nulls[about] += table[column["name"]].null_count
                self._stds.setdefault(about, []).append(_numbers(table[std]))
        if piece.table == "quality":
            self._judge(piece.subject, table)

    def _judge(self, subject: str, table: pa.Table) -> None:
        found = {str(word) for word in pc.unique(table["verdict"]).to_pylist()}
        worst = next((word for word in ("unusable", "look", "ok") if word in found), "")
        if worst:
            self.verdicts[subject] = worst

    def certainties(self, table: str) -> list[Certainty]:
        """Return what a table says of its own uncertainty, column by column."""
        found = []
        for column in self.schemas[table]["columns"]:
            if (parts := self._stds.get((table, column["name"]))) is not None:
                known = np.concatenate(parts)
                median = float(np.median(known)) if known.size else None
                share = self._nulls[table, column["name"]] / max(self.rows[table], 1)
                found.append(Certainty(column["name"], column["unit"], median, share))
        return found

    def settings(self) -> dict[str, list[dict[str, Any]]]:
        """Return by stage what its results were made with, each way once, with the number of files made so."""
        found: dict[str, list[dict[str, Any]]] = {}
        for made in self.made.values():
            way = {name: made[name] for name in ("code", "libraries", "params")}
            ways = found.setdefault(made["stage"], [])
            same = next((each for each in ways if {**each, "files": 0} == {**way, "files": 0}), None)
            if same is None:
                ways.append({**way, "files": 1})
            else:
                same["files"] += 1
        return dict(sorted(found.items()))


def _numbers(column: pa.ChunkedArray[Any]) -> FloatArray:
    """Return all numbers of a column, those of lists one by one, without nulls."""
    flat = pc.list_flatten(column) if pa.types.is_list(column.type) else column
    numbers: FloatArray = flat.drop_null().to_numpy().astype(np.float64)
    return numbers
