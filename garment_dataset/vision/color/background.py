"""The empty scene per pixel: mean, spread and what follows from them (thesis 5.2.1).

Everything that decides a mask is exact: sums and comparisons are integers, whatever arithmetic carries them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from garment_dataset.errors import PictureError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray, ByteMask, ColorImage, FloatArray

_EXACT_FRAMES = 258  # float32 holds sums of that many squares of bytes exactly: 258 * 255^2 < 2^24
_DRIFT_ROUNDS = 3
_FINE = 256  # parts of a grey level; sums of integers depend on no order
_BLOCK_ROWS = 16
_ANY = 1024  # a bound that no byte passes, whatever the drift


@dataclass(frozen=True, slots=True, eq=False)
class Background:
    """The model of the empty scene.

    Parameters
    ----------
    mean : (H, W, 3) float64
        Mean of every pixel and channel, in grey levels; thesis eq. (5.1).
    std : (H, W, 3) float64
        Corrected sample standard deviation, in grey levels; thesis eq. (5.2).
    count : int
        Number of frames.
    """

    mean: FloatArray
    std: FloatArray
    count: int


class BackgroundAccumulator:
    """Mean and standard deviation of any number of frames, in one pass.

    The sums are exact integers: float32 carries them for as many frames as it holds exactly, then 64-bit integers do.
    """

    def __init__(self) -> None:
        self.count = 0
        self._part: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None
        self._totals: tuple[NDArray[np.uint64], NDArray[np.uint64]] | None = None

    def add(self, frame: ColorImage) -> None:
        """Add one frame of the empty scene.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            Colour image; only read, and not kept.

        Raises
        ------
        PictureError
            If it is not a colour image of bytes, or of another size than the first.
        """
        if self._part is None or self._totals is None:
            if frame.dtype != np.uint8 or frame.ndim != 3 or frame.shape[2] != 3:
                found = f"{frame.dtype} of shape {frame.shape}"
                raise PictureError("not a colour image", expected="uint8 of shape (H, W, 3)", found=found)
            self._part = np.zeros(frame.shape, np.float32), np.zeros(frame.shape, np.float32)
            self._totals = np.zeros(frame.shape, np.uint64), np.zeros(frame.shape, np.uint64)
        total, squares = self._part
        if frame.shape != total.shape:
            raise PictureError("background frames of unequal size", expected=total.shape, found=frame.shape)
        cv2.accumulate(frame, total)
        cv2.accumulateSquare(frame, squares)
        self.count += 1
        if self.count % _EXACT_FRAMES == 0:
            self._carry()

    def _carry(self) -> None:
        assert self._part is not None
        assert self._totals is not None
        for part, total in zip(self._part, self._totals, strict=True):
            np.add(total, part, out=total, casting="unsafe")
            part[...] = 0

    def finish(self) -> Background:
        r"""Return the model of all frames so far.

        Raises
        ------
        PictureError
            If there were fewer than two frames: one has no spread.

        Notes
        -----
        The variance is :math:`(N \sum F^2 - (\sum F)^2) / (N (N - 1))`, eq. (5.2) over one denominator: the numerator
        is an exact integer, so nothing cancels.
        """
        if self.count < 2 or self._totals is None:
            hint = "Record some seconds of the scene without the garment."
            raise PictureError("too few background frames", expected="at least 2", found=self.count, hint=hint)
        self._carry()
        total, squares = self._totals
        count = np.uint64(self.count)
        scatter = count * squares - total * total
        return Background(total / count, np.sqrt(scatter / (count * (count - np.uint64(1)))), self.count)


@dataclass(frozen=True, slots=True, eq=False)
class Bounds:
    """The grey levels that count as background, per pixel and channel.

    Parameters
    ----------
    lower, upper : (H, W, 3) int16
        First and last such level; beyond 0..255 where the scene is so dark or so bright.
    """

    lower: NDArray[np.int16]
    upper: NDArray[np.int16]

    @classmethod
    def of(cls, background: Background, *, alpha: float, min_sigma: float, clip: BoolArray | None = None) -> Bounds:
        """Turn thesis eq. (5.3) into bounds.

        Parameters
        ----------
        background : Background
            Model of the empty scene.
        alpha : float
            Allowed difference from the mean, in standard deviations.
        min_sigma : float
            Smallest standard deviation to assume, in grey levels: a saturated pixel shows none, and a short background
            recording shows too little in places.
        clip : (H, W) bool, optional
            Where a garment can be; elsewhere every level counts as background.

        Returns
        -------
        Bounds
            Level I is outside exactly when ``abs(I - mean) > alpha * max(std, min_sigma)`` in float64.
        """
        shape = background.mean.shape
        lower, upper = np.empty(shape, np.int16), np.empty(shape, np.int16)
        for top in range(0, len(lower), _BLOCK_ROWS):  # as much as a processor holds near
            rows = slice(top, top + _BLOCK_ROWS)
            mean, reach = background.mean[rows], alpha * np.maximum(background.std[rows], min_sigma)
            lower[rows] = np.maximum(_first_within(mean, reach), -_ANY)
            upper[rows] = np.minimum(-_first_within(-mean, reach), _ANY)
        if clip is not None:
            lower[~clip], upper[~clip] = -_ANY, _ANY
        return cls(lower, upper)

    def __getitem__(self, part: tuple[slice, slice]) -> Bounds:
        """Return the bounds of a part of the image, as a view."""
        return Bounds(self.lower[part], self.upper[part])

    def lattice(self, pitch_px: int) -> Bounds:
        """Return the bounds of a lattice of pixels: see :func:`lattice`."""
        return Bounds(lattice(self.lower, pitch_px), lattice(self.upper, pitch_px))

    def outside(self, frame: ColorImage, drift: NDArray[np.int16]) -> ByteMask:
        """Mark the pixels of which any channel is outside its bounds.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            Colour image.
        drift : (3,) or (H, W, 3) int16
            Change of brightness to allow for, in grey levels: of all pixels, or of each.

        Returns
        -------
        (H, W) uint8
            255 outside, 0 within. The bounds move by ``drift`` and stop at 0 and 255, as the camera does: where the
            background would leave that range, it is expected at its end.
        """
        # a whole row: numpy is slow along an axis of three
        shift = np.tile(drift, (frame.shape[1], 1)) if drift.ndim == 1 else drift
        lower, upper = (np.clip(bound + shift, 0, 255).astype(np.uint8) for bound in (self.lower, self.upper))
        return np.asarray(cv2.bitwise_not(cv2.inRange(frame, lower, upper)), np.uint8)


def _first_within(mean: FloatArray, reach: FloatArray) -> FloatArray:
    """Return the smallest integer I with mean - I <= reach, in the very arithmetic of that comparison."""
    guess = np.ceil(mean - reach)
    guess += mean - guess > reach  # that difference rounds otherwise than the one above: the next integer, then
    return guess


def lattice(image: NDArray[Any], pitch_px: int) -> NDArray[Any]:
    """Return the pixels of a square lattice that leaves no margin as broad as its pitch.

    So every run of ``m * pitch_px`` pixels along a row or a column holds m of them, wherever it lies.

    Parameters
    ----------
    image : (H, W) or (H, W, C), any type that OpenCV knows
    pitch_px : int
        The pixels are those at ``H % pitch_px + i * pitch_px`` and ``W % pitch_px + j * pitch_px``.
    """
    height, width = image.shape[:2]
    size = width // pitch_px, height // pitch_px
    whole = image[height % pitch_px :, width % pitch_px :]
    return cv2.resize(whole, size, interpolation=cv2.INTER_NEAREST)


class DriftEstimator:
    """Global change of brightness of a frame against the background: exposure and white balance.

    Parameters
    ----------
    background : Background
        Model of the empty scene.
    clip : (H, W) bool, optional
        Where to look; everywhere by default.
    pitch_px : int
        Distance of the pixels looked at.
    max_drift : int
        Largest change looked for, in grey levels.

    Notes
    -----
    Per channel, the change on which most pixels agree within three standard deviations of the noise (the mode, not the
    median: the garment may cover much of the view), then the mean over those that agree in all channels.
    """

    def __init__(
        self, background: Background, clip: BoolArray | None = None, *, pitch_px: int = 8, max_drift: int = 24
    ) -> None:
        self._pitch_px = pitch_px
        seen = np.ones(background.mean.shape[:2], np.uint8) if clip is None else clip.view(np.uint8)
        self._pixels = np.flatnonzero(lattice(seen, pitch_px))
        self._expected = np.rint(self._planes(background.mean) * _FINE).astype(np.int32)
        spread = np.median(self._planes(background.std)) if len(self._pixels) else 0.0
        self._half_width = max(3, math.ceil(3 * spread))
        self._reach = max_drift + self._half_width

    def __call__(self, frame: ColorImage) -> FloatArray:
        """Estimate the change.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            Colour image.

        Returns
        -------
        (3,) float64
            Grey levels to add to the background, per channel; NaN when less than a tenth of the pixels agree.
        """
        change = self._planes(frame).astype(np.int32) * _FINE - self._expected
        centre = self._mode(change)
        for _ in range(_DRIFT_ROUNDS):
            near = np.abs(change - centre[:, np.newaxis]) <= self._half_width * _FINE
            agreeing = np.flatnonzero(near.all(axis=0))
            if len(agreeing) * 10 <= change.shape[1]:
                return np.full(3, np.nan)
            mean = np.take(change, agreeing, axis=1).sum(axis=1) / len(agreeing)
            centre = np.rint(mean).astype(np.int32)
        return np.asarray(mean / _FINE, np.float64)

    def _planes(self, image: NDArray[Any]) -> NDArray[Any]:
        """Return the pixels looked at as (3, n): numpy is slow along an axis of three."""
        return np.ascontiguousarray(np.take(lattice(image, self._pitch_px).reshape(-1, 3), self._pixels, axis=0).T)

    def _mode(self, change: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the centre of the window that holds most changes, per channel."""
        width = 2 * self._half_width + 1
        modes = []
        for levels in (change + _FINE // 2) // _FINE + self._reach:
            inside = levels[(levels >= 0) & (levels <= 2 * self._reach)]
            counts = np.bincount(inside, minlength=2 * self._reach + 1)
            modes.append(np.argmax(np.convolve(counts, np.ones(width, np.int64), "valid")))
        return (np.array(modes, np.int32) + self._half_width - self._reach) * _FINE
