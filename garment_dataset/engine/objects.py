"""Files that are called after their content: taken in only when the name is true, and trusted only as stored.

An object is trusted while it has the size and time that it was stored with; the digits of its time below the second
are taken from its digest, so that no two objects have the same. A copy, whose time is another, is read once.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import time
import uuid
from typing import TYPE_CHECKING

from garment_dataset.engine.errors import StorageError
from garment_dataset.engine.results import StoredFile

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

_FICLONE = 0x40049409  # Linux: share the blocks of another file until one of the two is written
_SECOND = 1_000_000_000


class Objects:
    """The folder of all objects: ``<two digits>/<sha256>.parquet``.

    Parameters
    ----------
    folder : Path
        Made when first written to.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._checked: dict[str, tuple[tuple[int, int, int], bool]] = {}

    def path(self, digest: str) -> Path:
        """Return where the object with this sha256 lies."""
        return self.folder / digest[:2] / f"{digest}.parquet"

    def __iter__(self) -> Iterator[Path]:
        """Yield the files of all objects, sorted, whatever is in them."""
        for path in sorted(self.folder.glob("??/*.parquet")):
            if path.name.startswith(path.parent.name) and path.is_file():
                yield path

    def take_in(self, scratch: Path, digest: str) -> tuple[StoredFile, bool]:
        """Move a finished scratch file among the objects, atomically.

        Returns
        -------
        StoredFile
            The object.
        bool
            Whether something else lay under its name: a damaged object, which is replaced.

        Raises
        ------
        StorageError
            If it cannot be written.
        """
        path = self.path(digest)
        try:
            is_there = os.path.lexists(path)
            is_whole = is_there and path.is_file() and file_digest(path) == digest
            if is_whole:
                scratch.unlink()
            else:
                path.parent.mkdir(parents=True, exist_ok=True)
                scratch.chmod(0o444)
                # earlier than now: whatever is written into the file later has another time
                moment = (time.time_ns() // _SECOND - 1) * _SECOND + int(digest[:8], 16) % _SECOND
                os.utime(scratch, ns=(moment, moment))
                scratch.replace(path)
            stat = path.stat()
        except OSError as error:
            raise StorageError("a result cannot be stored", where=path, found=error.strerror or error) from error
        return StoredFile(digest, stat.st_size, stat.st_mtime_ns), is_there and not is_whole

    def holds(self, file: StoredFile) -> bool:
        """Say whether an object is there, and whole."""
        # text, not Path: a plan asks this of every object
        return self.is_whole(f"{self.folder}/{file.digest[:2]}/{file.digest}.parquet", file)

    def is_what_it_says(self, digest: str) -> bool:
        """Read an object, and say whether it is what its name says."""
        try:
            return file_digest(self.path(digest)) == digest
        except OSError:
            return False

    def is_whole(self, path: Path | str, file: StoredFile) -> bool:
        """Say whether a file is this object or a copy of it.

        One of its size and time is. Where the times alone differ, as in a copied folder, its bytes are read once, and
        it is given the time; where that is not allowed, they are read by every process anew.
        """
        try:
            stat = os.stat(path)  # noqa: PTH116 - twice as fast as Path.stat
        except OSError:
            return False
        if stat.st_size != file.size_bytes:
            return False
        if stat.st_mtime_ns == file.mtime_ns:
            return True
        state = (stat.st_ino, stat.st_mtime_ns, stat.st_ctime_ns)
        known = self._checked.get(str(path))
        if known is not None and known[0] == state:
            return known[1]
        return self._look_into(path, state, file)

    def _look_into(self, path: Path | str, state: tuple[int, int, int], file: StoredFile) -> bool:
        try:
            is_whole = file_digest(path) == file.digest
        except OSError:
            return False
        if is_whole:
            with contextlib.suppress(OSError):
                os.utime(path, ns=(file.mtime_ns, file.mtime_ns))
        self._checked[str(path)] = state, is_whole
        return is_whole

    def discard(self, digest: str) -> None:
        """Remove an object, if it is there."""
        with contextlib.suppress(OSError):
            self.path(digest).unlink(missing_ok=True)


def sync(paths: Iterable[Path]) -> None:
    """Have the content of files on disk before this returns.

    Raises
    ------
    StorageError
        If the disk refuses.
    """
    for path in paths:
        try:
            with path.open("rb") as file:
                os.fsync(file.fileno())
        except OSError as error:
            raise StorageError("a result cannot be stored", where=path, found=error.strerror or error) from error


def file_digest(path: Path | str) -> str:
    """Return the sha256 of a file's bytes."""
    with open(path, "rb") as file:  # noqa: PTH123 - may be text, see Objects.is_whole
        return hashlib.file_digest(file, "sha256").hexdigest()


def place(source: Path, target: Path, scratch_dir: Path) -> None:
    """Put the content of an object where users look, from old to new in one instant.

    Shared blocks where the disk can; else a hard link, as long as it is the only one: what is written by mistake into
    one published file is to reach no other; else a copy.

    Parameters
    ----------
    source, target : Path
        The object, and where users look.
    scratch_dir : Path
        On the disk of ``target``, hidden from readers.

    Raises
    ------
    StorageError
        If that cannot be written.
    """
    temporary = scratch_dir / uuid.uuid4().hex
    try:
        scratch_dir.mkdir(parents=True, exist_ok=True)
        target.parent.mkdir(parents=True, exist_ok=True)
        if not _reflink(source, temporary):
            _link_or_copy(source, temporary)
        temporary.replace(target)
    except OSError as error:
        hint = "Something else is in its place: move that away." if os.path.isdir(target) else None  # noqa: PTH112 - whatever its name
        raise StorageError(
            "a result cannot be published", where=target, found=error.strerror or error, hint=hint
        ) from error
    finally:
        # rename(2) leaves the temporary name when both are links to one file
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def _link_or_copy(source: Path, target: Path) -> None:
    if source.stat().st_nlink == 1:
        with contextlib.suppress(OSError):
            target.hardlink_to(source)
            return
    shutil.copy2(source, target)


def _reflink(source: Path, target: Path) -> bool:
    import fcntl

    with source.open("rb") as old, target.open("xb") as new, contextlib.suppress(OSError):
        fcntl.ioctl(new.fileno(), _FICLONE, old.fileno())
        shutil.copystat(source, target)
        return True
    target.unlink()
    return False
