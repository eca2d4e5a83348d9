"""Where results live: content-addressed Parquet objects, and links to them where users look.

The files are the truth. The index (SQLite, written by the coordinating process only) makes them quick to find; it can
be deleted at any time and is rebuilt from their footers.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import warnings
from typing import TYPE_CHECKING

from garment_dataset.engine.errors import DataWarning, StoreError
from garment_dataset.engine.index import Index, Result, StoredFile

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

_FICLONE = 0x40049409  # Linux: share the blocks of another file until one of the two is written


class Store:
    """The objects, the index and the published links of one workspace.

    Parameters
    ----------
    private_dir : Path
        Holds ``objects/``, ``scratch/`` and ``index.sqlite``; made when first written to.
    features_dir : Path
        Holds the links ``<table>/<partition>/<subject>.parquet``, those of a named variant below ``variant=<name>/``.
    """

    def __init__(self, private_dir: Path, features_dir: Path) -> None:
        self.objects_dir = private_dir / "objects"
        self.scratch_dir = private_dir / "scratch"
        self.features_dir = features_dir
        known = (private_dir / "index.sqlite").is_file()
        self.index = Index(private_dir / "index.sqlite")
        if not known and self.objects_dir.is_dir():
            self.rebuild_index()

    def close(self) -> None:
        """Close the index."""
        self.index.close()

    def object_path(self, digest: str) -> Path:
        """Return where the object with this sha256 lies."""
        return self.objects_dir / digest[:2] / f"{digest}.parquet"

    def table_path(self, result: Result, table: str, variant: str) -> Path:
        """Return where a table can be read: among the objects or, should it be gone there, where users find it."""
        path = self.object_path(result.outputs[table].file.digest)
        published = self.feature_path(table, result.partition, result.subject, variant)
        return path if path.exists() else published

    def adopt(self, scratch: Path, digest: str) -> StoredFile:
        """Move a finished scratch file among the objects, atomically; an equal object that is there already is kept."""
        path = self.object_path(digest)
        if path.exists():
            scratch.unlink()
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            scratch.chmod(0o444)
            scratch.replace(path)
        stat = path.stat()
        return StoredFile(digest, stat.st_size, stat.st_mtime_ns)

    def holds(self, result: Result) -> bool:
        """Say whether every object of a result is there, with the size and time it was stored with."""
        return all(
            _is_as_stored(self.object_path(output.file.digest), output.file) for output in result.outputs.values()
        )

    def folder(self, variant: str = "") -> Path:
        """Return where the tables of a variant lie; those of the usual one stand above."""
        return self.features_dir / f"variant={variant}" if variant else self.features_dir

    def feature_path(self, table: str, partition: str, subject: str, variant: str = "") -> Path:
        """Return where users find a result."""
        return self.folder(variant) / table / partition / f"{subject}.parquet"

    def is_published(self, result: Result, variant: str = "") -> bool:
        """Say whether users find exactly this result."""
        # text, not Path: a plan asks this of every file there is
        place = f"{result.partition}/{result.subject}" if result.partition else result.subject
        folder = f"{self.features_dir}/variant={variant}" if variant else self.features_dir
        return all(
            _is_as_stored(f"{folder}/{table}/{place}.parquet", output.file) for table, output in result.outputs.items()
        )

    def publish(self, result: Result, variant: str = "") -> None:
        """Link a result to where users look; each file changes from old to new in one instant.

        When the subject has moved to another partition, its old files go once the new ones are there.
        """
        old = self.index.published_partition(result.stage, result.subject, variant)
        for table, output in result.outputs.items():
            target = self.feature_path(table, result.partition, result.subject, variant)
            target.parent.mkdir(parents=True, exist_ok=True)
            _link(self.object_path(output.file.digest), target)
            if old not in {None, result.partition}:
                self.feature_path(table, str(old), result.subject, variant).unlink(missing_ok=True)
        self.index.set_published(result, variant)

    def rebuild_index(self) -> int:
        """Read the index anew from the footers of all objects; return how many there are."""
        from garment_dataset.engine.artifacts import read_provenance

        footers = []
        for path in self._objects():
            stat = path.stat()
            try:
                footers.append((StoredFile(path.stem, stat.st_size, stat.st_mtime_ns), read_provenance(path)))
            except StoreError as error:
                warnings.warn(f"left out of the index: {error}", DataWarning, stacklevel=2)
        results = Result.from_footers(footers)
        named = (path.name.removeprefix("variant=") for path in sorted(self.features_dir.glob("variant=*")))
        variants = ("", *named)
        with self.index.transaction():
            for result in results.values():
                self.index.add_result(result)
                for variant in variants:
                    if self.is_published(result, variant):
                        self.index.set_published(result, variant)
        return len(footers)

    def _objects(self) -> Iterator[Path]:
        for path in sorted(self.objects_dir.glob("??/*.parquet")):
            if path.name.startswith(path.parent.name):
                yield path


def _is_as_stored(path: Path | str, file: StoredFile) -> bool:
    try:
        stat = os.stat(path)  # noqa: PTH116 - twice as fast as Path.stat
    except FileNotFoundError:
        return False
    return (stat.st_size, stat.st_mtime_ns) == (file.size_bytes, file.mtime_ns)


def _link(source: Path, target: Path) -> None:
    """Put the content of ``source`` at ``target``: shared blocks where the disk can, else a hard link, else a copy."""
    temporary = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        temporary.unlink(missing_ok=True)
        if not _reflink(source, temporary):
            try:
                temporary.hardlink_to(source)
            except OSError:
                shutil.copy2(source, temporary)
        temporary.replace(target)
    except OSError as error:
        raise StoreError("a result cannot be published", where=target, found=error.strerror or error) from error
    finally:
        # rename(2) leaves the temporary name when both are links to one file
        temporary.unlink(missing_ok=True)


def _reflink(source: Path, target: Path) -> bool:
    import fcntl

    with source.open("rb") as old, target.open("xb") as new, contextlib.suppress(OSError):
        fcntl.ioctl(new.fileno(), _FICLONE, old.fileno())
        shutil.copystat(source, target)
        return True
    target.unlink()
    return False
