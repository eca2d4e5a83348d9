"""External inputs: what a source is, by content, and whether it may have changed."""

from __future__ import annotations

import os
from stat import S_ISDIR
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.engine.canonical import digest
from garment_dataset.engine.errors import SourceError

if TYPE_CHECKING:
    from pathlib import Path


class SourceStat(NamedTuple):
    """What the file system says of a source; equal values mean that its content need not be read again.

    The time of the last change of the inode is among it, since nobody can set that back. For a folder the sizes are
    summed, the latest times stand for all files, and the third number names all files with their states: two of them
    swapped are another folder.
    """

    size_bytes: int
    mtime_ns: int
    inode: int
    ctime_ns: int


def source_files(path: Path) -> list[Path]:
    """Return the files of a source, sorted: itself, or all files in it when it is a folder."""
    if not path.is_dir():
        return [path]
    return sorted(file for file in path.rglob("*") if file.is_file())


def stat_source(path: Path) -> SourceStat | None:
    """Return the state of a source, or None when it is not there or out of reach."""
    try:
        stat = os.stat(path)  # noqa: PTH116 - every plan asks this of every source
        if S_ISDIR(stat.st_mode):
            return _stat_folder(path)
    except OSError:
        return None
    return SourceStat(stat.st_size, stat.st_mtime_ns, stat.st_ino, stat.st_ctime_ns)


def _stat_folder(path: Path) -> SourceStat:
    stats = {file.relative_to(path).as_posix(): file.stat() for file in source_files(path)}
    listing = [[name, each.st_size, each.st_mtime_ns, each.st_ino] for name, each in stats.items()]
    return SourceStat(
        sum(each.st_size for each in stats.values()),
        max((each.st_mtime_ns for each in stats.values()), default=0),
        int(digest("folder-state/1", listing)[:15], 16),  # SQLite holds 63 bits
        max((each.st_ctime_ns for each in stats.values()), default=0),
    )


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
