"""Which bags lie in a folder, at any depth; links are followed, nothing is opened."""

from __future__ import annotations

import os
import unicodedata
import warnings
from dataclasses import dataclass, field
from pathlib import Path

from garment_dataset.catalog.ignoring import IGNORE_FILE, Ignoring, read_ignoring
from garment_dataset.catalog.schemes import THESIS, BagName, Scheme
from garment_dataset.errors import CatalogError, DataWarning, RecordingNameError

SALVAGED = ".salvaged.bag"
"""How the names of salvaged bags end, until they take the place of their originals."""

_UNFINISHED = (".bag.active", ".db3", ".mcap")


@dataclass(frozen=True, slots=True)
class FoundBag:
    """A finished bag with a readable name: a ROS 1 ``.bag`` file or a rosbag2 folder."""

    path: Path
    name: BagName

    @property
    def is_canonical(self) -> bool:
        """Whether the file is called as the name is written."""
        return unicodedata.normalize("NFC", self.path.name) in (str(self.name), f"{self.name}.bag")


@dataclass(frozen=True, slots=True)
class Duplicate:
    """Another bag with the name of one that is used."""

    bag: FoundBag
    used: FoundBag


@dataclass(frozen=True)
class FolderScan:
    """What a folder holds, in the order of names.

    Parameters
    ----------
    folder : Path
        The folder, as given.
    bags : tuple of FoundBag
        One for each name: the canonically named one if there are several, else the first path.
    duplicates : tuple of Duplicate
        The others, unless they are the same file.
    refused : tuple of (Path, RecordingNameError)
        Bags whose names the grammar does not admit.
    unfinished : tuple of Path
        ``.bag.active`` files, and rosbag2 storage without its ``metadata.yaml``.
    salvaged : tuple of Path
        ``.salvaged.bag`` files: copies of damaged bags, which are not used under that name.
    ignored : tuple of Path
        Bags and folders that ``.garmentignore`` leaves out.
    scheme : Scheme
        By which the names were read.
    """

    folder: Path
    bags: tuple[FoundBag, ...]
    duplicates: tuple[Duplicate, ...]
    refused: tuple[tuple[Path, RecordingNameError], ...]
    unfinished: tuple[Path, ...]
    salvaged: tuple[Path, ...] = ()
    ignored: tuple[Path, ...] = ()
    scheme: Scheme = THESIS

    @property
    def is_empty(self) -> bool:
        """Whether there is no bag at all, of whatever kind or name."""
        return not (self.bags or self.refused or self.unfinished)


def scan(folder: Path, scheme: Scheme = THESIS) -> FolderScan:
    """Look for bags in ``folder``; a folder that does not exist holds none.

    A bag is a ``.bag`` file or a folder with a ``metadata.yaml`` (rosbag2). Hidden entries are not looked at, nor what
    ``.garmentignore`` leaves out (:mod:`garment_dataset.catalog.ignoring`). A folder reached in two ways is looked at
    once, so links that form a loop do no harm. What cannot be looked at is left out with a
    :class:`~garment_dataset.errors.DataWarning`.

    Raises
    ------
    CatalogError
        If ``folder`` is not a folder, or its ``.garmentignore`` cannot be understood.
    """
    if folder.exists() and not folder.is_dir():
        raise CatalogError("not a folder", where=folder, expected="a folder of bags", found="a file")
    walked = _walk(folder, read_ignoring(folder)) if folder.exists() else _Walked()
    named: dict[str, list[FoundBag]] = {}
    refused: list[tuple[Path, RecordingNameError]] = []
    for path in map(Path, sorted(walked.finished)):
        try:
            bag = FoundBag(path, scheme.parse(path.name))
        except RecordingNameError as error:
            refused.append((path, error))
        else:
            named.setdefault(str(bag.name), []).append(bag)
    bags: list[FoundBag] = []
    duplicates: list[Duplicate] = []
    for _, found in sorted(named.items()):
        used, *others = sorted(found, key=lambda bag: not bag.is_canonical) if len(found) > 1 else found
        bags.append(used)
        duplicates += [Duplicate(bag, used) for bag in others if not bag.path.samefile(used.path)]
    unused = (walked.unfinished, walked.salvaged, walked.ignored)
    unfinished, salvaged, ignored = (tuple(map(Path, sorted(paths))) for paths in unused)
    return FolderScan(folder, tuple(bags), tuple(duplicates), tuple(refused), unfinished, salvaged, ignored, scheme)


@dataclass
class _Walked:
    """Paths by what their names say they are."""

    finished: list[str] = field(default_factory=list)
    unfinished: list[str] = field(default_factory=list)
    salvaged: list[str] = field(default_factory=list)
    ignored: list[str] = field(default_factory=list)

    def add(self, entry: os.DirEntry[str]) -> None:
        lower = entry.name.lower()
        if lower.endswith(_UNFINISHED):
            self.unfinished.append(entry.path)
        elif lower.endswith(SALVAGED):
            self.salvaged.append(entry.path)
        elif lower.endswith(".bag"):
            if entry.is_symlink() and not Path(entry.path).exists():
                warnings.warn(f"{entry.path}: a link to nothing, left out", DataWarning, stacklevel=5)
            else:
                self.finished.append(entry.path)


def _walk(root: Path, ignoring: Ignoring) -> _Walked:
    walked = _Walked()
    seen: set[tuple[int, int]] = set()
    # Linked folders wait until the end, so that a folder is called by its own path if it has one here.
    pending, linked = [str(root)], list[str]()
    while pending or linked:
        here = pending.pop() if pending else linked.pop()
        entries = _left(_entries(here, seen), root, ignoring, walked)
        if any(entry.name == "metadata.yaml" for entry in entries) and here != str(root):
            walked.finished.append(here)
            continue
        for entry in entries:
            if _is_folder(entry):
                (linked if entry.is_symlink() else pending).append(entry.path)
            else:
                walked.add(entry)
    return walked


def _left(entries: list[os.DirEntry[str]], root: Path, ignoring: Ignoring, walked: _Walked) -> list[os.DirEntry[str]]:
    """Return the entries of a folder that are looked at, and note those that would be, were they not left out."""
    left = []
    for entry in entries:
        if entry.name == IGNORE_FILE and Path(entry.path).parent != root:
            warnings.warn(f"{entry.path}: not read, only that in {root} is", DataWarning, stacklevel=6)
        if entry.name.startswith("."):
            continue
        if ignoring.rules and ignoring.leaves_out(
            Path(entry.path).relative_to(root).as_posix(), is_folder=(is_folder := _is_folder(entry))
        ):
            if is_folder or entry.name.lower().endswith((".bag", *_UNFINISHED)):
                walked.ignored.append(entry.path)
            continue
        left.append(entry)
    return left


def _entries(here: str, seen: set[tuple[int, int]]) -> list[os.DirEntry[str]]:
    try:
        status = os.stat(here)  # noqa: PTH116 - a Path per folder would cost more than the folder
        if (status.st_dev, status.st_ino) in seen:
            return []
        seen.add((status.st_dev, status.st_ino))
        with os.scandir(here) as entries:
            return sorted(entries, key=lambda entry: entry.name)
    except OSError as error:
        warnings.warn(f"{here}: cannot be looked at and is left out ({error.strerror})", DataWarning, stacklevel=5)
        return []


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # a link to itself
        return False
