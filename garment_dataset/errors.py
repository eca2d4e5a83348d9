"""What a user can get wrong, one class each; their root is :class:`GarmentError`.

The form of their messages, and the errors of the engine itself, are in :mod:`garment_dataset.engine.errors`.
"""

from __future__ import annotations

from garment_dataset.engine.errors import (
    ClusterError,
    ClusterLostError,
    DataWarning,
    SourceError,
    StageError,
    StoreError,
    TableError,
    UntraceableCodeError,
)
from garment_dataset.engine.errors import ReportedError as GarmentError

__all__ = [
    "BagError",
    "CatalogError",
    "ClusterError",
    "ClusterLostError",
    "DataWarning",
    "FilterError",
    "GarmentError",
    "MessageError",
    "MissingExtraError",
    "PictureError",
    "PipelineError",
    "RecordingNameError",
    "SourceError",
    "StageError",
    "StoreError",
    "TableError",
    "TransformError",
    "UntraceableCodeError",
    "UsageError",
    "WorkspaceError",
]


class RecordingNameError(GarmentError):
    """A file name that the grammar of table 4.2 does not admit."""


class FilterError(GarmentError):
    """A filter term that names no column or cannot be read, or filters that nothing matches."""


class UsageError(GarmentError):
    """A command that asks for what does not exist, or for what does not go together."""


class CatalogError(GarmentError):
    """A table of the catalog that cannot be read or contradicts itself."""


class WorkspaceError(GarmentError):
    """No workspace here, or one whose configuration cannot be read."""


class PipelineError(GarmentError):
    """A pipeline file that names an unknown stage, parameter or recording."""


class BagError(GarmentError):
    """A recording that cannot be opened or read."""


class MessageError(GarmentError):
    """One message of a bag that does not fit its own description."""


class TransformError(GarmentError):
    """A question that the recorded transforms cannot answer."""


class PictureError(GarmentError):
    """Bytes or pixels that are no picture of the kind or size needed."""


class MissingExtraError(GarmentError):
    """A command whose optional dependencies are not installed."""
