"""Files that commands write: what is refused before anything is read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.errors import UsageError

if TYPE_CHECKING:
    from pathlib import Path


def refuse_file(path: Path, suffix: str) -> None:
    """Refuse a file that is of another kind, or whose folder is not there, before anything is read.

    Raises
    ------
    UsageError
        If it is.
    """
    if path.suffix != suffix:
        raise UsageError("not the kind of file", where=path, expected=suffix, found=repr(path.suffix))
    if not path.parent.is_dir():
        raise UsageError("no folder for a file", where=path, expected="one that is there", found=path.parent)
    if path.is_dir():
        raise UsageError("a folder", where=path, expected=f"the name of a {suffix} file")
