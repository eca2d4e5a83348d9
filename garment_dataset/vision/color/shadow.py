"""Shadows that arm and garment cast on the wall behind: how much of its light each pixel of the background has.

A shadow darkens the wall at nearly constant hue, so that brightness and chromaticity, taken apart as by Horprasert et
al. (1999), tell it from cloth of another colour. Cloth of the wall's own hue, grey before a white wall, is told by its
edges: it hangs some decimetres before the wall, so that its shadow's edge is soft where its own is sharp. Whatever can
be reached from the lit wall without a step is wall, with less light. A dark patch with sharp edges all around is taken
for a shadow only if it is as flat as the lit wall and something that no shadow explains hangs from the gripper.

Sums are of integers, so that results depend on no order: light is counted in :data:`WHOLE` parts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from garment_dataset.vision.color.masks import square

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray, ByteMask, ColorImage, FloatArray

WHOLE = 1024
"""Full light."""

_FINE = 64  # parts of a grey level in half-size images
# Chosen on rendered garments and painted shadows: soft and hard, of one lamp and of two, tinted, 7 to 25 % deep
_DARKEST = WHOLE // 2  # no shadow in a lit room takes more than half of the light
_BRIGHTEST = round(1.02 * WHOLE)
_HUE_LEVELS, _TINT = 4.5, 0.2  # allowed difference of a channel: noise, and the second lamp's colour in the shadow
_STEP_LEVELS = 6.0  # a difference within 3 x 3 half-size pixels that is an edge
_LIT_LEVELS = 3.0
_LEAST_LIT_PX = 100  # half-size pixels of full light that make a region wall
_LEAST_PATCH_PX = 500  # half-size pixels of a shadow with sharp edges
_LEAST_HELD_PX = 50  # half-size pixels of what is surely garment
_FLATNESS = 6.0  # spread of a sharp-edged shadow against the lit wall's median deviation; 4.9 for equal normal noise
_SPREAD = (5, 95)  # percentiles
_GAP_PX = 7  # between lit and shadowed wall lies a border, up to this broad in half-size pixels
_STRONG_LEVELS = 14.0
_AS_GOOD_AS_LIT_LEVELS = 2.0
_WINDOWS_PX = (3, 5, 25, 81)  # for what is behind the garment, the nearest wall around; sums stay below 2^24


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """How the background is lit in one frame.

    Parameters
    ----------
    change : (H, W, 3) int16 or None
        What shadows add to the background's grey levels: 0 or less, up to 2 % more where the wall is brighter. None
        when there is no shadow.
    wall_like : (H, W) bool
        Whether the pixel has the wall's hue and no more than its light, so that it could be a shadow.
    """

    change: NDArray[np.int16] | None
    wall_like: BoolArray


class LightFinder:
    """Finds how the background is lit.

    Parameters
    ----------
    mean : (H, W, 3) float64
        Of the background, in grey levels.
    clip : (H, W) uint8, optional
        Where the wall is, not 0.
    """

    def __init__(self, mean: FloatArray, clip: ByteMask | None) -> None:
        self._mean = mean
        self._half_mean = _half(np.rint(mean * _FINE).astype(np.uint16)).astype(np.float32) / _FINE
        self._clip = None if clip is None else np.ascontiguousarray(clip[1::2, 1::2])

    def __call__(
        self, frame: ColorImage, drift: FloatArray, box: tuple[slice, slice], held: BoolArray | None = None
    ) -> Light:
        """Estimate the light in a part of a frame.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            Colour image.
        drift : (3,) float64
            Change of the whole picture's brightness, in grey levels.
        box : (slice, slice)
            Rows and columns of the part, with even ends; it should show lit wall around what is in it.
        held : (H, W) bool, optional
            Surroundings of the gripper's end point. Without them no shadow with sharp edges is looked for.

        Returns
        -------
        Light
            Of the part.
        """
        small = tuple(slice(part.start // 2, part.stop // 2) for part in box)
        expected = self._half_mean[small] + drift.astype(np.float32)
        np.maximum(expected, 1, out=expected)
        seen = _Seen.of(_half(frame[box]), expected)
        if self._clip is not None:
            seen.passable &= self._clip[small]
        near = None if held is None else held[box][1::2, 1::2]
        wall = _wall(seen, near)
        share = _spread_out(seen, wall)
        like = np.asarray(cv2.resize(seen.like, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST), np.uint8)
        if (share == WHOLE).all():
            return Light(None, like.view(np.bool_))
        full = cv2.GaussianBlur(cv2.resize(share, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST), (3, 3), 0)
        less = full.astype(np.float32) / WHOLE - 1
        change = np.rint((self._mean[box] + drift) * less[..., np.newaxis]).astype(np.int16)
        return Light(change, like.view(np.bool_))


def _half(image: NDArray[np.uint16] | ColorImage) -> NDArray[np.uint16]:
    """Return means over 2 x 2 pixels, in 1/64 of what a colour image of bytes holds."""
    fine = image if image.dtype == np.uint16 else image.astype(np.uint16) * np.uint16(_FINE)
    return np.asarray(cv2.resize(fine, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint16)


@dataclass(slots=True, eq=False)
class _Seen:
    """What is seen in half size.

    Parameters
    ----------
    share : (h, w) uint16
        Brightness against that expected, in parts of :data:`WHOLE`.
    level : (h, w) float32
        Expected grey level.
    like, passable, other : (h, w) uint8
        1 where a shadow could be; where moreover brightness changes little; where there is surely no shadow.
    """

    share: NDArray[np.uint16]
    level: FloatArray
    like: ByteMask
    passable: ByteMask
    other: ByteMask

    @classmethod
    def of(cls, image: NDArray[np.uint16], expected: FloatArray) -> _Seen:
        """Take brightness and hue apart: the share a that minimises ``abs(I - a B)``, and what is left."""
        color = cv2.GaussianBlur(image, (3, 3), 0).astype(np.float32) / _FINE
        b0, b1, b2 = cv2.split(expected)
        i0, i1, i2 = cv2.split(color)
        a = (i0 * b0 + i1 * b1 + i2 * b2) / (b0 * b0 + b1 * b1 + b2 * b2)
        level = (b0 + b1 + b2) / np.float32(3)
        off = np.maximum(np.maximum(np.abs(i0 - a * b0), np.abs(i1 - a * b1)), np.abs(i2 - a * b2))
        share = np.rint(np.minimum(a, 4) * WHOLE).astype(np.uint16)
        allowed = _HUE_LEVELS + _TINT * np.maximum(1 - a, 0) * level
        like = ((off <= allowed) & (share > _DARKEST) & (share < _BRIGHTEST)).view(np.uint8)
        bright = np.rint(np.minimum(a * level, 900) * _FINE).astype(np.uint16)
        step = cv2.dilate(bright, square(3)) - cv2.erode(bright, square(3))
        passable = np.asarray(
            cv2.morphologyEx(like & (step <= _STEP_LEVELS * _FINE), cv2.MORPH_OPEN, square(3)), np.uint8
        )
        other = (off > _STRONG_LEVELS) | (share <= _DARKEST) | (share > 1.04 * WHOLE)
        return cls(share, level, like, passable, other.view(np.uint8))


def _wall(seen: _Seen, near: BoolArray | None) -> ByteMask:
    """Mark the wall, lit or not."""
    off_levels = (seen.share.astype(np.float32) - WHOLE) * seen.level / WHOLE
    lit = (np.abs(off_levels) < _LIT_LEVELS) & seen.passable.view(np.bool_)
    count, found, stats, _ = cv2.connectedComponentsWithStats(seen.passable, connectivity=4, ltype=cv2.CV_32S)
    labels = np.asarray(found, np.int32)
    is_wall = np.bincount(labels.ravel(), lit.ravel(), minlength=count) >= _LEAST_LIT_PX
    is_wall[0] = False
    patches = (
        _flat_patches(seen, labels, stats[:, cv2.CC_STAT_AREA], is_wall, lit)
        if near is not None and _is_held(seen, near)
        else []
    )
    for patch in patches:
        is_wall[patch] = True
    wall = np.take(is_wall, labels).astype(np.uint8)
    wall |= _between(seen, wall)
    if patches:
        wall |= _partly_shadowed(seen, np.isin(labels, patches), patches, labels)
    return np.asarray(wall, np.uint8)


def _is_held(seen: _Seen, near: BoolArray) -> bool:
    """Whether something that no shadow explains hangs from the gripper."""
    other = cv2.morphologyEx(seen.other, cv2.MORPH_OPEN, square(2))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(other, connectivity=8)
    touching = np.unique(labels[near])
    return bool((stats[touching[touching > 0], cv2.CC_STAT_AREA] >= _LEAST_HELD_PX).any())


def _flat_patches(
    seen: _Seen, labels: NDArray[np.int32], areas_px: NDArray[Any], is_wall: BoolArray, lit: BoolArray
) -> list[int]:
    """Return the labels of large dark patches whose brightness varies as little as that of the lit wall."""
    if not lit.any():
        return []
    share = seen.share.astype(np.float32) / np.float32(WHOLE)
    noise = np.median(np.abs(share[lit] - 1) * seen.level[lit])
    large = np.flatnonzero(~is_wall & (areas_px >= _LEAST_PATCH_PX))
    patches = []
    for label in large[large > 0].tolist():
        patch = (labels == label).view(np.uint8)
        inside = np.asarray(cv2.erode(patch, square(7), borderType=cv2.BORDER_CONSTANT, borderValue=0), np.uint8)
        if np.count_nonzero(inside) >= _LEAST_PATCH_PX // 2 and _spread(share, seen.level, inside) <= _FLATNESS * noise:
            patches.append(label)
    return patches


def _spread(share: NDArray[np.float32], level: FloatArray, where: ByteMask) -> float:
    """Return how far brightness varies, in grey levels; the wall's own shading does not count."""
    low, high = np.percentile(share[where.view(np.bool_)], _SPREAD)
    return float((high - low) * level[where.view(np.bool_)].mean())


