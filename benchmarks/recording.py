"""One full-size recording in a running process, from its bag to published Parquet, beside reading the bag once.

    python benchmarks/recording.py [--compression none lz4 bz2] [--cache FOLDER]

Each line is a process of its own that builds the recording once, for imports and digests, and then everything anew
(``forced``), in this very process; the page cache is warm, and the ratio is of processor time. Memory is what a worker
has for itself at its peak: pages of the mapped bag are the system's.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parent.parent))

from benchmarks.read_bag import own_memory_mib, read_file
from benchmarks.whole import BACKGROUND, ORIGINALS, simulate, write_noisy
from garment_dataset.workspace import Workspace

THESIS = '\n[params.depth_points]\nmethod = "thesis"\n'
LINES = {
    "depth, profile": (ORIGINALS[0], ""),
    "depth, thesis": (ORIGINALS[0], THESIS),
    "colour": (ORIGINALS[1], ""),
}


class Taken(NamedTuple):
    """What a build took, wall and processor s; processor s to read the bag once; MiB; the seconds of each stage."""

    wall_s: float
    cpu_s: float
    read_s: float
    peak_mib: float
    stages: dict[str, float]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0] if __doc__ else None)
    parser.add_argument("--compression", nargs="+", choices=("none", "lz4", "bz2"), default=["none"])
    parser.add_argument("--cache", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        originals = simulate(options.cache or Path(folder, "originals"))
        print(f"load {os.getloadavg()[0]:.1f}")
        print(f"{'':24}{'s':>8}{'cpu s':>8}{'read cpu':>9}{'x read':>8}{'MiB':>6}  s of each stage")
        for compression in options.compression:
            for line, (name, settings) in LINES.items():
                root = Path(folder, f"{compression} {line}")
                write_workspace(root, originals, name, settings, compression)
                with ProcessPoolExecutor(1, get_context("spawn")) as pool:
                    taken = pool.submit(build, root, name).result()
                stages = ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in taken.stages.items())
                times = f"{taken.wall_s:8.2f}{taken.cpu_s:8.2f}{taken.read_s:9.3f}{taken.cpu_s / taken.read_s:8.1f}"
                print(f"{line + ', ' + compression:24}{times}{taken.peak_mib:6.0f}  {stages}", flush=True)


def write_workspace(root: Path, originals: dict[str, Path], name: str, settings: str, compression: str) -> None:
    """Write a workspace that holds a recording and the background."""
    recordings_dir = Workspace.create(root).recordings_dir
    with (root / "pipelines" / "depth.toml").open("a") as file:
        file.write(settings)
    for each in (BACKGROUND, name):
        write_noisy(originals[each], recordings_dir / f"{each}.bag", seed=0, compression=compression)


def build(root: Path, name: str) -> Taken:
    """Build in this process, a second time with a watch on what it takes."""
    workspace, peak_mib, done = Workspace.at(root), 0.0, threading.Event()
    workspace.build(name, jobs=0)
    read_s = min(timed_reading(workspace.recordings_dir / f"{name}.bag") for _ in range(3))

    def watch() -> None:
        nonlocal peak_mib
        while not done.wait(0.005):
            peak_mib = max(peak_mib, own_memory_mib())

    watcher = threading.Thread(target=watch)
    watcher.start()
    began_s, began_cpu_s = time.perf_counter(), time.process_time()
    report = workspace.build(name, jobs=0, forced=True)
    wall_s, cpu_s = time.perf_counter() - began_s, time.process_time() - began_cpu_s
    done.set()
    watcher.join()
    stages: dict[str, float] = {}
    for event in report.events.values():
        stages[event.node.stage] = stages.get(event.node.stage, 0.0) + event.seconds
    return Taken(wall_s, cpu_s, read_s, peak_mib, stages)


def timed_reading(path: Path) -> float:
    """Read the file once; return how much of the processor it took, s."""
    began_s = time.process_time()
    read_file(path)
    return time.process_time() - began_s


if __name__ == "__main__":
    main()
