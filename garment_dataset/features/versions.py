"""Files of one table that were written in different versions of it: read as one, and named."""

from __future__ import annotations

import warnings
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from garment_dataset.errors import DataWarning, StoreError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pyarrow as pa

_MOST_NAMED = 3
_HINT = "`garment build` makes them anew; CHANGELOG.md says what changed."


def whole_schema(files: Sequence[str], table: str) -> pa.Schema:
    """Return the schema of the newest version among files, with columns that only older ones have behind.

    Parameters
    ----------
    files : sequence of str
        Paths; one at least.
    table : str
        What they are files of.

    Raises
    ------
    StoreError
        If a file cannot be read, or a column is of different types.

    Warns
    -----
    DataWarning
        If there are several versions: which, and what that makes of the rows.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    by_version: dict[int, dict[str, pa.Schema]] = defaultdict(dict)
    for file in files:
        try:
            schema = pq.read_schema(file)
        except (OSError, pa.ArrowInvalid) as error:
            raise StoreError("cannot be read", where=file, found=error, hint="`garment verify` finds more.") from error
        by_version[_version(schema)][file] = schema
    newest = max(by_version)
    whole = next(iter(by_version[newest].values()))
    for version in sorted(by_version, reverse=True):
        for file, schema in by_version[version].items():
            whole = _widened(whole, schema, file)
    if len(by_version) > 1:
        _warn(table, by_version)
    return whole


def _version(schema: pa.Schema) -> int:
    """Return the version that a file says it is of; 0 where it says none, as of another program."""
    text = (schema.metadata or {}).get(b"version", b"").decode()
    return int(text) if text.isdecimal() else 0


def _widened(whole: pa.Schema, schema: pa.Schema, file: str) -> pa.Schema:
    for field in schema:
        position = whole.get_field_index(field.name)
        if position < 0:
            whole = whole.append(field.with_nullable(True))
        elif whole.field(position).type != field.type:
            where = f"{file}, column {field.name}"
            expected = f"{whole.field(position).type}, as in other files"
            raise StoreError("a column of another type", where=where, expected=expected, found=field.type, hint=_HINT)
    return whole


def _warn(table: str, by_version: Mapping[int, Mapping[str, Any]]) -> None:
    def named(files: Sequence[str]) -> str:
        names = ", ".join(Path(file).stem for file in files[:_MOST_NAMED])
        return names + (f" and {len(files) - _MOST_NAMED} more" if len(files) > _MOST_NAMED else "")

    parts = [
        f"{len(files)} of version {version} ({named(list(files))})" for version, files in sorted(by_version.items())
    ]
    text = f"{table} has results of several versions: {'; '.join(parts)}; columns that one has not are null in its rows"
    warnings.warn(f"{text}. {_HINT}", DataWarning, stacklevel=4)