def _between(seen: _Seen, wall: ByteMask) -> ByteMask:
    """Mark the border between lit and shadowed wall: of the wall's hue, and no darker than the darker side."""
    window = square(_GAP_PX)
    darkest = cv2.erode(np.where(wall, seen.share, 4 * WHOLE).astype(np.uint16), window)
    brightest = cv2.dilate(np.where(wall, seen.share, 0).astype(np.uint16), window)
    margin = 2 * WHOLE / seen.level
    step = (brightest.astype(np.float32) - darkest) * seen.level > 5 * WHOLE
    inside = (seen.share >= darkest - margin) & (seen.share <= brightest + margin) & step
    closed = np.asarray(cv2.morphologyEx(wall, cv2.MORPH_CLOSE, window), np.uint8)
    border = closed & seen.like & inside.view(np.uint8)
    return np.asarray(cv2.morphologyEx(border | wall, cv2.MORPH_OPEN, square(2)), np.uint8)


def _partly_shadowed(seen: _Seen, hard: BoolArray, patches: list[int], labels: NDArray[np.int32]) -> ByteMask:
    """Mark what has the wall's hue near shadows with sharp edges, and is not darker than they are."""
    darkest = min(float(np.median(seen.share[labels == patch])) for patch in patches)
    near = np.asarray(cv2.dilate(hard.view(np.uint8), square(21)), np.uint8)
    lighter = (seen.share >= darkest - 3 * WHOLE / seen.level).view(np.uint8)
    return np.asarray(cv2.morphologyEx(near & seen.like & lighter, cv2.MORPH_OPEN, square(2)), np.uint8)


def _spread_out(seen: _Seen, wall: ByteMask) -> NDArray[np.uint16]:
    """Return the light of the wall, and behind other things that of the wall around them.

    What is as good as lit is lit: so a frame without shadows is compared with the background as it is.
    """
    found = np.where(wall, np.minimum(seen.share, _BRIGHTEST), 0).astype(np.uint16)
    light = np.full(found.shape, WHOLE, np.uint16)
    unknown = np.ones(found.shape, np.bool_)
    for side in _WINDOWS_PX:
        sums, counts = (
            cv2.boxFilter(part, cv2.CV_32F, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)
            for part in (found, wall)
        )
        known = unknown & (counts > 0.04 * side * side) & (wall.view(np.bool_) | (side > _WINDOWS_PX[0]))
        light[known] = np.rint(sums[known] / counts[known]).astype(np.uint16)
        unknown &= ~known
        if not unknown.any():
            break
    off_levels = (light.astype(np.float32) - WHOLE) * seen.level
    light[np.abs(off_levels) < _AS_GOOD_AS_LIT_LEVELS * WHOLE] = WHOLE
    return light
