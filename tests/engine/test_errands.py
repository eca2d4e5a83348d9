"""What comes back from workers ends in the order in which it came, however long the disk takes for each."""

from __future__ import annotations

import threading
from concurrent.futures import Future
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import pytest

from garment_dataset.engine import errands
from garment_dataset.engine.errands import Errand, Errands
from garment_dataset.engine.worker import Reading, Success, Trouble

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from garment_dataset.engine.executors import Pool
    from garment_dataset.engine.graph import Node
    from garment_dataset.engine.sources import SourceStat
    from garment_dataset.engine.worker import Task

MADE = {
    "slow": Success({"slow": cast("Any", None)}, (), 0.0),
    "quick": Success({}, (), 0.0),
    "failed": Trouble("E", ""),
}


class InThisProcess:
    """A pool whose work is done as soon as it is handed over."""

    def submit(self, function: Callable[[Any], Any], work: Task | Reading) -> Future[Any]:
        done: Future[Any] = Future()
        done.set_result(function(work))
        return done

    def close(self) -> None:
        pass


@pytest.mark.parametrize(
    "names", [("slow", "quick", "failed"), ("quick", "slow", "failed"), ("failed", "slow", "quick")]
)
def test_what_came_back_first_ends_first(names: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    all_are_back = threading.Event()

    def synced(made: Success) -> Success:
        if made.outputs:
            assert all_are_back.wait(10)
        return made

    monkeypatch.setattr(errands, "_synced", synced)
    out = Errands(cast("Pool", InThisProcess()))
    ended: list[str] = []

    def collect() -> Iterable[str]:
        return [each.errand.work.key for each in out.collect()]

    for name in names:
        work = Reading(Path(name), cast("SourceStat", None))
        out.hand_over(Errand(cast("Node", None), work), lambda reading: MADE[reading.key])
        threading.Timer(0.05, all_are_back.set).start()
        ended += collect()
    while out:
        ended += collect()
    out.close()
    assert tuple(ended) == names
