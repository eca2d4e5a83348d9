"""The default method on many short draws: other cloth, and sensors with other fixed patterns and noise.

    python benchmarks/accuracy_draws.py [--cache FOLDER] [NAME ...]

Cloth and exact depth of every draw are simulated once (some 5 s and 65 MB each) and kept in FOLDER; each sensor then
sees them anew, so that a method is not tuned to one camera's pattern. Prints Markdown tables: draws that the method was
chosen on, and draws that were held out. Frames whose hem is below the image are left out. In calm frames the second
difference in time of every true coordinate is below 4 mm: no fold crosses the plane.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.catalog import Catalog
from garment_dataset.catalog.names import RecordingName, parse_bag_name
from garment_dataset.simulate import scene, sensor, truth
from garment_dataset.simulate.cloth import build_mesh
from garment_dataset.simulate.garments import cloth_of, fabric_of, unusual
from garment_dataset.simulate.hanging import Hanging
from garment_dataset.simulate.motion import Swing
from garment_dataset.simulate.nuisance import draw_nuisance
from garment_dataset.simulate.nuisance_depth import DepthNuisance
from garment_dataset.simulate.physics import simulate_cloth
from garment_dataset.simulate.recording import SCALES, begin_ns, random_streams
from garment_dataset.simulate.render import Stage
from garment_dataset.simulate.timing import frame_times
from garment_dataset.stages.depth_points import DepthPointsParams
from garment_dataset.vision.depth.cloud import Intrinsics
from garment_dataset.vision.depth.flat_field import column_offsets, inverse_depth_table
from garment_dataset.vision.depth.pattern import measured_pattern
from garment_dataset.vision.depth.trace import KnownSensor, trace_profiles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    Draw = tuple[str, int, str]

CHOSEN: tuple[Draw, ...] = (
    ("GreenTowel_Ruler_01_pi16_0.5_R1", 0, "none"),
    ("GreenTowel_Ruler_02_pi16_0.5_R1", 1, "bending"),
    ("FelShirt_Ruler_pi16_0.5_R1", 0, "bending"),
    ("GreenTowel_Corner_01_pi16_0.5_R1", 0, "none"),
    ("GreenTowel_Corner_01_pi16_0.5_R1", 1, "bending"),
    ("RedPullover_Collar_pi16_0.5_R1", 0, "none"),
    ("BlackShorts_Belt_pi16_0.5_R1", 0, "none"),
)
HELD_OUT: tuple[Draw, ...] = (
    ("GreenTowel_Ruler_03_pi16_0.5_R1", 31, "bending"),
    ("FelShirt_Ruler_pi16_0.5_R1", 31, "bending"),
    ("GreenTowel_Corner_02_pi16_0.5_R1", 31, "none"),
    ("GreenTowel_Corner_03_pi16_0.5_R1", 32, "bending"),
    ("BlueShirt_Collar_pi16_0.5_R1", 31, "none"),
    ("RedSkirt_Belt_pi16_0.5_R1", 31, "bending"),
)
SENSORS = ("usual", "no pattern", "blobs", "noisy")
CAMERA = Intrinsics(scene.DEPTH_CAMERA.focal_px, scene.DEPTH_CAMERA.focal_px, 319.5, 239.5)
_UNIT_M = 5e-5
_LAST_ROW = 475
_CALM_M = 0.004
HEAD = (
    "draw",
    "sensor",
    "coverage %",
    "3-D rms",
    "median",
    "95 %",
    "z rms",
    "y at 1",
    "y at 5",
    "calm: 3-D rms",
    "z rms",
)


def simulate(draw: Draw, folder: Path) -> None:
    """Simulate cloth, exact depth in units of 0.05 mm, and truth of one draw."""
    text, seed, nuisance = draw
    name, scale = parse_bag_name(text), SCALES["small"]
    assert isinstance(name, RecordingName)
    holding, catalog, streams = str(name.holding), Catalog.load(), random_streams(text, seed)
    spec = unusual(cloth_of(str(name.garment), holding, catalog), draw_nuisance(nuisance, text, seed).cloth)
    mesh = build_mesh(spec, holding, float(np.sqrt(spec.area_m2() / scale.cells)))
    swing = Swing(name.axis, name.swing_rad or np.pi / 16, float(name.speed), scale.rest_s)
    times, _ = frame_times(streams["clock"], begin_ns(text, seed), scale.duration_s, None)
    hanging = Hanging.draw(streams["hanging"])
    moved = simulate_cloth(
        spec, mesh, holding, swing, duration_s=scale.duration_s, step_s=scale.step_s, hanging=hanging
    )
    view = truth.GarmentView(mesh, moved, swing, scale.levels)
    ruler = scene.ruler(spec.extent_m[0]).moved(hanging.turn, hanging.slip_m) if holding == "Ruler" else None
    stage = Stage(swing, fabric_of(str(name.garment), catalog), view.triangles, view.material_m, ruler)
    folder.mkdir(parents=True, exist_ok=True)
    exact = np.lib.format.open_memmap(folder / "depth.npy", "w+", np.uint16, (times.time_s.size, 480, 640))
    for index, time_s in enumerate(times.time_s.tolist()):
        exact[index] = np.rint(stage.depth_m(time_s, view.surface_m(time_s)) / _UNIT_M)
    exact.flush()
    points = [view.surface_points(time_s)[0].T for time_s in times.time_s.tolist()]
    lines = [view.surface_line(time_s) for time_s in times.time_s.tolist()]
    ends = [np.full(3, np.nan) if line is None else line.nodes_m[-1] for line in lines]
    gripper = [swing.gripper_m(time_s) for time_s in times.time_s.tolist()]
    np.savez(folder / "truth.npz", stamp_ns=times.stamp_ns, points_m=points, end_m=ends, gripper_m=gripper)


def camera(kind: str, seed: int) -> sensor.DepthSensor:
    """Return a sensor of one of :data:`SENSORS`."""
    made = sensor.DepthSensor(np.random.default_rng(seed), DepthNuisance(depth_noise=1.5 if kind == "noisy" else None))
    if kind == "no pattern":
        made._pattern = np.zeros_like(made._pattern)  # noqa: SLF001
    elif kind == "blobs":
        made._pattern = 0.35 * sensor.blobs(np.random.default_rng(7), 6.0)  # noqa: SLF001
    return made


def errors_m(folder: Path, kind: str, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return errors of the points, (T, 3, 5), and the true points; both NaN where the hem is not in the image."""
    known = np.load(folder / "truth.npz")
    seen_by = camera(kind, seed)
    images = [(i, seen_by.frame(frame * _UNIT_M)) for i, frame in enumerate(np.load(folder / "depth.npy"))]
    stamps_ns = dict(enumerate(known["stamp_ns"].tolist()))
    grippers_m = {i: tuple(place) for i, place in enumerate(known["gripper_m"].tolist())}
    some = [image for _, image in images[:: max(len(images) // 24, 1)]]
    table, _ = inverse_depth_table(some)
    pattern = measured_pattern(some, table, column_offsets(some, table, beyond_m=1.4), beyond_m=1.4)
    measured = KnownSensor(pattern)
    traces = trace_profiles(images, stamps_ns, CAMERA, grippers_m, DepthPointsParams().track_settings(), measured)
    nothing = np.full((3, 5), np.nan)
    found_m = np.stack([nothing if trace.points is None else trace.points.position_m for trace in traces.values()])
    true_m = known["points_m"].copy()
    end_m = known["end_m"]
    true_m[CAMERA.cy_px + CAMERA.fy_px * end_m[:, 1] / end_m[:, 2] > _LAST_ROW] = np.nan
    return found_m - true_m, true_m


def row_of(draw: Draw, kind: str, folder: Path) -> str:
    """Return one row of the table, lengths in mm."""
    error_m, true_m = errors_m(folder, kind, draw[1])
    error, expected = 1000 * error_m, np.isfinite(true_m).all(axis=1)
    bend_m = np.abs(np.diff(true_m, 2, axis=0, prepend=true_m[:1], append=true_m[-1:])).max(axis=(1, 2))
    calm = bend_m < _CALM_M

    def rms(values: FloatArray) -> float:
        return float(np.sqrt(np.nanmean(values**2)))

    distance = np.sqrt((error**2).sum(axis=1))
    figures = (
        rms(distance), np.nanmedian(distance), np.nanpercentile(distance, 95), rms(error[:, 2]),
        np.nanmean(error[:, 1, 0]), np.nanmean(error[:, 1, 4]), rms(distance[calm]), rms(error[calm, 2]),
    )  # fmt: skip
    coverage = 100 * np.isfinite(distance[expected]).mean()
    cells = [f"{draw[0]}, {draw[1]}, {draw[2]}", kind, f"{coverage:.1f}", *(f"{figure:.2f}" for figure in figures)]
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Simulate what is missing, and print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="parts of the names of the recordings wanted; all by default")
    parser.add_argument("--cache", type=Path, default=Path("demo/draws"), help="folder of the simulated draws")
    options = parser.parse_args()
    for title, draws in (("Chosen on", CHOSEN), ("Held out", HELD_OUT)):
        print(f"\n{title}:\n\n| {' | '.join(HEAD)} |\n| --- | ---{' | ---:' * (len(HEAD) - 2)} |")
        for draw in draws:
            if options.names and not any(part in draw[0] for part in options.names):
                continue
            folder = options.cache / f"{draw[0]}_{draw[1]}_{draw[2]}"
            if not (folder / "truth.npz").exists():
                simulate(draw, folder)
            for kind in SENSORS:
                print(row_of(draw, kind, folder), flush=True)


if __name__ == "__main__":
    main()
