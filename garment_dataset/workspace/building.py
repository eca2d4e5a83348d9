"""Build a workspace: under the lock, with all that has to be true before and afterwards."""

from __future__ import annotations

import contextlib
import json
import os
from typing import TYPE_CHECKING, Any

from garment_dataset import interrupts
from garment_dataset.engine.locking import write_lock
from garment_dataset.engine.table import SCHEMAS, read_schemas
from garment_dataset.errors import LockedError, StorageError
from garment_dataset.layout import ORPHANS
from garment_dataset.workspace.log import BuildLog

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from garment_dataset.engine.events import Event, Report
    from garment_dataset.engine.graph import NodeId
    from garment_dataset.workspace.session import Session

_INTERRUPTED = "interrupted; what was finished is kept, `garment build` goes on from there"


def build(
    session: Session,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    retry_failed: bool = False,
    forced: bool = False,
    rehash: bool = False,
    wait: bool = True,
    is_planned: bool = False,
    emit: Callable[[Event], None] = lambda _: None,
    begin: Callable[[NodeId], None] = lambda _: None,
    tell: Callable[[str], None] = lambda _: None,
) -> Report:
    """Make what is missing or stale.

    Parameters
    ----------
    session : Session
        What it is about; read anew where another build had to be waited for.
    jobs : int, optional
        Worker processes; 0 runs everything in this process. By default one per usable processor, and no more than there
        are recordings. On a cluster, the number of tasks at a time; by default one per worker.
    scheduler : str, optional
        Address of a Dask scheduler, on whose workers everything is run.
    retry_failed : bool
        Run again what failed before with the very same inputs.
    forced : bool
        Run everything, fresh or not.
    rehash : bool
        Read the content of every bag anew, whatever size and time say.
    wait : bool
        Whether to wait for another build.
    is_planned : bool
        Whether the session's plan was made just now, and is to be acted on unless another build came between.
    emit : callable
        Told of every node's ending as it happens.
    begin : callable
        Told of every node that work is handed over for.
    tell : callable
        Told for whom this waits.

    Raises
    ------
    LockedError
        If another build is at work, and ``wait`` is False.
    StorageError
        If the workspace cannot be written.
    """
    layout = session.layout
    with write_lock(layout.private_dir, what="garment build", wait=wait, tell=tell) as has_waited:
        session.reload(everything=has_waited)
        if rehash:
            session.forget_digests()
        with interrupts.cleaning_up(session.store.clear_scratch, _INTERRUPTED):
            log = BuildLog.begin(layout.private_dir, session.codes)
            describe_tables(session)
            report = session.act(
                jobs=jobs,
                scheduler=scheduler,
                retry_failed=retry_failed,
                forced=forced,
                is_planned=is_planned,
                emit=emit,
                begin=begin,
            )
            describe_tables(session)
            note_orphans(session)
            log.end(report)
    return report


def tidy(session: Session) -> None:
    """Do what a build that was ended may have left undone, where nothing else is to be done.

    Raises
    ------
    StorageError
        If the workspace cannot be written.
    """
    if session.layout.features_dir.is_dir():
        describe_tables(session)
        note_orphans(session)
    if any(folder.exists() for folder in session.store.scratch_dirs):
        private_dir = session.layout.private_dir
        # a build that is under way has the lock, and uses them
        with (
            contextlib.suppress(LockedError),
            write_lock(private_dir, what="garment build", wait=False, tell=lambda _: None),
        ):
            session.store.clear_scratch()


def describe_tables(session: Session) -> None:
    """Write the schemas of all tables that have files above their folders, for readers that drop Arrow's metadata.

    A table that no pipeline makes any more keeps the description it had, as long as its files are there.

    Raises
    ------
    StorageError
        If that cannot be written.
    """
    for variant in dict.fromkeys(pipeline.file.variant for pipeline in session.pipelines):
        folder = session.store.folder(variant)
        stages = [stage for each in session.pipelines if each.file.variant == variant for stage in each.stages]
        described: dict[str, Any] = {}
        with contextlib.suppress(OSError, ValueError):
            described |= read_schemas(folder)
        described |= {
            output.name: output.describe(stage.identity, stage.partitions)
            for stage in stages
            for output in stage.outputs
        }
        there = {name: text for name, text in sorted(described.items()) if (folder / name).is_dir()}
        if there:
            _write_if_changed(folder / SCHEMAS, json.dumps(there, indent=2) + "\n")
        for name in there:  # where they used to lie
            with contextlib.suppress(OSError):
                (folder / name / "_schema.json").unlink(missing_ok=True)


def note_orphans(session: Session) -> dict[Path, str]:
    """Write down, where readers look, which files nothing asks for any more; return them, with why.

    Raises
    ------
    StorageError
        If that cannot be written.
    """
    found = session.orphaned_files()
    folder = session.layout.features_dir
    path = folder / ORPHANS
    if found:
        listed = {each.relative_to(folder).as_posix(): why for each, why in found.items()}
        _write_if_changed(path, json.dumps(listed, indent=2, ensure_ascii=False) + "\n")
    elif path.exists():
        try:
            path.unlink()
        except OSError as error:
            raise StorageError("cannot be removed", where=path, found=error.strerror or error) from error
    return found


def _write_if_changed(path: Path, text: str) -> None:
    try:
        if path.is_file() and path.read_text("utf-8", errors="replace") == text:
            return
        temporary = path.with_name(f".{path.name}.{os.getpid()}")
        temporary.write_text(text, "utf-8")
        temporary.replace(path)
    except OSError as error:
        raise StorageError("cannot be written", where=path, found=error.strerror or error) from error
