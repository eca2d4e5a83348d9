"""Simulate one recording, from its name to its files."""

from __future__ import annotations

import hashlib
import shutil
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from garment_dataset.catalog import Catalog
from garment_dataset.catalog.names import BackgroundName, RecordingName, parse_bag_name
from garment_dataset.errors import GarmentError, RecordingNameError
from garment_dataset.simulate import scene, truth_tables
from garment_dataset.simulate.bag import Compression, Streams, write_bag
from garment_dataset.simulate.camera_pose import CameraPose
from garment_dataset.simulate.cloth import ClothMesh, ClothSpec, build_mesh
from garment_dataset.simulate.garments import cloth_of, fabric_of, unusual, unusual_fabric
from garment_dataset.simulate.hanging import Hanging
from garment_dataset.simulate.motion import Swing
from garment_dataset.simulate.nuisance import Nuisance, draw_nuisance
from garment_dataset.simulate.physics import import_mujoco, simulate_cloth
from garment_dataset.simulate.render import Fabric, Stage, as_millimetres
from garment_dataset.simulate.sensor import DepthSensor
from garment_dataset.simulate.sensor_color import ColorSensor, as_bytes, soften
from garment_dataset.simulate.sheet import thickness_m
from garment_dataset.simulate.timing import frame_times, start_ns
from garment_dataset.simulate.truth import GarmentView

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from garment_dataset.simulate.timing import FrameTimes

Noise = Literal["none", "xtion"]
_BACKGROUND_S = 3.0
_REPEAT_NS = 90 * 10**9  # from the begin of one repeat to that of the next


@dataclass(frozen=True, slots=True)
class Scale:
    """How fine and how long a simulation is.

    Parameters
    ----------
    cells : int
        About how many cells the cloth is divided into.
    step_s : float
        Step of the integration.
    levels : int
        Subdivisions from the simulated to the visible mesh.
    duration_s : float
        Length of the recording.
    rest_s : float
        How long the gripper rests before it swings.
    """

    cells: int
    step_s: float
    levels: int
    duration_s: float
    rest_s: float


SCALES = {"full": Scale(260, 0.002, 2, 8.0, 1.5), "small": Scale(180, 0.002, 2, 3.5, 0.5)}
"""`small` has a coarser cloth, a short rest and no ring-out; the images are of the same size."""


def simulate_recording(
    name: str,
    folder: Path,
    *,
    seed: int = 0,
    noise: Noise = "xtion",
    frames: int | None = None,
    scale: str = "full",
    compression: Compression = "none",
    nuisance: str | Nuisance = "none",
    catalog: Catalog | None = None,
) -> Path:
    """Write a recording and the truth beside it.

    Parameters
    ----------
    name : str
        Of a recording (``GreenTowel_Ruler_01_pi16_0.5_R1``): garment, holding, swing, speed and axis are simulated as
        it says. Of an empty scene (``camera_default_0``): 3 s without garment, the gripper out of view, no truth.
    folder : Path
        Where ``<name>.bag`` and ``<name>.truth/`` are written; made if need be. Existing ones are replaced.
    seed : int
        Equal seeds give equal bytes; every recording draws its own random numbers from seed and name.
    noise : {"none", "xtion"}
        none: exact depth, rounded to whole millimetres as 16UC1 demands. xtion: as such a sensor sees it.
    frames : int, optional
        Most frames per stream; the recording ends with the last of them.
    scale : str
        One of :data:`SCALES`.
    compression : {"none", "lz4", "bz2"}
        Of the bag's chunks.
    nuisance : str or Nuisance
        What is unusual about room, camera and garment: ``none``, ``wide``, or names of nuisances with commas between,
        drawn from the seed; or what exactly.
    catalog : Catalog, optional
        Whose ``garments.csv`` says the garment's size and weight; by default :meth:`Catalog.load`'s.

    Returns
    -------
    Path
        The bag.

    Raises
    ------
    GarmentError
        If the name says no garment, holding or swing that can be simulated, or an option is unknown.
    MissingExtraError
        If MuJoCo is not installed.
    """
    parsed = parse_bag_name(name)
    if scale not in SCALES or noise not in {"none", "xtion"}:
        found = f"scale {scale}, noise {noise}"
        raise GarmentError("no such option", expected="scale small or full, noise none or xtion", found=found)
    folder.mkdir(parents=True, exist_ok=True)
    unusual_things = draw_nuisance(nuisance, str(parsed), seed) if isinstance(nuisance, str) else nuisance
    making = _Making(str(parsed), folder, seed, noise, frames, compression, unusual_things)
    if isinstance(parsed, BackgroundName):
        return making.write_background()
    return making.write_garment(parsed, SCALES[scale], Catalog.load() if catalog is None else catalog)


