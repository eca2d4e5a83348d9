"""Ctrl-C, SIGTERM and a closed terminal: at any instant the command ends at once, quietly, with the right exit code.

Nothing is unwound. Whatever a build has finished is on disk already, and what is half done lies in scratch folders: so
the processes that it started are killed, its scratch is removed, and that is all. An exception raised wherever the
program happens to be could be swallowed, or leave another thread waiting for ever.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from typing import TYPE_CHECKING, NamedTuple, NoReturn

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType

_SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
_SHOW_CURSOR = "\r\x1b[K\x1b[?25h"  # a progress bar hides it
_ending: list[int] = []


class _Scope(NamedTuple):
    """What a signal does while something is going on; the outermost exit code that is not None counts."""

    cleanup: Callable[[], None]
    message: str
    exit_code: int | None


_scopes: list[_Scope] = []


def install() -> None:
    """Handle the signals from here on; one that is ignored, as ``nohup`` has it, stays ignored."""
    for number in _SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _end)


@contextlib.contextmanager
def cleaning_up(cleanup: Callable[[], None], message: str) -> Iterator[None]:
    """Have something done, and a line said, should a signal come meanwhile.

    Parameters
    ----------
    cleanup : callable
        Called in the middle of whatever is going on: it may remove files, and no more.
    message : str
        For the person at the terminal.
    """
    with _during(_Scope(cleanup, message, None)):
        yield


@contextlib.contextmanager
def stopping_well(message: str) -> Iterator[None]:
    """Have a signal be the way to stop what goes on meanwhile: a line is said, and the exit code is 0.

    Parameters
    ----------
    message : str
        For the person at the terminal.
    """
    with _during(_Scope(lambda: None, message, 0)):
        yield


@contextlib.contextmanager
def _during(scope: _Scope) -> Iterator[None]:
    _scopes.append(scope)
    try:
        yield
    finally:
        _scopes.pop()


def end_for_broken_pipe() -> NoReturn:
    """End the process as a signal would: nobody reads any more what it has to say."""
    _end(signal.SIGPIPE, None)


def _end(number: int, _: FrameType | None) -> NoReturn:
    if _ending:
        os._exit(128 + number)
    _ending.append(number)
    if "multiprocessing.process" in sys.modules:
        import multiprocessing

        for child in multiprocessing.active_children():
            child.kill()
    for scope in reversed(_scopes):
        with contextlib.suppress(Exception):
            scope.cleanup()
        with contextlib.suppress(OSError):
            text = f"{_SHOW_CURSOR if os.isatty(2) else ''}garment: {scope.message}\n"
            os.write(2, text.encode())
    os._exit(next((scope.exit_code for scope in _scopes if scope.exit_code is not None), 128 + number))
