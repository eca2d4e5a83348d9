"""Builds on a real Dask cluster: the bytes are those of a local build, and what does not fit is never stored."""

from __future__ import annotations

import dataclasses
import os
import pickle
import shutil
import signal
import threading
import time
from typing import TYPE_CHECKING

import pytest

from garment_dataset.engine import cluster_worker
from garment_dataset.engine.cluster_worker import Expected, digest_code, find_fault, python_version, run_call
from garment_dataset.engine.codebase.libraries import library_versions
from garment_dataset.engine.errors import ClusterError, ClusterLostError
from garment_dataset.engine.events import Ending, Event, Report
from garment_dataset.engine.plan import State
from garment_dataset.engine.sources import stat_source
from garment_dataset.engine.threads import VARIABLES
from garment_dataset.engine.worker import Reading, Trouble, digest_task
from tests.dask_cluster import DaskCluster
from tests.engine.conftest import ROOTS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from tests.engine.conftest import Toy

pytest.importorskip("distributed", reason="the extra dask is not installed")
from garment_dataset.engine import cluster as cluster_module
from garment_dataset.engine.cluster import open_cluster

WAITS = """if "wait" in text:
        import time

        text = text.replace("wait", "")
        (bag.parent / f"{bag.stem}.begun").touch()
        while not (bag.parent / "go").exists():
            time.sleep(0.02)
    """


@pytest.fixture
def dask(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DaskCluster]:
    with DaskCluster(tmp_path_factory.mktemp("dask")) as cluster:
        yield cluster


def build(toy: Toy, cluster: DaskCluster, slots: int | None = None) -> Report:
    """Build the toy project on a cluster."""
    with open_cluster(
        cluster.address,
        roots=ROOTS | {"toy": toy.root / "toy"},
        homes=frozenset(),
        libraries=library_versions(["numpy", "pyarrow"]),
        shared_dir=toy.private_dir,
    ) as (executor, workers):
        toy.executor = lambda _: executor
        return toy.build(slots or workers)


def as_waits(toy: Toy) -> None:
    """Let the stage ``numbers`` wait where a source says so, until there is a file ``go``."""
    toy.edit("numbers.py", 'if "skip" in text:', WAITS + 'if "skip" in text:')


def wait_for(condition: Callable[[], bool]) -> None:
    until = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.02)


def test_the_bytes_are_those_of_a_local_build_and_failures_end_alike(toy: Toy, dask: DaskCluster) -> None:
    dask.start_worker(toy.root)
    dask.start_worker(toy.root, nanny=True, environment={})
    toy.source("c", "6 skip")
    toy.source("d", "7 bad")
    toy.source("e", "7 bug")
    local = toy.build(jobs=0)
    before = toy.files()
    shutil.rmtree(toy.private_dir)
    shutil.rmtree(toy.features_dir)
    dask.wait_for_workers()
    report = build(toy, dask)
    assert toy.files() == before

    def told(event: Event) -> Event:
        return dataclasses.replace(event, seconds=0.0)

    assert {node: told(event) for node, event in report.events.items()} == {
        node: told(event) for node, event in local.events.items()
    }
    assert list(toy.private_dir.glob("scratch/*")) == []


def test_a_killed_worker_costs_nothing_and_a_task_that_kills_its_workers_only_itself(
    toy: Toy, dask: DaskCluster
) -> None:
    as_waits(toy)
    toy.source("a", "1 wait")
    toy.source("b", "4 die")
    first = dask.start_worker(toy.root)
    dask.wait_for_workers()

    def kill() -> None:
        wait_for((toy.root / "sources" / "a.begun").exists)
        first.send_signal(signal.SIGKILL)
        (toy.root / "sources" / "go").touch()
        for _ in range(3):
            dask.start_worker(toy.root)

    killer = threading.Thread(target=kill)
    killer.start()
    report = build(toy, dask, slots=1)
    killer.join()
    assert toy.endings(report)["total built"] == ["a"]
    (failure,) = report.of(Ending.FAILED)
    assert (failure.node.stage, failure.node.subject) == ("numbers", "b")
    assert failure.message is not None
    assert "every worker that ran it died" in failure.message
    assert {decision.node.subject: decision.state for decision in toy.plan() if decision.node.stage == "numbers"} == {
        "a": State.FRESH,
        "b": State.MISSING,
    }


