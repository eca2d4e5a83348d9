"""How good each recording is, in one line: what ``list``, ``status`` and ``show`` say of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from garment_dataset.errors import StoreError
from garment_dataset.features.reading import open_features, result_files, variant_folder

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

QUALITY_KEYS: Mapping[str, type[str | float]] = {"quality": str, "coverage": float, "bridged": float, "noise_m": float}
"""What recordings can be filtered by once they were built."""

QUALITY_UNITS: Mapping[str, str] = {"coverage": "1", "bridged": "1", "noise_m": "m"}
"""Units of those that are quantities."""

_ORDER = ("ok", "look", "unusable")

QUALITY_WORDS: Mapping[str, Sequence[str]] = {"quality": _ORDER}
"""All words of those that are text."""

_VALUES = ("depth_points", "silhouette")


@dataclass(frozen=True, slots=True)
class RecordingQuality:
    """The worst verdict on a recording, and the figures of its points or silhouettes; None: not built, or none.

    Parameters
    ----------
    quality : {"ok", "look", "unusable"} or None
        The worst verdict of its stages.
    coverage, bridged : float or None
        Share of the possible values that were found, and of these without pixels; the smallest and the largest.
    noise_m : float or None
        Scatter of z at rest.
    why : tuple of str
        What speaks against it, stage by stage.
    """

    quality: str | None = None
    coverage: float | None = None
    bridged: float | None = None
    noise_m: float | None = None
    why: tuple[str, ...] = ()

    def record(self) -> dict[str, object]:
        """Return the figures that recordings are filtered by."""
        return {name: getattr(self, name) for name in QUALITY_KEYS}


def read_quality(folder: Path, variant: str = "") -> dict[str, RecordingQuality]:
    """Return what the table ``quality`` says of every recording that was built; nothing where there is none.

    Raises
    ------
    StoreError
        If it is there and cannot be read.
    """
    place = variant_folder(folder, variant) / "quality"
    columns = ["recording", "stage", "verdict", "why", "coverage", "bridged", "noise_m"]
    found: dict[str, list[dict[str, Any]]] = {}
    try:
        # not by load_features: `garment list` does without pandas
        if place.is_dir() and result_files(place.parent, place.name):
            for row in open_features("quality", folder=folder, variant=variant).to_table(columns).to_pylist():
                found.setdefault(row["recording"], []).append(row)
        return {name: _summary(rows) for name, rows in sorted(found.items())}
    except (OSError, ValueError) as error:  # of the disk, of Arrow, and of verdicts that nobody gives
        raise StoreError("results that cannot be read", where=place, found=error) from error


def _summary(rows: Sequence[Mapping[str, Any]]) -> RecordingQuality:
    values = [row for row in rows if row["stage"] in _VALUES]
    return RecordingQuality(
        max((row["verdict"] for row in rows), key=_ORDER.index),
        min(_known(values, "coverage"), default=None),
        max(_known(values, "bridged"), default=None),
        max(_known(rows, "noise_m"), default=None),
        tuple(f"{row['stage']}: {text}" for row in rows for text in row["why"]),
    )


def _known(rows: Sequence[Mapping[str, Any]], name: str) -> list[float]:
    return [row[name] for row in rows if row[name] is not None]
