"""What a worker process does: run one stage for one subject, and write its tables to scratch files."""

from __future__ import annotations

import errno
import re
import time
import traceback
import uuid
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from garment_dataset.engine.canonical import digest
from garment_dataset.engine.errors import (
    CodeChangedError,
    DataWarning,
    ReportedError,
    ResultDamagedError,
    SourceChangedError,
    StageError,
)
from garment_dataset.engine.loaded import edited_since_loaded
from garment_dataset.engine.loading import load_stage
from garment_dataset.engine.objects import file_digest
from garment_dataset.engine.sources import digest_source, stat_source
from garment_dataset.engine.stage import NOTES
from garment_dataset.engine.threads import one_thread

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyarrow as pa

    from garment_dataset.engine.sources import SourceStat
    from garment_dataset.engine.stage import Stage
    from garment_dataset.engine.table import Label, TableSpec

_PASSING = frozenset(
    getattr(errno, f"E{name}")
    for name in "NOSPC DQUOT NOMEM IO MFILE NFILE ROFS ACCES PERM STALE TIMEDOUT".split()  # noqa: SIM905
)
"""What the machine cannot do now, and perhaps can do later."""


class StoredTable(NamedTuple):
    """A table to be read: where it is, and the sha256 that its bytes must have."""

    path: Path
    digest: str


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
    inputs : mapping of str to StoredTable
        The input tables.
    gathers : mapping of str to mapping of str to StoredTable
        The tables of several subjects, by input and subject.
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
    body : str
        Names what the function makes, before it is labelled.
    code_files : mapping of str to str
        The source files that the code in the key was read from, and the state of their content.
    donor : mapping of str to StoredTable
        The tables of another subject with the same body: they are labelled anew, and the function is not run.
    donor_subject : str
        Whose they are.
    donor_notes : tuple of str
        What the stage said when it made them.
    scratch_dir : Path
        Where the tables are written; on the same disk as the store.
    """

    module: str
    home: Path | None
    subject: str
    partition: str
    params: Mapping[str, Any]
    sources: Mapping[str, tuple[Path, SourceStat]]
    inputs: Mapping[str, StoredTable]
    gathers: Mapping[str, Mapping[str, StoredTable]]
    notes: tuple[str, ...]
    upstream_notes: Mapping[str, tuple[str, ...]]
    labels: tuple[Label, ...]
    key: str
    facts: Mapping[str, Any]
    body: str
    code_files: Mapping[str, str]
    scratch_dir: Path
    donor: Mapping[str, StoredTable] = field(default_factory=dict)
    donor_subject: str = ""
    donor_notes: tuple[str, ...] = ()


class Reading(NamedTuple):
    """What a worker is to compute the digest of: a source, and the state it must still be in afterwards."""

    path: Path
    stat: SourceStat

    @property
    def key(self) -> str:
        """Name of the source."""
        return str(self.path)


class Written(NamedTuple):
    """One table on scratch: where, the sha256 of its bytes, its content digest, its rows, its digest with labels.

    ``counts``: how many different values each key column has.
    """

    path: Path
    digest: str
    content: str
    rows: int
    labelled: str
    counts: Mapping[str, int]


@dataclass(frozen=True)
class Success:
    """What a stage made, by table name, what it said of data left out, and how long it took."""

    outputs: Mapping[str, Written]
    notes: tuple[str, ...]
    seconds: float

    @property
    def counts(self) -> dict[str, int]:
        """How many different values each key column has, in the table that has most."""
        found: dict[str, int] = {}
        for written in self.outputs.values():
            found |= {key: max(count, found.get(key, 0)) for key, count in written.counts.items()}
        return found


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
        It came from what happened meanwhile, or from the machine: the very same run may succeed next time.
    damaged : Path or None
        A stored table that is not what was stored, and has to be made anew first.
    """

    kind: str
    message: str
    traceback: str = ""
    is_passing: bool = False
    damaged: Path | None = None

    @classmethod
    def of(cls, error: Exception) -> Trouble:
        """Describe the error that is being handled; one of a bug with its class in front."""
        kind = type(error).__name__
        message = str(error) if isinstance(error, ReportedError) else f"{kind}: {error}"
        if isinstance(error, OSError) and error.errno in _PASSING:
            message = f"{error.strerror}: nothing of this result was kept; build again when that is mended"
        damaged = Path(error.where) if isinstance(error, ResultDamagedError) and error.where else None
        return cls(kind, message, traceback.format_exc(), _is_passing(error), damaged)


