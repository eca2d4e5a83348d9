"""What the engine itself costs: trivial stages, cold and with nothing to do, beside GNU make on as many files.

make compares times of files; the engine compares content, parameters and code. Both are timed in one run, whole
processes, start-up included.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

STAGES = 4
ROUNDS = 5
TOY = """
from pathlib import Path

from garment_dataset.engine.stage import Stage, StageParams
from garment_dataset.engine.table import Column, TableSpec

TABLE = TableSpec("table{n}", 1, "one subject", (Column("value", "int64", "1", "a number"),))


class Params(StageParams):
    factor: int = 1

"""
SOURCE = """
def stage0(text: Path, params: Params):
    return {"table0": TABLE.table({"value": [int(text.read_text())]})}


STAGE = Stage(stage0, params=Params, outputs=(TABLE,), sources=frozenset({"text"}))
"""
STEP = """
def stage{n}(table{m}, params: Params):
    return {{"table{n}": TABLE.table({{"value": table{m}["value"]}})}}


STAGE = Stage(stage{n}, params=Params, outputs=(TABLE,))
"""
IMPORTS = """
import importlib, sys
from pathlib import Path
import garment_dataset
from garment_dataset.engine.code import CodeCache
from garment_dataset.engine.graph import Graph, Node, NodeId
from garment_dataset.engine.plan import make_plan
from garment_dataset.engine.store import Store
"""
RUN = """
root = Path.cwd()
stages = [importlib.import_module(f"toy{n}").STAGE for n in range(int(sys.argv[1]))]
nodes = []
params = [stage.params() for stage in stages]
for path in sorted((root / "sources").iterdir()):
    for n, stage in enumerate(stages):
        inputs = {} if n == 0 else {f"table{n - 1}": NodeId(f"stage{n - 1}", path.name)}
        nodes.append(Node(stage, path.name, params[n], sources={} if n else {"text": path}, inputs=inputs))
graph = Graph(nodes)
package = Path(garment_dataset.__file__).parent
roots = {"garment_dataset": package} | {f"toy{n}": root / f"toy{n}.py" for n in range(len(stages))}
cache = CodeCache(root / "private" / "code", roots)
codes = cache.codes(stages)
store = Store(root / "private", root / "features")
plan = make_plan(graph, codes, store)
if not plan.is_fresh:
    from garment_dataset.engine.executors import Pool, local_executor
    from garment_dataset.engine.options import Options
    from garment_dataset.engine.run import Run

    run = Run(
        graph, plan, codes=codes, code_cache=cache, store=store, pool=Pool(lambda: local_executor(0)),
        options=Options(), emit=lambda event: None,
    )
    run.finish()
store.close()
"""


def main() -> None:
    """Time cold and no-op runs of both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--subjects", type=int, default=1000)
    subjects = parser.parse_args().subjects
    tasks = subjects * STAGES
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        write_project(root, subjects)
        engine = [sys.executable, "run.py", str(STAGES)]
        make = ["make", "--silent", "-f", "toy.mk"]
        start = median_of([sys.executable, "-c", IMPORTS], root, ROUNDS)
        rows = [("engine", "cold", timed(engine, root)), ("make", "cold", timed(make, root))]
        rows += [("engine", "nothing to do", median_of(engine, root, ROUNDS))]
        rows += [("make", "nothing to do", median_of(make, root, ROUNDS))]
        (root / "sources" / "0000").write_text("99")
        rows += [("engine", "one changed", timed(engine, root)), ("make", "one changed", timed(make, root))]
    print(f"{subjects} subjects x {STAGES} stages; start-up of the engine alone {1000 * start:.0f} ms")
    for who, what, seconds in rows:
        per_task = 1000 * (seconds - (start if who == "engine" else 0)) / tasks
        print(f"{who:8}{what:16}{seconds:9.2f} s{per_task:9.3f} ms per task, less start-up")


def write_project(root: Path, subjects: int) -> None:
    """Write the toy stages, their sources, and a makefile that copies files along the same chain."""
    (root / "sources").mkdir()
    (root / "made").mkdir()
    for number in range(subjects):
        (root / "sources" / f"{number:04}").write_text(str(number))
    (root / "toy0.py").write_text(TOY.format(n=0) + SOURCE)
    for number in range(1, STAGES):
        (root / f"toy{number}.py").write_text((TOY + STEP).format(n=number, m=number - 1))
    (root / "run.py").write_text(IMPORTS + RUN)
    names = [f"{number:04}" for number in range(subjects)]
    rules = [f"all: {' '.join(f'made/{name}.{STAGES - 1}' for name in names)}"]
    for name in names:
        for number in range(STAGES):
            before = f"sources/{name}" if number == 0 else f"made/{name}.{number - 1}"
            rules.append(f"made/{name}.{number}: {before}\n\t@cp $< $@")
    (root / "toy.mk").write_text("\n".join(rules) + "\n")
    assert shutil.which("make") is not None


def timed(command: list[str], folder: Path) -> float:
    """Return the wall time of one process, in seconds."""
    started = time.perf_counter()
    subprocess.run(command, cwd=folder, check=True)
    return time.perf_counter() - started


def median_of(command: list[str], folder: Path, rounds: int) -> float:
    """Return the median wall time of several processes, in seconds."""
    return statistics.median(timed(command, folder) for _ in range(rounds))


if __name__ == "__main__":
    main()
