"""One thread for numerics: sums taken in another order have other last digits."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
"""What libraries look at when they are loaded."""

_SUFFIXES = ("64_", "")
_PREFIXES = ("scipy_openblas", "openblas")


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Have OpenBLAS and OpenCV use one thread, those loaded already and those loaded within; afterwards as before."""
    with one_thread_variables():
        undo = [_set_to_one(get, set_) for get, set_ in _thread_counts()]
        try:
            yield
        finally:
            for back in undo:
                back()


@contextlib.contextmanager
def one_thread_variables() -> Iterator[None]:
    """Have libraries that are loaded within, and in processes that are started within, use one thread."""
    variables = {name: os.environ.get(name) for name in VARIABLES}
    os.environ.update(dict.fromkeys(VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in variables.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _set_to_one(get: Callable[[], int], set_: Callable[[int], Any]) -> Callable[[], Any]:
    before = get()
    if before != 1:
        set_(1)
    return lambda: set_(before) if before != 1 else None


def _thread_counts() -> Iterator[tuple[Callable[[], int], Callable[[int], Any]]]:
    """Yield how to get and set the number of threads of each library that is loaded."""
    if (cv2 := sys.modules.get("cv2")) is not None:
        yield cv2.getNumThreads, cv2.setNumThreads
    if "numpy" in sys.modules:
        for library in _loaded_blas():
            for prefix in _PREFIXES:
                for suffix in _SUFFIXES:
                    get = getattr(library, f"{prefix}_get_num_threads{suffix}", None)
                    set_ = getattr(library, f"{prefix}_set_num_threads{suffix}", None)
                    if get is not None and set_ is not None:
                        yield get, set_


def _loaded_blas() -> list[ctypes.CDLL]:
    """Return the OpenBLAS libraries that this process has loaded, where the system tells."""
    return _blas_beside(len(sys.modules))


@functools.lru_cache(maxsize=1)
def _blas_beside(modules: int) -> list[ctypes.CDLL]:  # noqa: ARG001 - looked for again once something was imported
    try:
        with open("/proc/self/maps", encoding="utf-8", errors="surrogateescape") as maps:  # noqa: PTH123
            paths = {line.split(maxsplit=5)[5].strip() for line in maps if "openblas" in line}
    except (OSError, IndexError):
        return []
    found = []
    for path in sorted(paths):
        with contextlib.suppress(OSError):
            found.append(ctypes.CDLL(path))
    return found
