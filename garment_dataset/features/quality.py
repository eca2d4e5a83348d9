"""How good each recording is, in one line: what ``list``, ``status`` and ``show`` say of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from garment_dataset.features.reading import load_features, variant_folder

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import pandas as pd

QUALITY_KEYS: Mapping[str, type[str | float]] = {"quality": str, "coverage": float, "bridged": float, "noise_m": float}
"""What recordings can be filtered by once they were built."""

_ORDER = ("ok", "look", "unusable")
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
    """Return what the table ``quality`` says of every recording that was built; nothing where there is none."""
    if not (variant_folder(folder, variant) / "quality").is_dir():
        return {}
    rows = load_features("quality", folder=folder, variant=variant)
    return {str(name): _summary(own) for name, own in rows.groupby("recording", sort=True)}


def _summary(rows: pd.DataFrame) -> RecordingQuality:
    values = rows[rows["stage"].isin(_VALUES)]
    why = tuple(f"{stage}: {text}" for stage, texts in zip(rows["stage"], rows["why"], strict=True) for text in texts)
    return RecordingQuality(
        max(rows["verdict"], key=_ORDER.index),
        _known(values["coverage"].min()),
        _known(values["bridged"].max()),
        _known(rows["noise_m"].max()),
        why,
    )


def _known(value: float) -> float | None:
    return None if value != value else float(value)  # noqa: PLR0124 - NaN
