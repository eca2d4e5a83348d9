"""How far a prediction is from the cloud that was seen, frame by frame, as sim-to-real studies draw it.

    python -m examples.estimator.distance SNAPSHOT CLOUDS FITTED HELD_BACK PICTURE

CLOUDS is what ``garment export clouds`` writes. The distance of a predicted point is that to the nearest point of the
cloud: the chain must lie in the cloth.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree  # type: ignore[import-untyped]

from examples.estimator.chain import simulate
from examples.estimator.fitting import fit
from examples.estimator.recording import Recording, read

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]


def distances_m(recording: Recording, displacement_m: FloatArray, clouds: Path) -> FloatArray:
    """Return the mean distance of the points from the cloud in each frame, (T,); NaN where there is no cloud.

    Parameters
    ----------
    recording : Recording
        Whose points.
    displacement_m : (T, r, 2) float64
        Where they are predicted to go, from rest, along y and z.
    clouds : Path
        Folder of the export.
    """
    arrays = np.load(clouds / recording.name / "clouds.npz")
    number = {int(stamp): k for k, stamp in enumerate(arrays["stamp_ns"])}
    found = np.full(len(recording.stamp_ns), np.nan)
    for frame, stamp_ns in enumerate(recording.stamp_ns.tolist()):
        if (k := number.get(stamp_ns)) is None:
            continue
        cloud_m = arrays["points_m"][arrays["offsets"][k] : arrays["offsets"][k + 1]]
        points_m = recording.rest_m + np.pad(displacement_m[frame], ((0, 0), (1, 0)))
        points_m = points_m[np.isfinite(points_m).all(axis=1)]
        if len(cloud_m) and len(points_m):
            found[frame] = cKDTree(cloud_m).query(points_m)[0].mean()
    return found


def main(snapshot: Path, clouds: Path, fitted: str, held_back: str, picture: Path) -> None:
    """Draw the distances of both recordings, those of measured points and of a rigid garment beside them."""
    from matplotlib.figure import Figure

    chain = fit(read(snapshot, fitted))
    figure = Figure(figsize=(7, 3), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for panel, name, title in zip(axes, (fitted, held_back), ("fitted", "held back"), strict=True):
        recording = read(snapshot, name)
        rigid_m = np.repeat(recording.gripper_m[:, None], recording.count, axis=1)
        lines = {
            "chain": (simulate(recording, chain.logarithms[None])[0], "#0072b2", "-"),
            "hanging rigidly": (rigid_m, "#d55e00", "--"),
            "measured points": (recording.points_m, "#000000", ":"),
        }
        for label, (displacement_m, color, style) in lines.items():
            panel.plot(
                recording.time_s, 1e3 * distances_m(recording, displacement_m, clouds), style, color=color, label=label
            )
        panel.set(title=f"{title}: {name}", xlabel="time since the gripper began to move [s]")
        panel.title.set_fontsize(8)
    axes[0].set(ylabel="distance from the cloud [mm]", yscale="log")
    axes[0].legend(fontsize=8)
    figure.savefig(picture, dpi=120, metadata={"Software": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], sys.argv[4], Path(sys.argv[5]))
