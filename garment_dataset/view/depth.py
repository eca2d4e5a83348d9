"""A depth frame with the chain, the points and the gripper, and the garment's profile beside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure
    from numpy.typing import NDArray


POINT_COLORS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442")
POINT_MARKERS = ("o", "s", "^", "D", "v", "P", "X")
"""One for each point, from the gripper down: colours that the colour-blind tell apart (Okabe and Ito), and shapes."""

_ROOM_SHARE, _ROOM_M = 0.15, 0.01
"""Room beyond the garment's own depths in the scale of colours, and the least of it."""


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
        Depths farther than this from the gripper's are outside of the scale of colours in any case.
    """
    image, profile = figure.subplots(1, 2, width_ratios=(3, 2))
    points = frame.points.dropna(subset=["z_m"])
    figure.suptitle(f"{title}{_reasons(frame.points)}")
    _draw_image(image, frame, points, color_limits_m(frame, band_half_width_m))
    _draw_profile(profile, frame, points)


def _reasons(points: pd.DataFrame) -> str:
    """Say why points are missing, if any are."""
    missing = points[points["z_m"].isna()]
    counts = missing["reason"].value_counts()
    return "".join(f"; {count} without a point: {reason}" for reason, count in counts.items())


def color_limits_m(frame: DepthFrame, band_half_width_m: float) -> tuple[float, float]:
    """Return the depths between which colour changes: the garment's own, within the band around the gripper.

    Parameters
    ----------
    frame : DepthFrame
        What is drawn.
    band_half_width_m : float
        See :func:`draw_depth`.
    """
    centre_m = centre_depth_m(frame)
    near_m, far_m = centre_m - band_half_width_m, centre_m + band_half_width_m
    if frame.chain.empty:
        return near_m, far_m
    nearest_m, farthest_m = float(frame.chain["z_m"].min()), float(frame.chain["z_m"].max())
    room_m = max(_ROOM_SHARE * (farthest_m - nearest_m), _ROOM_M)
    return max(near_m, nearest_m - room_m), min(far_m, farthest_m + room_m)


def centre_depth_m(frame: DepthFrame) -> float:
    """Return the gripper's depth; without a gripper, the median of what is seen."""
    if frame.gripper is not None and not np.isnan(frame.gripper["z_m"]):
        return float(frame.gripper["z_m"])
    seen = frame.depth_mm[frame.depth_mm > 0]
    return float(np.median(seen)) * 1e-3 if seen.size else 1.0


def _draw_image(axes: Axes, frame: DepthFrame, points: pd.DataFrame, limits_m: tuple[float, float]) -> None:
    depth_m = np.where(frame.depth_mm == 0, np.nan, frame.depth_mm * 1e-3)
    axes.set_facecolor("0.85")
    # what is nearer or farther than the garment keeps out of its colours
    colors = depth_colors()
    shown = axes.imshow(depth_m, cmap=colors, vmin=limits_m[0], vmax=limits_m[1], interpolation="nearest")
    bar = axes.figure.colorbar(shown, ax=axes, orientation="horizontal", shrink=0.7, pad=0.08, extend="both")
    bar.set_label("depth [m]; light grey: no return, white: farther, black: nearer")
    u, v = project(frame.chain, frame.camera)
    axes.plot(u, v, color="white", linewidth=1, label="chain")
    u, v = project(points, frame.camera)
    axes.plot(u, v, color="none")
    for number, (point_u, point_v, point) in enumerate(zip(u, v, points["point"], strict=True)):
        _draw_point(axes, point_u, point_v, int(point), label="points, from the gripper" if not number else None)
    if frame.gripper is not None and not np.isnan(frame.gripper["z_m"]):
        u, v = project(frame.gripper.to_frame().T, frame.camera)
        axes.plot(u, v, "x", color="black", markersize=9, markeredgewidth=2, label="gripper")
    axes.set(xlabel="u [px]", ylabel="v [px]")
    axes.legend(loc="lower left", fontsize="small", facecolor="0.3", labelcolor="white")


def _draw_profile(axes: Axes, frame: DepthFrame, points: pd.DataFrame) -> None:
    axes.plot(frame.chain["z_m"], frame.chain["y_m"], color="0.4", linewidth=1, label="chain")
    numbers = points["point"].to_numpy(np.int64)
    places = points[["z_m", "y_m", "z_std_m", "y_std_m"]].to_numpy(np.float64)
    for index, (number, (z_m, y_m, z_std_m, y_std_m)) in enumerate(zip(numbers, places, strict=True)):
        label = None if index else "points, ±2 standard uncertainties"
        color = POINT_COLORS[(number - 1) % len(POINT_COLORS)]
        axes.errorbar(
            z_m, y_m, xerr=2 * z_std_m, yerr=2 * y_std_m, fmt="none", ecolor=color, capsize=3, elinewidth=2, label=label
        )
        _draw_point(axes, z_m, y_m, int(number))
    _draw_bridges(axes, frame.chain)
    if frame.gripper is not None:
        axes.plot(frame.gripper["z_m"], frame.gripper["y_m"], "x", color="black", markersize=9, label="gripper")
    axes.invert_yaxis()
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="z, forward [m]", ylabel="y, down [m]", title="profile")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), fontsize="small")


def _draw_point(axes: Axes, x: float, y: float, number: int, label: str | None = None) -> None:
    """Draw a point of its own shape and colour: neither alone tells it apart on every printer and to every eye."""
    style = (number - 1) % len(POINT_COLORS)
    axes.plot(x, y, POINT_MARKERS[style], color=POINT_COLORS[style], markersize=8, markeredgecolor="white", label=label)


def _draw_bridges(axes: Axes, chain: pd.DataFrame) -> None:
    """Mark the samples of the chain that no pixel carries."""
    bridged = chain[chain["pixels"] == 0]
    if len(bridged):
        axes.plot(bridged["z_m"], bridged["y_m"], ".", color="0.7", markersize=4, label="bridged: no pixels")


def depth_colors() -> Colormap:
    """Return the colours of depth: nearer than the limits is black, farther white."""
    from matplotlib import colormaps

    return colormaps["cividis_r"].with_extremes(under="black", over="white")


def project(rows: pd.DataFrame, camera: pd.Series[float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the pixels of 3-D rows, thesis eq. (5.6) solved for u and v.

    Parameters
    ----------
    rows : pandas.DataFrame
        With ``x_m``, ``y_m``, ``z_m``.
    camera : pandas.Series
        Row of ``camera``.

    Returns
    -------
    u, v : (N,) float64
        In pixels.
    """
    x, y, z = (rows[name].to_numpy(np.float64) for name in ("x_m", "y_m", "z_m"))
    return camera["fx_px"] * x / z + camera["cx_px"], camera["fy_px"] * y / z + camera["cy_px"]
