"""What a user can get wrong, one class each; their root is :class:`GarmentError`.

The form of their messages, and the errors of the engine itself, are in :mod:`garment_dataset.engine.errors`.
"""

from __future__ import annotations

import difflib
import os
import reprlib
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from garment_dataset.engine.errors import (
    ClusterError,
    ClusterLostError,
    DataWarning,
    LockedError,
    SourceError,
    StageError,
    StorageError,
    StoreError,
    TableError,
    UntraceableCodeError,
    printable,
)
from garment_dataset.engine.errors import ReportedError as GarmentError

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = [
    "BagError",
    "CatalogError",
    "ClusterError",
    "ClusterLostError",
    "DataWarning",
    "FilterError",
    "GarmentError",
    "LockedError",
    "MessageError",
    "MissingExtraError",
    "PictureError",
    "PipelineError",
    "RecordingNameError",
    "SourceError",
    "StageError",
    "StorageError",
    "StoreError",
    "TableError",
    "TransformError",
    "UntraceableCodeError",
    "UsageError",
    "WorkspaceError",
    "as_path",
    "did_you_mean",
    "nearest_word",
    "one_of",
    "printable",
    "require_extra",
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


_MAX_NAMED = 24
"""How many words a message names: all garments of a catalog, but not all of its recordings."""


def nearest_word(word: str, known: Iterable[str], cutoff: float = 0.6) -> str | None:
    """Return the known word that looks most like one that is not, whatever its case; None when none does."""
    folded: dict[str, str] = {}
    for each in known:
        folded.setdefault(each.casefold(), each)
    found = difflib.get_close_matches(word.casefold(), list(folded), n=1, cutoff=cutoff)
    return folded[found[0]] if found else None


def did_you_mean(word: str, known: Iterable[str], prefix: str = "") -> str | None:
    """Return the hint that names the nearest known word, behind a prefix; None when none looks like it."""
    nearest = nearest_word(word, known)
    return None if nearest is None else f"Did you mean {prefix}{nearest}?"


def one_of(known: Iterable[str]) -> str:
    """Say in a message what is allowed; of very many words only how many there are."""
    words = list(known)
    if not words:
        return "nothing: there is none"
    return f"one of {', '.join(words)}" if len(words) <= _MAX_NAMED else f"one of the {len(words)} that there are"


def as_path(given: Path | str) -> Path:
    """Return a path that may be given as text.

    Raises
    ------
    UsageError
        If it is neither.
    """
    if not isinstance(given, str | os.PathLike):
        raise UsageError("not a path", expected="a path, or text", found=reprlib.repr(given))
    return Path(given)


def require_extra(module: str, what: str, extra: str) -> None:
    """Import a library that only an extra installs, or say what it is for and how to get it.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        import_module(module)
    except ImportError as error:
        raise MissingExtraError(what, hint=f"Install it with: pip install 'garment-dataset[{extra}]'") from error
