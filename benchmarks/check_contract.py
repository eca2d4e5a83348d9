"""Measure how long `garment check` takes over a recording: ``python benchmarks/check_contract.py [BAG]``.

Without a bag, a recording of 8 s is simulated (half a minute). The check and the ways to read the bag take turns; the
table gives the median of each, and its ratio to reading the file through one buffer.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from rosbags.highlevel import AnyReader

from garment_dataset.checks.contract import CONTRACT, read_contract
from garment_dataset.checks.runner import check_bag
from garment_dataset.layout import packaged_workspace
from garment_dataset.simulate.orders import Order, run_orders

if TYPE_CHECKING:
    from collections.abc import Callable

NAME = "GreenTowel_Ruler_01_pi16_0.5_R1"
ROUNDS = 7


def read_file(path: Path) -> object:
    """Read the file through one buffer: the floor."""
    buffer = bytearray(2**20)
    with path.open("rb", buffering=0) as file:
        return sum(iter(lambda: file.readinto(buffer) or 0, 0))


def check(path: Path) -> object:
    """Hold it against the packaged contract."""
    contract = read_contract(packaged_workspace() / "catalog" / CONTRACT)
    return check_bag(path, contract, recording=path.stem, axis="R")


def deserialise(path: Path) -> object:
    """Deserialise every message that rosbags can read without being told its type."""
    with AnyReader([path]) as reader:
        return sum(reader.deserialize(raw, each.msgtype) is not None for each, _, raw in reader.messages())


WAYS: dict[str, Callable[[Path], object]] = {
    "file, one buffer": read_file,
    "`garment check`": check,
    "rosbags' AnyReader, all messages deserialised": deserialise,
}


def measure(path: Path) -> None:
    """Print the table of one bag."""
    times_ms: dict[str, list[float]] = {name: [] for name in WAYS}
    for way in WAYS.values():
        way(path)
    for _ in range(ROUNDS):
        for name, way in WAYS.items():
            start = time.perf_counter()
            way(path)
            times_ms[name].append((time.perf_counter() - start) * 1e3)
    floor_ms = statistics.median(times_ms["file, one buffer"])
    print(f"{path.name}, {path.stat().st_size / 1e6:.0f} MB: {check(path) or 'keeps the contract'}")
    for name, each in times_ms.items():
        median_ms = statistics.median(each)
        print(f"| {name} | {median_ms:.0f} ms | {median_ms / floor_ms:.2f} x file |")


def main() -> None:
    """Measure the bag that is named, or one that is simulated for it."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("bag", type=Path, nargs="?")
    bag = parser.parse_args().bag
    if bag is not None:
        measure(bag)
        return
    with tempfile.TemporaryDirectory() as folder:
        for path in run_orders([Order(NAME, Path(folder), 0, "xtion", "full", "none", None)], 1):
            measure(path)


if __name__ == "__main__":
    main()
