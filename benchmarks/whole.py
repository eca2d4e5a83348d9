"""Full-size recordings built for the first time from a cold disk, beside one ``cat`` of the same bytes.

    python benchmarks/whole.py [--recordings 4] [--cache FOLDER] [--workers 2] [--rounds 1]

Simulates the three recordings of :data:`ORIGINALS` and an empty scene (what FOLDER holds is not simulated again), and
writes them under as many names as are asked for, each with other noise in the lowest bit of its images, so that no
result of one serves another.
*Cold*: the bags' pages are dropped from the page cache; libraries stay in it, and what lies below a virtual disk is
beyond reach. A workspace is made for every build, so it knows neither results nor code.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from rosbags.rosbag1 import Reader, Writer

sys.path.insert(0, str(Path(__file__).parent.parent))

from benchmarks.ratios import Cost, environment, median, timed
from benchmarks.start_up import GARMENT
from garment_dataset.simulate.orders import Order, run_orders
from garment_dataset.workspace import Workspace

if TYPE_CHECKING:
    from collections.abc import Iterable

ALL = 46
"""Recordings of the thesis."""

ORIGINALS = ("GreenTowel_Ruler_01_pi16_0.5_R1", "GreenTowel_Corner_01_pi16_0.5_B1", "GreenTowel_Corner_01_pi16_0.5_R1")
"""Depth and colour in turns; whoever wants two recordings has one of each."""

BACKGROUND = "camera_default_0"
LINE = re.compile(r"built +(\S+) +\S+ +([\d.]+) s")


class Build(NamedTuple):
    """What a build took, the time to its first result, s, and the seconds of its results by stage."""

    cost: Cost
    first_s: float
    stages: dict[str, list[float]]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0] if __doc__ else None)
    parser.add_argument("--recordings", type=int, default=4)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--cache", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        originals = simulate(options.cache or Path(folder, "originals"))
        bags = write_bags(originals, Path(folder, "bags"), options.recordings)
        if options.cache is None:
            shutil.rmtree(Path(folder, "originals"))
        read, read_warm, builds = list[Cost](), list[Cost](), list[Build]()
        for number in range(options.rounds):
            drop(bags)
            read.append(timed(["cat", *map(str, bags)], Path(folder)))
            read_warm.append(timed(["cat", *map(str, bags)], Path(folder)))
            drop(bags)
            builds.append(build(Path(folder, f"ws{number}"), bags, options.workers))
        report(bags, read, read_warm, builds, options.workers)


def report(bags: list[Path], read: list[Cost], read_warm: list[Cost], builds: list[Build], workers: int) -> None:
    """Print what was measured, and what that makes of all recordings of the thesis."""
    recordings, mib = len(bags) - 1, sum(bag.stat().st_size for bag in bags) / 2**20
    cold, warm, built = median(read), median(read_warm), median([each.cost for each in builds])
    first_s = min(each.first_s for each in builds)
    print(f"{recordings} recordings and a background, {mib:.0f} MiB; {workers} workers; load {os.getloadavg()[0]:.1f}")
    print(f"{'':34}{'s':>8}{'cpu s':>8}{'x cold cat':>12}{'s a recording':>15}")
    for name, cost in (("cat, cold", cold), ("cat, warm", warm), ("first build, cold", built)):
        ratio = f"{cost.wall_s / cold.wall_s:12.1f}{cost.wall_s / recordings:15.2f}"
        print(f"{name:34}{cost.wall_s:8.2f}{cost.cpu_s:8.2f}{ratio}")
    print(f"first result after {first_s:.2f} s")
    each_s = (built.wall_s - first_s) / recordings
    all_s, cat_s = first_s + ALL * each_s, ALL * cold.wall_s / len(bags)
    print(f"all {ALL}, extrapolated from what follows the first result: {all_s:.0f} s, {all_s / cat_s:.1f} x cold cat")
    print(f"{'stage':34}{'results':>8}{'s each':>8}{'s in all':>10}")
    for stage, seconds in builds[0].stages.items():
        print(f"{stage:34}{len(seconds):8}{sum(seconds) / len(seconds):8.2f}{sum(seconds):10.2f}")


def simulate(folder: Path) -> dict[str, Path]:
    """Simulate what the folder does not hold; return the bags by name."""
    folder.mkdir(parents=True, exist_ok=True)
    bags = {name: folder / f"{name}.bag" for name in (*ORIGINALS, BACKGROUND)}
    orders = [Order(name, folder, 0, "xtion", "full", "none", None) for name, bag in bags.items() if not bag.exists()]
    for _ in run_orders(orders, os.cpu_count() or 1):
        pass
    return bags


def write_bags(originals: dict[str, Path], folder: Path, recordings: int) -> list[Path]:
    """Write as many recordings as asked for, none like another, and the background; return them in order of name."""
    folder.mkdir()
    bags = [folder / f"{BACKGROUND}.bag"]
    shutil.copy(originals[BACKGROUND], bags[0])
    for number in range(recordings):
        original = ORIGINALS[number % len(ORIGINALS)]
        bags.append(folder / f"{original.replace('_01_', f'_{number + 1:02}_')}.bag")
        write_noisy(originals[original], bags[-1], seed=number)
    os.sync()
    return bags


def write_noisy(original: Path, copy: Path, seed: int, compression: str = "none") -> None:
    """Write a recording anew with other noise in the lowest bit of pixels that were measured."""
    rng, writer = np.random.default_rng(seed), Writer(copy)
    if compression != "none":
        writer.set_compression(Writer.CompressionFormat[compression.upper()])
    with Reader(original) as reader, writer:
        on = {
            each.id: writer.add_connection(
                each.topic,
                each.msgtype,
                msgdef=each.msgdef.data,
                md5sum=each.digest,
                callerid=each.ext.callerid,  # type: ignore[union-attr]
                latching=each.ext.latching,  # type: ignore[union-attr]
            )
            for each in reader.connections
        }
        for connection, stamp_ns, raw in reader.messages():
            is_image = connection.msgtype == "sensor_msgs/msg/Image"
            writer.write(on[connection.id], stamp_ns, with_noise(raw, rng) if is_image else raw)


def with_noise(raw: bytes, rng: np.random.Generator) -> bytes:
    """Return a message whose last 2^18 words of 16 bits have noise in their lowest bit, where they are not 0."""
    size = 2**18
    words = np.frombuffer(raw[-2 * size :], "<u2")
    noise = rng.integers(0, 2, size, np.uint16)
    noisy: bytes = (words ^ np.where(words > 1, noise, 0).astype("<u2")).tobytes()
    return raw[: -2 * size] + noisy


def drop(bags: Iterable[Path]) -> None:
    """Have the system forget the pages of files."""
    for bag in bags:
        with bag.open("rb") as file:
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def build(root: Path, bags: list[Path], workers: int) -> Build:
    """Build a new workspace of these bags."""
    workspace = Workspace.create(root)
    table = root / "catalog" / "recordings.csv"
    table.write_text(table.read_text().split("\n", 1)[0] + "\n" + "".join(f"{bag.stem},,,,,no\n" for bag in bags[1:]))
    for bag in bags:
        (workspace.recordings_dir / bag.name).hardlink_to(bag)
    started, first_s, stages = time.perf_counter(), 0.0, dict[str, list[float]]()
    command = [sys.executable, "-c", GARMENT, "build", "-j", str(workers)]
    with subprocess.Popen(command, cwd=root, env=environment(), stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        said = []
        for line in process.stderr:
            said.append(line)
            if (found := LINE.match(line)) is not None:
                first_s = first_s or time.perf_counter() - started
                stages.setdefault(found[1], []).append(float(found[2]))
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, "".join(said)
    cost = Cost(time.perf_counter() - started, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)
    return Build(cost, first_s, stages)


if __name__ == "__main__":
    main()
