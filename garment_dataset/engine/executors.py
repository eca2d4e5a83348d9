"""Where tasks run: in this process, or in spawned worker processes; both speak ``concurrent.futures``."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
import types
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from multiprocessing import forkserver
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from garment_dataset.engine.threads import VARIABLES, one_thread_variables

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from multiprocessing.context import BaseContext

P = ParamSpec("P")
T = TypeVar("T")

_PRELOADED = ("numpy", "pandas", "pyarrow.parquet", "cv2", "pydantic")
"""Libraries that workers load sooner or later; one that is not installed is passed over."""

# Public is only to start it
_SERVER: Any = forkserver._forkserver  # noqa: SLF001

_OF_THE_TERMINAL = [signal.Signals[name] for name in ("SIGINT", "SIGHUP", "SIGQUIT") if hasattr(signal, name)]


class SerialExecutor(Executor):
    """Runs each task at once, in the calling process: for debuggers, profilers and small builds."""

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Run ``fn`` now and return its finished future."""
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:  # noqa: BLE001 - the future carries whatever was raised
            future.set_exception(error)
        return future


class LocalExecutor(ProcessPoolExecutor):
    """Worker processes, one thread each, that end when this process does, however it ends.

    This process is never forked: OpenCV and Arrow hold threads and locks that a fork would copy half. Where the system
    can, workers are forked from a server that has imported the heavy libraries and run nothing of them, so that the
    second costs no import; it ends with the executor, for the next one may find other versions. Elsewhere they are
    spawned. They do not import the program that builds: a script needs no ``if __name__ == "__main__"`` and may come
    from standard input.

    Parameters
    ----------
    jobs : int
        How many.
    """

    def __init__(self, jobs: int) -> None:
        context = _context(jobs)
        self._is_forked = context.get_start_method() == "forkserver"
        super().__init__(jobs, mp_context=context, initializer=prepare_process)

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Hand over a task; it is here that processes are started."""
        with _without_program(), _deaf(), one_thread_variables():
            return super().submit(fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes, and with the last of them the server that they were forked from."""
        super().shutdown(wait, cancel_futures=cancel_futures)
        if wait and self._is_forked:
            _SERVER._stop()  # noqa: SLF001 - left running, it would give a later build the libraries of this moment

    def kill(self) -> None:
        """End all processes at once, whatever they do."""
        processes = list((getattr(self, "_processes", None) or {}).values())
        for process in processes:
            with contextlib.suppress(OSError, ValueError):
                process.kill()
        self.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            with contextlib.suppress(OSError, ValueError, AssertionError):
                process.join(5)


@contextlib.contextmanager
def server_ahead(jobs: int | None) -> Iterator[None]:
    """Have the server that workers are forked from, where there is one, import while this process plans.

    It ends with the first executor that uses it, or here.

    Parameters
    ----------
    jobs : int, optional
        How many workers are wanted; by default as many as there are processors. For one, no server is started.
    """
    if _context(usable_cpus() if jobs is None else jobs).get_start_method() == "forkserver":
        with _without_program(), _deaf(), one_thread_variables():
            forkserver.ensure_running()
    try:
        yield
    finally:
        if (pid := _SERVER._forkserver_pid) is not None:  # noqa: SLF001
            os.kill(pid, signal.SIGKILL)  # in the midst of an import it would hear nothing else
            _SERVER._stop()  # noqa: SLF001


def _context(jobs: int) -> BaseContext:
    """Return how processes are started; for a single one, a server that does not run yet would only come on top."""
    can_serve = "forkserver" in multiprocessing.get_all_start_methods()
    if not can_serve or (jobs < 2 and _SERVER._forkserver_pid is None):  # noqa: SLF001
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(_PRELOADED))
    return context


@contextlib.contextmanager
def _without_program() -> Iterator[None]:
    """Let a process be spawned that does not run the program of this one again, which is what Python has it do."""
    program = sys.modules.get("__main__")
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        if program is not None:
            sys.modules["__main__"] = program


@contextlib.contextmanager
def _deaf() -> Iterator[None]:
    """Let a process be spawned that never hears Ctrl-C, not even while it starts; this one hears it a moment later."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _OF_THE_TERMINAL)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def prepare_process() -> None:
    """Set up a worker process: one thread, deaf to the terminal, and gone as soon as the coordinating process is."""
    os.environ.update(dict.fromkeys(VARIABLES, "1"))
    for each in _OF_THE_TERMINAL:
        signal.signal(each, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    from multiprocessing.connection import wait

    wait([sentinel])
    os._exit(1)


def usable_cpus() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def local_executor(jobs: int) -> Executor:
    """Return an executor of ``jobs`` spawned processes; with 0, one that runs in this process."""
    return LocalExecutor(jobs) if jobs else SerialExecutor()


class Pool:
    """An executor that is made when first needed, and anew after one of its processes died.

    Parameters
    ----------
    make : callable
        Makes the executor.
    """

    def __init__(self, make: Callable[[], Executor]) -> None:
        self._make = make
        self._executor: Executor | None = None

    def submit(self, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Hand over a task."""
        if self._executor is None:
            self._executor = self._make()
        return self._executor.submit(function, *args, **kwargs)

    def restart(self) -> None:
        """Give up the present executor; the next task makes another."""
        if self._executor is not None:
            self._executor.shutdown(wait=False, cancel_futures=True)
            self._executor = None

    def close(self) -> None:
        """Wait for what is running, drop what is not."""
        if self._executor is not None:
            self._executor.shutdown(wait=True, cancel_futures=True)

    def kill(self) -> None:
        """End what is running, at once."""
        if isinstance(self._executor, LocalExecutor):
            self._executor.kill()
        elif self._executor is not None:
            self._executor.shutdown(wait=False, cancel_futures=True)
