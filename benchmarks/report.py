"""The report of a workspace of full-size recordings: time of the whole command, and sizes of its pages.

    python benchmarks/report.py [--recordings 46] [--cache FOLDER]

Simulates what ``benchmarks/whole.py`` does (what FOLDER holds is not simulated again) and has links to it under as many
names as are asked for: a page costs the same whether or not its bag is like another.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from benchmarks.ratios import timed
from benchmarks.start_up import GARMENT
from benchmarks.whole import BACKGROUND, ORIGINALS, simulate
from garment_dataset.report.site import CAP_BYTES
from garment_dataset.workspace import Workspace


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0] if __doc__ else None)
    parser.add_argument("--recordings", type=int, default=46)
    parser.add_argument("--cache", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        originals = simulate(options.cache or Path(folder, "originals"))
        place = Workspace.create(Path(folder, "ws"), empty=True)
        (place.recordings_dir / f"{BACKGROUND}.bag").symlink_to(originals[BACKGROUND].resolve())
        for number in range(options.recordings):
            name = ORIGINALS[number % len(ORIGINALS)]
            copy = f"{name.replace('_01_', f'_{number + 1:02}_')}.bag"
            (place.recordings_dir / copy).symlink_to(originals[name].resolve())
        place.build()
        measure(place, options.recordings)


def measure(place: Workspace, recordings: int) -> None:
    """Time the command on a built workspace: all pages, none, one."""
    command = [sys.executable, "-c", GARMENT, "report"]
    print(f"{recordings} recordings; whole processes; load {os.getloadavg()[0]:.1f}")
    print(f"{'':24}{'s':>8}{'cpu s':>8}{'s a recording':>15}")
    pages = place.root / "report" / "recordings"
    for name in ("all pages", "nothing to do", "one page"):
        if name == "one page":
            min(pages.iterdir()).unlink()
        cost = timed(command, place.root)
        each = f"{cost.wall_s / recordings:15.2f}" if name == "all pages" else ""
        print(f"{name:24}{cost.wall_s:8.2f}{cost.cpu_s:8.2f}{each}")
    sizes = sorted(path.stat().st_size for path in pages.iterdir())
    index = (place.root / "report" / "index.html").stat().st_size
    assets = sum(path.stat().st_size for path in (place.root / "report" / "assets").iterdir())
    pages_mb = f"pages {sizes[0] / 1e6:.2f} to {sizes[-1] / 1e6:.2f} MB (at most {CAP_BYTES / 1e6:g})"
    print(f"{pages_mb}, first page {index / 1e3:.0f} kB")
    print(f"what they share {assets / 1e6:.1f} MB, in all {(sum(sizes) + index + assets) / 1e6:.0f} MB")


if __name__ == "__main__":
    main()
