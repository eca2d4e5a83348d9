"""Ratios against what they are to be: ``make bench-check``.

A script of this folder that has a function ``ratios`` takes part: it measures at a small size, and yields one
:class:`Ratio` each. Ratios of one run are compared, never seconds; and no test asserts them, since machines are shared.
"""

from __future__ import annotations

import importlib
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).parent
GROWTH = 4 / 3


class Ratio(NamedTuple):
    """One measured ratio: less is better.

    Parameters
    ----------
    what : str
        What is divided by what.
    measured, target : float
        What was found, and what is to be reached.
    committed : float
        What was measured when this was last looked at; a third more is a failure.
    """

    what: str
    measured: float
    target: float
    committed: float


class Cost(NamedTuple):
    """What a process took: wall time and processor time with those of its children, s; memory, MiB."""

    wall_s: float
    cpu_s: float
    peak_mib: float


def median(costs: list[Cost]) -> Cost:
    """Return the median of each."""
    return Cost(*(statistics.median(values) for values in zip(*costs, strict=True)))


def timed(command: list[str], folder: Path) -> Cost:
    """Run a process to its end, and return what it took."""
    started = time.perf_counter()
    with subprocess.Popen(
        command, cwd=folder, env=environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, command
    return Cost(time.perf_counter() - started, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)


def environment() -> dict[str, str]:
    """Return an environment in which this checkout is what is imported."""
    return {**os.environ, "PYTHONPATH": str(HERE.parent)}


def main() -> int:
    """Print one table of all ratios; return 1 when one has grown by more than a third over the committed one."""
    sys.path.insert(0, str(HERE.parent))
    has_grown = False
    print(f"{'':64}{'ratio':>8}{'target':>8}  reached  {'committed':>9}")
    for path in sorted(HERE.glob("*.py")):
        if "\ndef ratios(" not in path.read_text("utf-8"):
            continue
        for what, measured, target, committed in importlib.import_module(f"benchmarks.{path.stem}").ratios():
            grown = measured > GROWTH * committed
            has_grown |= grown
            reached = "yes" if measured <= target else "no"
            print(f"{what:64}{measured:8.2f}{target:8.2f}  {reached:7}  {committed:9.2f}{'  GROWN' if grown else ''}")
    return int(has_grown)


if __name__ == "__main__":
    sys.exit(main())
