"""Which bags get which names: what can be renamed without two of one name, and in which order. Nothing is touched."""

from __future__ import annotations

import unicodedata
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from garment_dataset.catalog.schemes import THESIS, Scheme
from garment_dataset.errors import RecordingNameError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence
    from pathlib import Path

    from garment_dataset.catalog.lint import Finding


@dataclass(frozen=True, slots=True)
class Rename:
    """A bag, and the file name that it gets."""

    path: Path
    name: str

    @property
    def target(self) -> Path:
        """Where the bag is afterwards: in the same folder."""
        return self.path.with_name(self.name)


@dataclass(frozen=True, slots=True)
class RefusedRename:
    """A rename that is proposed and not done.

    Parameters
    ----------
    path : Path
        The bag.
    names : tuple of str
        What it should be called; several when findings disagree.
    reason : str
        Why it keeps its name.
    """

    path: Path
    names: tuple[str, ...]
    reason: str


@dataclass(frozen=True, slots=True)
class RenamePlan:
    """What is renamed and what is not, both in the order of the paths."""

    renames: tuple[Rename, ...]
    refused: tuple[RefusedRename, ...]


def proposals(
    findings: Iterable[Finding], at: Mapping[str, Path], scheme: Scheme = THESIS
) -> dict[Path, tuple[str, ...]]:
    """Collect the file names that findings propose.

    Parameters
    ----------
    findings : iterable of Finding
        Those without a target propose nothing.
    at : mapping of str to Path
        The bags by what findings say of where they are.
    scheme : Scheme
        By which recordings are named.

    Returns
    -------
    dict of Path to tuple of str
        A bag whose name is only written in another way than the grammar's, but says what its content contradicts, gets
        the name that the content says.
    """
    found: dict[Path, list[str]] = {}
    for finding in findings:
        path = at.get(finding.where or "")
        if finding.target is not None and path is not None:
            found.setdefault(path, []).append(finding.target)
    return {path: _decided(path, tuple(dict.fromkeys(names)), scheme) for path, names in sorted(found.items())}


def plan_renames(
    proposed: Mapping[Path, tuple[str, ...]],
    bags: Collection[Path],
    untouchable: Mapping[Path, str],
    scheme: Scheme = THESIS,
) -> RenamePlan:
    """Decide which of the proposed renames can be done, all together.

    Parameters
    ----------
    proposed : mapping of Path to tuple of str
        See :func:`proposals`.
    bags : collection of Path
        All that the folder holds: a rename to the name of one that keeps its own is refused, in whatever folder it is.
    untouchable : mapping of Path to str
        Bags that must not be renamed, and why.
    scheme : Scheme
        By which recordings are named.

    Returns
    -------
    RenamePlan
        Names that differ in case alone are taken for one, as some disks do.
    """
    refused: dict[Path, str] = {}
    for path, names in proposed.items():
        if len(names) > 1:
            refused[path] = f"findings disagree: {' or '.join(names)}"
        elif path in untouchable:
            refused[path] = untouchable[path]
    moving = {path: names[0] for path, names in proposed.items() if path not in refused}
    while collisions := _collisions(moving, bags, scheme):
        refused |= collisions
        moving = {path: name for path, name in moving.items() if path not in collisions}
    return RenamePlan(
        tuple(Rename(path, name) for path, name in sorted(moving.items())),
        tuple(RefusedRename(path, proposed[path], reason) for path, reason in sorted(refused.items())),
    )


def steps_of(renames: Sequence[Rename]) -> tuple[tuple[Path, Path], ...]:
    """Return the renames one by one, each onto a free name: of bags that swap theirs, one steps aside meanwhile."""
    waiting = {rename.path: rename.target for rename in renames}
    steps: list[tuple[Path, Path]] = []
    while waiting:
        held = {folded(str(path)): path for path in waiting}
        free = next((path for path, to in waiting.items() if held.get(folded(str(to)), path) == path), None)
        if free is None:
            path, target = next(iter(waiting.items()))
            aside = path.with_name(f".renaming-{len(steps)}.bag")
            steps.append((path, aside))
            del waiting[path]
            waiting[aside] = target
        else:
            steps.append((free, waiting.pop(free)))
    return tuple(steps)


def folded(text: str) -> str:
    """Return what file names have in common that some disk takes for one."""
    return unicodedata.normalize("NFC", text).casefold()


def _decided(path: Path, names: tuple[str, ...], scheme: Scheme) -> tuple[str, ...]:
    same = tuple(name for name in names if _recording(name, scheme) != _recording(path.name, scheme))
    return same or names


def _collisions(moving: Mapping[Path, str], bags: Collection[Path], scheme: Scheme) -> dict[Path, str]:
    """Return which renames would make two of one name."""
    staying = {_recording(path.name, scheme): path for path in bags if path not in moving}
    counts = Counter(_recording(name, scheme) for name in moving.values())
    found: dict[Path, str] = {}
    for path, name in moving.items():
        if (other := staying.get(_recording(name, scheme))) is not None:
            found[path] = f"{other} has that name already"
        elif counts[_recording(name, scheme)] > 1:
            found[path] = "another bag would get that name, too"
    return found


def _recording(file_name: str, scheme: Scheme) -> str:
    """Return what names of one recording have in common."""
    try:
        return folded(str(scheme.parse(file_name)))
    except RecordingNameError:
        return folded(file_name)
