"""Silhouette of the garment before a known background (thesis 5.2.1, 5.2.2).

The coarse mask is thesis eq. (5.3), opened, closed, cut free of the gripper and reduced to its largest region, bit by
bit as defined. Its edge lies where the colour leaves the noise: outside the garment, by more than a pixel in a blurred
image. :func:`.refine_edges` moves it to where a pixel is half garment, half background. Shadows on the wall differ from
the background, too: :class:`.LightFinder` says what is garment and how much of its light the wall has left; within that
garment, the comparison is made with the wall in this light.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import cv2
import numpy as np

from garment_dataset.errors import PictureError
from garment_dataset.vision.color.background import Bounds, DriftEstimator, lattice
from garment_dataset.vision.color.bar import bar_above
from garment_dataset.vision.color.confidence import confidence, inner_part
from garment_dataset.vision.color.edges import color_distance, refine_edges
from garment_dataset.vision.color.light import GainEstimator, LightFinder
from garment_dataset.vision.color.masks import bounding_box, largest_component, open_close, square

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray, ByteMask, ColorImage, FloatArray
    from garment_dataset.vision.color.background import Background
    from garment_dataset.vision.color.bar import Held
    from garment_dataset.vision.color.confidence import Doubt
    from garment_dataset.vision.color.light import Light
    from garment_dataset.vision.color.masks import Box

Edge = Literal["half_contrast", "threshold"]

_CONTEXT_PX = 8  # rows above the gripper's end point that edges are decided with
_ELSEWHERE_PX = 7  # side of a square that noise does not fill
_CORE_PX = 9  # deeper inside, no pixel is background
_NO_DRIFT = np.zeros(3)


@dataclass(frozen=True, slots=True, eq=False)
class Silhouette:
    """What one frame shows.

    Parameters
    ----------
    mask : (H, W) bool
        One 8-connected region; all False when nothing is found.
    confidence : float or None
        About the intersection over union to expect: see :func:`.confidence`. None without a mask or ``shadows``.
    doubt : str or None
        What lowers it most, where it is low.
    is_elsewhere : bool
        Whether there is no mask because what differs from the background does not come near the gripper.
    """

    mask: BoolArray
    confidence: float | None = None
    doubt: Doubt | None = None
    is_elsewhere: bool = False


class BackgroundSubtractor:
    """Finds the garment in frames of one camera position.

    Parameters
    ----------
    background : Background
        Model of the empty scene.
    clip : (H, W) bool, optional
        Where the garment can be; everywhere by default.
    alpha : float
        Allowed difference from the mean, in standard deviations; thesis eq. (5.3).
    min_sigma : float
        Smallest standard deviation to assume, in grey levels.
    open_px, close_px : int
        Sides of the squares that open and close the mask; odd. What holds no square of ``open_px`` is lost.
    edge : str
        ``half_contrast`` to refine the edges, ``threshold`` for the thesis' mask.
    shadows : bool
        Whether the wall may have less light than in the empty scene.

    Raises
    ------
    PictureError
        If the clipping mask is of another size than the background, or empty.
    """

    def __init__(
        self,
        background: Background,
        clip: BoolArray | None = None,
        *,
        alpha: float = 3.0,
        min_sigma: float = 2.0,
        open_px: int = 5,
        close_px: int = 5,
        edge: Edge = "half_contrast",
        shadows: bool = False,
    ) -> None:
        size = background.mean.shape[:2]
        if open_px % 2 == 0 or close_px % 2 == 0:
            raise ValueError(f"open_px and close_px must be odd, not {open_px} and {close_px}")
        if clip is not None and clip.shape != size:
            raise PictureError("clipping mask of another size than the image", expected=size, found=clip.shape)
        if clip is not None and not clip.any():
            raise PictureError("clipping mask that leaves nothing of the image")
        self._mean = np.ascontiguousarray(background.mean)
        self._clip = None if clip is None else clip.view(np.uint8)
        self._sides_px, self._edge = (open_px, close_px), edge
        self._bounds = Bounds.of(background, alpha=alpha, min_sigma=min_sigma, clip=clip)
        self._pitch_px = max(1, open_px // 3 if open_px >= 6 else open_px // 2)
        self._lattice_bounds = self._bounds.lattice(self._pitch_px)
        self._drift = DriftEstimator(background, clip)
        self._gain = GainEstimator(background, clip)
        self._light = LightFinder(background.mean) if shadows else None

    def drift(self, frame: ColorImage) -> FloatArray:
        """Estimate the change of brightness against the background.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            Colour image.

        Returns
        -------
        (3,) float64
            Grey levels by channel: see :class:`DriftEstimator`. With ``shadows`` brightness changes by a factor, and
            these are the levels of a pixel of median brightness: see :class:`.GainEstimator`. NaN when unknown.
        """
        return self._drift(frame) if self._light is None else (self._gain(frame) - 1) * self._gain.reference

    def find(
        self,
        frame: ColorImage,
        *,
        drift: FloatArray | None = None,
        top_v_px: float | None = None,
        gripper: BoolArray | None = None,
        near: BoolArray | None = None,
        held: Held | None = None,
    ) -> Silhouette:
        """Mark the garment.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            Colour image.
        drift : (3,) float64, optional
            Change of brightness to allow for, in grey levels; the coarse mask takes its nearest integer.
        top_v_px : float, optional
            Row of the gripper's end point; what lies above is removed.
        gripper : (H, W) bool, optional
            Pixels of the gripper, to be removed too.
        near : (H, W) bool, optional
            Surroundings of the gripper's end point, where the garment must begin; anywhere by default.
        held : Held, optional
            Where a bar that the garment hangs on may be; there is none by default. Looked for with ``shadows`` only.

        Returns
        -------
        Silhouette
            The largest region, of those that come near the gripper.

        Raises
        ------
        ValueError
            If the drift is NaN: such a frame cannot be compared with the background.

        Notes
        -----
        The gripper is removed before the largest region is chosen, other than in the thesis: a cut can leave several
        regions, and the arm is no garment, however large.
        """
        change = np.zeros(3) if drift is None else drift
        if not np.isfinite(change).all():
            raise ValueError("the drift of this frame is unknown")
        top = 0 if top_v_px is None else min(max(math.ceil(top_v_px), 0), frame.shape[0])
        if self._light is not None:
            return self._find_lit(frame, 1 + change / self._gain.reference, top, gripper, near, held)
        refined = self._edge == "half_contrast"
        shift = np.rint(change).astype(np.int16)
        mask = np.zeros(frame.shape[:2], np.uint8)
        box = self._search(frame, shift, max(top - _CONTEXT_PX, 0) if refined else top)
        if box is None:
            return Silhouette(mask.view(np.bool_))
        marked = np.minimum(open_close(self._bounds[box].outside(frame[box], shift), *self._sides_px), np.uint8(1))
        if self._clip is not None:
            marked &= self._clip[box]
        below = _without(marked, box, top, gripper)
        mask[box] = largest_component(below, None if near is None else near[box])
        if refined and mask[box].any():
            # Smaller regions go. What was cut off stays until the edges are decided: a cut is no edge of the garment
            mask[box] |= marked - below
            mask = refine_edges(frame, self._mean, mask, change)
            box = bounding_box(mask)
            if self._clip is not None:
                mask[box] &= self._clip[box]
            mask[box] = largest_component(_without(mask[box], box, top, gripper), None if near is None else near[box])
        return Silhouette(mask.view(np.bool_), is_elsewhere=not mask.any() and bool(below.any()) and near is not None)

    def _find_lit(
        self,
        frame: ColorImage,
        gain: FloatArray,
        top: int,
        gripper: BoolArray | None,
        near: BoolArray | None,
        held: Held | None,
    ) -> Silhouette:
        """Mark the garment before a background that shadows fall on."""
        assert self._light is not None
        cut = np.zeros(frame.shape[:2], np.bool_) if self._clip is None else self._clip == 0
        cut[: max(top - _CONTEXT_PX, 0)] = True  # a cut is no edge of the garment
        light = self._light(frame, gain, cut, near)
        cut[:top] = True
        if gripper is not None:
            cut |= gripper
        mask = np.zeros(frame.shape[:2], np.uint8)
        if isinstance(light, np.ndarray):
            other = cv2.erode((~light & ~cut).view(np.uint8), square(_ELSEWHERE_PX))
            return Silhouette(mask.view(np.bool_), is_elsewhere=near is not None and bool(other.any()))
        box, picture = light.box, np.ascontiguousarray(frame[light.box])
        expected = light.expected(self._mean, gain)
        marked = self._within(light, picture, expected)
        marked[cut[box]] = 0
        mask[box] = largest_component(marked, None if near is None else near[box])
        if held is not None and (bar := bar_above(frame, self._mean, mask, held, gain)) is not None:
            mask[bar] = marked[bar[box]] = 0
            mask[box] = largest_component(mask[box], None if near is None else near[box])
        there = np.ascontiguousarray(mask[box])
        if not (area_px := np.count_nonzero(there)):
            return Silhouette(mask.view(np.bool_), is_elsewhere=near is not None)
        judged = confidence(
            there,
            color_distance(picture, expected, np.flatnonzero(inner_part(there))),
            light.pale,
            by_edges_alone=light.by_edges_alone,
            doubtful_px=light.doubtful_px,
            lost_px=int(np.count_nonzero(marked)) - int(area_px),
            noise=light.noise,
        )
        return Silhouette(mask.view(np.bool_), *judged)

    def _within(self, light: Light, picture: ColorImage, expected: FloatArray) -> ByteMask:
        """Mark what differs from the wall in its light, within what is garment."""
        garment, between = np.minimum(light.garment, np.uint8(1)), light.garment >> np.uint8(1)
        opened, closed = self._sides_px
        change = expected - self._mean[light.box]
        shift = np.rint(change, out=change).astype(np.int16)
        outside = self._bounds[light.box].outside(picture, shift)
        differs = np.minimum(open_close(outside, opened, closed), np.uint8(1))
        core = np.asarray(cv2.erode(garment, square(_CORE_PX), borderType=cv2.BORDER_CONSTANT, borderValue=0), np.uint8)
        coarse = np.asarray(open_close((differs & garment) | core | between, 1, closed) & garment, np.uint8)
        if self._edge == "threshold":
            return coarse
        return refine_edges(picture, expected, coarse, _NO_DRIFT, light.edges)

    def _search(self, frame: ColorImage, shift: NDArray[np.int16], top: int) -> Box | None:
        """Find a box that holds all that opening leaves at and below row ``top``, or None when that is nothing.

        Every square of ``open_px`` holds a block of ``open_px // pitch`` lattice points each way, so only a fraction of
        the pixels is looked at, and of the rest only what is near to such a block.
        """
        if top >= frame.shape[0]:
            return None
        pitch, (side, close_px) = self._pitch_px, self._sides_px
        height, width = frame.shape[:2]
        v0, u0 = height % pitch, width % pitch
        # Opening and closing carry nothing further than this
        reach = side - 1 + close_px - 1
        skipped = max(top - reach - v0, 0) // pitch
        first = v0 + skipped * pitch if skipped else 0
        marked = self._lattice_bounds[skipped:, :].outside(lattice(frame[first:], pitch), shift)
        block = side // pitch
        blocks = cv2.erode(marked, square(block), anchor=(0, 0), borderType=cv2.BORDER_CONSTANT, borderValue=0)
        column, row, columns, rows = cv2.boundingRect(blocks)
        if columns == 0:
            return None
        v_px, u_px = v0 + (skipped + row) * pitch, u0 + column * pitch
        before = side - 1 - (block - 1) * pitch
        return (
            slice(max(v_px - before, first), v_px + (rows - 1) * pitch + side),
            slice(max(u_px - before, 0), u_px + (columns - 1) * pitch + side),
        )


def _without(mask: ByteMask, box: Box, top: int, gripper: BoolArray | None) -> ByteMask:
    """Return the mask of a box without what is above row ``top`` of the image, and without the gripper."""
    kept = mask.copy()
    kept[: max(top - box[0].start, 0)] = 0
    if gripper is not None:
        kept[gripper[box]] = 0
    return kept
