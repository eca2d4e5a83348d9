"""What the garment looks like while it hangs at rest: how long it is, and of which colour. Pure functions on arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.bags import Camera

_BAND_HALF_WIDTH_M = 0.3  # the garment is not farther before or behind the gripper (thesis 5.3.3: 0.27 m)
_ASIDE_M = 0.6
_LEAST_PIXELS = 400
_CLEAR_CHROMA, _GRAY_CHROMA = 24.0, 9.0  # CIELAB: what is surely coloured, and what surely is not
_OPPOSED_DEG = 75.0  # hues farther apart are never called the same
_DARK, _LIGHT = 55.0, 45.0  # L*: nothing black is lighter at its darkest tenth, nothing white darker at its lightest
_HUES_DEG = {"red": 30.0, "orange": 60.0, "yellow": 95.0, "green": 145.0, "blue": 280.0, "purple": 315.0, "pink": 0.0}
_ACHROMATIC = {"black", "white", "gray", "grey"}


class Region(NamedTuple):
    """The part of a depth image that hangs from the gripper.

    Parameters
    ----------
    points_m : (N, 3) float64
        Its pixels in the optical frame of the depth camera.
    length_m : float
        How far it reaches below the gripper.
    is_cut : bool
        Whether the image ends before it does: it is longer.
    """

    points_m: NDArray[np.float64]
    length_m: float
    is_cut: bool


class Color(NamedTuple):
    """What the pixels of a garment have in common, in CIELAB.

    Parameters
    ----------
    lightness, a, b : float
        Medians of L* (0 to 100), a* and b*.
    darkest, lightest : float
        10 % and 90 % quantile of L*.
    """

    lightness: float
    a: float
    b: float
    darkest: float
    lightest: float

    @property
    def chroma(self) -> float:
        """Distance from gray."""
        return float(np.hypot(self.a, self.b))

    def distance(self, other: Color) -> float:
        """Return the difference to another colour, lightness counting half: lamps change it."""
        return float(np.linalg.norm([(self.lightness - other.lightness) / 2, self.a - other.a, self.b - other.b]))

    def __str__(self) -> str:
        return f"L* {self.lightness:.0f}, a* {self.a:.0f}, b* {self.b:.0f}"


def hanging_region(depth_mm: NDArray[np.uint16], camera: Camera, gripper_m: NDArray[np.float64]) -> Region | None:
    """Find what hangs from the gripper in a depth image.

    Parameters
    ----------
    depth_mm : (H, W) uint16
        Depth, 0 for no return.
    camera : Camera
        Of the image.
    gripper_m : (3,) float64
        End point of the gripper in its optical frame.

    Returns
    -------
    Region or None
        None when nothing of that size does.
    """
    height_px, width_px = depth_mm.shape
    z_m = depth_mm / 1e3
    x_m = (np.arange(width_px) - camera.cx_px)[None, :] / camera.fx_px * z_m
    y_m = (np.arange(height_px) - camera.cy_px)[:, None] / camera.fy_px * z_m
    near = (depth_mm > 0) & (np.abs(z_m - gripper_m[2]) < _BAND_HALF_WIDTH_M)
    near &= (y_m > gripper_m[1]) & (np.abs(x_m - gripper_m[0]) < _ASIDE_M)
    near_u8 = cv2.morphologyEx(near.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(near_u8, connectivity=8)
    top_m = np.where(near, np.hypot(x_m - gripper_m[0], y_m - gripper_m[1]), np.inf)
    if not np.isfinite(top_m.min()) or top_m.min() > 0.1:
        return None
    label = labels[np.unravel_index(top_m.argmin(), top_m.shape)]
    found = near & (labels == label)
    if label == 0 or found.sum() < _LEAST_PIXELS:
        return None
    points_m = np.column_stack([each[found] for each in (x_m, np.broadcast_to(y_m, z_m.shape), z_m)])
    is_cut = bool(stats[label, cv2.CC_STAT_TOP] + stats[label, cv2.CC_STAT_HEIGHT] >= height_px - 2)
    return Region(points_m, float(np.quantile(points_m[:, 1], 0.999) - gripper_m[1]), is_cut)


def color_of(rgb: NDArray[np.uint8], camera: Camera, points_m: NDArray[np.float64]) -> Color | None:
    """Return the colour of points in an image; None when too few of them lie in it.

    Parameters
    ----------
    rgb : (H, W, 3) uint8
        The image.
    camera : Camera
        Of the image.
    points_m : (N, 3) float64
        In its optical frame.
    """
    u_px = np.rint(camera.fx_px * points_m[:, 0] / points_m[:, 2] + camera.cx_px).astype(int)
    v_px = np.rint(camera.fy_px * points_m[:, 1] / points_m[:, 2] + camera.cy_px).astype(int)
    within = (u_px >= 0) & (u_px < rgb.shape[1]) & (v_px >= 0) & (v_px < rgb.shape[0])
    if within.sum() < _LEAST_PIXELS:
        return None
    pixels = rgb[v_px[within], u_px[within]][None].astype(np.float32) / 255
    lightness, a, b = cv2.cvtColor(pixels, cv2.COLOR_RGB2LAB)[0].T
    darkest, middle, lightest = np.quantile(lightness, [0.1, 0.5, 0.9]).tolist()
    return Color(middle, float(np.median(a)), float(np.median(b)), darkest, lightest)


def contradicts(color: Color, words: str) -> bool | None:
    """Say whether a measured colour cannot be what a table calls it; None when that is no colour that is known.

    Parameters
    ----------
    color : Color
        Measured.
    words : str
        Such as ``red`` or ``black&white``: one of them is enough.
    """
    each = [word for word in "".join(c if c.isalpha() else " " for c in words.lower()).split() if word != "and"]
    if not each or not set(each) <= _ACHROMATIC | set(_HUES_DEG):
        return None
    return all(_contradicts(color, word) for word in each)


def _contradicts(color: Color, word: str) -> bool:
    if word in _HUES_DEG:
        hue_deg = float(np.degrees(np.arctan2(color.b, color.a)))
        apart_deg = abs((hue_deg - _HUES_DEG[word] + 180) % 360 - 180)
        return color.chroma < _GRAY_CHROMA or (color.chroma > _CLEAR_CHROMA and apart_deg > _OPPOSED_DEG)
    is_wrong = {"black": color.darkest > _DARK, "white": color.lightest < _LIGHT}.get(word, False)
    return is_wrong or color.chroma > _CLEAR_CHROMA
