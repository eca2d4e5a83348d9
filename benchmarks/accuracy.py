"""How far points and velocities are from the truth: methods side by side on simulated recordings.

    python benchmarks/accuracy.py [--cache FOLDER]

Simulates what is missing in FOLDER (twelve recordings, 4.4 GB, a minute of one processor each), extracts points by
every method, and writes ``docs/accuracy.md`` from ``accuracy.md`` beside this script, the text around the tables.
Everything was chosen on the recordings of :data:`TUNING`; those of :data:`HELD_OUT` were only looked at.
"""

from __future__ import annotations

import argparse
import warnings
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from garment_dataset.score.points import PointErrors, PointScore, join_errors, point_errors, score_errors
from garment_dataset.score.recordings import LINES
from garment_dataset.simulate.recording import simulate_recording
from garment_dataset.stages.decode import DecodeParams, decode
from garment_dataset.stages.depth_points import DepthPointsParams, depth_points
from garment_dataset.stages.kinematics import KinematicsParams, kinematics
from garment_dataset.stages.sensor import SensorParams, sensor

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from garment_dataset.score.points import Line

Recording = tuple[str, int]
"""Name and seed."""

Errors = dict[str, PointErrors]
"""By line, and by :data:`VISIBLE`."""

VISIBLE = "visible"
"""The points of the visible profile, taken for points of the material line."""

TUNING: tuple[Recording, ...] = (
    ("GreenTowel_Ruler_01_pi16_0.5_R1", 0),
    ("GreenTowel_Ruler_01_pi16_0.5_R1", 1),
    ("GreenTowel_Corner_01_pi16_0.5_R1", 0),
    ("GreenTowel_Corner_01_pi16_0.5_R1", 1),
)
HELD_OUT: tuple[Recording, ...] = (
    ("GreenTowel_Ruler_02_pi16_0.5_R1", 11),
    ("GreenTowel_Ruler_03_pi16_0.5_R1", 12),
    ("FelShirt_Ruler_pi16_0.5_R1", 11),
    ("GreenTowel_Ruler_04_pi16_0.5_R1", 21),
    ("GreenTowel_Corner_02_pi16_0.5_R1", 11),
    ("GreenTowel_Corner_03_pi16_0.5_R1", 21),
    ("RedPullover_Collar_pi16_0.5_R1", 11),
    ("WhitePullover_Free_pi16_0.5_B1", 11),
)


@dataclass(frozen=True)
class Method:
    """A way to extract, with the parameters that differ from the defaults."""

    name: str
    points: dict[str, Any] = field(default_factory=dict)
    motion: dict[str, Any] = field(default_factory=dict)


THESIS = Method("thesis", {"method": "thesis"}, {"velocity_method": "thesis"})
DEFAULT = Method("profile")
EXACT_GRIPPER = Method("profile, gripper exact", {"gripper_std_m": 0.0})
"""The simulated gripper's end point is known without error: what is stated for it is never used up."""

CALIBRATED = (THESIS, DEFAULT, EXACT_GRIPPER)
_BARE = {"windows_px": ((12, 12),), "smoothing_frames": (), "flat_field_beyond_m": 100.0}
STEPS = (
    THESIS,
    Method("surfaces in 4.7 x 4.7 cm, each frame divided by its own length", _BARE),
    Method("and in 14 x 9 cm, as bend and pattern say", {k: v for k, v in _BARE.items() if k != "windows_px"}),
    Method("columns corrected on the wall behind", {"smoothing_frames": ()}),
    Method("points smoothed over time, parabolas of 5 frames", {"smoothing_frames": (5,)}),
    Method("of 5, 9 or 13 frames, as agree: the default"),
)
VELOCITIES = (
    Method("difference", {}, {"velocity_method": "thesis"}),
    *(
        Method(f"{frames} frames, degree {degree}", {}, {"polynomial_frames": frames, "polynomial_degree": degree})
        for frames, degree in ((5, 2), (7, 2), (9, 2), (7, 3), (11, 3))
    ),
)


def bag_of(recording: Recording, cache: Path) -> Path:
    """Return the bag of a recording in the cache."""
    name, seed = recording
    return cache / f"seed{seed}" / f"{name}.bag"


def simulate(recording: Recording, cache: Path) -> None:
    """Simulate a recording that the cache does not hold."""
    bag = bag_of(recording, cache)
    if not (bag.with_suffix(".truth") / "points.parquet").exists():
        simulate_recording(recording[0], bag.parent, seed=recording[1])


