"""What this process has loaded, compared with what was read for the key: the code that runs must be that code.

Python keeps what it once imported, and takes a compiled file for current when size and whole seconds fit.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import operator
import os
import py_compile
import sys
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

FileState = tuple[int, int, int, int]
"""Size, times of the content and of the inode, and the inode: whoever edits a file changes one of them."""


def content_state(path: str) -> str | None:
    """Return a digest of a file's content, or of a folder's list of modules; None when it is gone."""
    try:
        if os.path.isdir(path):  # noqa: PTH112 - every plan asks this of every file that code rests on
            names = sorted(name for name in os.listdir(path) if not name.startswith((".", "__pycache__")))  # noqa: PTH208
            content = "/".join(names).encode("utf-8", "surrogateescape")
        else:
            with open(path, "rb") as file:  # noqa: PTH123
                content = file.read()
    except OSError:
        return None
    return state_of(content)


def state_of(content: bytes) -> str:
    """Return the digest of a file's content."""
    return hashlib.blake2b(content, digest_size=12).hexdigest()


def file_state(file: str) -> FileState | None:
    """Return what a file system says of a file; None when it is gone."""
    try:
        stat = os.stat(file)  # noqa: PTH116
    except OSError:
        return None
    # whoever sets the time of a file back cannot set that of its inode
    return stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns, stat.st_ino


_SETTLED_NS = 2_000_000_000
"""A file may be written twice within one tick of a file system's clock; one that has rested for so long was not."""


class ContentStates:
    """What :func:`content_state` says of files, each read again only when the file system says that it was written.

    A file that was young when it was read is read again all the same: it may have been written since, in the same tick.
    """

    def __init__(self) -> None:
        self._known: dict[str, tuple[FileState, str | None]] = {}

    def __call__(self, path: str) -> str | None:
        """Return the digest of a file's content, or of a folder's list of modules; None when it is gone."""
        state = file_state(path)
        known = self._known.get(path)
        if state is not None and known is not None and known[0] == state:
            return known[1]
        now = time.time_ns()
        content = content_state(path)
        if state is not None and is_settled(state, now):
            self._known[path] = state, content
        return content


def is_settled(state: FileState, now_ns: int) -> bool:
    """Say whether a file has rested for so long that whoever writes it from now on changes its state."""
    return max(state[1:3]) + _SETTLED_NS < now_ns


def refresh_bytecode(files: Iterable[str]) -> None:
    """Have the compiled files of modules checked by content from now on, where Python would go by size and second."""
    for file in files:
        with contextlib.suppress(OSError, NotImplementedError, py_compile.PyCompileError):
            compiled = importlib.util.cache_from_source(file)
            with open(compiled, "rb") as old:  # noqa: PTH123
                flags = old.read(8)[4:]
            if not flags or not flags[0] & 0b10:
                mode = py_compile.PycInvalidationMode.CHECKED_HASH
                py_compile.compile(file, compiled, doraise=True, invalidation_mode=mode)


class _Loaded:
    """By file: the module that was made of it, and the state of the file then; None: nobody can say."""

    def __init__(self) -> None:
        self.states: dict[str, tuple[object, FileState | None]] = {}
        self.contents: dict[str, tuple[FileState, str | None]] = {}
        self.noted_ns = _started_ns()
        self.modules: list[object] = []

    def note(self) -> None:
        now = time.time_ns()
        modules: list[object] = list(sys.modules.values())
        if len(modules) == len(self.modules) and all(map(operator.is_, modules, self.modules)):
            self.noted_ns = now
            return
        self.modules = modules
        for module in modules:
            file = getattr(module, "__file__", None)
            if isinstance(file, str) and file.endswith(".py") and self.states.get(file, (None,))[0] is not module:
                state = file_state(file)
                # edited and loaded since the last look: in which order?
                is_sure = state is not None and max(state[1:3]) <= self.noted_ns
                self.states[file] = module, state if is_sure else None
        self.noted_ns = now

    def is_still(self, file: str, content: str) -> bool:
        """Say whether a file that was loaded has had a content all the time."""
        state = file_state(file)
        if state is None or self.states[file][1] != state:
            return False
        if self.contents.get(file, (None,))[0] != state:
            self.contents[file] = state, content_state(file)
        return self.contents[file][1] == content


def _started_ns() -> int:
    """Return when this process started; where that cannot be found out, when it came here."""
    try:
        return os.stat("/proc/self").st_ctime_ns  # noqa: PTH116
    except OSError:
        return time.time_ns()


_LOADED = _Loaded()


def note_loaded() -> None:
    """Note the state of the files of all modules that were loaded since the last call."""
    _LOADED.note()


def edited_since_loaded(files: Mapping[str, str]) -> str | None:
    """Return the first file that this process has loaded, or may have loaded, with another content than the one given.

    Parameters
    ----------
    files : mapping of str to str
        Source files, and what :func:`content_state` said of them when they were read for a key.
    """
    _LOADED.note()
    loaded = (file for file in files if file in _LOADED.states)
    return next((file for file in loaded if not _LOADED.is_still(file, files[file])), None)
