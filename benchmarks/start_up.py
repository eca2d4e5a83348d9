"""How long a command takes to start, and a build that has nothing to do: beside a bare command, in one run.

Every figure is the median over interleaved rounds; what counts are the ratios.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).parent.parent))

from benchmarks.ratios import Ratio
from garment_dataset.workspace import Workspace
from tests.conftest import write_recording

if TYPE_CHECKING:
    from collections.abc import Iterator

ROUNDS = 9
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
    seconds = measure(ROUNDS)
    base = statistics.median(seconds["bare typer + pydantic command"])
    print(f"{'':42}{'median ms':>10}{'best ms':>10}{'x bare':>8}")
    for name, values in seconds.items():
        median = statistics.median(values)
        print(f"{name:42}{1000 * median:10.0f}{1000 * min(values):10.0f}{median / base:8.2f}")


def ratios() -> Iterator[Ratio]:
    """Yield what ``bench-check`` compares."""
    seconds = measure(5)
    base = statistics.median(seconds["bare typer + pydantic command"])
    for name, target, committed in (("garment --help", 1.0, 0.7), ("garment build, nothing to do (46 bags)", 1.3, 1.3)):
        yield Ratio(f"{name} / bare command", statistics.median(seconds[name]) / base, target, committed)


def measure(rounds: int) -> dict[str, list[float]]:
    """Build 46 small recordings once, then time the commands in rounds; return seconds by command."""
    with tempfile.TemporaryDirectory() as folder:
        workspace = Workspace.create(Path(folder) / "ws")
        bag = write_recording(Path(folder) / "small.bag", frames=6)
        for row in workspace.catalog().rows:
            (workspace.recordings_dir / f"{row.recording}.bag").hardlink_to(bag)
        (workspace.recordings_dir / "camera_default_0.bag").hardlink_to(bag)
        run(["build"], workspace.root)
        time.sleep(3)  # what is young is not remembered
        run(["build"], workspace.root)
        commands = {
            "bare typer + pydantic command": ["-c", BARE],
            "garment --help": ["-c", GARMENT, "--help"],
            "garment list (46 bags)": ["-c", GARMENT, "list"],
            "garment build, nothing to do (46 bags)": ["-c", GARMENT, "build"],
            "import all seven packages": ["-c", SEVEN],
        }
        seconds: dict[str, list[float]] = {name: [] for name in commands}
        for _ in range(rounds):
            for name, command in commands.items():
                seconds[name].append(timed(command, workspace.root))
    return seconds


def run(arguments: list[str], folder: Path) -> None:
    """Run one command to its end."""
    subprocess.run([sys.executable, "-c", GARMENT, *arguments], cwd=folder, check=True, env=environment())


def timed(command: list[str], folder: Path) -> float:
    """Return the wall time of one process, in seconds."""
    started = time.perf_counter()
    subprocess.run([sys.executable, *command], cwd=folder, check=True, capture_output=True, env=environment())
    return time.perf_counter() - started


def environment() -> dict[str, str]:
    """Return an environment in which this checkout is what is imported."""
    return {**os.environ, "PYTHONPATH": str(Path(__file__).parent.parent)}


if __name__ == "__main__":
    main()
