"""A real Dask cluster for tests: scheduler and workers in processes of their own, on the loopback device."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

PACKAGE_HOME = Path(__file__).parents[1]
QUIET = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1", "DASK_DISTRIBUTED__LOGGING__DISTRIBUTED": "error"}
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


@dataclass
class DaskCluster:
    """A scheduler, and workers that are started one by one.

    Parameters
    ----------
    folder : Path
        Where its processes write.
    """

    folder: Path
    address: str = ""
    scheduler: subprocess.Popen[bytes] | None = None
    workers: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def __enter__(self) -> Self:
        file = self.folder / "scheduler.json"
        self.scheduler = self._start("scheduler", "--port", "0", "--scheduler-file", str(file))
        until = time.monotonic() + 30
        while not self.address:
            assert time.monotonic() < until, "the scheduler does not start"
            assert self.scheduler.poll() is None
            if file.exists() and (text := file.read_text()):
                self.address = json.loads(text)["address"]
            time.sleep(0.02)
        return self

    def __exit__(self, *_: object) -> None:
        for process in [*self.workers, self.scheduler]:
            if process is not None:
                process.kill()
                process.wait()

    def start_worker(
        self, *path: Path, nanny: bool = False, environment: dict[str, str] | None = None
    ) -> subprocess.Popen[bytes]:
        """Start a worker that finds modules in ``path``; it is there some time after."""
        options = ["--nthreads", "1", "--nworkers", "1", "--death-timeout", "30", "--memory-limit", "0"]
        options += ["--local-directory", str(self.folder), "--nanny" if nanny else "--no-nanny"]
        worker = self._start("worker", self.address, *options, path=path, environment=environment)
        self.workers.append(worker)
        return worker

    def wait_for_workers(self) -> None:
        """Return when all are there that were started."""
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(len(self.workers), timeout=60)

    def _start(
        self, kind: str, *arguments: str, path: tuple[Path, ...] = (), environment: dict[str, str] | None = None
    ) -> subprocess.Popen[bytes]:
        found = {**os.environ, **QUIET, **(ONE_THREAD if environment is None else environment)}
        found |= {"PYTHONPATH": os.pathsep.join(map(str, [*path, PACKAGE_HOME])), "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, "-m", "dask", kind, "--host", "127.0.0.1", "--no-dashboard", *arguments]
        with (self.folder / f"{kind}.log").open("ab") as log:
            return subprocess.Popen(command, env=found, cwd=self.folder, stdout=log, stderr=log)
