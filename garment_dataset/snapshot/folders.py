"""Folders that are written whole: beside what they replace, with sums, or not at all."""

from __future__ import annotations

import os
import shutil
from contextlib import contextmanager
from typing import TYPE_CHECKING

from garment_dataset.errors import StorageError, StoreError
from garment_dataset.snapshot.sums import SUMS, compare, sums_of, sums_text

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


def refuse_foreign(folder: Path) -> None:
    """Refuse to replace what this package has not written, or what somebody has changed since.

    Raises
    ------
    StoreError
        If it is so.
    """
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return
    hint = "Choose another folder, or move it away."
    if not folder.is_dir() or not (folder / SUMS).is_file():
        raise StoreError("in the way of what is exported", where=folder, hint=hint)
    if found := compare(folder):
        names = [*found.changed, *found.missing, *found.added]
        raise StoreError(
            "what was exported and then changed is not replaced", where=folder, found=", ".join(names[:5]), hint=hint
        )


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """Yield a new folder to fill, which gets its sums and takes the place of the old one when all went well.

    Raises
    ------
    StoreError
        See :func:`refuse_foreign`.
    StorageError
        If it cannot be written.
    """
    refuse_foreign(folder)
    new, old = (folder.with_name(f".{folder.name}.{word}.{os.getpid()}") for word in ("new", "old"))
    try:
        new.mkdir(parents=True)
        yield new
        (new / SUMS).write_text(sums_text(sums_of(new)), "utf-8")
        if folder.is_dir():
            folder.rename(old)
        new.rename(folder)
    except OSError as error:
        if old.is_dir() and not folder.exists():
            old.rename(folder)
        raise StorageError("cannot be written", where=folder, found=error.strerror or error) from error
    finally:
        shutil.rmtree(new, ignore_errors=True)
        if folder.exists():
            shutil.rmtree(old, ignore_errors=True)
