"""How far points that stay on the material are from it, beside those of the visible profile, and what they cost.

    python benchmarks/tracks.py [--cache FOLDER]

Simulates what is missing in FOLDER (of full size, a minute of one processor and 0.4 GB each; ``accuracy.py`` shares
most of them), extracts ``points`` and ``tracks`` with their defaults, scores both against the simulated material, and
puts the tables into ``docs/tracks.md``, between its marks. Time and memory are of the stage ``tracks`` alone: seconds
of one processor, and by how much the process grew, the pages of the bag included.
Everything was chosen on the recordings of :data:`CHOSEN_ON`.
"""

from __future__ import annotations

import argparse
import multiprocessing
import re
import resource
import sys
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).parent.parent))

from benchmarks.accuracy import bag_of, number, simulate, table
from garment_dataset.engine.threads import one_thread, one_thread_variables
from garment_dataset.score.tables import column_errors
from garment_dataset.stages.decode import DecodeParams, decode
from garment_dataset.stages.depth_points import DepthPointsParams, depth_points
from garment_dataset.stages.kinematics import KinematicsParams, kinematics
from garment_dataset.stages.sensor import SensorParams, sensor
from garment_dataset.stages.tracks import TracksParams, tracks

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pyarrow as pa

    from garment_dataset.score.tables import ColumnErrors

    Recording = tuple[str, int]
    Row = list[str]

CHOSEN_ON: tuple[Recording, ...] = (
    ("GreenTowel_Ruler_01_pi16_0.5_R1", 0),
    ("GreenTowel_Corner_01_pi16_0.5_R1", 0),
    ("GreenTowel_Corner_01_pi16_0.5_R1", 1),
    ("RedPullover_Collar_pi16_0.5_R1", 0),
    ("BlackShorts_Belt_pi16_0.5_R1", 0),
)
HELD_OUT: tuple[Recording, ...] = (
    ("GreenTowel_Ruler_02_pi16_0.5_R1", 11),
    ("FelShirt_Ruler_pi16_0.5_R1", 11),
    ("GreenTowel_Corner_02_pi16_0.5_R1", 11),
    ("GreenTowel_Corner_03_pi16_0.5_R1", 21),
    ("RedPullover_Collar_pi16_0.5_R1", 11),
    ("BlackShorts_Belt_pi16_0.5_R1", 11),
)
BEGIN, END = "<!-- tracks against the material: begin -->", "<!-- tracks against the material: end -->"
AXES = "xyz"
WITHIN_95 = 1.959964
"""So many standard uncertainties hold 95 % of normal errors."""
HEAD = ("recording, seed", "table", "found %", "3-D", "median", *AXES, "v", "v_z")
HONEST_HEAD = ("recording, seed", "x²", "y²", "z²", "v_z²", *(f"{axis} in 95 %" for axis in AXES), "s", "GB")


def measured(bag: Path, tables: dict[str, pa.Table], points: pa.Table) -> tuple[pa.Table, float, float]:
    """Return the table of tracks, seconds of the processor, and by how many GB the process grew: of a new process."""
    before_kb, before_s = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    with one_thread():
        found = tracks(bag, tables["frames"], tables["camera"], tables["gripper"], points, TracksParams())["tracks"]
    grown_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb
    return found, time.process_time() - before_s, grown_kb / 1e6


