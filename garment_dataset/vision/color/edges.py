"""Edges of a silhouette, where a pixel is half garment, half background."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from garment_dataset.vision.color.masks import Box, bounding_box, square

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import ByteMask, ColorImage, FloatArray

    Indices = NDArray[np.intp]

_CROSS: ByteMask = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)).astype(np.uint8)
_SQUARE: ByteMask = np.ones((3, 3), np.uint8)
_DISC: ByteMask = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5)).astype(np.uint8)

# How edges are refined; chosen on rendered garments with an Xtion's noise, blur of 1 to 2 px, motion and texture:
# with more layers blur matters less and texture more.
_PEELING = (_CROSS, _SQUARE, _CROSS, _SQUARE)  # layers above the core
_MIN_CONTRAST = 8.0  # grey levels, all channels together; with less, noise would decide
_SURE_CONTRAST = 24.0  # likewise, further out
_THIN = 3  # layers: too narrow to smooth across
_PEAK_PX = 7  # along a thin part
_FINE = 64  # parts of a grey level, for distances of colours; sums of integers depend on no order
_WHOLE = 16384  # a pixel that is all garment, for the same reason


def refine_edges(
    frame: ColorImage, mean: FloatArray, mask: ByteMask, drift: FloatArray, also: ByteMask | None = None
) -> ByteMask:
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
    also : (H, W) uint8, optional
        Where else to look besides 2 pixels around the mask, 0 or 1: for what clearly differs from the background.

    Returns
    -------
    (H, W) uint8
        0 or 1; may be of several regions.
    """
    refined = mask.copy()
    box = bounding_box(mask, margin_px=4)
    coarse = np.ascontiguousarray(mask[box])
    if not coarse.any():
        return refined
    core, depth = _core(coarse)
    rim = core - np.asarray(cv2.erode(core, square(5)), np.uint8)
    near = np.asarray(cv2.dilate(coarse, _DISC), np.uint8)
    further = np.zeros_like(near) if also is None else np.asarray(also[box] & ~near, np.uint8)
    around = (near | further) - core
    band = np.flatnonzero(around.view(np.bool_))
    used = np.flatnonzero((around | rim).view(np.bool_))
    distance = np.zeros(coarse.shape, np.uint16)
    pixels = _whole(used, box, mask.shape[1])
    distance.ravel()[used] = np.rint(color_distance(frame, mean, pixels, drift) * _FINE)
    nearest = _nearest(core, band)
    contrast = _contrast(distance, rim, nearest)
    thin = (np.take(depth, nearest) <= _THIN) & (contrast >= _SURE_CONTRAST * _FINE)
    peak = np.take(cv2.dilate(distance * rim, square(_PEAK_PX)), nearest)  # blur takes some of a thin part's contrast
    contrast = np.where(thin, np.maximum(peak, contrast), contrast)
    beyond = np.take(further.ravel(), band).astype(np.bool_)
    clear = contrast >= np.where(beyond, _SURE_CONTRAST, _MIN_CONTRAST) * _FINE
    band = band[clear]
    shares = coarse.astype(np.uint16) * np.uint16(_WHOLE)
    share = np.minimum(np.take(distance, band) / contrast[clear], 1.5)
    shares.ravel()[band] = np.rint(share * _WHOLE)
    smooth = cv2.GaussianBlur(shares, (3, 3), 0)  # noise is as fine as a pixel, edges are blurred
    decisive = np.where(thin[clear], np.take(shares, band), np.take(smooth, band))
    refined.ravel()[_whole(band, box, mask.shape[1])] = decisive > _WHOLE // 2
    return refined


def _whole(pixels: Indices, box: Box, width: int) -> Indices:
    """Turn indices of pixels in a box into those in the whole image."""
    rows, columns = np.divmod(pixels, min(box[1].stop, width) - box[1].start)
    return np.asarray((rows + box[0].start) * width + columns + box[1].start)


def color_distance(
    frame: ColorImage, expected: FloatArray, pixels: Indices, drift: FloatArray | None = None
) -> FloatArray:
    """Return the distances of the colours of some pixels from those expected, (n,), in grey levels.

    Parameters
    ----------
    frame, expected : (H, W, 3) uint8 and float64
        Colour image, and what it is compared with, in grey levels.
    pixels : (n,) int
        Which, as indices of the flat image.
    drift : (3,) float64, optional
        Change of brightness against what is expected.
    """
    # By channel: numpy is slow along an axis of three
    color, background = (np.take(image.reshape(-1, 3), pixels, axis=0).T for image in (frame, expected))
    change = np.subtract(color, background, order="C")
    if drift is not None:
        change -= drift[:, np.newaxis]
    return np.asarray(np.sqrt((change * change).sum(axis=0)))


def _core(mask: ByteMask) -> tuple[ByteMask, ByteMask]:
    """Mark the pixels below all layers, and those with no neighbour in a deeper layer; and say how deep each is."""
    layer = peeled = mask
    for element in _PEELING:
        peeled = np.asarray(cv2.erode(peeled, element), np.uint8)
        layer = np.asarray(cv2.add(layer, peeled), np.uint8)
    deepest = np.asarray(layer == cv2.dilate(layer, _SQUARE)).view(np.uint8)
    return np.asarray(cv2.bitwise_and(deepest, mask), np.uint8), layer


def _nearest(core: ByteMask, band: Indices) -> Indices:
    """Return the core pixel nearest to each pixel of the band."""
    _, labels = cv2.distanceTransformWithLabels(1 - core, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    pixels = np.flatnonzero(core.view(np.bool_))
    return np.asarray(pixels[np.take(labels, band) - 1])  # labels count by rows, from 1


def _contrast(distance: NDArray[np.uint16], rim: ByteMask, nearest: Indices) -> FloatArray:
    """Return the mean distance over the rim of the core, around given core pixels."""
    sums = cv2.boxFilter(distance * rim, cv2.CV_32F, (3, 3), normalize=False)
    counts = cv2.boxFilter(rim, cv2.CV_32F, (3, 3), normalize=False)
    return np.asarray(np.take(sums, nearest).astype(np.float64) / np.take(counts, nearest))
