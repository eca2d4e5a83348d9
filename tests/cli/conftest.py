"""Run the command line as a user does: in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import pytest

_WHERE_IT_RUNS = {"-j", "--jobs", "--engine", "--scheduler", "--help"}


@dataclass(frozen=True)
class Ran:
    """What a command printed, and its exit code."""

    code: int
    out: str
    err: str


class Garment(Protocol):
    """Runs ``garment ARGUMENTS``; a build without workers, which take longer to start than it takes, unless asked."""

    def __call__(self, *arguments: str, cwd: Path, code: int | None = 0, package: Path | None = None) -> Ran: ...


@pytest.fixture
def garment() -> Garment:
    def run(*arguments: str, cwd: Path, code: int | None = 0, package: Path | None = None) -> Ran:
        environment = {**os.environ, "NO_COLOR": "1", "COLUMNS": "120"}
        if package is not None:
            environment["PYTHONPATH"] = str(package)
        command = [sys.executable, "-c", "from garment_dataset.cli import main; main()", *arguments]
        if arguments[:1] == ("build",) and _WHERE_IT_RUNS.isdisjoint(arguments):
            command += ["-j", "0"]
        done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
        ran = Ran(done.returncode, done.stdout, done.stderr)
        assert code is None or ran.code == code, ran
        return ran

    return run
