"""Fixtures of the whole suite: small recordings of a hanging sheet, and a workspace that holds them."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from garment_dataset.workspace import Workspace

if TYPE_CHECKING:
    from numpy.typing import NDArray

CACHE_VARIABLE = "GARMENT_CACHE_DIR"

PERIOD_NS = 33_000_000
START_NS = 1_400_000_000_000_000_000
WIDTH_PX, HEIGHT_PX, FOCAL_PX = 160, 120, 142.5
REST_M = (0.02, -0.28, 1.065)


def pytest_configure(config: pytest.Config) -> None:
    """Give all tests of a run, and all its workers, one cache: nobody's own is read or written."""
    if not hasattr(config, "workerinput"):
        os.environ[CACHE_VARIABLE] = tempfile.mkdtemp(prefix="garment-cache-")


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove it."""
    if not hasattr(config, "workerinput"):
        shutil.rmtree(os.environ[CACHE_VARIABLE], ignore_errors=True)


class MakeRecording(Protocol):
    """Writes a bag; see :func:`write_recording`."""

    def __call__(self, path: Path, *, frames: int = ..., shift_m: float = ..., fault: str | None = ...) -> Path: ...


def sheet_mm(gripper: tuple[float, float, float], length_m: float) -> NDArray[np.uint16]:
    """Return the depth image of a flat sheet, 10 cm wide, that hangs from the gripper before a far wall."""
    v, u = np.indices((HEIGHT_PX, WIDTH_PX))
    x = (u - WIDTH_PX / 2) * gripper[2] / FOCAL_PX
    y = (v - HEIGHT_PX / 2) * gripper[2] / FOCAL_PX
    on_sheet = (np.abs(x - gripper[0]) < 0.05) & (y >= gripper[1]) & (y <= gripper[1] + length_m)
    return np.where(on_sheet, round(gripper[2] * 1000), 2000).astype(np.uint16)


def gripper_at(stamp_ns: int, shift_m: float) -> tuple[float, float, float]:
    """Return where the gripper is: at rest for 0.3 s, then swinging along the optical axis."""
    seconds = max(0.0, (stamp_ns - START_NS) * 1e-9 - 0.3)
    return (REST_M[0], REST_M[1], REST_M[2] + shift_m - 0.05 * float(np.sin(4 * seconds)))


def write_recording(path: Path, *, frames: int = 24, shift_m: float = 0.0, fault: str | None = None) -> Path:
    """Write a recording of a sheet of 50 cm: small images, all that the depth pipeline reads.

    Parameters
    ----------
    path : Path
        The bag.
    frames : int
        Number of depth and of colour images.
    shift_m : float
        Added to the gripper's distance, to tell recordings apart.
    fault : str, optional
        ``zero_k``: a camera_info without calibration; ``short_image``: the third depth image lacks its last row.
    """
    store = get_typestore(Stores.ROS1_NOETIC)
    types: dict[str, Any] = store.types
    header, time = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]

    def head(stamp_ns: int, frame: str) -> Any:
        return header(seq=0, stamp=time(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9), frame_id=frame)

    def image(stamp_ns: int, frame: str, encoding: str, pixels: NDArray[Any]) -> Any:
        return types["sensor_msgs/msg/Image"](
            header=head(stamp_ns, frame),
            height=HEIGHT_PX,
            width=WIDTH_PX,
            encoding=encoding,
            is_bigendian=0,
            step=WIDTH_PX * pixels.itemsize * (pixels.ndim if pixels.ndim == 3 else 1),
            data=np.frombuffer(pixels.tobytes(), np.uint8),
        )

    def camera_info(stamp_ns: int, frame: str) -> Any:
        k = np.array([FOCAL_PX, 0, WIDTH_PX / 2, 0, FOCAL_PX, HEIGHT_PX / 2, 0, 0, 1.0])
        return types["sensor_msgs/msg/CameraInfo"](
            header=head(stamp_ns, frame),
            height=HEIGHT_PX,
            width=WIDTH_PX,
            distortion_model="plumb_bob",
            D=np.zeros(5),
            K=np.zeros(9) if fault == "zero_k" else k,
            R=np.eye(3).ravel(),
            P=np.zeros(12),
            binning_x=0,
            binning_y=0,
            roi=types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
        )

    def joints(stamp_ns: int) -> Any:
        return types["sensor_msgs/msg/JointState"](
            header=head(stamp_ns, ""),
            name=["r2_joint_b"],
            position=np.array([0.1]),
            velocity=np.array([0.0]),
            effort=np.zeros(0),
        )

    def point(stamp_ns: int) -> Any:
        x, y, z = gripper_at(stamp_ns, shift_m)
        at = types["geometry_msgs/msg/Point"](x=x, y=y, z=z)
        return types["geometry_msgs/msg/PointStamped"](header=head(stamp_ns, "xtion1_depth_optical_frame"), point=at)

    kinds = {
        "/xtion1/depth/image_raw": "sensor_msgs/msg/Image",
        "/xtion1/depth/camera_info": "sensor_msgs/msg/CameraInfo",
        "/xtion1/rgb/image_raw": "sensor_msgs/msg/Image",
        "/xtion1/rgb/camera_info": "sensor_msgs/msg/CameraInfo",
        "/joint_states": "sensor_msgs/msg/JointState",
        "/r2_ee_to_depth": "geometry_msgs/msg/PointStamped",
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    with Writer(path) as writer:
        connections = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}

        def write(topic: str, stamp_ns: int, message: Any) -> None:
            raw = store.serialize_ros1(message, kinds[topic])
            writer.write(connections[topic], stamp_ns + 20_000_000, raw)

        for number in range(frames):
            stamp = START_NS + number * PERIOD_NS
            depth = sheet_mm(gripper_at(stamp, shift_m), 0.5)
            message = image(stamp, "xtion1_depth_optical_frame", "16UC1", depth)
            if fault == "short_image" and number == 2:
                message.data = message.data[: -message.step]
            write("/xtion1/depth/image_raw", stamp, message)
            write("/xtion1/depth/camera_info", stamp, camera_info(stamp, "xtion1_depth_optical_frame"))
            color = np.full((HEIGHT_PX, WIDTH_PX, 3), number, np.uint8)
            write("/xtion1/rgb/image_raw", stamp + 2_000_000, image(stamp, "xtion1_rgb_optical_frame", "rgb8", color))
            write("/xtion1/rgb/camera_info", stamp, camera_info(stamp, "xtion1_rgb_optical_frame"))
            write("/joint_states", stamp, joints(stamp))
            write("/r2_ee_to_depth", stamp, point(stamp))
    return path


@pytest.fixture
def make_recording() -> MakeRecording:
    return write_recording


class MakeColorRecording(Protocol):
    """Writes a bag; see :func:`write_color_recording`."""

    def __call__(
        self, path: Path, *, frames: int = ..., empty_frames: int = ..., level: int = ..., seed: int = ...
    ) -> Path: ...


def scene_rgb(level: int, seed: int, left_px: int | None) -> NDArray[np.uint8]:
    """Return a wall of one colour with noise, and before it a green sheet, 30 x 60 pixels, that begins in row 25."""
    noise = np.random.default_rng(seed).integers(-3, 4, (HEIGHT_PX, WIDTH_PX, 3))
    image = np.full((HEIGHT_PX, WIDTH_PX, 3), level) + noise
    if left_px is not None:
        image[25:85, left_px : left_px + 30] += np.array([60, 140, 80]) - level
    return np.clip(image, 0, 255).astype(np.uint8)


def write_color_recording(
    path: Path, *, frames: int = 6, empty_frames: int = 0, level: int = 190, seed: int = 0
) -> Path:
    """Write a recording of a sheet that moves across the view, one pixel a frame: all that the colour pipeline reads.

    Parameters
    ----------
    path : Path
        The bag.
    frames, empty_frames : int
        Number of images, and of those at the beginning that show the wall alone; with the sheet in none, it is the
        recording of an empty scene.
    level, seed : int
        Grey level of the wall, and of what noise.
    """
    store = get_typestore(Stores.ROS1_NOETIC)
    types: dict[str, Any] = store.types
    kinds = {
        "/xtion1/rgb/image_raw": "sensor_msgs/msg/Image",
        "/xtion1/rgb/camera_info": "sensor_msgs/msg/CameraInfo",
        "/r2_ee_to_rgb": "geometry_msgs/msg/PointStamped",
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    with Writer(path) as writer:
        connections = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
        for number in range(frames):
            stamp_ns = START_NS + number * PERIOD_NS
            stamp = types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
            head = types["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id="xtion1_rgb_optical_frame")
            left_px = None if number < empty_frames else 60 + number
            pixels = scene_rgb(level, 1000 * seed + number, left_px)
            size = {"header": head, "height": HEIGHT_PX, "width": WIDTH_PX}
            k = np.array([FOCAL_PX, 0, WIDTH_PX / 2, 0, FOCAL_PX, HEIGHT_PX / 2, 0, 0, 1.0])
            roi = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, do_rectify=False)
            messages = {
                "/xtion1/rgb/image_raw": types["sensor_msgs/msg/Image"](
                    **size, encoding="rgb8", is_bigendian=0, step=3 * WIDTH_PX, data=pixels.ravel()
                ),
                "/xtion1/rgb/camera_info": types["sensor_msgs/msg/CameraInfo"](
                    **size,
                    distortion_model="",
                    D=np.zeros(5),
                    K=k,
                    R=k,
                    P=np.zeros(12),
                    binning_x=0,
                    binning_y=0,
                    roi=roi,
                ),
                "/r2_ee_to_rgb": types["geometry_msgs/msg/PointStamped"](
                    header=head,
                    point=types["geometry_msgs/msg/Point"](
                        x=(75 + number - WIDTH_PX / 2) / FOCAL_PX, y=(24.5 - HEIGHT_PX / 2) / FOCAL_PX, z=1.0
                    ),
                ),
            }
            for topic, message in messages.items():
                raw = store.serialize_ros1(message, kinds[topic])
                writer.write(connections[topic], stamp_ns + 20_000_000, raw)
    return path


@pytest.fixture
def make_color_recording() -> MakeColorRecording:
    return write_color_recording


RECORDINGS = ("GreenTowel_Ruler_01_pi16_0.5_R1", "GreenTowel_Ruler_02_pi16_0.5_R1", "MyScarf_Corner_pi16_0.5_R1")


@pytest.fixture(scope="session")
def sample_bags(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Three small recordings: two of the thesis' names, one of a user's own."""
    folder = tmp_path_factory.mktemp("bags")
    return {
        name: write_recording(folder / f"{name}.bag", shift_m=0.004 * number) for number, name in enumerate(RECORDINGS)
    }


