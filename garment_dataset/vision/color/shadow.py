"""Tells the garment from the shadows that it, the gripper and the arm cast on the wall.

What no shadow explains (:class:`.Seen`) and hangs from the gripper is garment: its *own* pixels. What could be a shadow
is sorted by surfaces, parts of the picture within which brightness makes no step:

- What is reached from the lit wall without a step is wall: penumbras are soft.
- A surface with an edge to the wall belongs to the garment if its own pixels surround it, as they do stripes and
  checks of the wall's hue, or if it differs less from them than from the wall and the garment shows such a grey within
  its outline. Otherwise it is a shadow with sharp edges, of a small lamp.
- Where nothing but such surfaces hangs from the gripper, they are the garment: grey cloth before a white wall, told by
  its edges alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import cv2
import numpy as np

from garment_dataset.vision.color.discs import closed_by_disc, dilated_by_disc
from garment_dataset.vision.color.masks import bounding_box, grown, looked_up, square
from garment_dataset.vision.color.seen import dark_lines
from garment_dataset.vision.color.surfaces import Surface, surfaces_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray, ByteMask
    from garment_dataset.vision.color.masks import Box
    from garment_dataset.vision.color.seen import Plane, Seen


# Lengths and areas are of half-size pixels, some 4 mm at the garment. Chosen on wide draws of `garment simulate`
_SMOOTH_PX = 1.5  # brightness, before steps are looked for
_STEP_NOISE, _LEAST_STEP_LEVELS = 4.0, 6.0  # a difference within 3 x 3 pixels that is an edge
_LEAST_LIT_PX = 60  # of full light that make a surface wall
_SPECK_PX = 6  # smaller groups of pixels are noise
_BRIDGE_PX = 25  # how far apart the garment's own pixels may lie: fields of a pattern, up to 10 cm
_LEAST_OWN_PX = 50
_LEAST_SURFACE_PX = 20
_SURROUNDED = 0.5
_LEAST_CONTACT = 0.05
_SHALLOWEST = 0.7  # light that a single lamp's shadow leaves; what is darker needs no other sign of being cloth
_SEAM_PX = 7  # how far from the garment pixels of no surface may belong to it
_WALL_PX = 7  # side of the square within which the wall around is looked at
_LEAST_STRIPE_PX = (5, 2)  # lower ones are closed in full size
_STRIPE_PX = 21  # height of a stripe of the wall's very colour, between the garment's own
_GREY_BINS, _GREY_LIKELY, _LEAST_GREY_PX = 50, 0.02, 8  # of full light; share of the garment
_OUTLINE_PX = 13
_EDGE_PX = 3  # how broad a blurred edge is, from where it is surely garment
_GAP_PX = 21  # how far apart parts of a thin sheet are seen


class Sorted(NamedTuple):
    """What is garment, in half size.

    Parameters
    ----------
    garment : (h, w) uint8
        1 where the garment is, 2 where it only must be, between its parts; may be of several parts, and empty.
    edges : (h, w) uint8
        1 where it may go on: its blurred edges, and gaps of thin parts, as far as they are nothing else.
    by_edges_alone : bool
        Whether all of it could be a shadow.
    doubtful_px : int
        Pixels beside it that were taken for a shadow with sharp edges, but could be cloth.
    """

    garment: ByteMask
    edges: ByteMask
    by_edges_alone: bool
    doubtful_px: int


def garment_in(seen: Seen, cut: BoolArray, near: BoolArray | None) -> Sorted:
    """Mark the garment, in half size.

    Parameters
    ----------
    seen : Seen
        The frame against the empty scene.
    cut : (h, w) bool
        Where no garment can be: above the gripper, at it, and outside of the clipping mask.
    near : (h, w) bool, optional
        Surroundings of the gripper's end point, where the garment must begin; anywhere by default.
    """
    sorting = _Sorting(seen, cut, _own(seen, cut, near))
    has_own = bool(np.count_nonzero(sorting.own) >= _LEAST_OWN_PX)
    if has_own:
        sorting.sort()
        garment = _bytes(sorting.garment)
        box = bounding_box(garment, _SEAM_PX)
        garment[box] |= sorting.seams(box)
    else:
        everywhere = slice(None), slice(None)
        garment = _bytes(sorting.own | _hanging(_opened(sorting.edges(everywhere)), near))
    edges = np.zeros(garment.shape, np.uint8)
    if garment.any():
        box = bounding_box(garment, 1)
        garment[box] = _filled(garment[box], seen, box)
        box = bounding_box(garment, max(_GAP_PX // 2, _EDGE_PX))
        nothing_else = ~(sorting.wall[box] | cut[box]) & (garment[box] == 0)
        edges[box] = _around(np.minimum(garment[box], np.uint8(1))) & _bytes(nothing_else)
    return Sorted(garment, edges, not has_own, sorting.doubtful_px)


def _around(there: ByteMask) -> ByteMask:
    """Mark what is close to the garment, or between its parts."""
    closed = closed_by_disc(there, _GAP_PX)
    return np.maximum(closed, _bytes(cv2.dilate(there, square(2 * _EDGE_PX + 1))))


def _bytes(mask: NDArray[Any]) -> ByteMask:
    return np.asarray(mask, np.uint8)


def _opened(mask: BoolArray) -> ByteMask:
    return _bytes(cv2.morphologyEx(_bytes(mask), cv2.MORPH_OPEN, square(2)))


def _own(seen: Seen, cut: BoolArray, near: BoolArray | None) -> BoolArray:
    """Mark what no shadow explains and hangs from the gripper, be it by fields of a pattern that one explains."""
    other = _bytes((~seen.like | dark_lines(seen)) & ~cut)
    own = np.zeros(other.shape, np.bool_)
    count, labels = cv2.connectedComponents(other, connectivity=8)
    there = other.view(np.bool_)
    is_speck = np.bincount(labels[there], minlength=count) < _SPECK_PX
    is_speck[0] = True
    other = _bytes(looked_up(~is_speck, labels))
    box = bounding_box(other, _BRIDGE_PX // 2)
    if not is_speck.all():
        linked = dilated_by_disc(other[box], _BRIDGE_PX)
        own[box] = _hanging(other[box], None if near is None else near[box], linked)
    return own


def _hanging(mask: ByteMask, near: BoolArray | None, linked: ByteMask | None = None) -> BoolArray:
    """Keep the regions, joined by what links them, that come near the gripper; without one, the largest."""
    count, labels = cv2.connectedComponents(mask if linked is None else linked, connectivity=8)
    there = mask.astype(np.bool_)
    kept = np.zeros(count, np.bool_)
    if near is not None:
        kept[labels[near & there]] = True
    elif there.any():
        kept[np.argmax(np.bincount(labels[there]))] = True
    return np.asarray(looked_up(kept, labels) & there)


@dataclass(slots=True, eq=False)
class _Sorting:
    """What is known so far of each pixel.

    Parameters
    ----------
    seen : Seen
        The frame against the empty scene.
    cut : (h, w) bool
        Where no garment can be.
    own : (h, w) bool
        The garment's own pixels.
    """

    seen: Seen
    cut: BoolArray
    own: BoolArray
    garment: BoolArray = field(init=False)
    wall: BoolArray = field(init=False)
    surfaces: list[Surface] = field(init=False)
    grey: BoolArray = field(init=False)
    doubtful_px: int = 0

    def __post_init__(self) -> None:
        self.garment = self.own.copy()
        smoothed = cv2.GaussianBlur(self.seen.brightness, (5, 5), _SMOOTH_PX)
        step = cv2.dilate(smoothed, square(3)) - cv2.erode(smoothed, square(3))
        even = self.seen.like & (step <= max(_STEP_NOISE * self.seen.noise, _LEAST_STEP_LEVELS))
        smooth = _bytes(cv2.morphologyEx(_bytes(even), cv2.MORPH_OPEN, square(3)))
        _, labels = cv2.connectedComponents(smooth, connectivity=4)
        lit = self.seen.lit & smooth.view(np.bool_)
        self.wall, self.surfaces = surfaces_of(labels, lit, _LEAST_LIT_PX, _LEAST_SURFACE_PX)

    def sort(self) -> None:
        """Decide each surface; those without an edge to the wall wait until one beside them is wall."""
        self.grey = _greys(self.seen, self.own, self.cut)
        waiting = self.surfaces
        for _ in range(3):
            left = [surface for surface in waiting if not self._decide(surface)]
            if len(left) == len(waiting):
                break
            waiting = left
        for surface in waiting:
            self.wall[surface.box] |= surface.mask
            self.doubtful_px += int(np.count_nonzero(surface.mask))

    def _decide(self, surface: Surface) -> bool:
        ring = surface.ring & ~self.cut[surface.box]
        own, wall = ring & self.own[surface.box], ring & self.wall[surface.box]
        around, beside = np.count_nonzero(ring), np.count_nonzero(own)
        is_garment = False
        if beside > _LEAST_CONTACT * around:
            from_own, from_wall = surface.contrast(self.seen, own), surface.contrast(self.seen, wall)
            share = self.seen.share[surface.box][surface.mask]
            likely = bool(np.mean(_is_grey(share, self.grey)) > 0.5 or np.median(share) < _SHALLOWEST)
            is_garment = bool(beside > _SURROUNDED * around) or (from_own < from_wall < np.inf and likely)
            if not is_garment and not (from_wall < np.inf and np.count_nonzero(wall) > 2 * _LEAST_CONTACT * around):
                return False
            self.doubtful_px += 0 if is_garment else int(np.count_nonzero(surface.mask))
        (self.garment if is_garment else self.wall)[surface.box] |= surface.mask
        return True

    def edges(self, box: Box) -> BoolArray:
        """Mark what of a box could be a shadow, but has a light that no wall around has."""
        margin_px = _WALL_PX // 2
        around, inside = grown(box, margin_px, self.wall.shape)
        brightness, wall, window = self.seen.brightness[around], self.wall[around], square(_WALL_PX)
        low = cv2.erode(np.where(wall, brightness, np.float32(1e4)), window)[inside]
        high = cv2.dilate(np.where(wall, brightness, np.float32(-1e4)), window)[inside]
        margin, here = np.float32(3 * self.seen.noise), brightness[inside]
        explained = (
            self.wall[box] | self.garment[box] | self.cut[box] | ((here >= low - margin) & (here <= high + margin))
        )
        return np.asarray(self.seen.like[box] & ~explained)

    def seams(self, box: Box) -> ByteMask:
        """Mark what of a box lies on no surface, beside the garment and as grey as it."""
        around, inside = grown(box, 2, self.wall.shape)  # opening with 2 x 2 pixels looks so far
        grey = _is_grey(self.seen.share[around], self.grey)
        beside = _bytes(cv2.dilate(_bytes(self.garment[box]), square(2 * _SEAM_PX + 1)))
        return _opened(self.edges(around) & grey)[inside] & beside


def _greys(seen: Seen, own: BoolArray, cut: BoolArray) -> BoolArray:
    """Return which shares of light, in steps of 1/50, are shown by the garment where it has the wall's hue.

    Well within the outline of its own pixels, for at its edges the background mixes in.
    """
    box = bounding_box(_bytes(own), _OUTLINE_PX // 2)
    closed = closed_by_disc(_bytes(own[box]), _OUTLINE_PX)
    contours, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(closed, contours, -1, 1, cv2.FILLED)
    inside = cv2.erode(closed, square(5), borderType=cv2.BORDER_CONSTANT, borderValue=0).astype(np.bool_)
    grey = inside & seen.own_hue[box] & ~cut[box]
    counts = np.bincount(_bins(seen.share[box][grey]), minlength=2 * _GREY_BINS)
    near_counts = np.convolve(counts, np.ones(5, np.int64), "same")
    return np.asarray(near_counts >= max(_GREY_LIKELY * np.count_nonzero(inside), _LEAST_GREY_PX))


def _bins(share: Plane) -> NDArray[np.int64]:
    return np.clip(share * _GREY_BINS, 0, 2 * _GREY_BINS - 1).astype(np.int64)


def _is_grey(share: Plane, grey: BoolArray) -> BoolArray:
    return np.asarray(grey[_bins(share)])


def _filled(garment: ByteMask, seen: Seen, box: Box) -> ByteMask:
    """Close stripes of the wall's very colour, and holes that are none: the lit wall is not seen through them."""
    stripe = np.ones((_STRIPE_PX, 1), np.uint8)
    pad = _STRIPE_PX
    padded = cv2.copyMakeBorder(garment, pad, pad, pad, pad, cv2.BORDER_CONSTANT, value=0)
    striped = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, stripe)
    between = _bytes(cv2.morphologyEx(striped - padded, cv2.MORPH_OPEN, np.ones(_LEAST_STRIPE_PX, np.uint8)))
    between = between[pad:-pad, pad:-pad]
    filled = _bytes(cv2.morphologyEx(striped, cv2.MORPH_CLOSE, square(5))[pad:-pad, pad:-pad])
    labels = cv2.connectedComponents(1 - filled, connectivity=4)[1]
    rims = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    inner = np.ones(int(labels.max()) + 1, np.bool_)
    inner[rims] = inner[0] = False
    if inner.any():
        within = looked_up(inner, labels)
        dark = seen.brightness[box][within] < -3 * seen.noise
        area_px = np.bincount(labels[within], minlength=len(inner))
        dark_px = np.bincount(labels[within], dark, minlength=len(inner))
        holes = inner & ((2 * dark_px > area_px) | (area_px < 30))
        filled |= _bytes(looked_up(holes, labels))
    return np.asarray(filled + between, np.uint8)
