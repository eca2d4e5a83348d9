"""A depth frame with the chain, the points and the gripper, and the garment's profile beside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray


@dataclass(frozen=True)
class DepthFrame:
    """One depth frame and the rows of the tables that belong to it.

    Parameters
    ----------
    depth_mm : (H, W) uint16
        Canonical depth image.
    camera : pandas.Series
        Row of ``camera``.
    gripper : pandas.Series or None
        Row of ``gripper``.
    chain, points : pandas.DataFrame
        Rows of ``chains`` and ``points``.
    """

    depth_mm: NDArray[np.uint16]
    camera: pd.Series[float]
    gripper: pd.Series[float] | None
    chain: pd.DataFrame
    points: pd.DataFrame


def draw_depth(figure: Figure, frame: DepthFrame, title: str, *, band_half_width_m: float) -> None:
    """Draw a depth frame into an empty figure.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Some 12 by 6 inches.
    frame : DepthFrame
        What is drawn.
    title : str
        Stands above.
    band_half_width_m : float
        Depths farther than this from the gripper's are drawn pale.
    """
    image, profile = figure.subplots(1, 2, width_ratios=(3, 2))
    figure.suptitle(title)
    points = frame.points.dropna(subset=["z_m"])
    centre_m = _centre_m(frame)
    _draw_image(image, frame, points, centre_m, band_half_width_m)
    _draw_profile(profile, frame, points)


def _centre_m(frame: DepthFrame) -> float:
    if frame.gripper is not None and not np.isnan(frame.gripper["z_m"]):
        return float(frame.gripper["z_m"])
    seen = frame.depth_mm[frame.depth_mm > 0]
    return float(np.median(seen)) * 1e-3 if seen.size else 1.0


def _draw_image(axes: Axes, frame: DepthFrame, points: pd.DataFrame, centre_m: float, band_m: float) -> None:
    depth_m = np.where(frame.depth_mm == 0, np.nan, frame.depth_mm * 1e-3)
    limits = (centre_m - band_m, centre_m + band_m)
    axes.set_facecolor("0.85")
    shown = axes.imshow(depth_m, cmap="viridis_r", vmin=limits[0], vmax=limits[1], interpolation="nearest")
    bar = axes.figure.colorbar(shown, ax=axes, orientation="horizontal", shrink=0.7, pad=0.08)
    bar.set_label("depth [m]; grey: no return")
    u, v = _project(frame.chain, frame.camera)
    axes.plot(u, v, color="white", linewidth=1, label="chain")
    u, v = _project(points, frame.camera)
    axes.plot(u, v, "o", color="red", markersize=5, markeredgecolor="white", label="points")
    if frame.gripper is not None and not np.isnan(frame.gripper["z_m"]):
        u, v = _project(frame.gripper.to_frame().T, frame.camera)
        axes.plot(u, v, "x", color="black", markersize=9, markeredgewidth=2, label="gripper")
    axes.set(xlabel="u [px]", ylabel="v [px]")
    axes.legend(loc="lower left", fontsize="small", facecolor="0.3", labelcolor="white")


def _draw_profile(axes: Axes, frame: DepthFrame, points: pd.DataFrame) -> None:
    axes.plot(frame.chain["z_m"], frame.chain["y_m"], color="0.4", linewidth=1, label="chain")
    axes.errorbar(
        points["z_m"],
        points["y_m"],
        xerr=2 * points["z_std_m"],
        yerr=2 * points["y_std_m"],
        fmt="o",
        color="red",
        capsize=2,
        label="points, ±2 standard uncertainties",
    )
    if frame.gripper is not None:
        axes.plot(frame.gripper["z_m"], frame.gripper["y_m"], "x", color="black", markersize=9, label="gripper")
    axes.invert_yaxis()
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="z, forward [m]", ylabel="y, down [m]", title="profile")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), fontsize="small")


def _project(rows: pd.DataFrame, camera: pd.Series[float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the pixels of 3-D rows, thesis eq. (5.6) solved for u and v."""
    x, y, z = (rows[name].to_numpy(np.float64) for name in ("x_m", "y_m", "z_m"))
    return camera["fx_px"] * x / z + camera["cx_px"], camera["fy_px"] * y / z + camera["cy_px"]