DEPTH_PIPELINE = 'recordings = ["axis=R"]\nstages = ["decode", "depth_points", "kinematics"]\n'
COLOR_PIPELINE = 'recordings = ["axis=B"]\nstages = ["decode", "background", "silhouette", "central_curve"]\n'


def make_workspace(root: Path) -> Workspace:
    """Make a workspace whose pipelines are its own: what the package ships may change."""
    made = Workspace.create(root)
    for path in made.pipelines_dir.glob("*.toml"):
        path.unlink()
    (made.pipelines_dir / "depth.toml").write_text(DEPTH_PIPELINE)
    (made.pipelines_dir / "colour.toml").write_text(COLOR_PIPELINE)
    return made


@pytest.fixture
def workspace(tmp_path: Path, sample_bags: dict[str, Path]) -> Workspace:
    """A new workspace with links to the sample bags."""
    made = make_workspace(tmp_path / "workspace")
    for name, path in sample_bags.items():
        (made.recordings_dir / f"{name}.bag").symlink_to(path)
    return made


COLOR_RECORDINGS = (
    "GreenTowel_Corner_01_pi16_0.5_B1",
    "GreenTowel_Corner_02_pi16_0.5_B1",
    "MyScarf_Free_pi16_0.5_B2",
)


@pytest.fixture
def color_workspace(tmp_path: Path) -> Workspace:
    """A workspace with three recordings across the view, two of one camera position, whose empty scene is there.

    The third shows its own empty scene for three frames, and backgrounds.csv says so.
    """
    made = make_workspace(tmp_path / "color")
    *_, third = COLOR_RECORDINGS
    for seed, name in enumerate(COLOR_RECORDINGS):
        write_color_recording(made.recordings_dir / f"{name}.bag", seed=seed, empty_frames=3 * (name == third))
    write_color_recording(made.recordings_dir / "camera_default_0.bag", empty_frames=6, seed=9)
    (made.catalog_dir / "backgrounds.csv").write_text(
        f"topics_file,source,from_s,to_s\n1,camera_default_0,,\n2,{third},0,0.09\n"
    )
    return made


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of real recordings; tests that ask for it are skipped where there is none."""
    folder = os.environ.get("GARMENT_REAL_DATA")
    if not folder:
        pytest.skip("GARMENT_REAL_DATA names no folder of real recordings")
    return Path(folder)
