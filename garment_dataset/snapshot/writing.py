"""The one place that writes a snapshot: whole, beside what it replaces, or not at all."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import shutil
from importlib.metadata import version as version_of
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.canonical import digest
from garment_dataset.errors import StoreError
from garment_dataset.snapshot.card import card, paragraph
from garment_dataset.snapshot.croissant import croissant
from garment_dataset.snapshot.datapackage import datapackage
from garment_dataset.snapshot.folders import whole_folder
from garment_dataset.snapshot.portable import write_portable
from garment_dataset.snapshot.sums import sums_of
from garment_dataset.snapshot.tally import Tally

if TYPE_CHECKING:
    from pathlib import Path

    from garment_dataset.snapshot.contents import Contents

FORMAT = 1
"""Raised when the layout of a snapshot changes."""

MANIFEST = "snapshot.json"
_LIBRARIES = ("garment-dataset", "pyarrow")
_NOT_TOLD = frozenset({"state", "path", "in_tables"})
"""What the catalog says of this machine's folder of recordings."""


def write_snapshot(contents: Contents, folder: Path) -> None:
    """Write a snapshot; one that lies there is replaced when the new one is complete.

    Raises
    ------
    StoreError
        If something else is in the folder, or files of the old snapshot were edited: nothing is lost.
    StorageError
        If it cannot be written.
    """
    with whole_folder(folder) as new:
        _fill(contents, new)


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return what a snapshot says of itself.

    Raises
    ------
    StoreError
        If it is none, or of a newer version of this package.
    """
    path = folder / MANIFEST
    try:
        manifest: dict[str, Any] = json.loads(path.read_text("utf-8"))
        found = int(manifest["format"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise StoreError("not a snapshot", where=folder, expected=f"a file {MANIFEST}", found=error) from error
    if found > FORMAT:
        hint = "A newer garment-dataset wrote it: update this one. Its Parquet files can be read as they are."
        raise StoreError(
            "a snapshot of another format", where=folder, expected=f"at most {FORMAT}", found=found, hint=hint
        )
    return manifest


def _fill(contents: Contents, folder: Path) -> None:
    tally = Tally(contents.schemas)
    for piece in contents.pieces:
        tally.add(piece, write_portable(piece, folder / piece.name))
    if not tally.files:
        raise StoreError("nothing to export", found="no rows in any result")
    contents = dataclasses.replace(
        contents,
        schemas={table: contents.schemas[table] for table in tally.files},
        left_out={**contents.left_out, **dict.fromkeys(tally.empty, "no rows")},
    )
    (folder / "catalog").mkdir()
    (folder / "catalog" / "recordings.csv").write_text(_catalog_text(contents), "utf-8")
    for path in contents.catalog_files:
        shutil.copyfile(path, folder / "catalog" / path.name)
    _write_json(folder / "schemas.json", dict(contents.schemas))
    data = sums_of(folder)
    content = digest("snapshot/1", data)
    version = contents.settings.version or f"0.0.0+{content[:12]}"
    said = paragraph(contents, tally)
    _write_json(
        folder / "croissant.json", croissant(contents.schemas, contents.settings, version=version, description=said)
    )
    package = datapackage(tally.files, contents.schemas, contents.settings, version=version, description=said)
    _write_json(folder / "datapackage.json", package)
    made_with = {name: version_of(name) for name in _LIBRARIES}
    (folder / "README.md").write_text(card(contents, tally, version=version, made_with=made_with), "utf-8")
    described_by = {name: sha256 for name, sha256 in data.items() if name not in tally.made}
    _write_json(folder / MANIFEST, _manifest(contents, tally, version, content, made_with, described_by))


def _manifest(
    contents: Contents,
    tally: Tally,
    version: str,
    content: str,
    made_with: dict[str, str],
    described_by: dict[str, str],
) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "title": contents.settings.title,
        "version": version,
        "content": content,
        "made_with": made_with,
        "variant": contents.variant,
        "tables": {
            table: {"version": contents.schemas[table]["version"], "rows": tally.rows[table], "files": len(files)}
            for table, files in tally.files.items()
        },
        "recordings": contents.recordings,
        "left_out": dict(contents.left_out),
        "described_by": described_by,
        "files": dict(sorted(tally.made.items())),
    }


def _catalog_text(contents: Contents) -> str:
    chosen = set(contents.recordings)
    records = [row.record() for row in contents.rows if row.recording in chosen]
    columns = [name for name in (records[0] if records else {}) if name not in _NOT_TOLD]
    written = io.StringIO()
    writer = csv.writer(written, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(
        [record[name] for name in columns] for record in sorted(records, key=lambda each: str(each["recording"]))
    )
    return written.getvalue()


def _write_json(path: Path, value: dict[str, Any]) -> None:
    path.write_text(json.dumps(value, indent=1, ensure_ascii=False) + "\n", "utf-8")