def _is_passing(error: BaseException | None) -> bool:
    """Say whether an error, or what it came from, is of the moment or of the machine, and not of the data."""
    while error is not None:
        if isinstance(error, SourceChangedError | ResultDamagedError | CodeChangedError | MemoryError):
            return True
        if isinstance(error, OSError) and error.errno in _PASSING:
            return True
        error = error.__cause__
    return False


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
    stage: Stage = load_stage(task.module, task.home)
    _check_code(task)
    if task.donor:
        tables, notes = _take_over(task)
    else:
        tables, notes = _call(stage, task)
        _check_code(task)  # what the function imported
    expected = [output.name for output in stage.outputs]
    if sorted(tables) != sorted(expected):
        raise StageError(
            "returns other tables than it declares", where=stage.name, expected=expected, found=list(tables)
        )
    written = {output.name: _write(output, tables[output.name], expected, task, notes) for output in stage.outputs}
    return written, notes


def _call(stage: Stage, task: Task) -> tuple[Mapping[str, pa.Table], tuple[str, ...]]:
    """Run the function; return its tables, and what it said."""
    from garment_dataset.engine.artifacts import read_artifact, read_labelled

    read = read_labelled if stage.reads_identity else read_artifact
    arguments: dict[str, Any] = {name: path for name, (path, _) in task.sources.items()}
    arguments |= {name: read(*stored) for name, stored in task.inputs.items()}
    for name, members in task.gathers.items():
        arguments[name] = {subject: read_labelled(*stored) for subject, stored in members.items()}
    if stage.takes_notes:
        arguments[NOTES] = dict(task.upstream_notes)
    with warnings.catch_warnings(record=True) as caught, one_thread():
        warnings.simplefilter("always", DataWarning)
        tables = stage.run(arguments, stage.params.model_validate(task.params))
    for path, stat in task.sources.values():
        _check_unchanged(path, stat)
    said = (str(item.message) for item in caught if issubclass(item.category, DataWarning))
    return tables, tuple(dict.fromkeys((*task.notes, *said)))


def _take_over(task: Task) -> tuple[Mapping[str, pa.Table], tuple[str, ...]]:
    """Return the tables of another subject, of which the function would make the same, and what it would say."""
    from garment_dataset.engine.artifacts import read_artifact

    name = re.compile(rf"(?<!\w){re.escape(task.donor_subject)}(?!\w)")
    notes = tuple(name.sub(lambda _: task.subject, note) for note in task.donor_notes)
    return {table: read_artifact(*stored) for table, stored in task.donor.items()}, notes


def _write(output: TableSpec, table: pa.Table, tables: list[str], task: Task, notes: tuple[str, ...]) -> Written:
    from garment_dataset.engine.artifacts import content_digest, write_artifact

    labelled = output.labelled(table.replace_schema_metadata(None), task.labels)
    content = content_digest(table)
    with_labels = digest("labelled/1", [content, {label.column.name: label.value for label in task.labels}])
    footer = {
        "key": task.key,
        "table": output.name,
        "tables": tables,
        "subject": task.subject,
        "partition": task.partition,
        "facts": task.facts,
        "body": task.body,
        "content": content,
        "labelled": with_labels,
        "rows": table.num_rows,
        "notes": notes,
    }
    path = task.scratch_dir / f"{uuid.uuid4().hex}.parquet"
    write_artifact(labelled, path, footer)
    counts = {key: len(table[key].unique()) for key in output.keys}
    return Written(path, file_digest(path), content, table.num_rows, with_labels, counts)


def _check_code(task: Task) -> None:
    edited = edited_since_loaded(task.code_files)
    if edited is not None:
        hint = "Nothing made of it was kept; build again, and in a process that has been running since, start anew."
        raise CodeChangedError("its code was edited since it was loaded", where=edited, hint=hint)


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
