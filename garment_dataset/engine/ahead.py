"""Sources that come next, brought into memory while workers are busy with those before: a cold disk then works, too."""

from __future__ import annotations

import contextlib
import os
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

from garment_dataset.engine.sources import source_files

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

_ASKED_AT_ONCE_BYTES = 1 << 17
"""What Linux reads ahead by default; of a longer request it drops the rest."""


class ReadAhead:
    """Asks the system for the sources that come next.

    Parameters
    ----------
    sources : iterable of Path
        All that will be read, in the order in which they will; a source may be named again.
    count : int
        How many to be ahead of the one that work has begun on; with 0, nothing is asked for.
    ask : callable
        Asks for one source; gives up as soon as the event is set.
    """

    def __init__(
        self, sources: Iterable[Path], count: int, ask: Callable[[Path, threading.Event], None] | None = None
    ) -> None:
        self._sources = list(dict.fromkeys(sources)) if count else []
        self._numbers = {path: number for number, path in enumerate(self._sources)}
        self._count = count
        self._ask = ask or ask_for
        self._done = 0
        self._ended = threading.Event()
        self._thread: ThreadPoolExecutor | None = None

    def came_to(self, path: Path) -> None:
        """Note that work on a source begins, and ask for those behind it that were not asked for yet."""
        number = self._numbers.get(path)
        if number is None:
            return
        self._done = max(self._done, number + 1)
        for source in self._sources[self._done : number + 1 + self._count]:
            self._done += 1
            self._thread = self._thread or ThreadPoolExecutor(1)
            self._thread.submit(self._ask, source, self._ended)

    def close(self) -> None:
        """Ask for nothing more."""
        self._ended.set()
        if self._thread is not None:
            self._thread.shutdown(cancel_futures=True)


def ask_for(source: Path, ended: threading.Event) -> None:
    """Have the system read a source into its page cache, where it can be told to; what fails is read later.

    Parameters
    ----------
    source : Path
        A file, or a folder of files.
    ended : threading.Event
        Once it is set, no more is asked for.
    """
    if not hasattr(os, "posix_fadvise"):
        return
    with contextlib.suppress(OSError):
        for file in source_files(source):
            with file.open("rb", buffering=0) as opened:
                for start in range(0, os.fstat(opened.fileno()).st_size, _ASKED_AT_ONCE_BYTES):
                    if ended.is_set():
                        return
                    os.posix_fadvise(opened.fileno(), start, _ASKED_AT_ONCE_BYTES, os.POSIX_FADV_WILLNEED)
