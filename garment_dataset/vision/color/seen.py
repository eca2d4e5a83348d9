"""Brightness and hue of a frame against the empty scene, taken apart, in half size.

A pixel of the wall that is seen in a shadow has less light at nearly constant hue. So its colour I is compared with
that expected, B, in two ways (brightness and chromaticity distortion; Horprasert et al., 1999): the share of light is
the a that minimises ``abs(I - a B)``, and what is left, ``abs(I - a B)`` by channel, is the difference of hue. How
large both are by noise alone is taken from the frame itself, where most of it is as in the empty scene.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from garment_dataset.vision.color.masks import looked_up, square

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray, ColorImage, FloatArray
    from garment_dataset.vision.color.masks import Box

    Plane = NDArray[np.float32]
    Planes = tuple[Plane, ...]

WHOLE = 1024
"""Full light; shares are counted in such parts, so that sums of them depend on no order."""

DARKEST = 0.5
"""No shadow in a lit room takes more of the light."""

_FINE = 64  # parts of a grey level
_BLOCK_ROWS = 64
_BOUND = 5.0  # of what noise explains, in its own measure; 4.5 to 6 measure alike on wide draws
_TINT = 0.2  # a second lamp's colour in the shadow: share of the light that is missing
_LIT_BOUND = 3.0
_AS_BEFORE_LEVELS = 12.0  # what differs by less is looked at to measure noise
_LEAST_NOISE_LEVELS = 0.5  # rounding alone makes as much

_SAMPLED = 31  # of so many values one tells where the median lies
_FEW = 4000  # are sorted at once

_LINE_PX = 5  # broader than a line
_DEEP_DIP, _FAINT_DIP, _DIP_NOISE = 0.15, 0.07, 4.0  # how much less light than beside it a line has


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What is seen in half size.

    Parameters
    ----------
    image, expected : three of (h, w) float32
        Channels of the frame, and what is expected of the empty scene in its light, in grey levels.
    share : (h, w) float32
        Light against that expected.
    level : (h, w) float32
        Expected grey level.
    brightness : (h, w) float32
        Difference of brightness, in grey levels.
    noise : float
        Standard deviation of brightness, in grey levels.
    like : (h, w) bool
        Whether a shadow could be seen: the wall's hue, no more light than the wall's, and at least half of it.
    own_hue : (h, w) bool
        Whether it has the wall's hue, however dark or bright.
    lit : (h, w) bool
        Whether it is as in the empty scene.
    """

    image: Planes
    expected: Planes
    share: Plane
    level: Plane
    brightness: Plane
    noise: float
    like: BoolArray
    own_hue: BoolArray
    lit: BoolArray

    @classmethod
    def of(cls, frame: ColorImage, half_mean: Planes, gain: FloatArray) -> Seen:
        """Compare a frame with the empty scene.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            Colour image.
        half_mean : three of (h, w) float32
            Mean of the empty scene: see :func:`half`.
        gain : (3,) float64
            Of each channel against the empty scene.
        """
        image = half(frame)
        expected = tuple(
            np.clip(mean * factor, 4, 255) for mean, factor in zip(half_mean, gain.astype(np.float32), strict=True)
        )
        (i0, i1, i2), (b0, b1, b2) = image, expected
        share = np.asarray((i0 * b0 + i1 * b1 + i2 * b2) / (b0 * b0 + b1 * b1 + b2 * b2), np.float32)
        level = np.asarray((b0 + b1 + b2) / np.float32(3), np.float32)
        hue = np.abs(i0 - share * b0)
        for values, bare in ((i1, b1), (i2, b2)):
            np.maximum(hue, np.abs(values - share * bare), out=hue)
        brightness = (share - 1) * level
        apart = np.abs(brightness)
        usual = apart < _AS_BEFORE_LEVELS
        count = int(np.count_nonzero(usual))
        noise, hue_noise = (
            max(middle(values, count), _LEAST_NOISE_LEVELS) if count else _LEAST_NOISE_LEVELS
            for values in (apart * np.float32(1.4826), np.where(usual, hue, np.float32(np.inf)))
        )
        own_hue = hue <= _BOUND * hue_noise + _TINT * np.maximum(1 - share, 0) * level
        like = own_hue & (share > DARKEST) & (brightness < _BOUND * noise)
        lit = (apart < _LIT_BOUND * noise) & (hue < _LIT_BOUND * hue_noise)
        return cls(image, expected, share, level, brightness, noise, like, own_hue, lit)

    def typical_change(self, box: Box, pixels: BoolArray) -> Plane:
        """Return the median difference from what is expected of some pixels of a box, by channel, in grey levels.

        Parameters
        ----------
        box : tuple of slice
            Rows and columns.
        pixels : (rows, columns) bool
            Which of them; not empty.

        Returns
        -------
        (3,) float32
        """
        pairs = zip(self.image, self.expected, strict=True)
        ordered = np.sort(np.stack([plane[box][pixels] - bare[box][pixels] for plane, bare in pairs]), axis=1)
        last = ordered.shape[1] // 2
        return np.asarray(ordered[:, [(ordered.shape[1] - 1) // 2, last]].mean(axis=1), np.float32)


def half(image: ColorImage | FloatArray) -> Planes:
    """Return an image in half size, smoothed over a pixel, in grey levels; both must be alike to be compared.

    Parameters
    ----------
    image : (H, W, 3) uint8 or float64
        Grey levels.

    Returns
    -------
    three of (H // 2, W // 2) float32
        Channels, in 64ths of a level.
    """
    even = image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2]
    if even.dtype != np.uint8:
        fine = np.rint(even * _FINE).astype(np.uint16)
        small = cv2.GaussianBlur(cv2.resize(fine, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), (3, 3), 0)
        return tuple(plane.astype(np.float32) / np.float32(_FINE) for plane in cv2.split(small))
    # Sums of bytes with weights that are powers of two: nothing is rounded, in whatever arithmetic
    small = np.empty((even.shape[0] // 2, even.shape[1] // 2, 3), np.uint16)
    for top in range(0, len(even), _BLOCK_ROWS):  # as much as a processor holds near
        fine = np.multiply(even[top : top + _BLOCK_ROWS], _FINE, dtype=np.uint16)
        part = small[top // 2 : (top + _BLOCK_ROWS) // 2]
        cv2.resize(fine, part.shape[1::-1], dst=part, interpolation=cv2.INTER_AREA)
    planes = (np.asarray(plane * np.float32(1 / _FINE), np.float32) for plane in cv2.split(small))
    return tuple(np.asarray(cv2.GaussianBlur(plane, (3, 3), 0), np.float32) for plane in planes)


def middle(values: NDArray[Any], count: int) -> float:
    """Return the median of the smallest values, exactly as ``numpy.median`` does.

    Parameters
    ----------
    values : (...) float
        Without NaN.
    count : int
        How many of the smallest count; at least 1.

    Notes
    -----
    A sample says between which two values the median is likely to lie; only what is between them is sorted. If it was
    not there, all are.
    """
    flat = values.ravel()
    first, last = (count - 1) // 2, count // 2
    if len(flat) < _FEW:
        ordered = np.sort(flat)
        return float(np.mean(ordered[first : last + 1]))
    sample = np.sort(flat[::_SAMPLED])
    at, slack = first // _SAMPLED, 3 * math.isqrt(len(sample)) // 2
    low, high = sample[max(at - slack, 0)], sample[min(at + slack, len(sample) - 1)]
    below = int(np.count_nonzero(flat < low))
    between = np.asarray(flat[(flat >= low) & (flat <= high)], flat.dtype)
    if not below <= first <= last < below + len(between):
        below, between = 0, flat
    return float(np.mean(np.partition(between, (first - below, last - below))[first - below : last - below + 1]))


def dark_lines(seen: Seen) -> BoolArray:
    """Mark dark lines, finer than the shadow of anything in a lit room: a sheet edge-on before the wall.

    Parameters
    ----------
    seen : Seen
        What is seen in half size.

    Returns
    -------
    (h, w) bool
        Pixels with less light than both sides of the line have.
    """
    dip = cv2.morphologyEx(seen.share, cv2.MORPH_BLACKHAT, square(_LINE_PX))
    deep = dip > _DEEP_DIP
    if not deep.any():
        return np.asarray(deep)
    least, noise = _FAINT_DIP, _DIP_NOISE * seen.noise
    if 2 * np.count_nonzero(seen.level * np.float32(_FAINT_DIP) < noise) >= seen.level.size:  # rare, and costs more
        least = max(least, noise / middle(seen.level, seen.level.size))
    count, labels = cv2.connectedComponents(np.asarray(dip > least, np.uint8), connectivity=8)
    kept = np.zeros(count, np.bool_)
    kept[labels[deep]] = True
    kept[0] = False
    return looked_up(kept, labels)