def begin_ns(name: str, seed: int) -> int:
    """Return when a recording begins; the repeats of one movement begin one after the other, by their numbers."""
    parsed = parse_bag_name(name)
    repeat = parsed.repeat if isinstance(parsed, RecordingName) else None
    session = name if repeat is None else name.replace(f"_{repeat:02}_", "_", 1).replace(f"_{repeat:04}_", "_", 1)
    digest = hashlib.sha256(f"{seed}/{session}".encode()).digest()
    return start_ns(int.from_bytes(digest[-4:], "little")) + (repeat or 0) * _REPEAT_NS


def random_streams(name: str, seed: int) -> dict[str, np.random.Generator]:
    """Return independent random numbers for each part of a recording, the same for the same name and seed."""
    digest = hashlib.sha256(f"{seed}/{name}".encode()).digest()
    parts = ("clock", "hanging", "depth", "color")
    children = np.random.SeedSequence(int.from_bytes(digest[:16], "little"))
    return {part: np.random.default_rng(child) for part, child in zip(parts, children.spawn(len(parts)), strict=True)}


class _Making:
    """One recording being made."""

    def __init__(
        self,
        name: str,
        folder: Path,
        seed: int,
        noise: Noise,
        frames: int | None,
        compression: Compression,
        nuisance: Nuisance,
    ) -> None:
        self._name, self._folder, self._seed = name, folder, seed
        self._noise, self._frames, self._compression = noise, frames, compression
        self._nuisance = nuisance
        self._random = random_streams(name, seed)
        self._pose = CameraPose(nuisance.depth.camera_tilt_rad)
        self._begin_ns = begin_ns(name, seed)
        self._depth_sensor = DepthSensor(self._random["depth"], nuisance.depth) if noise == "xtion" else None
        self._color_sensor = ColorSensor(self._random["color"], nuisance.color) if noise == "xtion" else None

    def write_background(self) -> Path:
        """Write a bag of the empty scene."""
        depth_times, color_times, duration_s = self._times(_BACKGROUND_S)
        stage = Stage(pose=self._pose, nuisance=self._nuisance.color)
        streams = Streams(
            depth_times,
            color_times,
            lambda index: self._seen_depth(stage.depth_m(0.0, None), float(depth_times.time_s[index])),
            lambda index: self._seen_color(stage.color(float(color_times.time_s[index]), None).pixels),
        )
        return self._write(streams, None, duration_s)

    def write_garment(self, name: RecordingName, scale: Scale, catalog: Catalog) -> Path:
        """Write a bag of a garment, and its truth."""
        import_mujoco()
        holding, swing = _holding(name), _swing(name, scale)
        spec = unusual(cloth_of(str(name.garment), holding, catalog), self._nuisance.cloth)
        fabric = unusual_fabric(fabric_of(str(name.garment), catalog), self._nuisance.cloth)
        hem = self._nuisance.cloth.hem
        mesh = build_mesh(spec, holding, float(np.sqrt(spec.area_m2() / scale.cells)), hem)
        depth_times, color_times, duration_s = self._times(scale.duration_s)
        hanging = Hanging.draw(self._random["hanging"], self._nuisance.cloth.folds)
        if name.axis == "B" and self._nuisance.cloth.yaw_rad is not None:
            hanging = hanging.yawed(self._nuisance.cloth.yaw_rad)
        trajectory = simulate_cloth(
            spec, mesh, holding, swing, duration_s=duration_s, step_s=scale.step_s, hanging=hanging
        )
        view = GarmentView(mesh, trajectory, swing, scale.levels, self._pose, hem)
        ruler = _ruler(spec, holding, hanging)
        looks = (ruler, self._pose, self._nuisance.color, thickness_m(spec))
        stage = Stage(swing, fabric, view.triangles, view.material_m, *looks)
        rows: list[dict[str, Any]] = []

        def depth(index: int) -> NDArray[np.uint16]:
            time_s = float(depth_times.time_s[index])
            return self._seen_depth(stage.depth_m(time_s, view.surface_m(time_s)), time_s)

        def color(index: int) -> NDArray[np.uint8]:
            time_s = float(color_times.time_s[index])
            frame = stage.color(time_s, view.surface_m(time_s))
            rows.append(truth_tables.color_row(index, int(color_times.stamp_ns[index]), time_s, frame, view))
            return self._seen_color(frame.pixels)

        bag = self._write(Streams(depth_times, color_times, depth, color), swing, duration_s)
        folder = self._folder / f"{self._name}.truth"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        truth_tables.write_points(folder / "points.parquet", depth_times, view)
        truth_tables.write_tracks(folder / "tracks.parquet", depth_times, view)
        truth_tables.write_color(folder / "color.parquet", rows)
        truth_tables.write_scene(folder / "scene.json", self._facts(spec, mesh, fabric, holding, swing, scale))
        return bag

    def _times(self, duration_s: float) -> tuple[FrameTimes, FrameTimes, float]:
        """Return the stamps of both streams, and how long the recording takes."""
        unsteady = self._nuisance.depth.unsteady_frames
        depth, color = frame_times(self._random["clock"], self._begin_ns, duration_s, self._frames, unsteady)
        if self._frames is not None and len(depth.record_ns) and len(color.record_ns):
            last_ns = max(int(depth.record_ns[-1]), int(color.record_ns[-1]))
            duration_s = min(duration_s, (last_ns - self._begin_ns) / 1e9 + 0.02)
        return depth, color, duration_s

    def _seen_depth(self, depth_m: NDArray[np.float64], time_s: float) -> NDArray[np.uint16]:
        return as_millimetres(depth_m) if self._depth_sensor is None else self._depth_sensor.frame(depth_m, time_s)

    def _seen_color(self, pixels: NDArray[np.float32]) -> NDArray[np.uint8]:
        return as_bytes(soften(pixels)) if self._color_sensor is None else self._color_sensor.frame(pixels)

    def _write(self, streams: Streams, swing: Swing | None, duration_s: float) -> Path:
        path = self._folder / f"{self._name}.bag"
        part = path.with_suffix(".bag.part")
        part.unlink(missing_ok=True)
        write_bag(part, streams, swing, self._begin_ns, duration_s, self._compression, self._nuisance.depth)
        return part.replace(path)

    def _facts(
        self, spec: ClothSpec, mesh: ClothMesh, fabric: Fabric, holding: str, swing: Swing, scale: Scale
    ) -> dict[str, object]:
        return {
            "recording": self._name,
            "seed": self._seed,
            "noise": self._noise,
            "nuisance": asdict(self._nuisance),
            "holding": holding,
            "cloth": asdict(spec),
            "fabric": asdict(fabric),
            "swing": asdict(swing),
            "scale": asdict(scale),
            "vertices": len(mesh.material_m),
            "flat_length_m": float(np.linalg.norm(mesh.end_m - mesh.hold_m)),
            "motion_start_ns": self._begin_ns + round(swing.start_s * 1e9),
            "motion_end_ns": self._begin_ns + round(swing.end_s * 1e9),
            "gripper_rest_m": self._pose.see(swing.rest_m).tolist(),
            "wrist_m": self._pose.see(swing.wrist_m).tolist(),
            "versions": {"mujoco": str(import_mujoco().__version__), "numpy": np.__version__},
        }


def _holding(name: RecordingName) -> str:
    if name.garment is None or name.holding is None:
        raise RecordingNameError(
            "the name says no garment and holding to simulate",
            where=str(name),
            expected="<Garment>_<Holding>[_<NN>]_pi<D>_<speed>_<R|B><X>",
        )
    return name.holding


def _swing(name: RecordingName, scale: Scale) -> Swing:
    speed = float(name.speed)
    if speed <= 0:
        raise RecordingNameError("a speed that moves nothing", where=str(name), found=name.speed)
    return Swing(name.axis, name.swing_rad or np.pi / 16, speed, scale.rest_s)


def _ruler(spec: ClothSpec, holding: str, hanging: Hanging) -> scene.Solid | None:
    """Return the ruler as it lies in the gripper, as crooked as the garment that hangs on it."""
    return scene.ruler(spec.extent_m[0]).moved(hanging.turn, hanging.slip_m) if holding == "Ruler" else None
