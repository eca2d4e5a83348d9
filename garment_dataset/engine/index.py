"""The index of a store: which results there are, what is published, what failed, and what sources were last time."""

from __future__ import annotations

import json
import sqlite3
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from garment_dataset.engine.canonical import canonical_json
from garment_dataset.engine.sources import SourceStat

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

FORMAT = 2
"""Raised when the layout below or the files' footers change; an index of another format is thrown away."""

_LAYOUT = """
CREATE TABLE result (key TEXT PRIMARY KEY, stage TEXT, subject TEXT, partition TEXT, outputs TEXT, facts TEXT,
                     notes TEXT) WITHOUT ROWID;
CREATE TABLE published (stage TEXT, subject TEXT, variant TEXT, key TEXT, PRIMARY KEY (stage, subject, variant))
                     WITHOUT ROWID;
CREATE TABLE failure (stage TEXT, subject TEXT, variant TEXT, key TEXT, kind TEXT, message TEXT, traceback TEXT,
                      attempts INTEGER, PRIMARY KEY (stage, subject, variant)) WITHOUT ROWID;
CREATE TABLE source (path TEXT PRIMARY KEY, size_bytes INTEGER, mtime_ns INTEGER, inode INTEGER, digest TEXT)
                     WITHOUT ROWID;
"""


class StoredFile(NamedTuple):
    """One object: the sha256 of its bytes, and its state when it was stored."""

    digest: str
    size_bytes: int
    mtime_ns: int


class StoredOutput(NamedTuple):
    """One table of a result."""

    file: StoredFile
    content: str
    rows: int


@dataclass(frozen=True)
class Result:
    """All tables that one run of a stage made, and what they were made from.

    Parameters
    ----------
    key : str
        Digest of ``facts``.
    stage, subject : str
        What was run, and for which subject.
    partition : str
        Where under a table's folder it is published, such as ``kind=a/side=b``; may be empty.
    outputs : mapping of str to StoredOutput
        By table name.
    facts : mapping
        Parameters, code, libraries, labels and input digests: the pre-image of the key.
    notes : tuple of str
        What the stage said of data that it left out.
    """

    key: str
    stage: str
    subject: str
    partition: str
    outputs: Mapping[str, StoredOutput]
    facts: Mapping[str, Any] = field(compare=False)
    notes: tuple[str, ...] = ()

    @classmethod
    def from_footers(cls, footers: Iterable[tuple[StoredFile, Mapping[str, Any]]]) -> dict[str, Result]:
        """Put results together from the footers of their files; a result with a table missing is left out."""
        outputs: dict[str, dict[str, StoredOutput]] = {}
        about: dict[str, Mapping[str, Any]] = {}
        for file, footer in footers:
            about[footer["key"]] = footer
            output = StoredOutput(file, footer["content"], footer["rows"])
            outputs.setdefault(footer["key"], {})[footer["table"]] = output
        return {
            key: cls(
                key,
                footer["facts"]["stage"],
                footer["subject"],
                footer["partition"],
                outputs[key],
                footer["facts"],
                tuple(footer["notes"]),
            )
            for key, footer in about.items()
            if set(outputs[key]) == set(footer["tables"])
        }


class Failure(NamedTuple):
    """Why a stage failed for a subject, with the key it failed with."""

    stage: str
    subject: str
    variant: str
    key: str
    kind: str
    message: str
    traceback: str
    attempts: int


