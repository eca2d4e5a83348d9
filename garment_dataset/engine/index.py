"""The index of a store: which results there are, what is published, what failed, and what sources were last time.

It can be lost at any time: a store makes it anew from its files. So nothing is done to repair it; every row carries a
checksum, and whatever does not read back as written is an :class:`IndexDamagedError`.
"""

from __future__ import annotations

import json
import os
import sqlite3
import zlib
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.canonical import canonical_json
from garment_dataset.engine.errors import StorageError
from garment_dataset.engine.results import FORMAT, Failure, Result, StoredFile, StoredOutput
from garment_dataset.engine.sources import SourceStat

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

_LAYOUT = """
CREATE TABLE result (key TEXT PRIMARY KEY, stage TEXT, subject TEXT, partition TEXT, outputs TEXT, notes TEXT,
                     body TEXT, checksum INTEGER) WITHOUT ROWID;
CREATE TABLE facts (key TEXT PRIMARY KEY, facts TEXT, checksum INTEGER) WITHOUT ROWID;
CREATE TABLE published (stage TEXT, subject TEXT, variant TEXT, key TEXT, checksum INTEGER,
                     PRIMARY KEY (stage, subject, variant)) WITHOUT ROWID;
CREATE TABLE failure (stage TEXT, subject TEXT, variant TEXT, key TEXT, kind TEXT, message TEXT, traceback TEXT,
                      attempts INTEGER, checksum INTEGER, PRIMARY KEY (stage, subject, variant)) WITHOUT ROWID;
CREATE TABLE source (path TEXT PRIMARY KEY, size_bytes INTEGER, mtime_ns INTEGER, inode INTEGER, ctime_ns INTEGER,
                     digest TEXT, checksum INTEGER) WITHOUT ROWID;
"""
_VERSION = 1000 * FORMAT + 1
"""Of the format of the results, and of this layout: an index of another one is made anew, and the results stay."""

_BUSY = frozenset({sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED})
_OUT_OF_REACH = frozenset(
    {sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_READONLY, sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_PERM}
)


_READ_WHOLE = ("result", "published", "failure", "source")
_NODE = "stage = ? AND subject = ? AND variant = ?"


class IndexDamagedError(Exception):
    """The index does not read back as it was written, is of another version, or is not there."""


