"""Silhouette of the garment before a known background (thesis 5.2.1, 5.2.2).

The coarse mask is thesis eq. (5.3), opened, closed, cut free of the gripper and reduced to its largest region, bit by
bit as defined. Its edge lies where the colour leaves the noise: outside the garment, by more than a pixel in a blurred
image. :func:`refine_edges` moves it to where a pixel is half garment, half background.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import cv2
import numpy as np

from garment_dataset.errors import PictureError
from garment_dataset.vision.color.background import Bounds, DriftEstimator, lattice
from garment_dataset.vision.color.masks import largest_component, open_close, square

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray, ByteMask, ColorImage, FloatArray
    from garment_dataset.vision.color.background import Background

    Box = tuple[slice, slice]
    Indices = NDArray[np.intp]

Edge = Literal["half_contrast", "threshold"]

_CROSS: ByteMask = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)).astype(np.uint8)
_SQUARE: ByteMask = np.ones((3, 3), np.uint8)
_DISC: ByteMask = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5)).astype(np.uint8)

# How edges are refined; chosen on rendered garments with an Xtion's noise, blur of 1 to 2 px, motion and texture:
# with more layers blur matters less and texture more.
_PEELING = (_CROSS, _SQUARE, _CROSS, _SQUARE)  # layers above the core
_MIN_CONTRAST = 8.0  # grey levels, all channels together; with less, noise would decide
_CONTEXT_PX = 8  # rows above the gripper's end point that edges are decided with
_FINE = 64  # parts of a grey level, for distances of colours; sums of integers depend on no order
_WHOLE = 16384  # a pixel that is all garment, for the same reason


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

    def drift(self, frame: ColorImage) -> FloatArray:
        """Estimate the change of brightness against the background: see :class:`DriftEstimator`."""
        return self._drift(frame)

    def silhouette(
        self,
        frame: ColorImage,
        *,
        drift: FloatArray | None = None,
        top_v_px: float | None = None,
        gripper: BoolArray | None = None,
    ) -> BoolArray:
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

        Returns
        -------
        (H, W) bool
            One 8-connected region; all False when nothing is found.

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
        shift = np.rint(change).astype(np.int16)
        top = 0 if top_v_px is None else min(max(math.ceil(top_v_px), 0), frame.shape[0])
        refined = self._edge == "half_contrast"
        mask = np.zeros(frame.shape[:2], np.uint8)
        box = self._search(frame, shift, max(top - _CONTEXT_PX, 0) if refined else top)
        if box is None:
            return mask.view(np.bool_)
        marked = np.minimum(open_close(self._bounds[box].outside(frame[box], shift), *self._sides_px), np.uint8(1))
        if self._clip is not None:
            marked &= self._clip[box]
        below = _without(marked, box, top, gripper)
        mask[box] = largest_component(below)
        if refined and mask[box].any():
            # Smaller regions go. What was cut off stays until the edges are decided: a cut is no edge of the garment
            mask[box] |= marked - below
            mask = refine_edges(frame, self._mean, mask, change)
            box = _bounding_box(mask)
            if self._clip is not None:
                mask[box] &= self._clip[box]
            mask[box] = largest_component(_without(mask[box], box, top, gripper))
        return mask.view(np.bool_)

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


def _bounding_box(mask: ByteMask, margin_px: int = 0) -> Box:
    u_px, v_px, width_px, height_px = cv2.boundingRect(mask)
    return (
        slice(max(v_px - margin_px, 0), v_px + height_px + margin_px),
        slice(max(u_px - margin_px, 0), u_px + width_px + margin_px),
    )


def refine_edges(frame: ColorImage, mean: FloatArray, mask: ByteMask, drift: FloatArray) -> ByteMask:
    """Decide the pixels near the edges of a mask by half contrast.

    A pixel is garment when its colour is further from the background's than half of what the garment's is nearby. The
    background's colour is known per pixel. The garment's distance from it is taken at the nearest core pixel: one so
    deep inside that blur mixes in no background, or on the ridge of a part too thin to have such. So shading and
    texture matter little, even stripes both darker and brighter than the background. Core pixels stay, and where
    garment and background have nearly one colour, the mask stays as it is.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        Colour image.
    mean : (H, W, 3) float64
        Mean of the background, in grey levels.
    mask : (H, W) uint8
        Coarse mask, 0 or 1.
    drift : (3,) float64
        Change of brightness against the background, in grey levels.

    Returns
    -------
    (H, W) uint8
        0 or 1; may be of several regions.
    """
    refined = mask.copy()
    box = _bounding_box(mask, margin_px=4)
    coarse = np.ascontiguousarray(mask[box])
    if not coarse.any():
        return refined
    core = _core(coarse)
    rim = core - np.asarray(cv2.erode(core, square(5)), np.uint8)
    around = np.asarray(cv2.dilate(coarse, _DISC), np.uint8) - core
    band = np.flatnonzero(around.view(np.bool_))
    used = np.flatnonzero((around | rim).view(np.bool_))
    distance = np.zeros(coarse.shape, np.uint16)
    distance.ravel()[used] = _color_distance(frame, mean, drift, _whole(used, box, mask.shape[1]))
    contrast = _contrast(distance, core, rim, band)
    clear = contrast >= _MIN_CONTRAST * _FINE
    band = band[clear]
    shares = coarse.astype(np.uint16) * np.uint16(_WHOLE)
    share = np.minimum(np.take(distance, band) / contrast[clear], 1.5)
    shares.ravel()[band] = np.rint(share * _WHOLE)
    smooth = cv2.GaussianBlur(shares, (3, 3), 0)  # noise is as fine as a pixel, edges are blurred
    refined.ravel()[_whole(band, box, mask.shape[1])] = np.take(smooth, band) > _WHOLE // 2
    return refined


def _whole(pixels: Indices, box: Box, width: int) -> Indices:
    """Turn indices of pixels in a box into those in the whole image."""
    rows, columns = np.divmod(pixels, min(box[1].stop, width) - box[1].start)
    return np.asarray((rows + box[0].start) * width + columns + box[1].start)


def _color_distance(frame: ColorImage, mean: FloatArray, drift: FloatArray, pixels: Indices) -> FloatArray:
    """Return the distances of pixels from the background's colour, in parts of a grey level, rounded."""
    # By channel: numpy is slow along an axis of three
    color, background = (np.take(image.reshape(-1, 3), pixels, axis=0).T for image in (frame, mean))
    change = np.subtract(color, background, order="C") - drift[:, np.newaxis]
    return np.asarray(np.rint(np.sqrt((change * change).sum(axis=0)) * _FINE), np.float64)


def _core(mask: ByteMask) -> ByteMask:
    """Mark the pixels below all layers, and those with no neighbour in a deeper layer than their own."""
    layer = peeled = mask
    for element in _PEELING:
        peeled = np.asarray(cv2.erode(peeled, element), np.uint8)
        layer = np.asarray(cv2.add(layer, peeled), np.uint8)
    deepest = np.asarray(layer == cv2.dilate(layer, _SQUARE)).view(np.uint8)
    return np.asarray(cv2.bitwise_and(deepest, mask), np.uint8)


def _contrast(distance: NDArray[np.uint16], core: ByteMask, rim: ByteMask, band: Indices) -> FloatArray:
    """Return the mean distance over the rim of the core, around the core pixel nearest to each pixel of the band."""
    sums = cv2.boxFilter(distance * rim, cv2.CV_32F, (3, 3), normalize=False)
    counts = cv2.boxFilter(rim, cv2.CV_32F, (3, 3), normalize=False)
    _, labels = cv2.distanceTransformWithLabels(1 - core, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    nearest = np.flatnonzero(core.view(np.bool_))[np.take(labels, band) - 1]  # labels count by rows, from 1
    return np.asarray(np.take(sums, nearest).astype(np.float64) / np.take(counts, nearest))
