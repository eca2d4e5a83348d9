"""How the background is lit in a frame: its gain, and how much of its light each pixel has left in the shadows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from garment_dataset.vision.color.background import lattice
from garment_dataset.vision.color.masks import bounding_box, grown, square
from garment_dataset.vision.color.seen import WHOLE, Seen, half
from garment_dataset.vision.color.shadow import garment_in

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray, ByteMask, ColorImage, FloatArray
    from garment_dataset.vision.color.background import Background
    from garment_dataset.vision.color.masks import Box

_BRIGHTEST = round(1.05 * WHOLE)
_WINDOWS_PX = (3, 5, 25, 81)  # for what is behind the garment, the nearest wall around; sums stay below 2^24
_PALE = 0.75  # of the light, that nearly all shadows leave
_MARGIN_PX = 8  # around the garment, in half size: what is looked at closely
_AWAY_PX = 7  # at the garment's edges it mixes in

_STEPS = 2**16  # of a logarithm; sums of integers depend on no order
_BIN, _REACH = 0.01, 0.6
_EDGES = np.arange(-_REACH, _REACH, _BIN)
_AGREE = 0.04
_LEVELS = (40.0, 250.0)  # darker pixels are too noisy to divide by, brighter ones may be saturated
_LEAST_SHARE = 0.1
_LOG = np.log(np.maximum(np.arange(256, dtype=np.uint8), 1)).astype(np.float64)


class GainEstimator:
    """Gain of a frame against the background: exposure and white balance.

    Parameters
    ----------
    background : Background
        Model of the empty scene.
    clip : (H, W) bool, optional
        Where to look; everywhere by default.
    pitch_px : int
        Distance of the pixels looked at.

    Notes
    -----
    Of the logarithms of the ratios, the one on which most pixels agree (the mode, not the median: garment and shadows
    may cover much of the view), then the mean over those that agree in all channels.
    """

    def __init__(self, background: Background, clip: BoolArray | None = None, *, pitch_px: int = 8) -> None:
        self._pitch_px = pitch_px
        mean = self._planes(background.mean)
        seen = ((mean > _LEVELS[0]) & (mean < _LEVELS[1])).all(axis=0)
        if clip is not None:
            seen &= lattice(clip.view(np.uint8), pitch_px).ravel() > 0
        self._seen = np.flatnonzero(seen)
        mean = np.take(mean, self._seen, axis=1)
        self._log_mean = np.log(mean)
        # Where nothing is seen, the reference matters not
        self.reference = np.median(mean, axis=1) if len(self._seen) else np.full(3, 128.0)

    def _planes(self, image: NDArray[Any]) -> NDArray[Any]:
        """Return the pixels looked at as (3, n): numpy is slow along an axis of three."""
        return np.ascontiguousarray(lattice(image, self._pitch_px).reshape(-1, 3).T)

    def __call__(self, frame: ColorImage) -> FloatArray:
        """Estimate the gain.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            Colour image.

        Returns
        -------
        (3,) float64
            Factors of the background; NaN when less than a tenth of the pixels agree.
        """
        ratio = np.take(_LOG, np.take(self._planes(frame), self._seen, axis=1)) - self._log_mean
        agreeing = np.abs(_overall(ratio) - _mode(_overall(ratio))) < _AGREE
        steps = np.rint(ratio * _STEPS)
        for _ in range(4):
            count = np.count_nonzero(agreeing)
            if count <= _LEAST_SHARE * ratio.shape[1]:
                return np.full(3, np.nan)
            centre = steps @ agreeing.astype(np.float64) / (_STEPS * count)  # sums of integers: exact
            agreeing = (np.abs(ratio - centre[:, np.newaxis]) < _AGREE).all(axis=0)
        return np.asarray(np.exp(centre), np.float64)


def _overall(ratio: FloatArray) -> FloatArray:
    """Return the mean over the channels."""
    return np.asarray((ratio[0] + ratio[1] + ratio[2]) / 3)


def _mode(overall: FloatArray) -> float:
    """Return the value on which most agree."""
    index = np.floor((overall + _REACH) / _BIN).astype(np.int64)
    inside = index[(index >= 0) & (index < len(_EDGES) - 1)]
    counts = np.bincount(inside, minlength=len(_EDGES) - 1)
    return float(_EDGES[np.argmax(np.convolve(counts, np.ones(5), "same"))] + _BIN / 2)


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """What a frame shows, and how the background is lit in it.

    Parameters
    ----------
    box : tuple of slice
        Rows and columns around the garment, of which the others tell.
    garment : (h, w) uint8
        1 where the garment is, 2 where it only must be, between its parts; by whole half-size pixels.
    edges : (h, w) uint8
        1 where it may go on, likewise.
    share : (h, w) float32
        Of the background's light.
    pale : (h, w) bool
        Whether a shallow shadow on the wall could be seen.
    by_edges_alone : bool
        Whether all of the garment could be a shadow.
    doubtful_px : int
        Pixels beside it that were taken for a shadow with sharp edges, but could be cloth.
    noise : float
        Standard deviation of brightness in half size, in grey levels.
    """

    box: Box
    garment: ByteMask
    edges: ByteMask
    share: NDArray[np.float32]
    pale: BoolArray
    by_edges_alone: bool
    doubtful_px: int
    noise: float

    def expected(self, mean: FloatArray, gain: FloatArray) -> FloatArray:
        """Return the wall of the box in its light, in grey levels.

        Parameters
        ----------
        mean : (H, W, 3) float64
            Of the background, in grey levels.
        gain : (3,) float64
            Of each channel against the background.

        Returns
        -------
        (h, w, 3) float64
        """
        rows, columns = self.box
        # A row of pixels and channels at a time: numpy is slow along an axis of three
        bare = mean.reshape(len(mean), -1)[rows, 3 * columns.start : 3 * columns.stop]
        lit = bare * np.tile(gain, columns.stop - columns.start)
        lit *= cv2.merge([self.share] * 3).reshape(lit.shape)
        return np.asarray(lit.reshape(*self.share.shape, 3), np.float64)


class LightFinder:
    """Finds how the background is lit, and so what is before it.

    Parameters
    ----------
    mean : (H, W, 3) float64
        Of the background, in grey levels.
    """

    def __init__(self, mean: FloatArray) -> None:
        self._half_mean = half(mean)

    def __call__(
        self, frame: ColorImage, gain: FloatArray, cut: BoolArray, near: BoolArray | None
    ) -> Light | BoolArray:
        """Look at a frame.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            Colour image.
        gain : (3,) float64
            Of each channel against the background.
        cut : (H, W) bool
            Where no garment can be.
        near : (H, W) bool, optional
            Surroundings of the gripper's end point, where the garment must begin; anywhere by default.

        Returns
        -------
        Light or (H, W) bool
            Where there is no garment: whether a shadow on the wall could be seen.
        """
        seen = Seen.of(frame, self._half_mean, gain)
        small_cut, small_near = (None if part is None else _reduced(part) for part in (cut, near))
        assert small_cut is not None
        garment, edges, by_edges_alone, doubtful_px = garment_in(seen, small_cut, small_near)
        if not garment.any():
            return _doubled(seen.like.view(np.uint8), frame.shape).view(np.bool_)
        box = grown(bounding_box(garment), _MARGIN_PX, garment.shape)[0]
        place = _doubled_box(box, frame.shape)
        size = place[0].stop - place[0].start, place[1].stop - place[1].start
        wall = np.asarray(seen.like & (cv2.dilate(garment, square(_AWAY_PX)) == 0)).view(np.uint8)
        pale = np.asarray(seen.like[box] & (seen.share[box] > _PALE)).view(np.uint8)
        around, inside = grown(box, 1, wall.shape)  # what interpolation looks at
        share = cv2.resize(_spread_out(seen, wall, around), None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR)
        share = share[2 * inside[0].start : 2 * inside[0].stop, 2 * inside[1].start : 2 * inside[1].stop]
        return Light(
            place,
            _doubled(garment[box], size),
            _doubled(edges[box], size),
            _filled_up(share, size),
            _doubled(pale, size).view(np.bool_),
            by_edges_alone,
            4 * doubtful_px,
            seen.noise,
        )


def _reduced(mask: BoolArray) -> BoolArray:
    rows, columns = (size // 2 * 2 for size in mask.shape)
    return mask[1:rows:2, 1:columns:2]


def _doubled_box(box: Box, shape: tuple[int, ...]) -> Box:
    """Return where a box of half-size pixels lies in the image; an odd last row or column belongs to the one before."""
    v, u = (
        slice(2 * side.start, size if side.stop == size // 2 else 2 * side.stop)
        for side, size in zip(box, shape, strict=False)
    )
    return v, u


def _doubled(mask: ByteMask, shape: tuple[int, ...]) -> ByteMask:
    """Return a mask in full size, which may be odd."""
    return _filled_up(cv2.resize(mask, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST), shape)


def _filled_up(image: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    rows, columns = shape[0] - image.shape[0], shape[1] - image.shape[1]
    if rows == columns == 0:
        return image
    return np.asarray(cv2.copyMakeBorder(image, 0, rows, 0, columns, cv2.BORDER_REPLICATE))


def _spread_out(seen: Seen, wall: ByteMask, box: Box) -> NDArray[np.float32]:
    """Return the light of the wall in a box, and behind other things that of the wall around them."""
    (top, left), light = (side.start for side in box), np.ones(wall[box].shape, np.float32)
    unknown = np.ones(light.shape, np.uint8)
    for side in _WINDOWS_PX:
        part = bounding_box(unknown)
        place = slice(top + part[0].start, top + part[0].stop), slice(left + part[1].start, left + part[1].stop)
        around, inside = grown(place, side // 2, wall.shape)
        there = wall[around]
        lit = np.rint(np.clip(seen.share[around] * WHOLE, 0, _BRIGHTEST)).astype(np.uint16) * there
        sums, counts = (
            cv2.boxFilter(each, cv2.CV_32F, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)[inside]
            for each in (lit, there)
        )
        known = unknown[part].view(np.bool_) & (counts > 0.04 * side * side)
        if side == _WINDOWS_PX[0]:
            known &= there[inside].view(np.bool_)
        np.divide(sums, counts * np.float32(WHOLE), out=light[part], where=known)
        unknown[part][known] = 0
        if not unknown.any():
            break
    return light
