"""What a Xtion makes of a scene's depth.

The figures are measured ones, of real raw frames of Xtion cameras. All of the noise is in shift units, eighths of a
pixel of disparity, because that is where the sensor measures: there it is the same at every distance.
"""

from __future__ import annotations

from statistics import NormalDist
from typing import TYPE_CHECKING

import cv2
import numpy as np

from garment_dataset.simulate.nuisance_depth import USUAL_DEPTH, DepthNuisance
from garment_dataset.simulate.raster import HEIGHT_PX, WIDTH_PX

if TYPE_CHECKING:
    from numpy.typing import NDArray

SHIFT_COUNT = 1053
DEAD_COLUMNS_PX = 7
_SHIFT_OFFSET = 800.0
_SHIFT_PITCH = 0.1052
_FOCAL_BASELINE_PX_M = 570.3422 * 0.075

_NOISE_SHIFT = 0.49
_FINE_PX, _COARSE_PX, _FINE_SHARE = 1.0, 6.0, 0.6
_TIME_CORRELATION = 0.2
_BAND_SHIFT = 0.40
_BAND_PITCH_PX, _BAND_START_PX = 56.3, 36.0
_PATTERN_SHIFT = 0.25
_CAMERA_SEED = 20140505

_SHADOW_LOSS_PX = 2.5
_EDGE_M = 0.1
_EDGE_DISTANCE_PX = (0.0, 1.5, 3.5, 6.5, 12.5, 640.0)
_EDGE_MISSING = (0.16, 0.09, 0.035, 0.012, 0.0008)
_CLOSED_SHADOWS = 0.26


def openni_table() -> NDArray[np.uint16]:
    """Return the depth that OpenNI reports for every shift, shape (1053,), millimetres: 314 to 9870."""
    tan = ((np.arange(SHIFT_COUNT) - _SHIFT_OFFSET) / 4 - 0.375) * _SHIFT_PITCH
    return np.floor(10 * (tan * 120 / (7.5 - tan) + 120)).astype(np.uint16)


