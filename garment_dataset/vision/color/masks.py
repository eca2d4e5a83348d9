"""Masks: stored as 1-bit PNG, drawn from polygons, cleaned, outlined, and suggested for clipping."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from garment_dataset.errors import PictureError, TableError
from garment_dataset.vision.color.png import read_own_png, write_png

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray, ByteMask
    from garment_dataset.vision.color.background import Background

    Border = NDArray[np.int32]

Box = tuple[slice, slice]
"""Rows and columns of a part of an image."""


def encode_mask(mask: BoolArray) -> bytes:
    """Write a mask as a PNG of one bit per pixel; equal masks give equal bytes.

    Parameters
    ----------
    mask : (H, W) bool

    Returns
    -------
    bytes
        White is True; some 500 bytes for a garment in 640 x 480 pixels.
    """
    return write_png(mask)


def decode_mask(png: bytes) -> BoolArray:
    """Read a mask back: ``decode_mask(row.mask)``.

    Parameters
    ----------
    png : bytes
        What :func:`encode_mask` wrote, or any image that OpenCV reads: what is lighter than mid-grey is True.

    Returns
    -------
    (H, W) bool

    Raises
    ------
    TableError
        If it is no such image.
    """
    if (own := read_own_png(png)) is not None:
        return own
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_GRAYSCALE) if png else None
    if image is None:
        raise TableError("mask that cannot be read", expected="a PNG image", found=f"{len(png)} bytes")
    return np.asarray(image > 127)


def polygon_mask(polygon: Sequence[tuple[float, float]], height_px: int, width_px: int) -> BoolArray:
    """Fill a polygon.

    Parameters
    ----------
    polygon : sequence of (u, v)
        Corners in pixels, rounded to whole ones; the border belongs to the mask. What is beyond the image is cut off.
    height_px, width_px : int
        Size of the image.

    Returns
    -------
    (H, W) bool

    Raises
    ------
    PictureError
        If there are fewer than three corners.
    """
    if len(polygon) < 3:
        raise PictureError("polygon with too few corners", expected="at least 3", found=len(polygon))
    mask = np.zeros((height_px, width_px), np.uint8)
    cv2.fillPoly(mask, [np.rint(polygon).astype(np.int32)], 1)
    return mask.view(np.bool_)


def disc_mask(centre_px: tuple[float, float], radius_px: float, height_px: int, width_px: int) -> BoolArray:
    """Return the pixels whose centres are within a radius.

    Parameters
    ----------
    centre_px : (u, v)
        In pixels; may be outside of the image.
    radius_px : float
        How far from it.
    height_px, width_px : int
        Of the image.

    Returns
    -------
    (H, W) bool
    """
    disc = np.zeros((height_px, width_px), np.bool_)
    u, v = centre_px
    first_u, first_v = (max(0, math.floor(middle - radius_px)) for middle in centre_px)
    box = disc[first_v : max(0, math.ceil(v + radius_px) + 1), first_u : max(0, math.ceil(u + radius_px) + 1)]
    v_px, u_px = np.ogrid[first_v : first_v + box.shape[0], first_u : first_u + box.shape[1]]
    box[...] = (u_px - u) ** 2 + (v_px - v) ** 2 <= radius_px**2
    return disc


def square(side_px: int) -> ByteMask:
    """Return a square structuring element."""
    return np.ones((side_px, side_px), np.uint8)


def open_close(mask: ByteMask, open_px: int, close_px: int) -> ByteMask:
    """Open, then close, with squares; all beyond the image counts as background.

    Parameters
    ----------
    mask : (H, W) uint8
        0 is background.
    open_px, close_px : int
        Sides of the squares, odd; 1 does nothing.

    Returns
    -------
    (H, W) uint8
        Values as in ``mask``.
    """
    # Closing grows first: without room beyond the image, it would cling to its border
    pad = close_px // 2
    padded = cv2.copyMakeBorder(mask, pad, pad, pad, pad, cv2.BORDER_CONSTANT, value=0)
    padded = cv2.erode(padded, square(open_px), borderType=cv2.BORDER_CONSTANT, borderValue=0)
    padded = cv2.dilate(padded, square(open_px + close_px - 1))  # that of opening and that of closing in one
    padded = cv2.erode(padded, square(close_px))
    return np.asarray(padded[pad : pad + mask.shape[0], pad : pad + mask.shape[1]], np.uint8)


def largest_component(mask: ByteMask, near: BoolArray | None = None) -> ByteMask:
    """Keep the largest 8-connected region; of equal ones the one that begins highest, then furthest left.

    Parameters
    ----------
    mask : (H, W) uint8
        0 is background.
    near : (H, W) bool, optional
        Where the region must have a pixel; anywhere by default.

    Returns
    -------
    (H, W) uint8
        1 in the region, all 0 when there is none.
    """
    if near is not None and not (mask & near).any():
        return np.zeros(mask.shape, np.uint8)
    few = mask.size < 4 * np.iinfo(np.uint16).max  # regions touch no other: at most one in 2 x 2 pixels
    kind = cv2.CV_16U if few else cv2.CV_32S
    if cv2.connectedComponents(mask, connectivity=8, ltype=kind)[0] <= 2:  # a region and the rest
        return np.minimum(mask, np.uint8(1))  # nearly always, and far cheaper than measuring them
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8, ltype=kind)
    left, top, area = (stats[1:, key] for key in (cv2.CC_STAT_LEFT, cv2.CC_STAT_TOP, cv2.CC_STAT_AREA))
    order = 1 + np.lexsort((left, top, -area))
    there = range(1, len(stats)) if near is None else set(np.unique(labels[near]).tolist())
    largest = next(label for label in order.tolist() if label in there)
    return np.asarray(labels == largest).view(np.uint8)


def bounding_box(mask: ByteMask, margin_px: int = 0) -> Box:
    """Return the box around all that is not 0 in a mask, with a margin that may reach beyond the image's end.

    Parameters
    ----------
    mask : (H, W) uint8
    margin_px : int
        On all sides.
    """
    u_px, v_px, width_px, height_px = cv2.boundingRect(mask)
    return (
        slice(max(v_px - margin_px, 0), v_px + height_px + margin_px),
        slice(max(u_px - margin_px, 0), u_px + width_px + margin_px),
    )


def grown(box: Box, margin_px: int, shape: tuple[int, ...]) -> tuple[Box, Box]:
    """Return a box grown on all sides as far as the image goes, and where the old one lies in it.

    Parameters
    ----------
    box : Box
        Rows and columns; may reach beyond the image's end, and be open.
    margin_px : int
        By how much.
    shape : (H, W, ...)
        Of the image.
    """
    ranges = [side.indices(size)[:2] for side, size in zip(box, shape, strict=False)]
    (v0, v1), (u0, u1) = (
        (max(a - margin_px, 0), min(b + margin_px, n)) for (a, b), n in zip(ranges, shape, strict=False)
    )
    (top, bottom), (left, right) = ranges
    return (slice(v0, v1), slice(u0, u1)), (slice(top - v0, bottom - v0), slice(left - u0, right - u0))


def looked_up(by_label: BoolArray, labels: NDArray[Any]) -> BoolArray:
    """Return what holds for each pixel's label: ``by_label[labels]``, at half the cost.

    Parameters
    ----------
    by_label : (n,) bool
    labels : (h, w) int
        From 0 to n - 1.
    """
    return np.asarray(np.take(by_label, labels.astype(np.intp, copy=False), mode="clip"))


def borders(mask: BoolArray) -> list[Border]:
    """Follow the borders of a region: the outer one, then those of its holes.

    Parameters
    ----------
    mask : (H, W) bool
        One 8-connected region.

    Returns
    -------
    list of (n, 2) int32
        Centres (u, v) of the border pixels in order, the region to the left of the way as displayed, so the outer
        border runs counter-clockwise. Empty for an empty mask.
    """
    u_px, v_px, width_px, height_px = cv2.boundingRect(mask.view(np.uint8))
    if width_px == 0:
        return []
    box = mask.view(np.uint8)[v_px : v_px + height_px, u_px : u_px + width_px]
    found, hierarchy = cv2.findContours(box, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE, offset=(u_px, v_px))
    order = np.argsort(hierarchy[0, :, 3] >= 0, kind="stable")  # holes have a parent
    return [np.asarray(found[i][:, 0, :], np.int32) for i in order]


def suggest_clip_mask(
    background: Background, *, max_step: float = 4.0, max_sigma: float = 10.0, margin_px: int = 3
) -> BoolArray:
    """Suggest where a garment can be seen: before the largest part of the background that is monochrome.

    Parameters
    ----------
    background : Background
        Model of the empty scene.
    max_step : float
        Largest difference of the smoothed colour within 5 pixels, in grey levels; shading is slower, edges are not.
    max_sigma : float
        Largest standard deviation, in grey levels: what flickers or moves is no background.
    margin_px : int
        How far to stay away from what is not monochrome, beyond the 5 pixels by which edges are seen too broad.

    Returns
    -------
    (H, W) bool
        One region without holes, for marks on the background belong to it; all False when nothing is monochrome.
    """
    smooth = cv2.GaussianBlur(background.mean.astype(np.float32), (0, 0), 1.5)
    around = square(5)
    step = (cv2.dilate(smooth, around) - cv2.erode(smooth, around)).max(axis=2)
    plain = (step <= max_step) & (background.std.max(axis=2) <= max_sigma)
    # Opened, so that no region leaks through a gap of some pixels in an edge
    plain_area = cv2.morphologyEx(plain.astype(np.uint8), cv2.MORPH_OPEN, square(9))
    contours, _ = cv2.findContours(plain_area, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    suggestion = np.zeros(plain.shape, np.uint8)
    if contours:
        cv2.drawContours(suggestion, [max(contours, key=cv2.contourArea)], -1, 1, cv2.FILLED)
        element = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * margin_px + 1, 2 * margin_px + 1))
        suggestion[...] = cv2.erode(suggestion, element)
    return suggestion.view(np.bool_)
