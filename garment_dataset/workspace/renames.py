"""Bags are renamed here and nowhere else: step by step, with a journal from which an interrupted renaming goes on."""

from __future__ import annotations

import json
import os
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from garment_dataset.catalog.renaming import RenamePlan, plan_renames, proposals, steps_of
from garment_dataset.errors import StorageError, WorkspaceError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from pathlib import Path

    from garment_dataset.catalog.folder import FolderScan
    from garment_dataset.catalog.lint import Finding
    from garment_dataset.catalog.renaming import Rename
    from garment_dataset.layout import Layout

JOURNAL = "renames.json"
"""File in the private folder that says which renames are under way; there is none when none is."""


@dataclass(frozen=True, slots=True)
class _Journal:
    """Steps from path to path, relative to the folder of recordings, and how many of them are surely done."""

    steps: tuple[tuple[str, str], ...]
    done: int


def plan_for(place: Layout, findings: Iterable[Finding], found: FolderScan) -> RenamePlan:
    """Plan the renames that findings propose for the bags of a folder.

    Left alone are links, what lies behind them, and bags whose new name something else has.
    """
    bags = [bag.path for bag in found.bags] + [each.bag.path for each in found.duplicates]
    bags += [path for path, _ in found.refused]
    proposed = proposals(findings, {str(path): path for path in bags}, found.scheme)
    untouchable = {path: "a link into somewhere else" for path in proposed if _is_linked(path, place.recordings_dir)}
    for path, names in proposed.items():
        target = path.with_name(names[0])
        if _is_there(target) and target not in bags:
            untouchable.setdefault(path, f"{target} is in the way")
    return plan_renames(proposed, bags, untouchable, found.scheme)


def is_interrupted(place: Layout) -> bool:
    """Say whether a renaming was begun and not finished."""
    return (place.private_dir / JOURNAL).exists()


@contextmanager
def locked(place: Layout) -> Iterator[None]:
    """Keep builds and other renamings out meanwhile.

    Raises
    ------
    LockedError
        If one is at work.
    """
    from garment_dataset.engine.locking import write_lock

    with write_lock(place.private_dir, what="garment lint --apply", wait=False, tell=lambda _: None):
        yield


def apply_renames(place: Layout, renames: Sequence[Rename]) -> None:
    """Rename bags; a kill at any instant leaves a journal from which :func:`finish_renames` goes on.

    Raises
    ------
    WorkspaceError
        If a bag is not where it was, or something has taken its new name.
    StorageError
        If the disk refuses.
    """
    if not renames:
        return
    root = place.recordings_dir
    steps = tuple((str(old.relative_to(root)), str(new.relative_to(root))) for old, new in steps_of(renames))
    _write(place.private_dir / JOURNAL, _Journal(steps, 0))
    finish_renames(place)


def finish_renames(place: Layout, tell: Callable[[str, str], None] | None = None) -> None:
    """Do what is left of the renames in the journal, if there is one.

    Parameters
    ----------
    place : Layout
        The workspace.
    tell : callable, optional
        Told of each step that was left, as names relative to the folder of recordings.
    """
    path = place.private_dir / JOURNAL
    if not path.exists():
        return
    journal = _read(path)
    for number in range(journal.done, len(journal.steps)):
        old, new = journal.steps[number]
        if _step(place.recordings_dir / old, place.recordings_dir / new, path) and tell is not None:
            tell(old, new)
        _write(path, _Journal(journal.steps, number + 1))
    path.unlink()


def _step(old: Path, new: Path, journal: Path) -> bool:
    """Rename one bag unless that is done; return whether it was not."""
    old_there, new_there = _is_there(old), _is_there(new)
    if new_there and not old_there:
        return False
    if new_there or not old_there:
        found = "both are there" if new_there else "neither is there"
        hint = f"See which bag is which; renaming goes on when one is there, or is given up when {journal} is deleted."
        raise WorkspaceError("cannot be renamed", where=old, expected=f"it, and no {new.name}", found=found, hint=hint)
    try:
        old.rename(new)
        _sync(new.parent)
    except OSError as error:
        hint = "`garment lint --rename --apply` goes on when that is mended."
        raise StorageError(f"cannot be renamed to {new.name}", where=old, found=error.strerror, hint=hint) from error
    return True


def _is_there(path: Path) -> bool:
    """Say whether a folder lists this very name: a disk that knows no case says yes to others, too."""
    try:
        return path in path.parent.iterdir()
    except OSError:
        return False


def _is_linked(path: Path, folder: Path) -> bool:
    below = path.relative_to(folder).parts
    return any(folder.joinpath(*below[:depth]).is_symlink() for depth in range(len(below) + 1))


def _sync(folder: Path) -> None:
    """Make names last through a loss of power, where a folder can be opened."""
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _read(path: Path) -> _Journal:
    try:
        found = json.loads(path.read_text("ascii"))
        return _Journal(tuple((str(old), str(new)) for old, new in found["steps"]), int(found["done"]))
    except (OSError, ValueError, KeyError, TypeError) as error:
        hint = "Delete it, and look for .renaming-*.bag among the recordings."
        raise WorkspaceError("the journal of a renaming cannot be read", where=path, found=error, hint=hint) from error


def _write(path: Path, journal: _Journal) -> None:
    # names may hold bytes that are no UTF-8: ASCII escapes keep them
    text = json.dumps({"done": journal.done, "steps": journal.steps})
    part = path.with_suffix(".part")
    try:
        with part.open("w", encoding="ascii") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
        _sync(path.parent)
    except OSError as error:
        raise StorageError("cannot be written", where=path, found=error.strerror) from error
