"""Where tasks run: in this process, or in spawned worker processes; both speak ``concurrent.futures``."""

from __future__ import annotations

import multiprocessing
import os
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from typing import TYPE_CHECKING, ParamSpec, TypeVar

from garment_dataset.engine.worker import prepare_process

if TYPE_CHECKING:
    from collections.abc import Callable

P = ParamSpec("P")
T = TypeVar("T")


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


def usable_cpus() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def local_executor(jobs: int) -> Executor:
    """Return an executor of ``jobs`` spawned processes; with 0, one that runs in this process.

    Processes are spawned, not forked: OpenCV and Arrow hold threads and locks that a fork would copy half.
    """
    if jobs == 0:
        return SerialExecutor()
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(jobs, mp_context=context, initializer=prepare_process)


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
