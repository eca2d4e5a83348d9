"""Rows of the catalog: tables and folder joined, each recording with its garment and its partner."""

from __future__ import annotations

from dataclasses import dataclass, field
from operator import itemgetter
from typing import TYPE_CHECKING, Any, Literal

from garment_dataset.catalog.names import RecordingName
from garment_dataset.catalog.own_values import OwnValues
from garment_dataset.catalog.schemes import THESIS, Scheme

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from datetime import date
    from pathlib import Path

    import pandas as pd

    from garment_dataset.catalog.columns import Column, Value
    from garment_dataset.catalog.filters import Kind
    from garment_dataset.catalog.tables import Garment, Tables

ROW_KEYS: dict[str, Kind] = {
    "recording": str,
    "garment": str,
    "holding": str,
    "repeat": float,
    "swing_rad": float,
    "speed": float,
    "axis": str,
    "topics_file": float,
    "dvd": bool,
    "table": str,
    "partner": str,
    "garment_kind": str,
    "color": str,
    "width_m": float,
    "height_m": float,
    "weight_kg": float,
    "in_tables": bool,
    "state": str,
}
"""What every catalog's rows can be filtered by, and of which type each value is; columns of one's own come behind."""

ROW_UNITS = {"swing_rad": "rad", "speed": "1", "width_m": "m", "height_m": "m", "weight_kg": "kg"}
"""Units of the quantities of a row."""

FIXED_WORDS: dict[str, tuple[str, ...]] = {"axis": ("R", "B"), "state": ("present", "missing", "unexpected")}
"""All words that there can be of some keys, whatever the tables say."""

LABELS = ("recording", "axis", "speed", "repeat", "swing_rad")
"""The values of a row that say whose a result is."""

UNSPECIFIED = "unspecified"
"""Holding in the path of a result whose recording does not say: a null partition cannot be read by pandas."""


@dataclass(frozen=True, slots=True)
class CatalogRow:
    """One recording, with its garment and holding joined in; what is not known is None.

    Parameters
    ----------
    recording : str
        Canonical name, without ``.bag``.
    name : RecordingName
        What that name says.
    garment, holding : str or None
        Words of the name; where the name follows no convention, those of its letters in recordings.csv.
    repeat : int or None
        Number of the repeat.
    swing_rad : float or None
        Swing of the gripper's axis.
    speed : float
        Speed of the robot, as typed (no unit: a fraction of the arm's own).
    axis : {"R", "B"}
        R: along the optical axis; B: across it.
    topics_file : int
        Number of the topics file.
    dvd : bool or None
        Whether the thesis' DVD holds it.
    table : str or None
        Table of the thesis that lists it.
    partner : str or None
        The recording of the same movement along the other axis.
    garment_kind, color : str or None
        As in garments.csv.
    width_m, height_m, weight_kg : float or None
        As in garments.csv, in SI units.
    in_tables : bool
        Whether recordings.csv lists it.
    state : {"present", "missing", "unexpected"} or None
        Listed and there, listed and not there, there and not listed; None when no folder was looked at.
    path : Path or None
        The bag.
    own : mapping of str to value or None
        What columns of one's own say of it, of all that the tables have.
    """

    recording: str
    name: RecordingName
    garment: str | None
    holding: str | None
    repeat: int | None
    swing_rad: float | None
    speed: float
    axis: Literal["R", "B"]
    topics_file: int
    dvd: bool | None
    table: str | None
    partner: str | None
    garment_kind: str | None
    color: str | None
    width_m: float | None
    height_m: float | None
    weight_kg: float | None
    in_tables: bool
    state: Literal["present", "missing", "unexpected"] | None
    path: Path | None
    own: Mapping[str, Value | None] = field(default_factory=dict, hash=False)

    def __getitem__(self, key: str) -> Any:  # noqa: ANN401 - of one of many types
        """Return what it can be filtered by, columns of one's own among it."""
        return self.own[key] if key in self.own else getattr(self, key)

    @property
    def labels(self) -> dict[str, str | int | float | None]:
        """What stands in the identity columns of its results."""
        return {name: getattr(self, name) for name in LABELS}

    @property
    def partition(self) -> dict[str, str]:
        """The hive partition of its results: whole names stand in for a garment that is not known."""
        return {"garment": self.garment or self.name.name, "holding": self.holding or UNSPECIFIED}

    def record(self) -> dict[str, str | int | float | bool | date | None]:
        """Return the row as plain values, for ``--json`` and ``--csv``."""
        values = {name: getattr(self, name) for name in ROW_KEYS}
        return {**values, **self.own, "path": None if self.path is None else str(self.path)}


_OWN_DTYPES = {
    "text": "string",
    "integer": "Int64",
    "number": "float64",
    "boolean": "boolean",
    "date": "datetime64[s]",
}
_DTYPES: dict[Kind, str] = {str: "string", float: "Int64", bool: "boolean"}
"""Column types in pandas, for what is not a quantity: all can miss a value."""

_CATEGORIES: dict[str, list[str]] = {
    "garment": [],
    "holding": [],
    "axis": list(FIXED_WORDS["axis"]),
    "table": [],
    "garment_kind": [],
    "color": [],
    "state": list(FIXED_WORDS["state"]),
}
"""Columns of few words; where the words are not given, those of the whole catalog."""

_CLOTH = ("garment_kind", "color", "width_m", "height_m", "weight_kg")


