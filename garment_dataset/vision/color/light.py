"""How the background is lit in a frame: its gain, and how much of its light each pixel has left in the shadows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from garment_dataset.vision.color.background import lattice
from garment_dataset.vision.color.masks import square
from garment_dataset.vision.color.seen import WHOLE, Seen, half
from garment_dataset.vision.color.shadow import garment_in

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garment_dataset.arrays import BoolArray, ByteMask, ColorImage, FloatArray
    from garment_dataset.vision.color.background import Background

_BRIGHTEST = round(1.05 * WHOLE)
_WINDOWS_PX = (3, 5, 25, 81)  # for what is behind the garment, the nearest wall around; sums stay below 2^24
_PALE = 0.75  # of the light, that nearly all shadows leave
_AWAY_PX = 7  # at the garment's edges it mixes in

_STEPS = 2**16  # of a logarithm; sums of integers depend on no order
_BIN, _REACH = 0.01, 0.6
_AGREE = 0.04
_LEVELS = (40.0, 250.0)  # darker pixels are too noisy to divide by, brighter ones may be saturated
_LEAST_SHARE = 0.1


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
        mean = self._pixels(background.mean)
        seen = ((mean > _LEVELS[0]) & (mean < _LEVELS[1])).all(axis=1)
        if clip is not None:
            seen &= self._pixels(clip.view(np.uint8)[..., np.newaxis])[:, 0] > 0
        self._seen = np.flatnonzero(seen)
        self._log_mean = np.log(mean[self._seen])
        # Where nothing is seen, the reference matters not
        self.reference = np.median(mean[self._seen], axis=0) if len(self._seen) else np.full(3, 128.0)

    def _pixels(self, image: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(lattice(image, self._pitch_px).reshape(-1, image.shape[2]))

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
        ratio = np.log(np.maximum(self._pixels(frame)[self._seen], 1)) - self._log_mean
        overall = ratio.mean(axis=1)
        counts, edges = np.histogram(overall, bins=np.arange(-_REACH, _REACH, _BIN))
        mode = edges[np.argmax(np.convolve(counts, np.ones(5), "same"))] + _BIN / 2
        agreeing = np.abs(overall - mode) < _AGREE
        for _ in range(4):
            if np.count_nonzero(agreeing) <= _LEAST_SHARE * len(ratio):
                return np.full(3, np.nan)
            steps = np.rint(ratio[agreeing] * _STEPS).astype(np.int64).sum(axis=0)
            centre = steps / (_STEPS * np.count_nonzero(agreeing))
            agreeing = (np.abs(ratio - centre) < _AGREE).all(axis=1)
        return np.asarray(np.exp(centre), np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """What a frame shows, and how the background is lit in it.

    Parameters
    ----------
    garment : (H, W) uint8
        1 where the garment is, 2 where it only must be, between its parts; by whole half-size pixels.
    edges : (H, W) uint8
        1 where it may go on, likewise.
    share : (H, W) float32
        Of the background's light.
    wall_like, pale : (H, W) bool
        Whether a shadow on the wall could be seen; whether a shallow one could.
    by_edges_alone : bool
        Whether all of the garment could be a shadow.
    doubtful_px : int
        Pixels beside it that were taken for a shadow with sharp edges, but could be cloth.
    noise : float
        Standard deviation of brightness in half size, in grey levels.
    """

    garment: ByteMask
    edges: ByteMask
    share: NDArray[np.float32]
    wall_like: BoolArray
    pale: BoolArray
    by_edges_alone: bool
    doubtful_px: int
    noise: float


class LightFinder:
    """Finds how the background is lit, and so what is before it.

    Parameters
    ----------
    mean : (H, W, 3) float64
        Of the background, in grey levels.
    """

    def __init__(self, mean: FloatArray) -> None:
        self._half_mean = half(mean)
        self._size = mean.shape[1], mean.shape[0]

    def __call__(self, frame: ColorImage, gain: FloatArray, cut: BoolArray, near: BoolArray | None) -> Light:
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
        """
        seen = Seen.of(frame, self._half_mean, gain)
        rows, columns = seen.like.shape
        small_cut, small_near = (
            None if part is None else part[1 : 2 * rows : 2, 1 : 2 * columns : 2] for part in (cut, near)
        )
        assert small_cut is not None
        garment, edges, by_edges_alone, doubtful_px = garment_in(seen, small_cut, small_near)
        wall = np.asarray(seen.like & (cv2.dilate(garment, square(_AWAY_PX)) == 0)).view(np.uint8)
        share = cv2.resize(_spread_out(seen, wall), self._size, interpolation=cv2.INTER_LINEAR)
        return Light(
            self._enlarged(garment),
            self._enlarged(edges.view(np.uint8)),
            np.asarray(share, np.float32),
            self._enlarged(seen.like.view(np.uint8)).view(np.bool_),
            self._enlarged((seen.like & (seen.share > _PALE)).view(np.uint8)).view(np.bool_),
            by_edges_alone,
            4 * doubtful_px,
            seen.noise,
        )

    def _enlarged(self, mask: ByteMask) -> ByteMask:
        return np.asarray(cv2.resize(mask, self._size, interpolation=cv2.INTER_NEAREST), np.uint8)


def _spread_out(seen: Seen, wall: ByteMask) -> NDArray[np.float32]:
    """Return the light of the wall, and behind other things that of the wall around them."""
    parts = np.rint(np.clip(seen.share * WHOLE, 0, _BRIGHTEST)).astype(np.uint16) * wall
    light = np.ones(parts.shape, np.float32)
    unknown = np.ones(parts.shape, np.bool_)
    for side in _WINDOWS_PX:
        sums, counts = (
            cv2.boxFilter(part, cv2.CV_32F, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)
            for part in (parts, wall)
        )
        known = unknown & (counts > 0.04 * side * side) & (wall.view(np.bool_) | (side > _WINDOWS_PX[0]))
        light[known] = sums[known] / (counts[known] * np.float32(WHOLE))
        unknown &= ~known
        if not unknown.any():
            break
    return light
