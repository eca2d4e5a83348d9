"""Builds that are ended at random instants, by every signal, in the coordinator and in the workers.

The law, of :meth:`Sandbox.is_sound`: whatever happened, the next build completes, its bytes are those of an undisturbed
build, nothing is left over, and ``verify`` agrees.
"""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Callable

    from tests.drills.conftest import Sandbox

LONGEST_S = 3.0
EXIT_CODES = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}


def children(pid: int) -> list[int]:
    """Return the processes that a process has started, and theirs."""
    found = []
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            for child in map(int, path.read_text().split()):
                found += [child, *children(child)]
    return found


def workers(pid: int) -> list[int]:
    """Return the processes that run stages: not the server that they are forked from, nor Python's own."""
    found = []
    for child in children(pid):
        with contextlib.suppress(OSError):
            command = Path(f"/proc/{child}/cmdline").read_bytes()
            parent = int(Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()[1])
            if b"spawn_main" in command or (b"forkserver" in command and parent != pid):
                found.append(child)
    return found


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def end(process: subprocess.Popen[str], number: signal.Signals, *, group: bool) -> tuple[str, list[int]]:
    """Send a signal, wait for the end, and return what was said, and which processes are left two seconds later."""
    workers = children(process.pid)
    with contextlib.suppress(ProcessLookupError):
        (os.killpg if group else os.kill)(process.pid, number)
    err = process.communicate(timeout=30)[1]
    deadline = time.monotonic() + 2
    while (left := [pid for pid in workers if is_alive(pid)]) and time.monotonic() < deadline:
        time.sleep(0.02)
    return err, left


def kill_once(sandbox: Sandbox, chance: random.Random) -> str:
    """Begin a build, end it or one of its workers at some instant, and check how it ended; return what was done."""
    process = sandbox.start("build", "-j", "2")
    time.sleep(chance.uniform(0, LONGEST_S))
    kind = chance.choice(["SIGKILL", "SIGTERM", "SIGINT", "SIGHUP", "terminal", "twice", "worker"])
    if kind == "worker":
        if found := workers(process.pid):
            with contextlib.suppress(ProcessLookupError):
                os.kill(chance.choice(found), signal.SIGKILL)
        err = process.communicate(timeout=120)[1]
        assert "Traceback" not in err, err
        return kind
    number = signal.SIGINT if kind in {"terminal", "twice"} else signal.Signals[kind]
    if kind == "twice":
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, number)
        time.sleep(chance.uniform(0, 0.05))
    err, left = end(process, number, group=kind in {"terminal", "twice"})
    assert not left, f"{kind}: workers live on"
    if err.startswith("Fatal Python error: init"):
        return kind  # Python itself had not begun yet: nothing of ours can be quiet there
    assert "Traceback" not in err, err
    if number in EXIT_CODES and process.returncode:
        # before Python runs any of our code, the system's own way of ending is all there is
        assert process.returncode in {EXIT_CODES[number], -number}, (kind, process.returncode, err)
    return kind


def drill(sandbox: Sandbox, *, kills: int, seed: int) -> dict[str, int]:
    """End builds again and again, now and then from nothing; return how often what was done."""
    chance = random.Random(seed)
    counts: dict[str, int] = {}
    for number in range(kills):
        if number % 6 == 0:
            if number:
                sandbox.is_sound()
            shutil.rmtree(sandbox.private_dir, ignore_errors=True)
            shutil.rmtree(sandbox.features_dir, ignore_errors=True)
        kind = kill_once(sandbox, chance)
        counts[kind] = counts.get(kind, 0) + 1
    sandbox.is_sound()
    return counts


def test_a_build_that_is_ended_at_any_instant_loses_nothing(bare: Sandbox) -> None:
    drill(bare, kills=5, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 108))
def test_hundreds_of_builds_that_are_ended(
    bare: Sandbox, seed: int, record_property: Callable[[str, object], None]
) -> None:
    counts = drill(bare, kills=36, seed=seed)
    record_property("kills", str(counts))


def test_what_was_finished_before_an_interruption_is_kept(bare: Sandbox) -> None:
    process = bare.start("build", "-j", "1")
    assert process.stderr is not None
    lines = [process.stderr.readline() for _ in range(2)]
    err, left = end(process, signal.SIGTERM, group=False)
    assert (process.returncode, left) == (143, [])
    assert "interrupted; what was finished is kept" in err
    counts = bare.build()["counts"]
    assert counts["fresh"] >= sum(line.startswith("built") for line in lines) == 2


def test_a_pipe_ends_when_the_build_does(bare: Sandbox) -> None:
    """Workers do not hold what they inherited open: whoever reads the build's output sees its end."""
    process = bare.start("build", "-j", "2")
    assert process.stderr is not None
    process.stderr.readline()
    os.kill(process.pid, signal.SIGKILL)
    begun = time.monotonic()
    process.stderr.read()
    assert time.monotonic() - begun < 2
    process.communicate()