def errors_of(recording: Recording, cache: Path, methods: Sequence[Method]) -> list[Errors]:
    """Return the errors of one recording by method, against both lines."""
    bag = bag_of(recording, cache)
    truth = pd.read_parquet(bag.with_suffix(".truth") / "points.parquet")
    found: list[Errors] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        tables = decode(bag, DecodeParams())
        given = tables["frames"], tables["camera"], tables["gripper"]
        known = sensor(bag, *given, SensorParams())["sensor"]
        for method in methods:
            points = depth_points(bag, *given, DepthPointsParams(**method.points), known)["points"]
            moving = kinematics(points, tables["gripper"], KinematicsParams(**method.motion))["kinematics"]
            frames = points.to_pandas(), moving.to_pandas()
            own: Errors = {line: point_errors(*frames, truth, line) for line in LINES}
            visible = frames[0].assign(**{f"material_{axis}_m": frames[0][f"{axis}_m"] for axis in "xyz"})
            found.append({**own, VISIBLE: point_errors(visible, None, truth, "material")})
    return found


def pooled(errors: Iterable[Errors], name: str, key: str = "surface") -> list[PointScore]:
    """Score several recordings as one."""
    line: Line = "surface" if key == "surface" else "material"
    return score_errors(join_errors([own[key] for own in errors]), name, line)


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a Markdown table; all but the first column to the right."""
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines) + "\n"


def number(value: float | None, digits: int = 2, factor: float = 1.0) -> str:
    """Return a number as text."""
    return "-" if value is None else f"{factor * value:.{digits}f}"


@dataclass(frozen=True)
class Target:
    """A figure to be reached, by holding."""

    text: str
    field: str
    factor: float
    limits: dict[str, float]
    at_least: bool = False


TARGETS = (
    Target("3-D rms", "rmse_m", 1000, {"Ruler": 0.7, "Corner": 1.5}),
    Target("95 % of 3-D", "p95_m", 1000, {"Ruler": 1.2}),
    Target("z rms", "z_rmse_m", 1000, {"Ruler": 0.3}),
    Target("v_z rms", "vz_rmse_m_s", 1000, {"Ruler": 5}),
    Target("coverage %", "coverage", 100, {"Ruler": 99, "Corner": 99}, at_least=True),
)

ERROR_HEAD = (
    "coverage %", "3-D rms", "median", "95 %", "z rms", "95 %", "v_z rms", "median", "95 %",
)  # fmt: skip
LENGTHS = 6
"""So many of these cells come before the speeds."""


def error_cells(row: PointScore) -> list[str]:
    """Return coverage in %, lengths in mm, speeds in mm/s."""
    lengths = (row.rmse_m, row.median_m, row.p95_m, row.z_rmse_m, row.z_p95_m)
    speeds = (row.vz_rmse_m_s, row.vz_median_m_s, row.vz_p95_m_s)
    return [
        number(row.coverage, 1, 100),
        *(number(value, 2, 1000) for value in lengths),
        *(number(value, 1, 1000) for value in speeds),
    ]


def holding_of(recording: Recording) -> str:
    """Return how the garment is held."""
    return recording[0].split("_")[1]


def held_out_section(errors: dict[Recording, list[Errors]]) -> str:
    """Return the tables of the recordings that nothing was chosen on."""
    rows = []
    for recording, (old, new, *_) in errors.items():
        for method, own in (("thesis", old), ("profile", new)):
            name = f"{recording[0]}, seed {recording[1]}"
            rows.append([name, method, *error_cells(pooled([own], name)[0])])
    ruler = [own for recording, own in errors.items() if holding_of(recording) == "Ruler"]
    per_point = []
    for index, method in enumerate(("thesis", "profile")):
        scores = pooled([own[index] for own in ruler], "Ruler")
        per_point += [[method, "all" if row.point is None else row.point, *error_cells(row)] for row in scores]
    return (
        table(["recording", "method", *ERROR_HEAD], rows)
        + "\nAll ruler recordings together, by point:\n\n"
        + table(["method", "point", *ERROR_HEAD], per_point)
    )


def calibration_section(errors: dict[Recording, list[Errors]]) -> str:
    """Return mean squares of normalised errors by holding, of the methods :data:`CALIBRATED` in all frames."""
    rows = []
    for holding in dict.fromkeys(map(holding_of, errors)):
        for index, method in enumerate(CALIBRATED):
            row = pooled([own[index] for recording, own in errors.items() if holding_of(recording) == holding], "")[0]
            # of an exact gripper x has neither an error nor an uncertainty
            of_x = None if method is EXACT_GRIPPER else row.x_variance
            variances = (of_x, row.y_variance, row.z_variance, row.vz_variance)
            rows.append([holding, method.name, *(number(value) for value in variances)])
    return table(["holding", "method", "x", "y", "z", "v_z"], rows)


def material_section(errors: dict[Recording, list[Errors]], index: int) -> str:
    """Return the errors against the material line, by recording, of the method of this index."""
    rows = []
    for (name, seed), own in errors.items():
        for estimate, key in (("material line", "material"), ("visible profile", VISIBLE)):
            rows.append([f"{name}, {seed}", estimate, *error_cells(pooled([own[index]], "", key)[0])[:LENGTHS]])
    return table(["recording", "taken for it", *ERROR_HEAD[:LENGTHS]], rows)


def steps_section(errors: dict[Recording, list[Errors]], methods: Sequence[Method]) -> str:
    """Return what each step brings, by holding."""
    text = ""
    for holding in dict.fromkeys(map(holding_of, errors)):
        rows = []
        for index, method in enumerate(methods):
            chosen = [own[index] for recording, own in errors.items() if holding_of(recording) == holding]
            rows.append([method.name, *error_cells(pooled(chosen, "")[0])])
        text += f"\n{holding}:\n\n" + table(["step", *ERROR_HEAD], rows)
    return text


def recordings_text(recordings: Sequence[Recording]) -> str:
    """Return names and seeds in one line."""
    return ", ".join(f"`{name}` (seed {seed})" for name, seed in recordings)


def targets_section(errors: dict[Recording, list[Errors]]) -> str:
    """Return what was to be reached beside what was, by holding: all recordings together, and the worst."""
    rows = []
    for wanted, holding in ((target, holding) for target in TARGETS for holding in target.limits):
        scores = [pooled([own[1]], "")[0] for recording, own in errors.items() if holding_of(recording) == holding]
        whole = pooled([own[1] for recording, own in errors.items() if holding_of(recording) == holding], "")[0]
        values = [float(asdict(row)[wanted.field]) for row in (whole, *scores)]
        worst = min(values[1:]) if wanted.at_least else max(values[1:])
        sign = ">=" if wanted.at_least else "<="
        limit = wanted.limits[holding]
        rows.append(
            [f"{holding}: {wanted.text}", f"{sign} {limit}", *(number(v, 2, wanted.factor) for v in (values[0], worst))]
        )
    return table(["held-out, defaults", "to reach", "together", "worst recording"], rows)


def document(
    notes: str,
    tuning: dict[Recording, list[Errors]],
    held_out: dict[Recording, list[Errors]],
) -> str:
    """Return the page: the notes, with the tables in their places."""
    by_step = {recording: own[: len(STEPS)] for recording, own in tuning.items()}
    by_velocity = {recording: own[len(STEPS) : -1] for recording, own in tuning.items()}
    calibrated = {recording: [own[0], own[len(STEPS) - 1], own[-1]] for recording, own in tuning.items()}
    parts = {
        "TUNING": recordings_text(TUNING),
        "HELD_OUT": recordings_text(HELD_OUT),
        "held-out": held_out_section(held_out),
        "targets": targets_section(held_out),
        "calibration": calibration_section(held_out),
        "calibration-tuning": calibration_section(calibrated),
        "material": material_section(held_out, 1),
        "material-tuning": material_section(tuning, len(STEPS) - 1),
        "steps": steps_section(by_step, STEPS),
        "velocity": steps_section(by_velocity, VELOCITIES),
    }
    for name, text in parts.items():
        notes = notes.replace(f"<{name}>", text.strip())
    return notes


def main() -> None:
    """Simulate, extract, score, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, default=Path("demo/accuracy"), help="folder of the simulated recordings")
    parser.add_argument("--out", type=Path, default=Path("docs/accuracy.md"))
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    options = parser.parse_args()
    steps = (*STEPS, *VELOCITIES, EXACT_GRIPPER)
    notes = Path(__file__).with_suffix(".md").read_text("utf-8")
    with ProcessPoolExecutor(options.jobs) as pool:
        wanted = (*TUNING, *HELD_OUT)
        list(pool.map(simulate, wanted, [options.cache] * len(wanted)))
        tuning = list(pool.map(errors_of, TUNING, [options.cache] * len(TUNING), [steps] * len(TUNING)))
        held = list(pool.map(errors_of, HELD_OUT, [options.cache] * len(HELD_OUT), [CALIBRATED] * len(HELD_OUT)))
    text = document(notes, dict(zip(TUNING, tuning, strict=True)), dict(zip(HELD_OUT, held, strict=True)))
    options.out.write_text(text, "utf-8")
    print(f"wrote {options.out}")


if __name__ == "__main__":
    main()
