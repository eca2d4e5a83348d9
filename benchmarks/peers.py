"""The runner beside make, joblib, Hamilton, Snakemake and DVC: the same three trivial stages, whole processes.

    python benchmarks/peers.py --install [--peers FOLDER]
    python benchmarks/peers.py [--sizes 46 460 4600] [--peers FOLDER]

Each peer has a virtual environment of its own below FOLDER, which ``--install`` makes; one that has none is left out,
with the reason. A size is left out, too, where the last one lets expect more than :data:`PATIENCE_S` of a first run.
All get two workers where they know such, and all must find the same numbers. What they promise differs: see
docs/performance.md.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import venv
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow.parquet as pq

sys.path.insert(0, str(Path(__file__).parent.parent))

from benchmarks.ratios import Cost, median, timed
from benchmarks.scale import garment, write_workspace

if TYPE_CHECKING:
    from collections.abc import Callable

FOLDER = Path(__file__).parent.parent / ".venv-peers"
PATIENCE_S = 120.0
ROUNDS = 3
STAGES = 3

MAKEFILE = """
all: $(patsubst sources/%,made/%.third,$(wildcard sources/*))
made/%.first: sources/%
\t@cp $< $@
made/%.second: made/%.first
\t@cp $< $@
made/%.third: made/%.second
\t@cp $< $@
.SECONDARY:
"""
SNAKEFILE = """
names, = glob_wildcards("sources/{name}")
rule all:
    input: expand("made/{name}.third", name=names)
rule first:
    input: "sources/{name}"
    output: "made/{name}.first"
    shell: "cp {input} {output}"
rule second:
    input: "made/{name}.first"
    output: "made/{name}.second"
    shell: "cp {input} {output}"
rule third:
    input: "made/{name}.second"
    output: "made/{name}.third"
    shell: "cp {input} {output}"
"""
FUNCTIONS = """
def first(text: str) -> float:
    return 1.0 * float(text)


def second(first: float) -> float:
    return first


def third(second: float) -> float:
    return second
"""
JOBLIB = """
import json
from pathlib import Path
from joblib import Memory, Parallel, delayed
import functions

memory = Memory("cache", verbose=0)
first, second, third = (memory.cache(each) for each in (functions.first, functions.second, functions.third))

def chain(path):
    return path.name, third(second(first(path.read_text())))

paths = sorted(Path("sources").iterdir())
Path("made/all.json").write_text(json.dumps(dict(Parallel(n_jobs=2)(delayed(chain)(path) for path in paths))))
"""
HAMILTON = """
import json
from pathlib import Path
from hamilton import driver
import functions

ready = driver.Builder().with_modules(functions).with_cache("cache").build()
paths = sorted(Path("sources").iterdir())
found = {path.name: ready.execute(["third"], inputs={"text": path.read_text()})["third"] for path in paths}
Path("made/all.json").write_text(json.dumps(found))
"""
DVC_CONFIG = "[core]\n    no_scm = True\n    analytics = false\n    check_update = false\n"


@dataclass(frozen=True)
class Peer:
    """One runner: what is installed for it, what is written for it, and what is run.

    Parameters
    ----------
    packages : tuple of str
        From the package index; empty for a program of the system.
    files : mapping of str to str
        Texts by path.
    command : callable
        From the folder of its programs to a command line.
    write : callable, optional
        Writes into the folder what depends on the subjects.
    """

    packages: tuple[str, ...]
    files: dict[str, str]
    command: Callable[[Path], list[str]]
    write: Callable[[Path, list[str]], None] = field(default=lambda _root, _names: None)

    def is_there(self, programs: Path) -> bool:
        """Say whether it can be run."""
        return bool(shutil.which(self.command(programs)[0]))


def write_dvc(root: Path, names: list[str]) -> None:
    """Write a pipeline with one entry per stage and subject."""
    stages, before = {}, "sources/${item}"
    for stage in ("first", "second", "third"):
        out = f"made/${{item}}.{stage}"
        stages[stage] = {"foreach": names, "do": {"cmd": f"cp {before} {out}", "deps": [before], "outs": [out]}}
        before = out
    (root / "dvc.yaml").write_text(json.dumps({"stages": stages}))


PEERS = {
    "make": Peer((), {"Makefile": MAKEFILE}, lambda _: ["make", "--silent", "-j2"]),
    "joblib": Peer(
        ("joblib",), {"functions.py": FUNCTIONS, "run.py": JOBLIB}, lambda bin_dir: [f"{bin_dir}/python", "run.py"]
    ),
    "Hamilton": Peer(
        ("sf-hamilton",),
        {"functions.py": FUNCTIONS, "run.py": HAMILTON},
        lambda bin_dir: [f"{bin_dir}/python", "run.py"],
    ),
    "Snakemake": Peer(
        ("snakemake",),
        {"Snakefile": SNAKEFILE},
        lambda bin_dir: [f"{bin_dir}/snakemake", "--cores", "2", "--quiet", "all"],
    ),
    "DVC": Peer(
        ("dvc",),
        {".dvc/config": DVC_CONFIG},
        lambda bin_dir: [f"{bin_dir}/dvc", "repro", "--quiet"],
        write_dvc,
    ),
}


@dataclass
class Times:
    """What a runner took at one size."""

    cold: Cost
    idle: Cost
    changed: Cost


def main() -> None:
    """Print a table for every size."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0] if __doc__ else None)
    parser.add_argument("--sizes", type=int, nargs="+", default=[46])
    parser.add_argument("--peers", type=Path, default=FOLDER)
    parser.add_argument("--install", action="store_true")
    options = parser.parse_args()
    if options.install:
        install(options.peers)
        return
    last: dict[str, tuple[int, float]] = {}
    for size in options.sizes:
        print(f"{size} subjects x {STAGES} stages; wall (and processor) s; load {os.getloadavg()[0]:.1f}", flush=True)
        print(f"{'':12}{'first run':>18}{'nothing to do':>18}{'one changed':>18}", flush=True)
        for name in ("this engine", *PEERS):
            if (why := reason(name, size, options.peers, last)) is not None:
                print(f"{name:12}  left out: {why}", flush=True)
                continue
            times = measure(name, size, options.peers)
            last[name] = size, times.cold.wall_s
            cells = "".join(
                f"{each.wall_s:9.2f} ({each.cpu_s:6.2f})" for each in (times.cold, times.idle, times.changed)
            )
            print(f"{name:12}{cells}", flush=True)
    print("all found the same numbers")


def reason(name: str, size: int, folder: Path, last: dict[str, tuple[int, float]]) -> str | None:
    """Say why a runner is left out, if it is."""
    if name in PEERS and not PEERS[name].is_there(folder / name / "bin"):
        packages = " ".join(PEERS[name].packages)
        return (
            f"not installed; `python benchmarks/peers.py --install` installs {packages}"
            if packages
            else "not installed"
        )
    if name in last and (expected_s := last[name][1] * size / last[name][0]) > PATIENCE_S:
        return f"a first run would take some {expected_s:.0f} s"
    return None


def measure(name: str, size: int, folder: Path) -> Times:
    """Run one runner in a new folder; its numbers must be those of the sources, at first and after every change."""
    with tempfile.TemporaryDirectory() as temporary:
        root = Path(temporary) / "project"
        if name == "this engine":
            sources, command, read = write_workspace(root, size), garment("build", "-j", "2"), published
        else:
            sources = write_project(root, PEERS[name], size)
            command, read = PEERS[name].command(folder / name / "bin"), made
        cold = timed(command, root)
        check(name, sources, read(root))
        time.sleep(3)  # what is young is not remembered, and some compare whole seconds
        timed(command, root)
        idle = median([timed(command, root) for _ in range(ROUNDS)])
        changes = []
        for _ in range(ROUNDS):
            sources[0].write_text(f"{time.time_ns() % 10**9}")
            changes.append(timed(command, root))
            check(name, sources, read(root))
    return Times(cold, idle, median(changes))


def write_project(root: Path, peer: Peer, size: int) -> list[Path]:
    """Write the sources and what the peer needs; return the sources."""
    (root / "sources").mkdir(parents=True)
    (root / "made").mkdir()
    sources = [root / "sources" / f"s{number:04}" for number in range(size)]
    for number, path in enumerate(sources):
        path.write_text(f"{number}")
    for name, text in peer.files.items():
        (root / name).parent.mkdir(exist_ok=True)
        (root / name).write_text(text)
    peer.write(root, [path.name for path in sources])
    return sources


def published(root: Path) -> dict[str, float]:
    """Return what this engine made, by subject."""
    paths = (root / "features" / "third_table").rglob("*.parquet")
    return {path.stem: pq.ParquetFile(path).read(["value"])["value"][0].as_py() for path in paths}


def made(root: Path) -> dict[str, float]:
    """Return what a peer made, by subject."""
    if (whole := root / "made" / "all.json").exists():
        found: dict[str, float] = json.loads(whole.read_text())
        return found
    return {path.stem: float(path.read_text()) for path in (root / "made").glob("*.third")}


def check(name: str, sources: list[Path], found: dict[str, float]) -> None:
    """Stop where the numbers are others than those of the sources."""
    assert found == {path.stem: float(path.read_text()) for path in sources}, f"{name} found other numbers"


def install(folder: Path) -> None:
    """Make the environments that are not there yet."""
    for name, peer in PEERS.items():
        if peer.packages and not peer.is_there(folder / name / "bin"):
            print(f"{folder / name}: {' '.join(peer.packages)}")
            venv.create(folder / name, with_pip=True)
            subprocess.run([folder / name / "bin" / "python", "-m", "pip", "install", "-q", *peer.packages], check=True)


if __name__ == "__main__":
    main()