def test_a_worker_with_other_code_is_refused_before_anything_runs(toy: Toy, dask: DaskCluster, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(toy.root / "toy", other / "toy")
    (other / "toy" / "helpers.py").write_text(
        (other / "toy" / "helpers.py").read_text().replace("UNIT = 1", "UNIT = 2")
    )
    dask.start_worker(other)
    dask.wait_for_workers()
    with pytest.raises(ClusterError, match=r"a worker does not fit: found other code in toy, here .*other/toy"):
        build(toy, dask)
    assert toy.files() == {}
    assert {decision.state for decision in toy.plan()} == {State.MISSING}


def test_a_scheduler_that_goes_away_ends_the_build_and_keeps_what_is_finished(toy: Toy, dask: DaskCluster) -> None:
    as_waits(toy)
    toy.source("b", "4 wait")
    dask.start_worker(toy.root)
    dask.wait_for_workers()

    def kill() -> None:
        wait_for((toy.root / "sources" / "b.begun").exists)
        assert dask.scheduler is not None
        dask.scheduler.kill()

    killer = threading.Thread(target=kill)
    killer.start()
    with pytest.raises(ClusterLostError, match=r"the scheduler is gone.*What was finished is kept") as caught:
        build(toy, dask, slots=1)
    killer.join()
    assert caught.value.exit_code == 1
    assert {path.rpartition("/")[2] for path in toy.files()} == {"a.parquet"}


def test_nobody_answers_and_nobody_works(toy: Toy, dask: DaskCluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "TIMEOUT_S", 2.0)
    with pytest.raises(ClusterError, match="no worker: expected at least one"):
        build(toy, dask)
    assert dask.scheduler is not None
    dask.scheduler.kill()
    dask.scheduler.wait()
    for address in (dask.address, "nonsense://here", "nonsense", ""):
        dask.address = address
        with pytest.raises(ClusterError, match="no scheduler answers: expected the address"):
            build(toy, dask)


# -- what a worker compares, in this process


@pytest.fixture
def expected(toy: Toy, monkeypatch: pytest.MonkeyPatch) -> Expected:
    """What this process agrees with."""
    monkeypatch.setattr(cluster_worker, "_FIRST_SEEN", {})
    for name in VARIABLES:
        monkeypatch.setenv(name, "1")
    probe = toy.root / "probe"
    probe.write_text("token")
    return Expected(
        python=python_version(),
        libraries=library_versions(["numpy"]),
        installed={"toy": digest_code(toy.root / "toy")},
        shared={},
        probe=probe,
        token="token",
    )


def test_a_process_agrees_with_itself(expected: Expected) -> None:
    assert find_fault(expected) is None
    assert find_fault(expected) is None


def test_every_difference_is_named(toy: Toy, expected: Expected, tmp_path: Path) -> None:
    own = tmp_path / "stages" / "own_stage.py"
    own.parent.mkdir()
    own.write_text("A = 1")
    shared = dataclasses.replace(expected, shared={own: digest_code(own)})
    assert find_fault(shared) is None
    other = {
        "another version of Python: expected 3.2": dataclasses.replace(expected, python="3.2"),
        "another version of numpy: expected 1.0": dataclasses.replace(expected, libraries={"numpy": "1.0"}),
        "other code in toy, here": dataclasses.replace(expected, installed={"toy": "0"}),
        "other code in no_such_module": dataclasses.replace(expected, installed={"no_such_module": "0"}),
        "other code in " + str(own): dataclasses.replace(expected, shared={own: "0"}),
        "must be on a file system that is shared": dataclasses.replace(expected, token="another"),
        f"{toy.root / 'nowhere'} is another folder": dataclasses.replace(expected, probe=toy.root / "nowhere" / "p"),
    }
    for words, changed in other.items():
        assert words in str(find_fault(changed))


def test_a_shared_module_that_another_hides_is_refused(expected: Expected, tmp_path: Path) -> None:
    own = tmp_path / "stages" / "pytest.py"
    own.parent.mkdir()
    own.write_text("A = 1")
    shared = dataclasses.replace(expected, shared={own: digest_code(own)})
    assert "another module is called pytest here" in str(find_fault(shared))


def test_code_that_was_edited_after_a_worker_loaded_it_is_refused_though_it_lies_there(
    toy: Toy, expected: Expected
) -> None:
    assert find_fault(expected) is None
    toy.edit("helpers.py", "UNIT = 1", "UNIT = 2")
    edited = dataclasses.replace(expected, installed={"toy": digest_code(toy.root / "toy")})
    assert "toy was changed since this worker loaded it: restart the worker" in str(find_fault(edited))


def test_numerics_that_run_in_several_threads_are_refused(expected: Expected, monkeypatch: pytest.MonkeyPatch) -> None:
    import cv2
    import numpy as np

    assert np.__version__
    threads = cv2.getNumThreads()
    try:
        cv2.setNumThreads(2)
        monkeypatch.delenv("OPENCV_FOR_THREADS_NUM")
        assert find_fault(expected) is None
        assert (cv2.getNumThreads(), os.environ["OPENCV_FOR_THREADS_NUM"]) == (1, "1")
    finally:
        cv2.setNumThreads(threads)
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    assert "numpy was loaded without OMP_NUM_THREADS=1" in str(find_fault(expected))


def test_nothing_runs_on_a_worker_that_does_not_fit_and_the_trouble_passes(toy: Toy, expected: Expected) -> None:
    source = toy.root / "sources" / "a.txt"
    stat = stat_source(source)
    assert stat is not None
    call = pickle.dumps((digest_task, Reading(source, stat)))
    assert isinstance(run_call(call, expected), str)
    found = run_call(call, dataclasses.replace(expected, libraries={"numpy": "1.0"}))
    assert isinstance(found, Trouble)
    assert (found.kind, found.is_passing) == ("ClusterError", True)
    source.unlink()
    gone = run_call(call, expected)
    assert isinstance(gone, Trouble)
    assert gone.is_passing
    assert "a.txt is not there: sources, too, must be on a file system that is shared" in gone.message
