"""The engine at the size of a large data set, through the commands that a person types: whole processes, in rounds.

Beside each command a bare typer + pydantic command is timed in the same round. Wall time is what a person waits;
processor time is what other work on a shared machine disturbs least, and what ``bench-check`` compares. The workspace
has thousands of tiny recordings and three trivial stages.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).parent.parent))

from benchmarks.ratios import Cost, Ratio, median, timed
from benchmarks.start_up import BARE, GARMENT
from garment_dataset.workspace import Workspace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ROUNDS = 5
STAGES = ("first", "second", "third")
MODULE = """
from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from garment_dataset.stages import Column, Stage, StageParams, TableSpec

if TYPE_CHECKING:
    import pyarrow as pa

TABLE = TableSpec("{name}_table", 1, "one recording", (Column("value", "float64", "1", "a number"),))


class Params(StageParams):
    factor: float = 1.0


def {name}({argument}, params: Params):
    return {{"{name}_table": TABLE.table({{"value": {value}}})}}


STAGE = Stage({name}, params=Params, outputs=(TABLE,))
"""


def main() -> None:
    """Print the table of one size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, default=4600)
    recordings = parser.parse_args().recordings
    costs = measure(recordings)
    bare = median(costs["bare"])
    print(f"{recordings} recordings x {len(STAGES)} stages; wall and processor (cpu) time of whole processes")
    print(f"{'':32}{'median s':>10}{'min':>8}{'max':>8}{'beyond bare':>13}{'cpu s':>8}{'beyond bare':>13}{'MiB':>6}")
    for name, found in costs.items():
        cost, walls = median(found), [each.wall_s for each in found]
        print(
            f"{name:32}{cost.wall_s:10.2f}{min(walls):8.2f}{max(walls):8.2f}{cost.wall_s - bare.wall_s:13.2f}"
            f"{cost.cpu_s:8.2f}{cost.cpu_s - bare.cpu_s:13.2f}{cost.peak_mib:6.0f}"
        )
    cold = median(costs["cold build, 2 workers"])
    results = recordings * len(STAGES)
    print(f"cold: {1000 * cold.wall_s / results:.1f} ms per result, {1000 * cold.cpu_s / results:.1f} ms of processor")


def ratios() -> Iterator[Ratio]:
    """Yield what ``bench-check`` compares, at a tenth of the size."""
    recordings = 460
    costs = measure(recordings, rounds=3)
    bare_s = median(costs["bare"]).cpu_s
    results = recordings * len(STAGES)
    for name, target, committed in (
        ("build, nothing to do", 1.6, 1.6),
        ("status", 1.6, 1.7),
        ("why", 2.5, 3.4),
        ("one bag changed", 6.0, 7.0),
    ):
        cost_s = median(costs[name]).cpu_s
        yield Ratio(f"{name}, {recordings} recordings / bare command", cost_s / bare_s, target, committed)
    per_result = (median(costs["index read from the footers"]).cpu_s - median(costs["planned anew"]).cpu_s) / results
    yield Ratio("footer of a result, 1000 of them / bare command", 1000 * per_result / bare_s, 1.5, 2.05)
    cold = median(costs["cold build, 2 workers"]).cpu_s / results
    yield Ratio("cold result, 100 of them / bare command", 100 * cold / bare_s, 2.1, 3.3)


def measure(recordings: int, rounds: int = ROUNDS) -> dict[str, list[Cost]]:
    """Build a workspace, then time what a person does with it, each command beside a bare one."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "ws"
        bags = write_workspace(root, recordings)
        index = root / ".garment" / "index.sqlite"
        commands: dict[str, tuple[Callable[[], object], tuple[str, ...]]] = {
            "build, nothing to do": (lambda: None, ("build",)),
            "status": (lambda: None, ("status",)),
            "why": (lambda: None, ("why", bags[0].stem)),
            "planned anew": (lambda: None, ("build", "--dry-run")),
            "one bag changed": (lambda: bags[0].write_text(f"{time.time_ns()}"), ("build",)),
            "index read from the footers": (index.unlink, ("status",)),
        }
        costs: dict[str, list[Cost]] = {"bare": [], "cold build, 2 workers": [timed(garment("build", "-j", "2"), root)]}
        time.sleep(3)  # what is young is not remembered
        timed(garment("build"), root)
        for name, (before, arguments) in commands.items():
            for _ in range(rounds):
                costs["bare"].append(timed([sys.executable, "-c", BARE], root))
                before()
                costs.setdefault(name, []).append(timed(garment(*arguments), root))
                if not index.is_file():
                    timed(garment("build"), root)
    return costs


def garment(*arguments: str) -> list[str]:
    """Return the command line of a verb."""
    return [sys.executable, "-c", GARMENT, *arguments]


def write_workspace(root: Path, recordings: int) -> list[Path]:
    """Write a workspace of tiny recordings, each of other content, and of three trivial stages; return the bags."""
    workspace = Workspace.create(root, empty=True)
    for path in (root / "pipelines").glob("*.toml"):
        path.unlink()
    (root / "pipelines" / "tiny.toml").write_text(f"stages = {list(STAGES)}\n".replace("'", '"'))
    (root / "garment.toml").write_text(f"[stages]\nmodules = {list(STAGES)}\n".replace("'", '"'))
    (root / "stages").mkdir()
    for before, name in zip(("", *STAGES), STAGES, strict=False):
        argument = f"{before}_table: pa.Table" if before else "bag: Path"
        value = f'{before}_table["value"]' if before else "[params.factor * float(bag.read_text())]"
        (root / "stages" / f"{name}.py").write_text(MODULE.format(name=name, argument=argument, value=value))
    swings = range(1, 2 + recordings // 99)
    names = [f"GreenTowel_Ruler_{repeat:02}_pi{swing}_0.5_R1" for swing in swings for repeat in range(1, 100)]
    table = root / "catalog" / "recordings.csv"
    table.write_text(table.read_text() + "".join(f"{name},,,,,no\n" for name in names[:recordings]))
    bags = [workspace.recordings_dir / f"{name}.bag" for name in names[:recordings]]
    for number, bag in enumerate(bags):
        bag.write_text(f"{number}")
    return bags


if __name__ == "__main__":
    main()