class Index:
    """A small SQLite file; see the module's docstring.

    Parameters
    ----------
    path : Path or None
        Where it is; None: in memory, for a process that reads files whose index is lost and may not write one.

    Raises
    ------
    IndexDamagedError
        If it is not there, empty, damaged or of another format.
    StorageError
        If it is in use by another program for long, or cannot be opened.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._as_opened: dict[str, list[tuple[Any, ...]]] = {}
        if path is None:
            self._connection = sqlite3.connect(":memory:", isolation_level=None)
            self._connection.executescript(f"{_LAYOUT} PRAGMA user_version = {_VERSION};")
            return
        if not path.is_file():
            raise IndexDamagedError(f"{path} is not there")
        # one that may not be written is opened as such: else SQLite would want to make a journal beside it
        mode = "rw" if os.access(path, os.W_OK) and os.access(path.parent, os.W_OK) else "ro"
        with self._told():
            self._connection = sqlite3.connect(f"{path.resolve().as_uri()}?mode={mode}", uri=True, isolation_level=None)
        try:
            self._check(path)
        except BaseException:
            self._connection.close()
            raise

    @classmethod
    def create(cls, path: Path, content: Index) -> Index:
        """Put what another index holds, one in memory, in the place of what is there.

        Raises
        ------
        StorageError
            If that cannot be written.
        """
        new = path.with_name(f"{path.name}.new")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            for name in (new.name, f"{new.name}-journal", f"{path.name}-journal"):
                path.with_name(name).unlink(missing_ok=True)
            connection = sqlite3.connect(new, isolation_level=None)
            content._connection.backup(connection)
            connection.close()
            new.replace(path)  # whoever reads meanwhile finds the old one, or a whole new one
        except (OSError, sqlite3.Error) as error:
            found = getattr(error, "strerror", None) or error
            raise StorageError("the index cannot be written", where=path, found=found) from error
        return cls(path)

    def _check(self, path: Path) -> None:
        """Look at every page, and read every row but the facts, which are many and seldom asked for."""
        # the files are the truth: a crash of the machine may cost the index, never a result
        self._execute("PRAGMA synchronous = OFF")
        if self._execute("PRAGMA user_version")[0][0] != _VERSION:
            raise IndexDamagedError(f"{path} is of another format")
        if self._execute("PRAGMA quick_check(1)") != [("ok",)]:
            raise IndexDamagedError(f"{path} is damaged")
        self._as_opened = {table: self._read(f"SELECT * FROM {table}") for table in _READ_WHOLE}  # noqa: S608

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Say in our words what SQLite cannot do."""
        try:
            yield
        except sqlite3.DatabaseError as error:
            code = getattr(error, "sqlite_errorcode", 0) & 0xFF
            if code in _BUSY:
                hint = "Close the program that holds it open, and try again."
                raise StorageError("the index is in use", where=self._path, found=error, hint=hint) from error
            if code in _OUT_OF_REACH:
                hint = "Is the disk full, or the folder not writable?"
                raise StorageError("the index cannot be written", where=self._path, found=error, hint=hint) from error
            raise IndexDamagedError(f"{self._path}: {error}") from error

    def _execute(self, query: str, values: Iterable[object] = ()) -> list[Any]:
        with self._told():
            return self._connection.execute(query, tuple(map(_stored, values))).fetchall()

    def _read(self, query: str, *values: object) -> list[tuple[Any, ...]]:
        """Return rows without their checksums, each of which must be right."""
        rows = []
        for *row, checksum in self._execute(query, values):
            if bytes in map(type, row):
                row = [_loaded(value) for value in row]  # noqa: PLW2901 - names of files that are no UTF-8
            if _checksum(row) != checksum:
                raise IndexDamagedError(f"{self._path}: a row does not read back as written")
            rows.append(tuple(row))
        return rows

    def _whole(self, table: str) -> list[tuple[Any, ...]]:
        """Return a table; for whoever asks first what was read when the index was opened, unless it was written."""
        known = self._as_opened.pop(table, None)
        return self._read(f"SELECT * FROM {table}") if known is None else known  # noqa: S608

    def _write(self, table: str, *values: object) -> None:
        self._as_opened.pop(table, None)
        marks = ", ".join("?" * (len(values) + 1))
        self._execute(f"INSERT OR REPLACE INTO {table} VALUES ({marks})", (*values, _checksum(values)))  # noqa: S608

    def _delete(self, table: str, which: str, *values: object) -> None:
        self._as_opened.pop(table, None)
        self._execute(f"DELETE FROM {table} WHERE {which}", values)  # noqa: S608

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Group writes: all of them are kept, or none."""
        self._execute("BEGIN")
        try:
            yield
        except BaseException:
            if self._connection.in_transaction:
                self._execute("ROLLBACK")
            raise
        self._execute("COMMIT")

    def add_result(self, result: Result) -> None:
        """Remember a result."""
        self._write(
            "result",
            result.key,
            result.stage,
            result.subject,
            result.partition,
            canonical_json(result.outputs),
            canonical_json(result.notes),
            result.body,
        )
        self._write("facts", result.key, canonical_json(result.facts))

    def results(self) -> dict[str, Result]:
        """Return every known result by key, ``facts`` left empty: taking them all apart is slow and seldom needed."""
        return {
            key: Result(key, stage, subject, partition, _outputs(outputs), {}, _notes(notes), body)
            for key, stage, subject, partition, outputs, notes, body in self._whole("result")
        }

    def facts(self, key: str) -> dict[str, Any] | None:
        """Return what a result was made from, or None for an unknown key."""
        rows = self._read("SELECT * FROM facts WHERE key = ?", key)
        return json.loads(rows[0][1]) if rows else None

    def forget_results(self, keys: Iterable[str]) -> None:
        """Forget results whose files are gone."""
        for key in keys:
            self._delete("result", "key = ?", key)
            self._delete("facts", "key = ?", key)

    def published(self) -> dict[tuple[str, ...], str]:
        """Return the key that is published for each node: by stage, subject and variant."""
        return {tuple(node): key for *node, key in self._whole("published")}

    def published_partition(self, node: tuple[str, ...]) -> str | None:
        """Return the partition of what is published for a node, if anything is."""
        keys = [row[3] for row in self._read(f"SELECT * FROM published WHERE {_NODE}", *node)]  # noqa: S608
        rows = self._read("SELECT * FROM result WHERE key = ?", keys[0]) if keys else []
        return rows[0][3] if rows else None

    def set_published(self, result: Result, variant: str) -> None:
        """Remember which result users find; an earlier failure is forgotten with it."""
        node = (result.stage, result.subject, variant)
        self._write("published", *node, result.key)
        self._delete("failure", _NODE, *node)

    def forget_nodes(self, nodes: Iterable[tuple[str, ...]]) -> None:
        """Forget what is published for nodes, and how they failed."""
        for node in nodes:
            for table in ("published", "failure"):
                self._delete(table, _NODE, *node)

    def failures(self) -> dict[tuple[str, ...], Failure]:
        """Return the last failure of each node that has failed since it last succeeded."""
        return {tuple(row[:3]): Failure(*row) for row in self._whole("failure")}

    def set_failure(self, failure: Failure) -> None:
        """Remember a failure."""
        self._write("failure", *failure)

    def source_digests(self) -> dict[str, tuple[SourceStat, str]]:
        """Return what was last known of each external source, by absolute path."""
        return {path: (SourceStat(*stat), digest) for path, *stat, digest in self._whole("source")}

    def set_source_digest(self, path: Path, stat: SourceStat, digest: str) -> None:
        """Remember a source's digest, and the state of the file system that it holds for."""
        self._write("source", str(path), *stat, digest)

    def forget_sources(self, paths: Iterable[str]) -> None:
        """Forget the digests of these sources."""
        for path in paths:
            self._delete("source", "path = ?", path)


def _stored(value: object) -> object:
    """Return a value as SQLite takes it: text that is no UTF-8, such as the names of some files, as bytes."""
    if isinstance(value, str) and not value.isascii():
        try:
            value.encode()
        except UnicodeEncodeError:
            return value.encode("utf-8", "surrogatepass")
    return value


def _loaded(value: object) -> object:
    return value.decode("utf-8", "surrogatepass") if isinstance(value, bytes) else value


def _checksum(values: Iterable[object]) -> int:
    return zlib.crc32(repr(tuple(values)).encode("utf-8", "surrogateescape"))


def _notes(text: str) -> tuple[str, ...]:
    return () if text == "[]" else tuple(json.loads(text))


def _outputs(text: str) -> dict[str, StoredOutput]:
    return {table: StoredOutput(StoredFile(*file), *rest) for table, (file, *rest) in json.loads(text).items()}