def shift_of_depth(depth_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the shift, not rounded, at which a surface is measured: linear in the inverse depth."""
    tan = 7.5 - 9.0 / depth_m
    return _SHIFT_OFFSET + 4 * (tan / _SHIFT_PITCH + 0.375)


def blobs(rng: np.random.Generator, radius_px: float) -> NDArray[np.float32]:
    """Return a field of unit variance over the image, shape (H, W), correlated over some `radius_px`.

    White noise, smoothed by a Gaussian of that radius; coarse fields are made small and enlarged.
    """
    shrink = 4 if radius_px >= 4 else 1
    shape = (HEIGHT_PX // shrink, WIDTH_PX // shrink)
    sigma = radius_px / shrink
    white = rng.standard_normal(shape, dtype=np.float32)
    white *= 2 * np.sqrt(np.pi) * sigma
    field = cv2.GaussianBlur(white, (0, 0), sigma, borderType=cv2.BORDER_REFLECT_101)
    if shrink > 1:
        field = cv2.resize(field, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_CUBIC)
    return field.astype(np.float32, copy=False)


def fixed_pattern() -> NDArray[np.float32]:
    """Return what this camera always adds, shape (H, W), in shift units: vertical bands and a fine fixed texture.

    It belongs to the camera, so it is the same in every recording.
    """
    rng = np.random.default_rng(_CAMERA_SEED)
    edges = np.arange(_BAND_START_PX, WIDTH_PX, _BAND_PITCH_PX)
    levels = rng.standard_normal(len(edges) + 1)
    bands = levels[np.searchsorted(edges, np.arange(WIDTH_PX), side="right")]
    bands = _BAND_SHIFT * (bands - bands.mean()) / bands.std()
    texture = _PATTERN_SHIFT * blobs(rng, 3.0)
    pattern: NDArray[np.float32] = (bands + texture).astype(np.float32)
    return pattern


class DepthSensor:
    """Turns exact depth images into what the sensor reports, one frame after the other.

    Parameters
    ----------
    rng : numpy.random.Generator
        The noise of this recording.
    nuisance : DepthNuisance
        What is unusual about the sensor.
    """

    def __init__(self, rng: np.random.Generator, nuisance: DepthNuisance = USUAL_DEPTH) -> None:
        self._rng = rng
        self._noise_shift = _NOISE_SHIFT * (1.0 if nuisance.depth_noise is None else nuisance.depth_noise)
        self._table = openni_table()
        self._pattern = fixed_pattern()
        self._fine, self._coarse = blobs(rng, _FINE_PX), blobs(rng, _COARSE_PX)
        self._patchy = blobs(rng, 2.0)
        self._closing = blobs(rng, 6.0)

    def frame(self, depth_m: NDArray[np.float64]) -> NDArray[np.uint16]:
        """Return the next frame, shape (H, W), millimetres; 0 where the sensor sees nothing.

        Parameters
        ----------
        depth_m : ndarray, shape (H, W)
            Exact depth along the optical axis.
        """
        shift = shift_of_depth(depth_m) + self._pattern + self._noise()
        index = np.clip(np.rint(shift), 0, SHIFT_COUNT - 1).astype(np.intp)
        reported = self._table[index]
        reported[self._missing(depth_m)] = 0
        return reported

    def _noise(self) -> NDArray[np.float32]:
        """Return the noise of the next frame in shift units: blobs, weakly correlated in time."""
        keep, fresh = np.float32(_TIME_CORRELATION), np.float32(np.sqrt(1 - _TIME_CORRELATION**2))
        self._fine = keep * self._fine + fresh * blobs(self._rng, _FINE_PX)
        self._coarse = keep * self._coarse + fresh * blobs(self._rng, _COARSE_PX)
        fine, coarse = (np.float32(self._noise_shift * np.sqrt(share)) for share in (_FINE_SHARE, 1 - _FINE_SHARE))
        return fine * self._fine + coarse * self._coarse

    def _missing(self, depth_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        missing = shadow(depth_m) & (self._closing > _quantile(_CLOSED_SHADOWS))
        chance = _edge_chance(depth_m)
        # half of the patchiness stands still, half is new in every frame
        patches = np.float32(np.sqrt(0.5)) * (self._patchy + blobs(self._rng, 2.0))
        missing |= patches > _threshold(chance)
        missing[:, WIDTH_PX - DEAD_COLUMNS_PX :] = True
        return missing


def shadow(depth_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return where a nearer surface keeps the projector's light off, shape (H, W).

    The projector stands to the right of the camera, so the shadow lies on the left of near objects; its width is
    focal length times baseline times the difference of the inverse depths, less some 2.5 px that the sensor fills.
    """
    columns = np.arange(depth_m.shape[1])
    ray = columns - _FOCAL_BASELINE_PX_M / depth_m
    to_the_right = np.full_like(ray, np.inf)
    to_the_right[:, :-1] = np.minimum.accumulate(ray[:, :0:-1], axis=1)[:, ::-1]
    shaded: NDArray[np.bool_] = to_the_right < ray - _SHADOW_LOSS_PX
    return shaded


def _edge_chance(depth_m: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the class of distance to the nearest depth edge, shape (H, W): index into the missing rates."""
    edge = np.zeros(depth_m.shape, dtype=np.bool_)
    beside = np.abs(np.diff(depth_m, axis=1)) > _EDGE_M
    above = np.abs(np.diff(depth_m, axis=0)) > _EDGE_M
    edge[:, 1:] |= beside
    edge[:, :-1] |= beside
    edge[1:] |= above
    edge[:-1] |= above
    distance = cv2.distanceTransform((~edge).astype(np.uint8), cv2.DIST_L2, 3)
    return np.searchsorted(_EDGE_DISTANCE_PX[1:-1], distance.ravel()).reshape(distance.shape)


def _threshold(kind: NDArray[np.intp]) -> NDArray[np.float32]:
    levels = np.array([-_quantile(share) for share in _EDGE_MISSING], dtype=np.float32)
    return levels[kind]


def _quantile(share: float) -> float:
    """Return the value below which `share` of a standard normal variable lies."""
    return NormalDist().inv_cdf(share)
