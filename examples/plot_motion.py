"""An estimator's view: read the kinematics of all depth recordings and draw the thesis' figures 5.12 and 5.13."""

from __future__ import annotations

import argparse
from pathlib import Path

from matplotlib.figure import Figure

from garment_dataset import load_features


def main() -> None:
    """Draw displacement and velocity along the optical axis over time, one row per recording."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("features", type=Path, help="folder of results")
    parser.add_argument("picture", type=Path, help="file to write")
    arguments = parser.parse_args()
    motion = load_features("kinematics", folder=arguments.features, axis="R")
    units = motion.attrs["units"]
    recordings = list(motion.groupby("recording"))
    figure = Figure(figsize=(12, 3.2 * len(recordings)), layout="constrained")
    rows = figure.subplots(len(recordings), 2, squeeze=False, sharex=True)
    for (left, right), (name, frames) in zip(rows, recordings, strict=True):
        for point, track in frames.groupby("point"):
            style = {"color": "red"} if point == 0 else {"color": "C0", "alpha": 0.3 + 0.12 * int(str(point))}
            label = "gripper" if point == 0 else f"point {point}"
            left.plot(track["time_s"], track["dz_m"], label=label, **style)
            right.plot(track["time_s"], track["vz_m_s"], **style)
        left.set(title=name, ylabel=f"displacement dz [{units['dz_m']}]")
        right.set(title=name, ylabel=f"velocity vz [{units['vz_m_s']}]")
        left.legend(fontsize="small", ncols=3)
    for axes in rows[-1]:
        axes.set_xlabel(f"time since motion onset [{units['time_s']}]")
    figure.savefig(arguments.picture, dpi=100)
    print(f"wrote {arguments.picture}")


if __name__ == "__main__":
    main()
