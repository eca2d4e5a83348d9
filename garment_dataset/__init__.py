"""Robot recordings of moving cloth, turned into features that a parameter estimator can trust.

>>> from garment_dataset import Catalog, Workspace, load_features  # doctest: +SKIP
>>> Catalog.load().query(garment="GreenTowel", axis="R")  # doctest: +SKIP
>>> Workspace.find().build("garment=GreenTowel")  # doctest: +SKIP
>>> load_features("kinematics", garment="GreenTowel", point=[1, 5])  # doctest: +SKIP
>>> load_motion("GreenTowel_Ruler_01_pi16_0.5_R1").position_m  # doctest: +SKIP
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from garment_dataset.catalog import Catalog
    from garment_dataset.features.motion import load_motion
    from garment_dataset.features.reading import load_features, open_features
    from garment_dataset.workspace import Workspace

__all__ = ["Catalog", "Workspace", "load_features", "load_motion", "open_features"]

_HOMES = {
    "Catalog": "garment_dataset.catalog",
    "Workspace": "garment_dataset.workspace",
    "load_features": "garment_dataset.features.reading",
    "load_motion": "garment_dataset.features.motion",
    "open_features": "garment_dataset.features.reading",
}


def __getattr__(name: str) -> object:
    """Import the public names when they are asked for: the command line starts without them."""
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
