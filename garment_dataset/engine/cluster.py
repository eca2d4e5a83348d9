"""Tasks on an existing Dask cluster whose workers share a file system with this process.

Importing this module needs the library ``distributed``; nothing else of the engine does.
"""

from __future__ import annotations

import asyncio
import logging
import pickle
import uuid
from concurrent.futures import Executor, Future
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from distributed import Client, KilledWorker, Security
from distributed.comm.core import connect

from garment_dataset.engine.cluster_worker import (
    Expected,
    digest_code,
    find_fault,
    python_version,
    refusal,
    run_call,
)
from garment_dataset.engine.errors import ClusterError, ClusterLostError
from garment_dataset.engine.worker import Task

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

P = ParamSpec("P")
T = TypeVar("T")

TIMEOUT_S = 10.0
"""How long a scheduler may take to answer, and the first worker to be there."""

_KEEPS = "What was finished is kept, the next build goes on from there"


class ClusterExecutor(Executor):
    """Runs tasks on the workers of a cluster, each checked to be as this process is.

    Parameters
    ----------
    client : Client
        Connected to the scheduler.
    address : str
        Of the scheduler, for messages.
    expected : Expected
        What a worker must agree with.
    """

    def __init__(self, client: Client, address: str, expected: Expected) -> None:
        self._client = client
        self._address = address
        self._expected = expected
        self._executor = client.get_executor(pure=False, retries=0)

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Hand a task to the cluster.

        Returns
        -------
        Future
            Of what ``fn`` returns, or of a passing :class:`Trouble` where no worker could run it. It raises
            ClusterLostError when the scheduler is gone.
        """
        assert not kwargs
        (work,) = args
        name = work.facts["stage"] if isinstance(work, Task) else "digest"
        ours: Future[T] = Future()
        ours.set_running_or_notify_cancel()
        try:
            # as bytes: Dask looks for tasks of its own in what it is handed
            theirs = self._executor.submit(
                run_call, pickle.dumps((fn, work)), self._expected, key=f"{name}-{uuid.uuid4().hex}"
            )
        except Exception as error:  # noqa: BLE001 - a client that lost its scheduler raises many kinds
            ours.set_exception(self._lost(error))
        else:
            theirs.add_done_callback(lambda done: self._hand_over(done, ours))
        return ours

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002
        """Cancel what is not finished; a task that a worker has begun ends there, and what it makes is dropped."""
        with suppress(Exception):  # the scheduler may be gone, and with it all there was to cancel
            self._executor.shutdown(wait=False)

    def _hand_over(self, theirs: Future[Any], ours: Future[Any]) -> None:
        if theirs.cancelled():
            ours.set_exception(self._lost())
            return
        error = theirs.exception()
        if error is None:
            ours.set_result(theirs.result())
        elif isinstance(error, KilledWorker):
            ours.set_result(refusal("every worker that ran it died: killed, out of memory, or taken away"))
        else:
            ours.set_result(refusal(f"a worker cannot run it: {type(error).__name__}: {error}"))

    def _lost(self, error: Exception | None = None) -> ClusterLostError:
        return ClusterLostError("the scheduler is gone", where=self._address, found=error, hint=_KEEPS)


@contextmanager
def open_cluster(
    address: str,
    *,
    roots: Mapping[str, Path],
    homes: frozenset[Path],
    libraries: Mapping[str, str],
    shared_dir: Path,
) -> Iterator[tuple[ClusterExecutor, int]]:
    """Connect to a cluster, make sure that its workers fit, and yield an executor and the number of workers.

    Parameters
    ----------
    address : str
        Of the scheduler, such as ``tcp://10.0.0.1:8786``.
    roots : mapping of str to Path
        All first-party code, by import name.
    homes : frozenset of Path
        Folders of code that is not installed.
    libraries : mapping of str to str
        Versions of all third-party libraries in the reach of the stages.
    shared_dir : Path
        Where results are written; on a file system that the workers share.

    Raises
    ------
    ClusterError
        If nobody answers, no worker is there, or one does not fit.
    """
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what goes wrong is raised, in one line
    probe = shared_dir / f"probe-{uuid.uuid4().hex}"
    expected = Expected(
        python=python_version(),
        libraries=dict(libraries),
        installed={name: digest_code(place) for name, place in roots.items() if place.parent not in homes},
        shared={place: digest_code(place) for place in roots.values() if place.parent in homes},
        probe=probe,
        token=uuid.uuid4().hex,
    )
    client = _connect(address)
    try:
        shared_dir.mkdir(parents=True, exist_ok=True)
        probe.write_text(expected.token, "utf-8")
        workers = _check_workers(client, address, expected)
        executor = ClusterExecutor(client, address, expected)
        yield executor, workers
    finally:
        probe.unlink(missing_ok=True)
        with suppress(Exception):  # gone with its scheduler
            client.close(timeout=1)


def _connect(address: str) -> Client:
    try:
        asyncio.run(_knock(address))
        return Client(address, timeout=TIMEOUT_S, set_as_default=False, name="build")
    except (OSError, ValueError) as error:
        raise ClusterError(
            "no scheduler answers",
            where=address,
            expected="the address of a Dask scheduler",
            found=str(error) or type(error).__name__,
            hint="`dask scheduler` prints its own.",
        ) from error


async def _knock(address: str) -> None:
    """Make sure that somebody is there: a client that finds nobody is not closed, and ends with a traceback."""
    comm = await connect(address, timeout=TIMEOUT_S, **Security().get_connection_args("client"))
    await comm.close()


def _check_workers(client: Client, address: str, expected: Expected) -> int:
    """Return how many workers there are, once each has been compared."""
    try:
        client.wait_for_workers(1, timeout=TIMEOUT_S)
    except TimeoutError as error:
        hint = "Wait until one is there, then build."
        raise ClusterError("no worker", where=address, expected="at least one", hint=hint) from error
    faults: dict[str, Any] = client.run(find_fault, expected, on_error="return")
    for worker, fault in sorted(faults.items()):
        if fault is not None:
            found = f"{type(fault).__name__}: {fault}" if isinstance(fault, Exception) else fault
            raise ClusterError("a worker does not fit", where=worker, found=found)
    return len(faults)
