"""Points from depth images: the package beside plain numpy on the full cloud, in one run on the same frames.

The peer back-projects every pixel in float64, masks the cloud by the conditions of thesis 5.3.3 and 5.3.4, and averages
window by window. Both must give the same points. The default method, ``profile``, is timed beside them. Only ratios
count: milliseconds depend on the machine.

    python benchmarks/depth_points.py
"""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.engine.threads import one_thread
from garment_dataset.stages.depth_points import DepthPointsParams
from garment_dataset.vision.depth.cloud import Intrinsics
from garment_dataset.vision.depth.trace import trace_profiles, trace_windows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    Point = tuple[float, float, float]

CAMERA = Intrinsics(fx_px=570.3, fy_px=570.3, cx_px=319.5, cy_px=239.5)
GRIPPER_M = (0.01, -0.25, 1.065)
LENGTH_M = 0.64
PARAMS = DepthPointsParams(method="thesis")
TRACK = DepthPointsParams().track_settings()


def swinging_cloth(frame: int, rng: np.random.Generator) -> NDArray[np.uint16]:
    """Return a noisy depth image of a towel that swings in waves, before a wall: 640 x 480, levels 3 mm apart."""
    v, u = np.indices((480, 640))
    y_m = (v - CAMERA.cy_px) / CAMERA.fy_px * GRIPPER_M[2]
    below_m = y_m - GRIPPER_M[1]
    z_m = GRIPPER_M[2] + 0.05 * below_m * np.sin(0.2 * frame - 8 * below_m)
    there = (below_m >= -0.1) & (below_m <= LENGTH_M) & (np.abs((u - CAMERA.cx_px) / CAMERA.fx_px * z_m) < 0.2)
    z_mm = 1000 * np.where(there, z_m, 2.5) + rng.normal(0, 2, z_m.shape)
    z_mm = 3 * np.rint(z_mm / 3)
    z_mm[rng.random(z_m.shape) < 0.02] = 0
    depth_mm: NDArray[np.uint16] = z_mm.astype(np.uint16)
    return depth_mm


def plain_points_m(depth_mm: NDArray[np.uint16], gripper_m: Point) -> FloatArray:
    """Return the points of one frame, (3, r), step by step as the thesis writes it."""
    v, u = np.indices(depth_mm.shape)
    z_m = depth_mm / 1000
    x_m = z_m * ((u - CAMERA.cx_px) / CAMERA.fx_px)
    y_m = z_m * ((v - CAMERA.cy_px) / CAMERA.fy_px)
    cloud = np.stack([x_m.ravel(), y_m.ravel(), z_m.ravel()])
    cloud = cloud[:, (cloud[2] > 0) & (np.abs(cloud[2] - gripper_m[2]) <= PARAMS.band_half_width_m)]
    cloud = cloud[:, cloud[1] >= gripper_m[1]]
    cloud = cloud[:, np.abs(cloud[0] - gripper_m[0]) < PARAMS.strip_half_width_m]
    samples = []
    for y_i in np.arange(gripper_m[1], cloud[1].max(), PARAMS.sample_step_m):
        inside = cloud[:, np.abs(cloud[1] - y_i) < PARAMS.window_half_height_m]
        samples.append([inside[0].mean(), y_i, inside[2].mean()])
    chain = np.array(samples).T
    arc_m = np.append(0, np.cumsum(np.sqrt((np.diff(chain) ** 2).sum(axis=0))))
    middles_m = (np.arange(PARAMS.point_count) + 0.5) / PARAMS.point_count * arc_m[-1]
    return np.stack([np.interp(middles_m, arc_m, values) for values in chain])


def package_points_m(depth_mm: NDArray[np.uint16], gripper_m: Point) -> FloatArray:
    """Return the points of one frame, (3, r), with their uncertainties computed and dropped."""
    points = trace_windows(depth_mm, CAMERA, gripper_m, PARAMS.window_settings()).points
    assert points is not None
    return points.position_m


def profile_points(images: list[NDArray[np.uint16]]) -> None:
    """Trace all frames by the default method, as one recording."""
    stamps_ns = {frame: 33_000_000 * frame for frame in range(len(images))}
    trace_profiles(list(enumerate(images)), stamps_ns, CAMERA, dict.fromkeys(stamps_ns, GRIPPER_M), TRACK)


def main() -> None:
    """Time both on the same frames, in turns and in processor time, and compare what they give."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0] if __doc__ else None)
    parser.add_argument("--frames", type=int, default=24)
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    with one_thread():  # as in a build
        measure(options.frames, options.rounds)


def measure(frames: int, rounds: int) -> None:
    """Take the times and print them."""
    rng = np.random.default_rng(0)
    images = [swinging_cloth(frame, rng) for frame in range(frames)]

    seconds: dict[str, list[float]] = {"package": [], "plain numpy": []}
    for _ in range(rounds):
        for name, points_m in (("package", package_points_m), ("plain numpy", plain_points_m)):
            start = time.process_time()
            for depth_mm in images:
                points_m(depth_mm, GRIPPER_M)
            seconds[name].append((time.process_time() - start) / len(images))

    profiles_s = []
    for _ in range(rounds):
        start = time.process_time()
        profile_points(images)
        profiles_s.append((time.process_time() - start) / len(images))
    differences_m = [np.abs(package_points_m(image, GRIPPER_M) - plain_points_m(image, GRIPPER_M)) for image in images]
    print(f"{len(images)} frames, {rounds} rounds in turns; largest difference {np.max(differences_m):.1e} m")
    for name, taken_s in {**seconds, "profile": profiles_s}.items():
        median_s = float(np.median(taken_s))
        print(
            f"{name:12} {median_s * 1e6:8.0f} us per frame (best {min(taken_s) * 1e6:.0f}) {1 / median_s:8.0f} frames/s"
        )
    ratios = np.divide(seconds["plain numpy"], seconds["package"])
    print(f"ratio        {np.median(ratios):8.1f} (median over rounds)")


if __name__ == "__main__":
    main()
