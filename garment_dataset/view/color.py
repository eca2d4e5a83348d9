"""A colour frame with the outline of the mask, its axes, the central curve and the gripper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

_PALE = 0.45


@dataclass(frozen=True)
class ColorFrame:
    """One colour frame and the rows of the tables that belong to it.

    Parameters
    ----------
    pixels : (H, W, 3) uint8
        Canonical colour image.
    silhouette : mapping of str to object
        Row of ``silhouettes``.
    curve : pandas.DataFrame
        Rows of ``central_curves``.
    """

    pixels: NDArray[np.uint8]
    silhouette: Mapping[str, Any]
    curve: pd.DataFrame


def draw_color(figure: Figure, frame: ColorFrame, title: str) -> None:
    """Draw a colour frame into an empty figure: the whole image, and the garment enlarged.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Some 12 by 6 inches.
    frame : ColorFrame
        What is drawn.
    title : str
        Stands above.
    """
    whole, close = figure.subplots(1, 2, width_ratios=(3, 2))
    found = frame.silhouette["mask"] is not None
    figure.suptitle(title if found else f"{title}: no silhouette, {frame.silhouette['reason']}")
    for axes in (whole, close):
        axes.imshow(frame.pixels, interpolation="nearest")
        axes.set(xlabel="u [px]", ylabel="v [px]")
        if found:
            _draw_outline(axes, frame.silhouette)
            _draw_axes(axes, frame.silhouette)
            _draw_curve(axes, frame.curve)
        _draw_gripper(axes, frame.silhouette)
    if found:
        u, v, width, height = (frame.silhouette[f"box_{name}_px"] for name in ("u", "v", "width", "height"))
        margin = 12
        close.set(xlim=(u - margin, u + width + margin), ylim=(v + height + margin, v - margin))
    height_px, width_px = frame.pixels.shape[:2]
    whole.set(xlim=(-0.5, width_px - 0.5), ylim=(height_px - 0.5, -0.5))  # axes may reach beyond the image
    whole.legend(loc="lower left", fontsize="small", facecolor="0.3", labelcolor="white")


def draw_clip(
    figure: Figure, mean: NDArray[np.float64], mask: NDArray[np.bool_], polygon: Sequence[tuple[float, float]]
) -> None:
    """Draw the empty scene, pale where no garment is looked for, with the polygon around the rest.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Empty.
    mean : (H, W, 3) float64
        Mean of the background, in grey levels.
    mask : (H, W) bool
        Where a garment is looked for.
    polygon : sequence of (u, v)
        Its corners.
    """
    axes = figure.subplots()
    shown = mean / 255
    shown[~mask] = 1 - _PALE * (1 - shown[~mask])
    axes.imshow(shown, interpolation="nearest")
    u, v = np.array([*polygon, polygon[0]]).T
    axes.plot(u, v, "o-", color="red", markersize=3, linewidth=1, label="clip_polygon")
    axes.set(xlabel="u [px]", ylabel="v [px]")
    axes.legend(loc="lower left")


def _draw_curve(axes: Axes, curve: pd.DataFrame) -> None:
    """Draw the central curve white within black: seen on cloth of any colour, and by any eye."""
    axes.plot(curve["u_px"], curve["v_px"], color="black", linewidth=3.5)
    axes.plot(curve["u_px"], curve["v_px"], ".-", color="white", linewidth=1.5, markersize=4, label="central curve")


def _draw_outline(axes: Axes, silhouette: Mapping[str, Any]) -> None:
    u, v = (np.append(values, values[0]) for values in (silhouette["outline_u_px"], silhouette["outline_v_px"]))
    axes.plot(u, v, color="black", linewidth=2)
    axes.plot(u, v, color="#F0E442", linewidth=0.9, label="outline")


def _draw_axes(axes: Axes, silhouette: Mapping[str, Any]) -> None:
    """Draw both axes of the ellipse; v points down, the orientation is counter-clockwise as displayed."""
    centre = silhouette["centroid_u_px"], silhouette["centroid_v_px"]
    for name, turn in (("major", 0.0), ("minor", np.pi / 2)):
        angle, half = silhouette["orientation_rad"] + turn, silhouette[f"{name}_px"] / 2
        u, v = half * np.cos(angle), -half * np.sin(angle)
        label = "axes" if name == "major" else None
        axes.plot(
            [centre[0] - u, centre[0] + u],
            [centre[1] - v, centre[1] + v],
            "--",
            color="#56B4E9",
            linewidth=1.5,
            label=label,
        )


def _draw_gripper(axes: Axes, silhouette: Mapping[str, Any]) -> None:
    u, v = silhouette["gripper_u_px"], silhouette["gripper_v_px"]
    if not np.isnan(u):
        axes.plot(u, v, "x", color="black", markersize=9, markeredgewidth=2, label="gripper")
