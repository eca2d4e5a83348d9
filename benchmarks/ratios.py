"""Ratios against what they are to be: ``make bench-check``.

A script of this folder that has a function ``ratios`` takes part: it measures at a small size, and yields one
:class:`Ratio` each. Ratios of one run are compared, never seconds; and no test asserts them, since machines are shared.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).parent
GROWTH = 4 / 3


class Ratio(NamedTuple):
    """One measured ratio: less is better.

    Parameters
    ----------
    what : str
        What is divided by what.
    measured, target : float
        What was found, and what is to be reached.
    committed : float
        What was measured when this was last looked at; a third more is a failure.
    """

    what: str
    measured: float
    target: float
    committed: float


def main() -> int:
    """Print one table of all ratios; return 1 when one has grown by more than a third over the committed one."""
    sys.path.insert(0, str(HERE.parent))
    has_grown = False
    print(f"{'':64}{'ratio':>8}{'target':>8}  reached  {'committed':>9}")
    for path in sorted(HERE.glob("*.py")):
        if "\ndef ratios(" not in path.read_text("utf-8"):
            continue
        for what, measured, target, committed in importlib.import_module(f"benchmarks.{path.stem}").ratios():
            grown = measured > GROWTH * committed
            has_grown |= grown
            reached = "yes" if measured <= target else "no"
            print(f"{what:64}{measured:8.2f}{target:8.2f}  {reached:7}  {committed:9.2f}{'  GROWN' if grown else ''}")
    return int(has_grown)


if __name__ == "__main__":
    sys.exit(main())
