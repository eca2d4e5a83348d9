"""Work that is out: tasks in the hands of workers, and what they wrote on its way to the disk.

Files are synced by threads beside the coordinating process: the disk then takes several at a time, which costs it
hardly more than one, and no worker waits for it.
"""

from __future__ import annotations

import itertools
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import TYPE_CHECKING, Any, NamedTuple

from garment_dataset.engine.errors import StorageError
from garment_dataset.engine.objects import sync
from garment_dataset.engine.worker import Success, Trouble

if TYPE_CHECKING:
    from collections.abc import Callable

    from garment_dataset.engine.executors import Pool
    from garment_dataset.engine.graph import Node
    from garment_dataset.engine.worker import Reading, Task

_SYNCED_AT_ONCE = 16


class Errand(NamedTuple):
    """A node, and what is done for it."""

    node: Node
    work: Task | Reading


class Ended(NamedTuple):
    """An errand that has come back, what came of it, and the nodes that waited for the very same."""

    errand: Errand
    outcome: Success | Trouble | str
    twins: list[Node]


class Errands:
    """What was handed over and has not come back.

    Parameters
    ----------
    pool : Pool
        Where tasks run.
    """

    def __init__(self, pool: Pool) -> None:
        self._pool = pool
        self._disk = ThreadPoolExecutor(_SYNCED_AT_ONCE)
        self._at_work: dict[Future[Any], Errand] = {}
        self._back: dict[Future[Any], Errand] = {}
        self._twins: dict[str, list[Node]] = {}

    @property
    def at_work(self) -> int:
        """Number of tasks that workers have."""
        return len(self._at_work)

    def __len__(self) -> int:
        return len(self._at_work) + len(self._back)

    def wait_for_twin(self, node: Node, key: str) -> bool:
        """Have a node wait for another that needs the very same, if there is one."""
        if key in self._twins:
            self._twins[key].append(node)
            return True
        return False

    def hand_over(self, errand: Errand, function: Callable[[Any], Any]) -> None:
        """Give work to a worker.

        Raises
        ------
        BrokenProcessPool
            If a worker has died since the last look.
        """
        self._at_work[self._pool.submit(function, errand.work)] = errand
        self._twins[errand.work.key] = []

    @property
    def has_death(self) -> bool:
        """Whether a worker has died with something in its hands."""
        return any(map(_is_broken, self._at_work))

    def collect(self) -> list[Ended]:
        """Wait until something comes back, and return what has ended; what a dead worker had stays for :meth:`give_up`.

        What came back first ends first, however long the disk takes for it: one worker always gives the same order.
        """
        finished, _ = wait((*self._at_work, *itertools.islice(self._back, 1)), return_when=FIRST_COMPLETED)
        for future in [each for each in self._at_work if each in finished and not _is_broken(each)]:
            errand, outcome = self._at_work.pop(future), future.result()
            made = self._disk.submit(_synced, outcome) if isinstance(outcome, Success) else future
            self._back[made] = errand
        ended = []
        while (first := next(iter(self._back), None)) is not None and first.done():
            errand = self._back.pop(first)
            ended.append(Ended(errand, first.result(), self._twins.pop(errand.work.key)))
        return ended

    def give_up(self) -> tuple[list[Errand], list[Node]]:
        """Give up what workers have, after one of them died; return it, and who waited for the very same.

        What had come back before stays, for :meth:`collect`.
        """
        lost = [future for future in self._at_work if not future.done() or _is_broken(future)]
        interrupted = [self._at_work.pop(future) for future in lost]
        self._pool.restart()
        return interrupted, [twin for errand in interrupted for twin in self._twins.pop(errand.work.key)]

    def close(self) -> None:
        """End the workers; nothing is out any more."""
        self._pool.close()
        self._disk.shutdown()

    def kill(self) -> None:
        """End everything at once."""
        self._pool.kill()
        self._disk.shutdown(wait=False, cancel_futures=True)


def _is_broken(future: Future[Any]) -> bool:
    return future.done() and isinstance(future.exception(), BrokenProcessPool)


def _synced(made: Success) -> Success | Trouble:
    try:
        sync(written.path for written in made.outputs.values())
    except StorageError as error:
        return Trouble(type(error).__name__, str(error), is_passing=True)
    return made