class Index:
    """A small SQLite file; see the module's docstring.

    Parameters
    ----------
    path : Path
        Made, with its folder, at the first write; until then reads find nothing.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._connection: sqlite3.Connection | None = None
        if path.is_file():
            self._open()

    def close(self) -> None:
        """Close the file."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _open(self) -> sqlite3.Connection:
        if self._connection is None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            connection = sqlite3.connect(self._path, isolation_level=None)
            # the files are the truth: a crash of the machine may cost the index, never a result
            connection.execute("PRAGMA synchronous = OFF")
            (version,) = connection.execute("PRAGMA user_version").fetchone()
            if version != FORMAT:
                for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall():
                    connection.execute(f"DROP TABLE {name}")
                connection.executescript(_LAYOUT + f"PRAGMA user_version = {FORMAT};")
            self._connection = connection
        return self._connection

    def _read(self, query: str, *values: object) -> list[Any]:
        return [] if self._connection is None else self._connection.execute(query, values).fetchall()

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Group writes: all of them are kept, or none."""
        connection = self._open()
        connection.execute("BEGIN")
        try:
            yield
        except BaseException:
            connection.execute("ROLLBACK")
            raise
        connection.execute("COMMIT")

    def add_result(self, result: Result) -> None:
        """Remember a result."""
        self._open().execute(
            "INSERT OR REPLACE INTO result VALUES (?, ?, ?, ?, ?, ?, ?)",
            (
                result.key,
                result.stage,
                result.subject,
                result.partition,
                canonical_json(result.outputs),
                canonical_json(result.facts),
                canonical_json(result.notes),
            ),
        )

    def results(self) -> dict[str, Result]:
        """Return every known result by key, ``facts`` left empty: reading them all is slow and seldom needed."""
        rows = self._read("SELECT key, stage, subject, partition, outputs, notes FROM result")
        return {
            key: Result(key, stage, subject, partition, _outputs(outputs), {}, _notes(notes))
            for key, stage, subject, partition, outputs, notes in rows
        }

    def facts(self, key: str) -> dict[str, Any] | None:
        """Return what a result was made from, or None for an unknown key."""
        rows = self._read("SELECT facts FROM result WHERE key = ?", key)
        return json.loads(rows[0][0]) if rows else None

    def published(self) -> dict[tuple[str, ...], str]:
        """Return the key that is published for each node: by stage, subject and variant."""
        return {tuple(node): key for *node, key in self._read("SELECT * FROM published")}

    def published_partition(self, stage: str, subject: str, variant: str) -> str | None:
        """Return the partition of what is published for a node, if anything is."""
        rows = self._read(
            "SELECT partition FROM result WHERE key = "
            "(SELECT key FROM published WHERE stage = ? AND subject = ? AND variant = ?)",
            stage,
            subject,
            variant,
        )
        return rows[0][0] if rows else None

    def set_published(self, result: Result, variant: str) -> None:
        """Remember which result users find; an earlier failure is forgotten with it."""
        connection, node = self._open(), (result.stage, result.subject, variant)
        connection.execute("INSERT OR REPLACE INTO published VALUES (?, ?, ?, ?)", (*node, result.key))
        connection.execute("DELETE FROM failure WHERE stage = ? AND subject = ? AND variant = ?", node)

    def failures(self) -> dict[tuple[str, ...], Failure]:
        """Return the last failure of each node that has failed since it last succeeded."""
        return {tuple(row[:3]): Failure(*row) for row in self._read("SELECT * FROM failure")}

    def set_failure(self, failure: Failure) -> None:
        """Remember a failure."""
        self._open().execute("INSERT OR REPLACE INTO failure VALUES (?, ?, ?, ?, ?, ?, ?, ?)", failure)

    def source_digests(self) -> dict[str, tuple[SourceStat, str]]:
        """Return what was last known of each external source, by absolute path."""
        rows = self._read("SELECT * FROM source")
        return {path: (SourceStat(size, mtime, inode), digest) for path, size, mtime, inode, digest in rows}

    def set_source_digest(self, path: Path, stat: SourceStat, digest: str) -> None:
        """Remember a source's digest, and the state of the file system that it holds for."""
        self._open().execute("INSERT OR REPLACE INTO source VALUES (?, ?, ?, ?, ?)", (str(path), *stat, digest))

    def forget_sources(self, paths: Iterable[str]) -> None:
        """Forget the digests of these sources."""
        self._open().executemany("DELETE FROM source WHERE path = ?", [(path,) for path in paths])


def _notes(text: str) -> tuple[str, ...]:
    return () if text == "[]" else tuple(json.loads(text))


def _outputs(text: str) -> dict[str, StoredOutput]:
    return {
        table: StoredOutput(StoredFile(*file), content, rows)
        for table, (file, content, rows) in json.loads(text).items()
    }