def alone(bag: Path, tables: dict[str, pa.Table], points: pa.Table) -> tuple[pa.Table, float, float]:
    """Return :func:`measured` of a process that did nothing before."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(measured, bag, tables, points).result()


def errors_by_column(features: Sequence[pa.Table], truth: pd.DataFrame) -> dict[str, ColumnErrors]:
    """Return the errors of positions and velocities of points 1 and up."""
    return {
        own.column: own
        for each in features
        for own in column_errors(each.to_pandas().query("point > 0"), truth, {"keys": ["frame", "point"]})
    }


def rms(*errors: ColumnErrors) -> float:
    """Return the root mean square of a vector of some columns."""
    return float(np.sqrt(np.nanmean(np.sum([own.error**2 for own in errors], axis=0))))


def error_cells(errors: dict[str, ColumnErrors]) -> Row:
    """Return coverage in %, lengths in mm and speeds in mm/s."""
    places, speeds = ([errors[f"{axis}_m"] for axis in AXES], [errors[f"v{axis}_m_s"] for axis in AXES])
    away_m = np.sqrt(np.sum([own.error**2 for own in places], axis=0))
    lengths = (rms(*places), float(np.nanmedian(away_m)), *map(rms, places))
    return [
        number(float(np.isfinite(away_m).mean()), 1, 100),
        *(number(value, 2, 1000) for value in lengths),
        *(number(value, 1, 1000) for value in (rms(*speeds), rms(speeds[2]))),
    ]


def honest_cells(errors: dict[str, ColumnErrors]) -> Row:
    """Return mean squares of errors over their standard uncertainties, and how many places lie within 95 %."""
    columns = [errors[name] for name in ("x_m", "y_m", "z_m", "vz_m_s")]
    parts = [(own.error / own.std)[np.isfinite(own.error) & (own.std > 0)] for own in columns]
    return [
        *(number(float(np.mean(part**2))) for part in parts),
        *(number(float(np.mean(np.abs(part) <= WITHIN_95))) for part in parts[: len(AXES)]),
    ]


def measure(recording: Recording, cache: Path) -> tuple[list[Row], Row]:
    """Return the rows of both tables of one recording."""
    bag = bag_of(recording, cache)
    truth = pd.read_parquet(bag.with_suffix(".truth") / "tracks.parquet")
    with warnings.catch_warnings(), one_thread():
        warnings.simplefilter("ignore")
        tables = decode(bag, DecodeParams())
        given = tables["frames"], tables["camera"], tables["gripper"]
        points = depth_points(bag, *given, DepthPointsParams(), sensor(bag, *given, SensorParams())["sensor"])["points"]
        found, seconds, grown_gb = alone(bag, tables, points)
        of_points = kinematics(points, tables["gripper"], KinematicsParams())["kinematics"]
        of_tracks = kinematics(points, tables["gripper"], KinematicsParams(source="tracks"), found)["kinematics"]
    name = f"{recording[0].split('_pi')[0]}, {recording[1]}"
    visible, own = errors_by_column((points, of_points), truth), errors_by_column((found, of_tracks), truth)
    cost = [number(seconds, 1), number(grown_gb)]
    return [[name, "points", *error_cells(visible)], [name, "tracks", *error_cells(own)]], [
        name,
        *honest_cells(own),
        *cost,
    ]


def section(found: dict[Recording, tuple[list[Row], Row]]) -> str:
    """Return the text between the marks."""
    parts = []
    for title, recordings in (("Chosen on", CHOSEN_ON), ("Held out", HELD_OUT)):
        own = [found[recording] for recording in recordings]
        parts.append(f"{title}:\n\n" + table(HEAD, [row for rows, _ in own for row in rows]))
        parts.append(table(HONEST_HEAD, [row for _, row in own]))
    return "\n".join(parts)


def main() -> None:
    """Simulate, extract, score, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, default=Path("demo/accuracy"), help="folder of the simulated recordings")
    parser.add_argument("--out", type=Path, default=Path("docs/tracks.md"))
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    options = parser.parse_args()
    wanted = (*CHOSEN_ON, *HELD_OUT)
    with one_thread_variables(), ProcessPoolExecutor(options.jobs) as pool:
        list(pool.map(simulate, wanted, [options.cache] * len(wanted)))
        found = dict(zip(wanted, pool.map(measure, wanted, [options.cache] * len(wanted)), strict=True))
    text = f"{BEGIN}\n{section(found).strip()}\n{END}"
    page = options.out.read_text("utf-8")
    options.out.write_text(re.sub(f"{BEGIN}.*?{END}", lambda _: text, page, flags=re.DOTALL), "utf-8")
    print(f"wrote the tables in {options.out}")


if __name__ == "__main__":
    main()
