"""Fit a chain to one recording of a snapshot, and predict another.

python -m examples.estimator SNAPSHOT [FITTED HELD_BACK]
"""

from __future__ import annotations

import sys
from pathlib import Path

from examples.estimator.fitting import fit
from examples.estimator.judging import judge
from examples.estimator.recording import read, recordings_of


def main(snapshot: Path, fitted: str | None = None, held_back: str | None = None) -> None:
    """Print the parameters with their intervals, and how well another recording is predicted."""
    names = recordings_of(snapshot)
    fitted, held_back = fitted or names[0], held_back or names[-1]
    source = read(snapshot, fitted)
    chain = fit(source)
    print(f"{fitted}: {source.count} links of {1e3 * source.segment_m:.0f} mm")
    for each in chain.intervals:
        low, high = ("?" if end is None else f"{end:.3g}" for end in (each.low, each.high))
        told = "" if each.is_told else "   the motion does not tell it from both sides"
        print(f"  {each.name:13} {each.best:8.3g}   95 %: {low} to {high}{told}")
    errors = judge(chain, source, read(snapshot, held_back))
    print(f"{held_back}: predicted to {1e3 * errors.chain_m:.2f} mm (rms)")
    print(f"  hanging rigidly {1e3 * errors.rigid_m:.1f} mm, {errors.rigid_m / errors.chain_m:.0f} times as far off")
    print(f"  the mean of {fitted} {1e3 * errors.mean_m:.1f} mm, {errors.mean_m / errors.chain_m:.0f} times")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:4])
