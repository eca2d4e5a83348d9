"""Repeatability of each movement, for the first page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from garment_dataset.errors import FilterError, printable
from garment_dataset.features.reading import load_features

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


def repeats_of(folder: Path, groups: Sequence[str]) -> list[dict[str, Any]]:
    """Return how far the repeats of each movement are from each other, in displacement.

    Parameters
    ----------
    folder : Path
        The features.
    groups : sequence of str
        Which movements.

    Returns
    -------
    list of dict
        For each movement its ``name``, ``repeats``, and ``points``: each with ``point`` and by coordinate ``cells`` of
        rms with its interval, maximum and what is stated, in mm; ``reason`` where there is no number.

    Raises
    ------
    StoreError
        If the table is there and cannot be read.
    """
    if not groups:
        return []
    try:
        table = load_features("repeatability", folder=folder, group=list(groups))
    except FilterError:
        return []
    found = []
    for name, rows in table.groupby("group", sort=True):
        points = [
            {"point": int(str(point)), "cells": {row["coordinate"]: _cell(row) for row in of_point.to_dict("records")}}
            for point, of_point in rows.groupby("point", sort=True)
        ]
        found.append({"name": printable(str(name)), "repeats": int(rows["repeats"].max()), "points": points})
    return found


def _cell(row: dict[Any, Any]) -> dict[str, Any]:
    values = {
        name: _millimetres(row[f"displacement_{name}_m"])
        for name in ("rms", "rms_low", "rms_high", "max", "stated_rms")
    }
    reason = row["reason"] if isinstance(row["reason"], str) else None
    return {"reason": reason, **values}


def _millimetres(value: float) -> str | None:
    return f"{1e3 * value:.2f}" if np.isfinite(value) else None
