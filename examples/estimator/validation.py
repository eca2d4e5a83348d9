"""Is the estimator right? Recordings made from a chain, whose truth is known, and from cloths of different properties.

    python -m examples.estimator.validation FOLDER

FOLDER gets the simulated recordings and is used again. This program simulates and builds, so it needs garment_dataset;
what it judges does not.
"""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from examples.estimator.chain import PARAMETERS, simulate
from examples.estimator.fitting import Fitted, Interval, fit
from examples.estimator.judging import judge
from examples.estimator.recording import Recording, read
from garment_dataset.simulate.nuisance import Nuisance
from garment_dataset.simulate.nuisance_cloth import ClothNuisance
from garment_dataset.simulate.recording import simulate_recording
from garment_dataset.workspace import Workspace

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

CLOTHS = {
    "usual": ClothNuisance(),
    "stiff": ClothNuisance(bending=20.0),
    "heavy": ClothNuisance(mass=1.8),
    "light": ClothNuisance(mass=0.55),
}
FITTED = tuple(f"GreenTowel_Ruler_0{repeat}_pi16_0.5_R1" for repeat in (1, 2, 3))
OTHER = "GreenTowel_Ruler_04_pi8_0.3_R1"
"""Another movement, with which no chain is fitted."""

DRAWS = 40
LOWEST, HIGHEST = np.log([1.0, 0.3, 0.3, 0.2]), np.log([30.0, 3.0, 3.0, 3.0])
"""Of the parameters that chains are made with."""


class Draw(NamedTuple):
    """Of one chain: which intervals hold its true parameters, and which of them are told from both sides."""

    holds: tuple[bool, ...]
    is_told: tuple[bool, ...]


def main(folder: Path) -> None:
    """Print both tables."""
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        snapshots = dict(zip(CLOTHS, pool.map(prepare, [folder] * len(CLOTHS), CLOTHS), strict=True))
        template = read(snapshots["usual"], FITTED[0])
        draws = list(pool.map(draw, [template] * DRAWS, range(DRAWS)))
        print(f"{DRAWS} chains: intervals of 95 % that hold the truth; parameters told from both sides")
        for number, name in enumerate(PARAMETERS):
            holds, told = (sum(getattr(each, key)[number] for each in draws) / DRAWS for key in ("holds", "is_told"))
            print(f"{name:14} {holds:6.0%} {told:6.0%}")
        jobs = [(cloth, snapshots[cloth], name) for cloth in CLOTHS for name in FITTED]
        fits = list(pool.map(fit_recording, *zip(*[job[1:] for job in jobs], strict=True)))
    print(f"\n{'cloth':6} {'repeat':>6}" + "".join(f"{name:>26}" for name in PARAMETERS))
    for (cloth, _, name), chain in zip(jobs, fits, strict=True):
        print(f"{cloth:6} {name.split('_')[2]:>6}" + "".join(f"{_said(each):>26}" for each in chain.intervals))
    print(f"\n{'cloth':6} {'':20} {'chain':>8} {'rigid':>8} {'mean':>8}  rms, mm")
    for cloth, snapshot in snapshots.items():
        chain, source = fits[[job[0] for job in jobs].index(cloth)], read(snapshot, FITTED[0])
        for what, name in (("a repeat", FITTED[1]), ("another movement", OTHER)):
            errors = judge(chain, source, read(snapshot, name))
            print(f"{cloth:6} {what:20}" + "".join(f"{1e3 * each:9.2f}" for each in errors))


def prepare(folder: Path, cloth: str) -> Path:
    """Simulate, build and export the recordings of one cloth; return the snapshot."""
    root = folder / cloth
    workspace = Workspace.at(root) if (root / "catalog").is_dir() else Workspace.create(root)
    for name in (*FITTED, OTHER):
        if not (workspace.recordings_dir / f"{name}.bag").is_file():
            nuisance = Nuisance(cloth=CLOTHS[cloth])
            simulate_recording(name, workspace.recordings_dir, scale="small", nuisance=nuisance)
    workspace.build(jobs=0)
    garment = str(Path(sys.executable).with_name("garment"))
    subprocess.run([garment, "export", root / "snapshot", "-w", root], check=True, capture_output=True)
    return root / "snapshot"


def chain_made(template: Recording, logarithms: FloatArray, seed: int) -> Recording:
    """Return what would be measured of a chain: its motion, with errors that hang together as those of the template."""
    rng = np.random.default_rng(seed)
    points_m = simulate(template, logarithms[None])[0]
    for axis in (0, 1):
        std_m = np.where(np.isfinite(template.std_m[:, :, axis]), template.std_m[:, :, axis], 0.0)
        covariance = dataclasses.replace(template, std_m=np.repeat(std_m[..., None], 2, axis=2)).covariance(axis)
        values, vectors = np.linalg.eigh(covariance)
        errors_m = vectors @ (np.sqrt(values.clip(0)) * rng.standard_normal(values.size))
        points_m[:, :, axis] += errors_m.reshape(std_m.shape)
    return dataclasses.replace(template, points_m=np.where(np.isfinite(template.std_m), points_m, np.nan))


def draw(template: Recording, seed: int) -> Draw:
    """Make a chain of parameters drawn at random, fit it, and compare."""
    truth = np.random.default_rng(1000 + seed).uniform(LOWEST, HIGHEST)
    found = fit(chain_made(template, truth, seed), is_chain=True)
    holds = tuple(
        (each.low is None or each.low <= value) and (each.high is None or value <= each.high)
        for each, value in zip(found.intervals, np.exp(truth), strict=True)
    )
    return Draw(holds, tuple(each.is_told for each in found.intervals))


def fit_recording(snapshot: Path, name: str) -> Fitted:
    """Fit one recording."""
    return fit(read(snapshot, name))


def _said(interval: Interval) -> str:
    best, low, high = interval.best, interval.low, interval.high
    return f"{best:.2g} [{'?' if low is None else f'{low:.2g}'}, {'?' if high is None else f'{high:.2g}'}]"


if __name__ == "__main__":
    main(Path(sys.argv[1]))
