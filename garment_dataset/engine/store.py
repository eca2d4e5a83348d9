"""Where results live: content-addressed Parquet objects, and links to them where users look.

The files are the truth. The index (SQLite, written by the coordinating process only) makes them quick to find; it can
be deleted or damaged at any time and is made anew from their footers.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.errors import DataWarning, StorageError, StoreError
from garment_dataset.engine.index import Index, IndexDamagedError
from garment_dataset.engine.loaded import file_state
from garment_dataset.engine.objects import Objects, file_digest, place
from garment_dataset.engine.results import Result, StoredFile
from garment_dataset.engine.table import SCHEMAS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

_HIDDEN = ".scratch"


class Store:
    """The objects, the index and the published links of one workspace.

    Parameters
    ----------
    private_dir : Path
        Holds ``objects/``, ``scratch/`` and ``index.sqlite``; made when first written to.
    features_dir : Path
        Holds the links ``<table>/<partition>/<subject>.parquet``, those of a named variant below ``variant=<name>/``.

    Raises
    ------
    StorageError
        If the index is in use by another program, or cannot be opened.
    """

    def __init__(self, private_dir: Path, features_dir: Path) -> None:
        self.private_dir = private_dir
        self.objects = Objects(private_dir / "objects")
        self.scratch_dir = private_dir / "scratch"
        self.features_dir = features_dir
        self._index_path = private_dir / "index.sqlite"
        self._is_lasting = True
        self._is_prepared = False
        self._opened = file_state(str(self._index_path))
        try:
            self.index = Index(self._index_path)
            self.results = self.index.results()
        except IndexDamagedError as error:
            self._do_without_index(error)

    def _do_without_index(self, error: IndexDamagedError) -> None:
        """Read everything from the footers, into memory: only who may write puts it on disk, see :meth:`prepare`."""
        if os.path.lexists(self._index_path):
            warnings.warn(f"{error}: read anew from the results", DataWarning, stacklevel=3)
        with contextlib.suppress(AttributeError):
            self.index.close()
        self._is_lasting = False
        self.index = Index(None)
        self._read_footers()
        self.results = self.index.results()

    def prepare(self) -> None:
        """Make ready for writing, once: the index lasts, and what dead processes left behind is cleared away.

        The caller holds the lock: whatever lies in the scratch folders belongs to nobody.

        Raises
        ------
        StorageError
            If the folders cannot be written.
        """
        if self._is_prepared:
            return
        self._is_prepared = True
        self.clear_scratch()
        if not self._is_lasting:
            if self._index_path.is_dir():
                raise StorageError(
                    "a folder lies where the index belongs", where=self._index_path, hint="Move it away."
                )
            lasting = Index.create(self._index_path, self.index)
            self.index.close()
            self.index = lasting
            self._is_lasting = True
            self._opened = file_state(str(self._index_path))

    @property
    def is_current(self) -> bool:
        """Whether no other process has written the index since it was opened."""
        return file_state(str(self._index_path)) == self._opened

    @property
    def scratch_dirs(self) -> tuple[Path, ...]:
        """The folders for what is half done; nothing in them is worth anything once its process has ended."""
        return self.scratch_dir, self.features_dir / _HIDDEN

    def clear_scratch(self) -> None:
        """Remove the folders for what is half done; raises as :meth:`prepare` does."""
        for folder in self.scratch_dirs:
            if os.path.lexists(folder):
                _clear(folder)

    def close(self) -> None:
        """Close the index."""
        self.index.close()

    def table_path(self, result: Result, table: str, variant: str) -> Path:
        """Return where a table can be read: among the objects or, should it be gone there, where users find it."""
        path = self.objects.path(result.outputs[table].file.digest)
        published = self.feature_path(table, result.partition, result.subject, variant)
        return path if path.exists() else published

    def facts(self, key: str) -> dict[str, Any] | None:
        """Return what a result was made from, or None for an unknown key; from its file where need be."""
        with contextlib.suppress(IndexDamagedError):
            if (found := self.index.facts(key)) is not None:
                return found
        from garment_dataset.engine.artifacts import read_provenance

        for output in self.results[key].outputs.values() if key in self.results else ():
            with contextlib.suppress(StoreError):
                facts: dict[str, Any] = read_provenance(self.objects.path(output.file.digest))["facts"]
                return facts
        return None

    def holds(self, result: Result) -> bool:
        """Say whether every object of a result is there, and whole."""
        return all(self.objects.holds(output.file) for output in result.outputs.values())

    def restore(self, result: Result, variant: str) -> bool:
        """Put objects that are gone or damaged back from where they are published; say whether all are whole then."""
        for table, output in result.outputs.items():
            if self.objects.holds(output.file):
                continue
            self.objects.discard(output.file.digest)
            published = self.feature_path(table, result.partition, result.subject, variant)
            with contextlib.suppress(OSError):
                if published.is_file() and file_digest(published) == output.file.digest:
                    place(published, self.objects.path(output.file.digest), self.scratch_dir)
        return self.holds(result)

    def folder(self, variant: str = "") -> Path:
        """Return where the tables of a variant lie; those of the usual one stand above."""
        return self.features_dir / f"variant={variant}" if variant else self.features_dir

    def feature_path(self, table: str, partition: str, subject: str, variant: str = "") -> Path:
        """Return where users find a result."""
        return Path(self.feature_name(table, partition, subject, variant))

    def feature_name(self, table: str, partition: str, subject: str, variant: str = "") -> str:
        """Return the same as text, for whoever asks it of every file there is."""
        folder = f"{self.features_dir}/variant={variant}" if variant else self.features_dir
        return f"{folder}/{table}/{partition}/{subject}.parquet" if partition else f"{folder}/{table}/{subject}.parquet"

    def is_published(self, result: Result, variant: str = "") -> bool:
        """Say whether users find exactly this result."""
        return all(
            self.objects.is_whole(self.feature_name(table, result.partition, result.subject, variant), output.file)
            for table, output in result.outputs.items()
        )

    def remember(self, result: Result) -> None:
        """Enter a result whose objects are stored."""
        self.index.add_result(result)
        self.results[result.key] = result

    def publish(self, result: Result, variant: str = "") -> None:
        """Link a result to where users look; each file changes from old to new in one instant.

        When the subject has moved to another partition, its old files go once the new ones are there. What is written
        on the way lies in a scratch folder, which the caller clears in the end (:meth:`clear_scratch`).

        Raises
        ------
        StorageError
            If that cannot be written.
        """
        old = self.index.published_partition((result.stage, result.subject, variant))
        for table, output in result.outputs.items():
            target = self.feature_path(table, result.partition, result.subject, variant)
            place(self.objects.path(output.file.digest), target, self.features_dir / _HIDDEN)
            if old not in {None, result.partition}:
                self.feature_path(table, str(old), result.subject, variant).unlink(missing_ok=True)
        self.index.set_published(result, variant)

    def withdraw(self, node: tuple[str, ...], result: Result | None) -> None:
        """Take a result from where users look; its objects stay."""
        if result is not None:
            for table in result.outputs:
                path = self.feature_path(table, result.partition, result.subject, node[2])
                path.unlink(missing_ok=True)
                remove_empty(path.parent, self.features_dir)
        self.index.forget_nodes([node])

    def _read_footers(self) -> None:
        """Fill the index from the footers of all objects that are what their names say."""
        named = (path.name.removeprefix("variant=") for path in sorted(self.features_dir.glob("variant=*")))
        variants = ("", *named)
        with self.index.transaction():
            for result in Result.from_footers(self._footers()):
                self.index.add_result(result)
                for variant in variants:
                    if self.is_published(result, variant):
                        self.index.set_published(result, variant)

    def _footers(self) -> Iterator[tuple[StoredFile, dict[str, Any]]]:
        from garment_dataset.engine.artifacts import read_whole_provenance

        for path in self.objects:
            try:
                stat = path.stat()
                digest, provenance = read_whole_provenance(path)
            except (OSError, StoreError):
                continue  # whatever it was, it is made anew when it is wanted
            if digest == path.stem:
                yield StoredFile(path.stem, stat.st_size, stat.st_mtime_ns), provenance

    def forget(self, keys: Iterable[str]) -> None:
        """Forget results whose objects were removed."""
        for key in list(keys):
            self.index.forget_results([key])
            self.results.pop(key, None)


def _clear(folder: Path) -> None:
    try:
        if folder.is_dir() and not folder.is_symlink():
            shutil.rmtree(folder)
        else:
            folder.unlink()
    except OSError as error:
        raise StorageError("scratch space cannot be cleared", where=folder, found=error.strerror or error) from error


def remove_empty(folder: Path, root: Path) -> None:
    """Remove a folder, and those above it, as far as nothing is in them but what describes tables."""
    while folder != root and folder.is_relative_to(root):
        with contextlib.suppress(OSError):
            if [path.name for path in folder.iterdir()] == [SCHEMAS]:
                (folder / SCHEMAS).unlink()
        try:
            folder.rmdir()
        except OSError:
            return
        folder = folder.parent
