"""How tables are written is in every key: whoever changes the bytes has to raise the version that stands for it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow.parquet as pq

from garment_dataset.engine.artifacts import read_artifact
from garment_dataset.engine.results import FORMAT, WRITER

if TYPE_CHECKING:
    from tests.engine.conftest import Toy

RAISE_WRITER = "tables are written in another way: raise WRITER in engine/results.py, then write down here what is new"
RAISE_FORMAT = "the footer is another one: raise FORMAT in engine/results.py, then write down here what is new"
WRITTEN = {
    "version": 1,
    "columns": [
        # name, physical type, compression, encodings
        ["subject", "BYTE_ARRAY", "ZSTD", ["PLAIN", "RLE", "RLE_DICTIONARY"]],
        ["value", "DOUBLE", "ZSTD", ["BYTE_STREAM_SPLIT", "RLE"]],
    ],
    "metadata": {"provenance": "…", "row": "one number", "table": "squares", "version": "1"},
    "fields": {
        "subject": {"description": "whose rows these are", "unit": ""},
        "value": {"description": "its square", "unit": "1"},
    },
    "content": "21512dd4354e1e65",
    "row_groups": 1,
}
FOOTER = {
    "format": 3,
    "names": [
        "body",
        "content",
        "facts",
        "key",
        "labelled",
        "notes",
        "partition",
        "rows",
        "subject",
        "table",
        "tables",
    ],
    "facts": [
        *("code", "format", "identity", "inputs", "labels", "libraries", "params", "partition", "stage", "subject"),
        *("tables", "writer"),
    ],
}


def described(path: Path) -> dict[str, object]:
    """Return all of a file that its rows do not decide; not its bytes, which pyarrow's version decides."""
    file = pq.ParquetFile(path)
    group = file.metadata.row_group(0)
    chunks = [group.column(number) for number in range(group.num_columns)]
    footer = json.loads((file.schema_arrow.metadata or {})[b"provenance"])
    return {
        "version": WRITER,
        "columns": [
            [chunk.path_in_schema, chunk.physical_type, chunk.compression, sorted(chunk.encodings)] for chunk in chunks
        ],
        "metadata": {
            key.decode(): "…" if key == b"provenance" else value.decode()
            for key, value in sorted((file.schema_arrow.metadata or {}).items())
        },
        "fields": {
            field.name: {key.decode(): value.decode() for key, value in sorted((field.metadata or {}).items())}
            for field in file.schema_arrow
        },
        "content": footer["content"][:16],
        "row_groups": file.num_row_groups,
    }


def test_what_is_written_has_a_version(toy: Toy) -> None:
    toy.build()
    path = toy.features_dir / "squares" / "kind=toy" / "a.parquet"
    assert described(path) == WRITTEN, RAISE_WRITER
    footer = json.loads((pq.read_schema(path).metadata or {})[b"provenance"])
    assert {"format": FORMAT, "names": sorted(footer), "facts": sorted(footer["facts"])} == FOOTER, RAISE_FORMAT


def test_a_stage_is_given_what_was_returned_without_what_was_put_in_front(toy: Toy) -> None:
    toy.build()
    path = toy.features_dir / "squares" / "kind=toy" / "a.parquet"
    assert pq.read_schema(path).names == ["subject", "value"]
    assert read_artifact(path).column_names == ["value"]
