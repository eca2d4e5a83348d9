"""The server that workers are forked from: it starts while a build plans, and never stays."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys

import pytest

from garment_dataset.engine import executors
from garment_dataset.engine.executors import local_executor, server_ahead

pytestmark = pytest.mark.skipif(
    "forkserver" not in multiprocessing.get_all_start_methods(), reason="the system cannot fork from a server"
)


def server_pid() -> int | None:
    pid: int | None = executors._SERVER._forkserver_pid
    return pid


def is_running(pid: int | None) -> bool:
    if pid is None:
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_it_ends_unused() -> None:
    with server_ahead(2):
        pid = server_pid()
        assert is_running(pid)
    assert not is_running(pid)


@pytest.mark.parametrize("jobs", [1, 2])
def test_workers_come_from_it_and_it_ends_with_them(jobs: int) -> None:
    with server_ahead(2):
        pid = server_pid()
        with local_executor(jobs) as executor:
            assert executor.submit(os.getppid).result() == pid
        assert not is_running(pid)


def test_a_single_worker_needs_none() -> None:
    with server_ahead(1):
        assert server_pid() is None
        with local_executor(1) as executor:
            assert executor.submit(os.getppid).result() == os.getpid()


def test_a_library_of_it_that_is_not_installed_is_no_obstacle(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(executors, "_PRELOADED", ("no_such_library", "json"))
    with server_ahead(2), local_executor(2) as executor:
        assert executor.submit(pow, 2, 5).result() == 32


def test_a_build_that_is_refused_keeps_nobody_waiting_for_it() -> None:
    """What it would have held is the pipe that a caller reads to its end."""
    code = "from garment_dataset.engine.executors import server_ahead\nwith server_ahead(2): raise SystemExit(2)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", "")
