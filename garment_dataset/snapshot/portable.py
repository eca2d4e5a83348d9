"""Result files as every reader takes them: what stands in their paths as columns, and encodings from 2013.

Kept results lie in hive partitions, with floats split by byte (BYTE_STREAM_SPLIT). fastparquet and cuDF refuse that
encoding; Hugging Face's ``datasets``, and whoever opens a single file, lose what the path says; and a column that is in
both path and file is refused by ``pandas.read_parquet`` as text and by Arrow's hive partitioning as a dictionary. Files
side by side in one folder, with all columns in them, are read alike by all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.parquet as pq

from garment_dataset.engine.artifacts import read_labelled
from garment_dataset.snapshot.contents import PLACES

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from garment_dataset.snapshot.contents import Piece


def portable(table: pa.Table, places: Mapping[str, str | None]) -> pa.Table:
    """Return a table with what its path says in columns behind the first one.

    Parameters
    ----------
    table : pyarrow.Table
        A whole result, identity columns included.
    places : mapping of str to str or None
        Values of :data:`.PLACES`; of an empty one, nothing is added.
    """
    if not places:
        return table
    for position, column in enumerate(PLACES, start=1):
        values = pa.array([places.get(column.name)] * table.num_rows, pa.string())
        table = table.add_column(position, column.field(), values)
    return table


def write_portable(piece: Piece, path: Path) -> pa.Table:
    """Write a result file anew, in encodings that every reader knows, unless it has no rows; return its table.

    Hugging Face's ``datasets`` takes the number of rows for the size of a batch, and fails at 0.

    Raises
    ------
    ResultDamagedError
        If the result is not what was stored.
    """
    table = portable(read_labelled(piece.source, piece.digest), piece.places)
    if not table.num_rows:
        return table
    path.parent.mkdir(exist_ok=True)
    texts = [field.name for field in table.schema if pa.types.is_string(field.type)]
    pq.write_table(
        table,
        path,
        compression="zstd",
        use_dictionary=texts or False,  # type: ignore[arg-type]  # the stubs know no lists
        data_page_version="1.0",
    )
    return table
