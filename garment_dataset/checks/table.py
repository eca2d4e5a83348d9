"""The findings of checks as a table, for reports and for whoever counts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.engine.table import Column, TableSpec
from garment_dataset.errors import TableError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from garment_dataset.checks.finding import CheckFinding

PASSED = "passed"
"""Code of the one row of a recording that nothing was found of."""

CHECKS = TableSpec(
    "checks",
    1,
    "one finding, or one recording of which there is none",
    (
        Column("recording", "string", "", "name of the recording, without .bag"),
        Column("code", "string", "", f"which check; {PASSED}: nothing was found"),
        Column("severity", "string", "", "error, warning or note"),
        Column("topic", "string", "", "topic that it is about; null: the whole recording", nullable=True),
        Column("time_s", "float64", "s", "when, after the recording begins; null: no one instant", nullable=True),
        Column("message", "string", "", "what was expected and found"),
        Column("hint", "string", "", "what to do about it", nullable=True),
    ),
)


def save_findings(path: Path, findings: Mapping[str, Sequence[CheckFinding]]) -> None:
    """Write findings as Parquet, with units and descriptions in the schema; a file that is there is replaced.

    Parameters
    ----------
    path : Path
        The file.
    findings : mapping of str to sequence of CheckFinding
        By recording; none is a row, too.

    Raises
    ------
    TableError
        If the folder is not there, or the file cannot be written.
    """
    import pyarrow.parquet as pq

    rows: list[tuple[str | float | None, ...]] = []
    for recording, found in findings.items():
        if not found:
            rows.append((recording, PASSED, "note", None, None, "nothing was found", None))
        rows += [(recording, f.code, f.severity, f.topic, f.time_s, f.message, f.hint) for f in found]
    columns = dict(zip((column.name for column in CHECKS.columns), zip(*rows, strict=True), strict=True))
    table = CHECKS.labelled(CHECKS.table(columns), ())
    part = path.with_name(f"{path.name}.part")
    try:
        pq.write_table(table, part)
        part.replace(path)
    except OSError as error:
        raise TableError("cannot be written", where=path, found=error.strerror or error) from error
