"""What a worker process does: run one stage for one subject, and write its tables to scratch files."""

from __future__ import annotations

import hashlib
import os
import signal
import time
import traceback
import uuid
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from garment_dataset.engine.errors import DataWarning, ReportedError, SourceChangedError, StageError
from garment_dataset.engine.loading import load_stage
from garment_dataset.engine.sources import digest_source, stat_source
from garment_dataset.engine.stage import NOTES

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import pyarrow as pa

    from garment_dataset.engine.sources import SourceStat
    from garment_dataset.engine.stage import Stage
    from garment_dataset.engine.table import Label

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")


@dataclass(frozen=True)
class Task:
    """One run of one stage, in values that cross a process boundary.

    Parameters
    ----------
    module : str
        Holds the stage as ``STAGE``.
    home : Path or None
        Folder to import it from, where it is not installed.
    subject, partition : str
        Whose result, and where it will be published.
    params : mapping
        Resolved parameters, as JSON.
    sources : mapping of str to (Path, SourceStat)
        External inputs, and the state they must still be in afterwards.
    inputs : mapping of str to Path
        Objects with the input tables.
    gathers : mapping of str to mapping of str to Path
        Objects with the tables of several subjects, by input and subject.
    notes : tuple of str
        What is to be kept with the result whatever the stage says.
    upstream_notes : mapping of str to tuple of str
        What the stages that feed it said, by stage.
    labels : tuple of Label
        Identity columns and their values.
    key : str
        Name of the result.
    facts : mapping
        Pre-image of the key, for the footer.
    scratch_dir : Path
        Where the tables are written; on the same disk as the store.
    """

    module: str
    home: Path | None
    subject: str
    partition: str
    params: Mapping[str, Any]
    sources: Mapping[str, tuple[Path, SourceStat]]
    inputs: Mapping[str, Path]
    gathers: Mapping[str, Mapping[str, Path]]
    notes: tuple[str, ...]
    upstream_notes: Mapping[str, tuple[str, ...]]
    labels: tuple[Label, ...]
    key: str
    facts: Mapping[str, Any]
    scratch_dir: Path


class Reading(NamedTuple):
    """What a worker is to compute the digest of: a source, and the state it must still be in afterwards."""

    path: Path
    stat: SourceStat

    @property
    def key(self) -> str:
        """Name of the source."""
        return str(self.path)


class Written(NamedTuple):
    """One table on scratch: where, the sha256 of its bytes, its content digest, its number of rows."""

    path: Path
    digest: str
    content: str
    rows: int


@dataclass(frozen=True)
class Success:
    """What a stage made, by table name, what it said of data left out, and how long it took."""

    outputs: Mapping[str, Written]
    notes: tuple[str, ...]
    seconds: float


@dataclass(frozen=True)
class Trouble:
    """Why a stage did not succeed.

    Parameters
    ----------
    kind : str
        The error's class.
    message, traceback : str
        What it says, and where it came from.
    is_passing : bool
        It came from what happened meanwhile: the very same run may succeed next time.
    """

    kind: str
    message: str
    traceback: str = ""
    is_passing: bool = False

    @classmethod
    def of(cls, error: Exception) -> Trouble:
        """Describe the error that is being handled; one of a bug with its class in front."""
        kind = type(error).__name__
        message = str(error) if isinstance(error, ReportedError) else f"{kind}: {error}"
        return cls(kind, message, traceback.format_exc(), isinstance(error, SourceChangedError))


def prepare_process() -> None:
    """Set up a worker process: one thread each, and Ctrl-C left to the coordinating process."""
    for variable in ONE_THREAD:
        os.environ[variable] = "1"
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def run_task(task: Task) -> Success | Trouble:
    """Run a stage; never raise, since an error must reach the coordinating process whole."""
    started = time.perf_counter()
    try:
        outputs, notes = _run(task)
    except Exception as error:  # noqa: BLE001 - a bug in a stage must not stop the other subjects
        return Trouble.of(error)
    return Success(outputs, notes, time.perf_counter() - started)


def digest_task(reading: Reading) -> str | Trouble:
    """Compute a source's content digest; a source that changed meanwhile is a trouble."""
    try:
        found = digest_source(reading.path)
        _check_unchanged(*reading)
    except ReportedError as error:
        return Trouble.of(error)
    return found


def _run(task: Task) -> tuple[dict[str, Written], tuple[str, ...]]:
    from garment_dataset.engine.artifacts import read_artifact

    stage: Stage = load_stage(task.module, task.home)
    arguments: dict[str, Any] = {name: path for name, (path, _) in task.sources.items()}
    arguments |= {name: read_artifact(path) for name, path in task.inputs.items()}
    for name, paths in task.gathers.items():
        arguments[name] = {subject: read_artifact(path) for subject, path in paths.items()}
    if stage.takes_notes:
        arguments[NOTES] = dict(task.upstream_notes)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", DataWarning)
        tables = stage.run(arguments, stage.params.model_validate(task.params))
    said = (str(item.message) for item in caught if issubclass(item.category, DataWarning))
    notes = tuple(dict.fromkeys((*task.notes, *said)))
    for path, stat in task.sources.values():
        _check_unchanged(path, stat)
    expected = [output.name for output in stage.outputs]
    if sorted(tables) != sorted(expected):
        raise StageError(
            "returns other tables than it declares", where=stage.name, expected=expected, found=list(tables)
        )
    written = {
        output.name: _write(output.labelled(tables[output.name], task.labels), output.name, expected, task, notes)
        for output in stage.outputs
    }
    return written, notes


def _write(table: pa.Table, name: str, tables: list[str], task: Task, notes: tuple[str, ...]) -> Written:
    from garment_dataset.engine.artifacts import content_digest, write_artifact

    content = content_digest(table)
    footer = {
        "key": task.key,
        "table": name,
        "tables": tables,
        "subject": task.subject,
        "partition": task.partition,
        "facts": task.facts,
        "content": content,
        "rows": table.num_rows,
        "notes": notes,
    }
    path = task.scratch_dir / f"{uuid.uuid4().hex}.parquet"
    write_artifact(table, path, footer)
    return Written(path, hashlib.sha256(path.read_bytes()).hexdigest(), content, table.num_rows)


def _check_unchanged(path: Path, stat: SourceStat) -> None:
    found = stat_source(path)
    if found != stat:
        raise SourceChangedError(
            "changed while it was read",
            where=path,
            expected=f"{stat.size_bytes} bytes, unchanged",
            found="gone" if found is None else f"{found.size_bytes} bytes",
            hint="Nothing made of it was kept; build again when it is complete.",
        )
