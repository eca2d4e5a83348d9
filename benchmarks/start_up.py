"""How long a command takes to start, and a build that has nothing to do: beside a bare command, in one run.

Every figure is the median over interleaved rounds; what counts are the ratios, of processor time (cpu) above all.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).parent.parent))

from benchmarks.ratios import Cost, Ratio, median, timed
from garment_dataset.workspace import Workspace
from tests.conftest import write_recording

if TYPE_CHECKING:
    from collections.abc import Iterator

ROUNDS = 9
NOTHING = "bare typer + pydantic command"
BARE = """
import typer
from pydantic import BaseModel

class Settings(BaseModel):
    name: str = "x"

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)

@app.command()
def nothing(flag: bool = False) -> None:
    Settings()

app()
"""
SEVEN = "import rosbags.highlevel, pandas, pyarrow.parquet, numpy, cv2, pydantic, typer"
GARMENT = "from garment_dataset.cli import main; main()"


def main() -> None:
    """Time the commands, and print the table."""
    costs = measure(ROUNDS)
    bare = median(costs[NOTHING])
    print(f"{'':42}{'median ms':>10}{'best ms':>10}{'x bare':>8}{'cpu ms':>8}{'x bare':>8}")
    for name, found in costs.items():
        cost, best_s = median(found), min(each.wall_s for each in found)
        wall = f"{1000 * cost.wall_s:10.0f}{1000 * best_s:10.0f}{cost.wall_s / bare.wall_s:8.2f}"
        print(f"{name:42}{wall}{1000 * cost.cpu_s:8.0f}{cost.cpu_s / bare.cpu_s:8.2f}")


def ratios() -> Iterator[Ratio]:
    """Yield what ``bench-check`` compares."""
    costs = measure(5)
    bare_s = median(costs[NOTHING]).cpu_s
    for name, target, committed in (
        ("garment --help", 1.0, 0.9),
        ("garment build, nothing to do (46 bags)", 1.3, 1.35),
    ):
        yield Ratio(f"{name} / bare command", median(costs[name]).cpu_s / bare_s, target, committed)


def measure(rounds: int) -> dict[str, list[Cost]]:
    """Build 46 small recordings once, then time the commands in rounds; return what each took."""
    with tempfile.TemporaryDirectory() as folder:
        workspace = Workspace.create(Path(folder) / "ws")
        bag = write_recording(Path(folder) / "small.bag", frames=6)
        for row in workspace.catalog().rows:
            (workspace.recordings_dir / f"{row.recording}.bag").hardlink_to(bag)
        (workspace.recordings_dir / "camera_default_0.bag").hardlink_to(bag)
        build = [sys.executable, "-c", GARMENT, "build"]
        timed(build, workspace.root)
        time.sleep(3)  # what is young is not remembered
        timed(build, workspace.root)
        commands = {
            NOTHING: ["-c", BARE],
            "garment --help": ["-c", GARMENT, "--help"],
            "garment list (46 bags)": ["-c", GARMENT, "list"],
            "garment build, nothing to do (46 bags)": ["-c", GARMENT, "build"],
            "import all seven packages": ["-c", SEVEN],
        }
        costs: dict[str, list[Cost]] = {name: [] for name in commands}
        for _ in range(rounds):
            for name, command in commands.items():
                costs[name].append(timed([sys.executable, *command], workspace.root))
    return costs


if __name__ == "__main__":
    main()
