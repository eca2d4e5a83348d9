"""Brightness and hue of a frame against the empty scene, taken apart, in half size.

A pixel of the wall that is seen in a shadow has less light at nearly constant hue. So its colour I is compared with
that expected, B, in two ways (brightness and chromaticity distortion; Horprasert et al., 1999): the share of light is
the a that minimises ``abs(I - a B)``, and what is left, ``abs(I - a B)`` by channel, is the difference of hue. How
large both are by noise alone is taken from the frame itself, where most of it is as in the empty scene.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from garment_dataset.vision.color.masks import square

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray, ColorImage, FloatArray

    Plane = NDArray[np.float32]

WHOLE = 1024
"""Full light; shares are counted in such parts, so that sums of them depend on no order."""

DARKEST = 0.5
"""No shadow in a lit room takes more of the light."""

_FINE = 64  # parts of a grey level
_BOUND = 5.0  # of what noise explains, in its own measure; 4.5 to 6 measure alike on wide draws
_TINT = 0.2  # a second lamp's colour in the shadow: share of the light that is missing
_LIT_BOUND = 3.0
_AS_BEFORE_LEVELS = 12.0  # what differs by less is looked at to measure noise
_LEAST_NOISE_LEVELS = 0.5  # rounding alone makes as much

_LINE_PX = 5  # broader than a line
_DEEP_DIP, _FAINT_DIP, _DIP_NOISE = 0.15, 0.07, 4.0  # how much less light than beside it a line has


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What is seen in half size.

    Parameters
    ----------
    change : (h, w, 3) float32
        Difference from what is expected, in grey levels.
    share : (h, w) float32
        Light against that expected.
    level : (h, w) float32
        Expected grey level.
    hue : (h, w) float32
        Largest difference of a channel that the light does not explain, in grey levels.
    noise : float
        Standard deviation of brightness, in grey levels.
    like : (h, w) bool
        Whether a shadow could be seen: the wall's hue, no more light than the wall's, and at least half of it.
    own_hue : (h, w) bool
        Whether it has the wall's hue, however dark or bright.
    lit : (h, w) bool
        Whether it is as in the empty scene.
    """

    change: Plane
    share: Plane
    level: Plane
    hue: Plane
    noise: float
    like: BoolArray
    own_hue: BoolArray
    lit: BoolArray

    @property
    def brightness(self) -> Plane:
        """Difference of brightness, in grey levels, (h, w)."""
        return np.asarray((self.share - np.float32(1)) * self.level, np.float32)

    @classmethod
    def of(cls, frame: ColorImage, half_mean: Plane, gain: FloatArray) -> Seen:
        """Compare a frame with the empty scene.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            Colour image.
        half_mean : (h, w, 3) float32
            Mean of the empty scene: see :func:`half`.
        gain : (3,) float64
            Of each channel against the empty scene.
        """
        image = half(frame)
        expected = np.clip(half_mean * gain.astype(np.float32), 4, 255)
        b0, b1, b2 = cv2.split(expected)
        i0, i1, i2 = cv2.split(image)
        share = np.asarray((i0 * b0 + i1 * b1 + i2 * b2) / (b0 * b0 + b1 * b1 + b2 * b2), np.float32)
        level = np.asarray((b0 + b1 + b2) / np.float32(3), np.float32)
        hue = np.maximum(np.maximum(np.abs(i0 - share * b0), np.abs(i1 - share * b1)), np.abs(i2 - share * b2))
        brightness = (share - 1) * level
        usual = np.abs(brightness) < _AS_BEFORE_LEVELS
        noise, hue_noise = (
            max(float(np.median(values[usual])), _LEAST_NOISE_LEVELS) if usual.any() else _LEAST_NOISE_LEVELS
            for values in (np.abs(brightness) * np.float32(1.4826), hue)
        )
        own_hue = hue <= _BOUND * hue_noise + _TINT * np.maximum(1 - share, 0) * level
        like = own_hue & (share > DARKEST) & (brightness < _BOUND * noise)
        lit = (np.abs(brightness) < _LIT_BOUND * noise) & (hue < _LIT_BOUND * hue_noise)
        return cls(image - expected, share, level, np.asarray(hue, np.float32), noise, like, own_hue, lit)


def half(image: ColorImage | FloatArray) -> Plane:
    """Return an image in half size, smoothed over a pixel, in grey levels; both must be alike to be compared.

    Parameters
    ----------
    image : (H, W, 3) uint8 or float64
        Grey levels.

    Returns
    -------
    (H // 2, W // 2, 3) float32
        In 64ths of a level, computed in integers.
    """
    even = image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2]
    fine = (
        even.astype(np.uint16) * np.uint16(_FINE) if even.dtype == np.uint8 else np.rint(even * _FINE).astype(np.uint16)
    )
    small = cv2.resize(fine, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.GaussianBlur(small, (3, 3), 0), np.float32) / np.float32(_FINE)


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
    faint = np.asarray(dip > max(_FAINT_DIP, _DIP_NOISE * seen.noise / float(np.median(seen.level))), np.uint8)
    count, labels = cv2.connectedComponents(faint, connectivity=8)
    deep = np.zeros(count, np.bool_)
    deep[labels[dip > _DEEP_DIP]] = True
    deep[0] = False
    return np.asarray(deep[labels])
