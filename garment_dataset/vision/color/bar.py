"""The stiff bar that a garment may hang from: a ruler across the gripper, which is no garment.

Where a bar hangs below the row of the gripper's end point, it is of a colour that the cloth further down does not
show, ends along a straight line through the gripper, and goes on along that line on the other side of it. The line is
that which parts the two colours best; what is above it is cut off, so that the cloth clamped to the bar stays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

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


def bar_above(
    frame: ColorImage, mean: FloatArray, mask: ByteMask, held: Held, gain: FloatArray | None = None
) -> BoolArray | None:
    """Find what of a garment's mask is a bar, and no garment.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        Colour image.
    mean : (H, W, 3) float
        The empty scene, in grey levels.
    mask : (H, W) uint8
        Garment and bar below the gripper's row, 0 or 1.
    held : Held
        Where the bar is held.
    gain : (3,) float64, optional
        Of each channel against the empty scene; 1 by default.

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
    smooth = np.asarray(cv2.GaussianBlur(frame[part], (3, 3), 0), np.uint8)
    found = _bar(smooth, np.ascontiguousarray(mask[part]), within, end - part[0].start)
    if found is None or not _goes_on(smooth, mean[part], np.ones(3) if gain is None else gain, *found, within):
        return None
    bar = np.zeros(mask.shape, np.bool_)
    bar[part] = found[0]
    return bar


def _surroundings(mask: ByteMask, held: Held, zone_px: int) -> Box:
    """Return a box around the mask that also holds its reflection at the gripper, as far up as a bar may be."""
    rows, columns = bounding_box(mask)
    reach = max(abs(columns.start - held.u_px), abs(columns.stop - held.u_px)) + zone_px
    return (
        slice(max(round(held.v_px) - zone_px, 0), rows.stop),
        slice(max(round(held.u_px - reach), 0), round(held.u_px + reach) + 1),
    )


def _bar(smooth: ColorImage, mask: ByteMask, held: Held, end: int) -> tuple[BoolArray, tuple[float, float]] | None:
    """Find what above row ``end`` of a part of the image may be a bar, and along which direction it lies."""
    v, u = np.nonzero(mask[:end])
    strange = _strange(smooth, mask, end, v, u)
    if np.count_nonzero(strange) < _LEAST_PX:
        return None
    along, down = (np.asarray(pixel - at, np.float64) for pixel, at in ((u, held.u_px), (v, held.v_px)))
    found = _best_line(along, down, strange, held)
    if found is None:
        return None
    above, turned = found
    bar = np.zeros(mask.shape, np.bool_)
    bar[v[above], u[above]] = True
    return bar, turned


def _strange(smooth: ColorImage, mask: ByteMask, end: int, v: NDArray[np.intp], u: NDArray[np.intp]) -> BoolArray:
    """Return which pixels v, u of the mask have colours that are likelier above row ``end`` than on the garment below.

    Colours are counted well inside the mask, if it is not too thin: at its edges the wall mixes in.
    """
    inner = np.asarray(cv2.erode(mask, square(3)), np.uint8)
    inner = inner if 2 * np.count_nonzero(inner) > np.count_nonzero(mask) else mask
    inside, bins = inner.astype(np.bool_), _bins(smooth)
    shown, cloth = bins[v, u].astype(np.intp), _frequency(bins[end:][inside[end:]])
    strange = (cloth[shown] < _SHOWN) & inside[v, u]
    if not strange.any():
        return np.asarray(strange)
    return np.asarray(_frequency(shown[strange])[shown] > cloth[shown])


def _bins(image: ColorImage) -> NDArray[np.uint16]:
    """Return the bin of each pixel's colour, (H, W)."""
    red, green, blue = cv2.split((image // np.uint8(_BIN)).astype(np.uint16))
    return np.asarray((red * np.uint16(_BINS) + green) * np.uint16(_BINS) + blue, np.uint16)


def _frequency(shown: NDArray[Any]) -> FloatArray:
    """Return which share of pixels has a colour or one beside it, by bin."""
    counts = np.zeros((_BINS + 2,) * 3, np.int32)
    counts[1:-1, 1:-1, 1:-1] = np.bincount(shown, minlength=_BINS**3).reshape(_BINS, _BINS, _BINS)
    counts = counts[:-2] + counts[1:-1] + counts[2:]
    counts = counts[:, :-2] + counts[:, 1:-1] + counts[:, 2:]
    counts = counts[:, :, :-2] + counts[:, :, 1:-1] + counts[:, :, 2:]
    return np.asarray(counts.ravel() / len(shown), np.float64)


def _best_line(
    along: FloatArray, down: FloatArray, strange: BoolArray, held: Held
) -> tuple[BoolArray, tuple[float, float]] | None:
    """Return what lies above the line that parts strange colours from the garment's best, and the line's direction."""
    edges = np.arange(-_SLACK_M * held.px_per_m, _SLACK_M * held.px_per_m + 0.5, 0.5)
    best, angle, edge = 0.0, 0.0, 0.0
    for angles_deg in (_ANGLES_DEG, _FINE_DEG):
        tried = angle + np.radians(angles_deg)
        distance = np.outer(np.cos(tried), down) - np.outer(np.sin(tried), along)
        # The first edge that is not above a pixel, of edges half a pixel apart; odd where the colour is strange
        index = np.clip(np.ceil((distance - edges[0]) * 2), 0, len(edges)).astype(np.intp)
        index += np.arange(len(tried))[:, np.newaxis] * (len(edges) + 1)
        counts = np.bincount((2 * index + strange).ravel(), minlength=2 * len(tried) * (len(edges) + 1))
        counts = counts.reshape(len(tried), -1, 2)
        sums = np.cumsum(counts[..., 1] - counts[..., 0], axis=1)[:, :-1]
        row, column = np.unravel_index(np.argmax(sums), sums.shape)
        if sums[row, column] > best:
            best, chosen, edge = float(sums[row, column]), float(tried[row]), float(edges[column])
        angle = chosen if best > 0 else 0.0
    above = down * np.cos(angle) - along * np.sin(angle) < edge
    size = np.count_nonzero(above)
    if best < _LEAST_PX or np.count_nonzero(strange[above]) < _PURE * size:
        return None
    return np.asarray(above), (math.cos(angle), math.sin(angle))


def _goes_on(
    smooth: ColorImage, mean: FloatArray, gain: FloatArray, bar: BoolArray, turned: tuple[float, float], held: Held
) -> bool:
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
    differs = np.abs(there - mean[other_v[free], other_u[free]] * gain).max(axis=1) > _DIFFERENT_LEVELS
    return bool(np.mean(alike & differs) > _GOES_ON)
