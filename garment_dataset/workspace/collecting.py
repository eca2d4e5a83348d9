"""What a workspace keeps that nothing asks for any more: found, named, and removed on demand."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from garment_dataset.engine.store import remove_empty
from garment_dataset.workspace.building import note_orphans

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from garment_dataset.workspace.session import Session


@dataclass(frozen=True)
class Rubbish:
    """One file or folder that may go.

    Parameters
    ----------
    path : Path
        Where.
    size_bytes : int
        What its removal frees; of a hard link that has others, nothing.
    why : str
        Why nobody misses it.
    """

    path: Path
    size_bytes: int
    why: str


def find_rubbish(session: Session) -> list[Rubbish]:
    """Return all that nothing asks for: files of what is gone, objects of no published result, remains of dead builds.

    The caller has the lock, or lives with what a build that is under way keeps in its scratch folders.
    """
    found = [Rubbish(path, _size(path), why) for path, why in session.orphaned_files().items()]
    found += _unused_objects(session)
    for folder in session.store.scratch_dirs:
        if folder.exists():
            found.append(Rubbish(folder, _size(folder), "left by a build that was ended"))
    return found + list(_unused_code(session))


def remove(session: Session, rubbish: Iterable[Rubbish]) -> None:
    """Remove files and folders, and what the index says of them; the caller has the lock.

    Raises
    ------
    StorageError
        If scratch space cannot be cleared.
    """
    store = session.store
    gone = set(session.orphans())
    published = store.index.published()
    for node in gone:
        store.withdraw(node, store.results.get(published[node]))
    store.clear_scratch()
    for each in rubbish:
        with contextlib.suppress(OSError):
            each.path.unlink(missing_ok=True)
        remove_empty(each.path.parent, session.layout.features_dir)
    lost = [
        key
        for key, result in store.results.items()
        if not all(store.objects.path(output.file.digest).exists() for output in result.outputs.values())
    ]
    store.forget(lost)
    note_orphans(session)


def _unused_objects(session: Session) -> Iterator[Rubbish]:
    store = session.store
    gone = set(session.orphans())
    keys = {key for node, key in store.index.published().items() if node not in gone}
    used = {
        output.file.digest for key in keys if key in store.results for output in store.results[key].outputs.values()
    }
    known = {output.file.digest: result for result in store.results.values() for output in result.outputs.values()}
    for path in store.objects:
        if path.stem in used:
            continue
        result = known.get(path.stem)
        what = "an object of no result" if result is None else f"{result.stage} {result.subject}, no longer published"
        yield Rubbish(path, _size(path), what)


def _unused_code(session: Session) -> Iterator[Rubbish]:
    """Yield lists of functions that no result was made with, and that are not of the code as it is now."""
    store = session.store
    used = {code.digest for code in session.codes.values()}
    used |= {str((store.facts(key) or {}).get("code")) for key in store.index.published().values()}
    for path in sorted((session.layout.private_dir / "code").glob("*.json")):
        if path.stem != "fingerprints" and path.stem not in used:
            yield Rubbish(path, _size(path), "describes code of no published result")


def _size(path: Path) -> int:
    if path.is_dir():
        return sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
    with contextlib.suppress(OSError):
        stat = path.stat()
        return stat.st_size if stat.st_nlink == 1 else 0
    return 0
