"""The stages: one file each, and the tuple that names them all; and what whoever writes one needs."""

from __future__ import annotations

from pydantic import Field

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.errors import DataWarning
from garment_dataset.stages.columns import FRAME, RECORD_STAMP, STAMP
from garment_dataset.stages.stage import REPEATS, Group, Stage, StageParams

__all__ = [
    "FRAME",
    "RECORD_STAMP",
    "REPEATS",
    "STAGES",
    "STAMP",
    "Column",
    "DataWarning",
    "Field",
    "Group",
    "Stage",
    "StageParams",
    "TableSpec",
]

STAGES = (
    "decode",
    "pixel_pattern",
    "sensor",
    "depth_points",
    "kinematics",
    "motion",
    "background",
    "silhouette",
    "central_curve",
    "quality",
    "tracks",
    "repeatability",
)
"""The stages that the package brings: each is ``STAGE`` in the module of its name here."""
