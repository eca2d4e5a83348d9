"""The stiff bar that a garment may hang from: a ruler across the gripper, which is no garment.

Where a bar hangs below the row of the gripper's end point, it is of a colour that the cloth further down does not
show, ends along a straight line through the gripper, and goes on along that line on the other side of it. The line is
that which parts the two colours best; what is above it is cut off, so that the cloth clamped to the bar stays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from garment_dataset.vision.color.masks import bounding_box, square

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray, ByteMask, ColorImage, FloatArray
    from garment_dataset.vision.color.masks import Box

_ZONE_M = 0.10  # how far below the gripper a bar may hang: half a metre of it leans by 10 degrees, or points away
_SLACK_M = 0.02  # how far from the gripper's end point the bar may end: it is held anywhere across it
_BIN, _BINS = 8, 32  # grey levels by bin of a colour
_SHOWN = 0.004  # share of the cloth that has a colour, or one beside it
_LEAST_PX = 25
_PURE = 0.75  # of what is cut off, that the cloth does not show such a colour
_GRIPPER_M = 0.025  # half as broad as what hides the bar
_ALIKE_LEVELS, _DIFFERENT_LEVELS = 30.0, 16.0
_UNEVEN_LEVELS = 25.0
_GOES_ON = 0.6
_ANGLES_DEG = np.arange(-78.0, 79.0, 3.0)
_FINE_DEG = np.arange(-2.5, 2.6, 0.5)


@dataclass(frozen=True, slots=True)
class Held:
    """Where the gripper holds what hangs from it.

    Parameters
    ----------
    u_px, v_px : float
        Its end point.
    px_per_m : float
        How many pixels a metre is there.
    """

    u_px: float
    v_px: float
    px_per_m: float


def bar_above(frame: ColorImage, expected: FloatArray, mask: ByteMask, held: Held) -> BoolArray | None:
    """Find what of a garment's mask is a bar, and no garment.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        Colour image.
    expected : (H, W, 3) float
        The empty scene in this frame's light, in grey levels.
    mask : (H, W) uint8
        Garment and bar below the gripper's row, 0 or 1.
    held : Held
        Where the bar is held.

    Returns
    -------
    (H, W) bool or None
        Pixels of the bar; None when there is none, or none that can be told from the cloth.
    """
    zone_px = round(_ZONE_M * held.px_per_m)
    end = round(held.v_px) + zone_px
    if not mask[:end].any() or np.count_nonzero(mask[end:]) < _LEAST_PX:
        return None
    part = _surroundings(mask, held, zone_px)
    within = Held(held.u_px - part[1].start, held.v_px - part[0].start, held.px_per_m)
    found = _bar(frame[part], expected[part], np.ascontiguousarray(mask[part]), within, end - part[0].start)
    if found is None:
        return None
    bar = np.zeros(mask.shape, np.bool_)
    bar[part] = found
    return bar


def _surroundings(mask: ByteMask, held: Held, zone_px: int) -> Box:
    """Return a box around the mask that also holds its reflection at the gripper, as far up as a bar may be."""
    rows, columns = bounding_box(mask)
    reach = max(abs(columns.start - held.u_px), abs(columns.stop - held.u_px)) + zone_px
    return (
        slice(max(round(held.v_px) - zone_px, 0), rows.stop),
        slice(max(round(held.u_px - reach), 0), round(held.u_px + reach) + 1),
    )


def _bar(frame: ColorImage, expected: FloatArray, mask: ByteMask, held: Held, end: int) -> BoolArray | None:
    """Find the bar above row ``end`` in a part of the image."""
    smooth = np.asarray(cv2.GaussianBlur(frame, (3, 3), 0), np.uint8)
    strange = _strange(smooth, mask, end)
    v, u = np.nonzero(mask[:end])
    along, down = (np.asarray(pixel - at, np.float64) for pixel, at in ((u, held.u_px), (v, held.v_px)))
    found = _best_line(along, down, np.where(strange[v, u], 1, -1), held)
    if found is None:
        return None
    above, turned = found
    bar = np.zeros(mask.shape, np.bool_)
    bar[v[above], u[above]] = True
    return bar if _goes_on(smooth, expected, bar, turned, held) else None


def _strange(smooth: ColorImage, mask: ByteMask, end: int) -> BoolArray:
    """Mark colours that are likelier above row ``end`` than on the garment below it."""
    inner = np.asarray(cv2.erode(mask, square(3)), np.uint8)
    inner = inner if 2 * np.count_nonzero(inner) > np.count_nonzero(mask) else mask
    bins = (smooth // _BIN).astype(np.intp)
    index = (bins[..., 0] * _BINS + bins[..., 1]) * _BINS + bins[..., 2]
    inside = inner > 0
    cloth = _frequency(index[end:][inside[end:]])
    strange = np.asarray((cloth[index] < _SHOWN) & inside, np.bool_)
    strange[end:] = False
    if not strange.any():
        return strange
    return np.asarray(_frequency(index[strange])[index] > cloth[index])


def _frequency(shown: NDArray[np.intp]) -> FloatArray:
    """Return which share of pixels has a colour or one beside it, by bin."""
    counts = np.bincount(shown, minlength=_BINS**3).reshape(_BINS, _BINS, _BINS).astype(np.float64)
    for axis in range(3):
        padded = np.pad(counts, [(1, 1) if axis == other else (0, 0) for other in range(3)])
        low, middle, high = (np.take(padded, np.arange(_BINS) + shift, axis=axis) for shift in range(3))
        counts = low + middle + high
    return np.asarray(counts.ravel() / len(shown), np.float64)


def _best_line(
    along: FloatArray, down: FloatArray, weight: NDArray[np.intp], held: Held
) -> tuple[BoolArray, tuple[float, float]] | None:
    """Return what lies above the line that parts strange colours from the garment's best, and the line's direction."""
    if np.count_nonzero(weight > 0) < _LEAST_PX:
        return None
    edges = np.arange(-_SLACK_M * held.px_per_m, _SLACK_M * held.px_per_m + 0.5, 0.5)
    best, angle, edge = 0.0, 0.0, 0.0
    for angles_deg in (_ANGLES_DEG, _FINE_DEG):
        for tried in (angle + np.radians(angles_deg)).tolist():
            distance = down * math.cos(tried) - along * math.sin(tried)
            sums = np.cumsum(np.bincount(np.searchsorted(edges, distance), weight, len(edges) + 1))[:-1]
            if (most := float(sums.max())) > best:
                best, chosen, edge = most, tried, float(edges[np.argmax(sums)])
        angle = chosen if best > 0 else 0.0
    above = down * np.cos(angle) - along * np.sin(angle) < edge
    size = np.count_nonzero(above)
    if best < _LEAST_PX or np.count_nonzero(weight[above] > 0) < _PURE * size:
        return None
    return np.asarray(above), (math.cos(angle), math.sin(angle))


def _goes_on(smooth: ColorImage, expected: FloatArray, bar: BoolArray, turned: tuple[float, float], held: Held) -> bool:
    """Return whether it is of one colour, and there is more of it beyond the gripper, along the same line."""
    color = np.median(smooth[bar], axis=0)
    if np.median(np.abs(smooth[bar] - color).max(axis=1)) > _UNEVEN_LEVELS:
        return False
    v, u = np.nonzero(bar)
    cos, sin = turned
    along = (u - held.u_px) * cos + (v - held.v_px) * sin
    across = (v - held.v_px) * cos - (u - held.u_px) * sin
    other_u = np.rint(held.u_px - along * cos - across * sin).astype(np.intp)
    other_v = np.rint(held.v_px - along * sin + across * cos).astype(np.intp)
    inside = (other_u >= 0) & (other_u < bar.shape[1]) & (other_v >= 0) & (other_v < bar.shape[0])
    free = inside & (np.abs(other_u - held.u_px) > _GRIPPER_M * held.px_per_m)
    if np.count_nonzero(free) < _LEAST_PX:  # seen along it, all of it is behind or before the gripper
        return True
    there = smooth[other_v[free], other_u[free]].astype(np.float64)
    alike = np.abs(there - color).max(axis=1) < _ALIKE_LEVELS
    differs = np.abs(there - expected[other_v[free], other_u[free]]).max(axis=1) > _DIFFERENT_LEVELS
    return bool(np.mean(alike & differs) > _GOES_ON)
