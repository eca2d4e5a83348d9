"""External inputs: what a source is, by content, and whether it may have changed."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.engine.errors import SourceError

if TYPE_CHECKING:
    from pathlib import Path


class SourceStat(NamedTuple):
    """What the file system says of a source; equal values mean that its content need not be read again.

    For a folder the sizes are summed, and the latest time and a sum of inodes stand for all files.
    """

    size_bytes: int
    mtime_ns: int
    inode: int


def source_files(path: Path) -> list[Path]:
    """Return the files of a source, sorted: itself, or all files in it when it is a folder."""
    if not path.is_dir():
        return [path]
    return sorted(file for file in path.rglob("*") if file.is_file())


def stat_source(path: Path) -> SourceStat | None:
    """Return the state of a source, or None when it is not there."""
    try:
        if path.is_dir():
            stats = [file.stat() for file in source_files(path)]
            mtime_ns = max((stat.st_mtime_ns for stat in stats), default=0)
            return SourceStat(sum(stat.st_size for stat in stats), mtime_ns, sum(stat.st_ino for stat in stats))
        stat = path.stat()
    except FileNotFoundError:
        return None
    return SourceStat(stat.st_size, stat.st_mtime_ns, stat.st_ino)


def digest_source(path: Path) -> str:
    """Return the BLAKE3 of a source's bytes, 64 hex digits; of a folder, over its files' names and digests.

    Raises
    ------
    SourceError
        If it cannot be read.
    """
    from blake3 import blake3

    try:
        if not path.is_dir():
            return blake3(max_threads=1).update_mmap(path).hexdigest() if path.stat().st_size else blake3().hexdigest()
        state = blake3(b"folder/1\n")
        for file in source_files(path):
            name = os.fsencode(file.relative_to(path).as_posix())
            state.update(name + b"\0" + digest_source(file).encode() + b"\n")
        return state.hexdigest()
    except OSError as error:
        raise SourceError("cannot be read", where=path, found=error.strerror or error) from error