def join_rows(tables: Tables, bags: Mapping[str, Path] | None, scheme: Scheme = THESIS) -> tuple[CatalogRow, ...]:
    """Join the tables with each other and with the bags that were found.

    Parameters
    ----------
    tables : Tables
        The three tables.
    bags : mapping of str to Path, optional
        Path of every bag by the recording's name; None when no folder was looked at.
    scheme : Scheme
        By which recordings are named.

    Returns
    -------
    tuple of CatalogRow
        The tables' recordings in their order, then the unexpected ones in the order of ``bags``.
    """
    listed = {row.recording: row for row in tables.recordings}
    found = {} if bags is None else bags
    names = {text: _recording_name(text, scheme) for text in dict.fromkeys([*listed, *found])}
    garment_words = {row.letter: row.garment for row in tables.garments}
    holding_words = {row.letter: row.holding for row in tables.holdings}
    cloths = {row.garment: _cloth(row) for row in tables.garments}
    own_values = OwnValues(tables)
    unknown_cloth: dict[str, Any] = dict.fromkeys(_CLOTH)
    partners = _partners(names)
    rows = []
    for text, name in names.items():
        row, path = listed.get(text), found.get(text)
        garment = name.garment or (garment_words.get(row.garment) if row and row.garment else None)
        holding = name.holding or (holding_words.get(row.holding) if row and row.holding else None)
        rows.append(
            CatalogRow(
                recording=text,
                name=name,
                garment=garment,
                holding=holding,
                repeat=name.repeat,
                swing_rad=name.swing_rad,
                speed=float(name.speed),
                axis=name.axis,
                topics_file=name.topics_file,
                dvd=row.dvd if row else None,
                table=row.table if row else None,
                partner=partners.get(text),
                **(cloths.get(garment, unknown_cloth) if garment else unknown_cloth),
                in_tables=row is not None,
                state=None if bags is None else _state(row is not None, path is not None),
                path=path,
                own=own_values.of(row, garment, holding, name.topics_file),
            )
        )
    return tuple(rows)


def to_frame(
    rows: Sequence[CatalogRow], all_rows: Iterable[CatalogRow], columns: Sequence[Column] = ()
) -> pd.DataFrame:
    """Return ``rows`` as a DataFrame with typed columns, with the categories that ``all_rows`` have."""
    import pandas as pd

    vocabulary = tuple(all_rows)

    def column(name: str) -> Any:  # noqa: ANN401 - a Series of one of many types
        value = itemgetter(name)
        dtype: Any = "float64" if name in ROW_UNITS else _DTYPES[ROW_KEYS[name]]
        if name in _CATEGORIES:
            words = _CATEGORIES[name] or sorted({word for row in vocabulary if (word := value(row)) is not None})
            dtype = pd.CategoricalDtype(pd.Index(words, dtype="str"))
        return pd.Series([value(row) for row in rows], dtype=dtype)

    table = pd.DataFrame({name: column(name) for name in ROW_KEYS})
    for each in columns:
        table[each.name] = pd.Series([row.own[each.name] for row in rows], dtype=_OWN_DTYPES[each.type])
    table["path"] = pd.Series([None if row.path is None else str(row.path) for row in rows], dtype="string")
    table.attrs["units"] = ROW_UNITS | {each.name: each.unit for each in columns if each.unit is not None}
    return table


def words_of(tables: Tables, rows: Iterable[CatalogRow]) -> dict[str, tuple[str, ...]]:
    """Return, of every key that is text, all words that there are: in the tables, of the rows, or fixed ones."""
    listed: dict[str, list[str | None]] = {
        "garment": [row.garment for row in tables.garments],
        "holding": [row.holding for row in tables.holdings],
        "garment_kind": [row.kind for row in tables.garments],
        "color": [row.color for row in tables.garments],
    }
    keys = [key for key, kind in ROW_KEYS.items() if kind is str and key not in FIXED_WORDS]
    for table in (tables.garments, tables.holdings, tables.backgrounds):
        for column in (each.name for each in tables.columns if each.type == "text"):
            listed.setdefault(column, []).extend((row.model_extra or {}).get(column) for row in table)
    keys += [column.name for column in tables.columns if column.type == "text"]
    found = {key: [*listed.get(key, ()), *(row[key] for row in rows)] for key in keys}
    return FIXED_WORDS | {key: tuple(dict.fromkeys(filter(None, words))) for key, words in found.items()}


def _recording_name(text: str, scheme: Scheme) -> RecordingName:
    name = scheme.parse(text)
    assert isinstance(name, RecordingName)
    return name


def _state(in_tables: bool, on_disk: bool) -> Literal["present", "missing", "unexpected"]:
    if not in_tables:
        return "unexpected"
    return "present" if on_disk else "missing"


def _cloth(garment: Garment) -> dict[str, Any]:
    """Return what garments.csv says, in SI units."""
    return {
        "garment_kind": garment.kind,
        "color": garment.color,
        "width_m": _divided(garment.width_cm, 100),
        "height_m": _divided(garment.height_cm, 100),
        "weight_kg": _divided(garment.weight_g, 1000),
    }


def _divided(value: float | None, divisor: float) -> float | None:
    return None if value is None else value / divisor


def _partners(names: Mapping[str, RecordingName]) -> dict[str, str]:
    """Pair recordings of the same movement along both axes, one to one, with the same topics file where possible."""
    groups: dict[tuple[object, ...], list[str]] = {}
    for text, name in names.items():
        what = (name.name, None) if name.garment is None else (name.garment, name.holding)
        groups.setdefault((*what, name.repeat, name.swing_divisor, float(name.speed)), []).append(text)
    partners: dict[str, str] = {}
    for group in groups.values():
        for must_agree in (True, False):
            for along in (text for text in group if names[text].axis == "R" and text not in partners):
                for across in (text for text in group if names[text].axis == "B" and text not in partners):
                    if not must_agree or names[along].topics_file == names[across].topics_file:
                        partners[along], partners[across] = across, along
                        break
    return partners
