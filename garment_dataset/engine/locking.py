"""One writer at a time: a lock that dies with its owner, and says whose it is. Readers never ask for it."""

from __future__ import annotations

import contextlib
import getpass
import json
import os
import socket
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from garment_dataset.engine.errors import LockedError, StorageError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path


@contextmanager
def write_lock(folder: Path, *, what: str, wait: bool, tell: Callable[[str], None]) -> Iterator[bool]:
    """Hold the lock of a store while writing to it; yield whether it had to be waited for.

    Parameters
    ----------
    folder : Path
        The store's private folder; made when it is not there.
    what : str
        What is to be done, for whoever waits.
    wait : bool
        Whether to wait for another owner.
    tell : callable
        Told once whom this waits for.

    Raises
    ------
    LockedError
        If somebody else holds it, and ``wait`` is False.
    StorageError
        If the folder cannot be written, or its file system knows no locks.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(folder / "lock")
    has_waited = False
    try:
        folder.mkdir(parents=True, exist_ok=True)
        try:
            lock.acquire(blocking=False)
        except Timeout:
            owner = _owner(folder)
            if not wait:
                hint = "Try again later, or without --no-wait."
                raise LockedError("another process writes it", where=folder, found=owner, hint=hint) from None
            tell(f"waiting for {owner}")
            has_waited = True
            lock.acquire(poll_interval=0.1)
    except (OSError, NotImplementedError) as error:
        found = getattr(error, "strerror", None) or error
        raise StorageError("the store cannot be locked for writing", where=folder, found=found) from error
    try:
        _sign(folder, what)
        yield has_waited
    finally:
        with contextlib.suppress(OSError):
            _signature(folder).unlink(missing_ok=True)
        lock.release()


def _signature(folder: Path) -> Path:
    return folder / "lock.owner"


def _sign(folder: Path, what: str) -> None:
    signature = {
        "what": what,
        "user": user_name(),
        "host": socket.gethostname(),
        "pid": os.getpid(),
        "since": now_text(),
    }
    with contextlib.suppress(OSError):  # who waits is then told less
        _signature(folder).write_text(json.dumps(signature), "utf-8")


def _owner(folder: Path) -> str:
    try:
        found = json.loads(_signature(folder).read_text("utf-8"))
        return "{what} by {user} on {host}, process {pid}, since {since}".format(**found)
    except (OSError, ValueError, KeyError, TypeError):
        return "another process"


def user_name() -> str:
    """Return who runs this process; its number where nobody has that."""
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):
        return str(os.getuid()) if hasattr(os, "getuid") else "unknown"


def now_text() -> str:
    """Return the time now as text, with its zone: ``2026-01-31 12:00:00+0100``."""
    return time.strftime("%Y-%m-%d %H:%M:%S%z")
