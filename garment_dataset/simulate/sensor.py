"""What a Xtion makes of a scene's depth.

The figures are measured ones, of real raw frames of Xtion cameras. All of the noise is in shift units, eighths of a
pixel of disparity, because that is where the sensor measures: there it is the same at every distance.
"""

from __future__ import annotations

from statistics import NormalDist
from typing import TYPE_CHECKING

import cv2
import numpy as np

from garment_dataset.simulate.nuisance_depth import USUAL_DEPTH, DepthNuisance, Pattern
from garment_dataset.simulate.raster import HEIGHT_PX, WIDTH_PX
from garment_dataset.simulate.sensor_faults import EDGE_M, fatten, grain, grazing, mix

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
_EDGE_DISTANCE_PX = (0.0, 1.5, 3.5, 6.5, 12.5, 640.0)
_EDGE_MISSING = (0.16, 0.09, 0.035, 0.012, 0.0008)
_CLOSED_SHADOWS = 0.26

_REFERENCE_M = 1.07
_SHIFTS_PER_M = 36 / _SHIFT_PITCH / _REFERENCE_M**2
_RAGGED_PX, _RAGGED_RAD = 0.7, 0.1


def openni_table() -> NDArray[np.uint16]:
    """Return the depth that OpenNI reports for every shift, shape (1053,), millimetres: 314 to 9870."""
    tan = ((np.arange(SHIFT_COUNT) - _SHIFT_OFFSET) / 4 - 0.375) * _SHIFT_PITCH
    return np.floor(10 * (tan * 120 / (7.5 - tan) + 120)).astype(np.uint16)


def shift_of_depth(depth_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the shift, not rounded, at which a surface is measured: linear in the inverse depth."""
    tan = 7.5 - 9.0 / depth_m
    return _SHIFT_OFFSET + 4 * (tan / _SHIFT_PITCH + 0.375)


def depth_of_shift(shift: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the depth in metres that a shift stands for: the inverse of :func:`shift_of_depth`."""
    tan = ((shift - _SHIFT_OFFSET) / 4 - 0.375) * _SHIFT_PITCH
    return np.asarray(9.0 / (7.5 - tan))


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


def fixed_pattern(stays: float = 1.0) -> NDArray[np.float32]:
    """Return what this camera always adds, shape (H, W), in shift units: vertical bands and a fine fixed texture.

    It belongs to the camera, so it is the same in every recording; of the texture a share stays on its pixels.
    """
    rng = np.random.default_rng(_CAMERA_SEED)
    bands = _bands(rng, _BAND_START_PX, _BAND_PITCH_PX, _BAND_SHIFT)
    texture = _PATTERN_SHIFT * np.float32(np.sqrt(stays)) * blobs(rng, 3.0)
    pattern: NDArray[np.float32] = (bands + texture).astype(np.float32)
    return pattern


def _bands(rng: np.random.Generator, start_px: float, pitch_px: float, shift: float) -> NDArray[np.float64]:
    edges = np.arange(start_px, WIDTH_PX, pitch_px)
    levels = rng.standard_normal(len(edges) + 1)
    bands: NDArray[np.float64] = levels[np.searchsorted(edges, np.arange(WIDTH_PX), side="right")]
    scaled: NDArray[np.float64] = shift * (bands - bands.mean()) / bands.std()
    return scaled


def pattern_of(pattern: Pattern, stays: float = 1.0) -> NDArray[np.float32]:
    """Return what another camera always adds, shape (H, W), in shift units; of blobs a share stays on its pixels."""
    rng = np.random.default_rng(pattern.seed)
    if pattern.kind == "none":
        return np.zeros((HEIGHT_PX, WIDTH_PX), np.float32)
    if pattern.kind == "blobs":
        return np.float32(pattern.levels_shift * np.sqrt(stays)) * grain(rng, (HEIGHT_PX, WIDTH_PX), pattern.size_px)
    bands = _bands(rng, float(rng.uniform(0, pattern.size_px)), pattern.size_px, pattern.levels_shift)
    return np.broadcast_to(bands, (HEIGHT_PX, WIDTH_PX)).astype(np.float32)


def texture_of_dots(pattern: Pattern | None, stays: float) -> NDArray[np.float32] | None:
    """Return the texture that goes with the dots, shape (H, W), by the column that they were projected from.

    None where the camera has no texture.
    """
    if pattern is None:
        share = np.float32(_PATTERN_SHIFT * np.sqrt(1 - stays))
        return share * blobs(np.random.default_rng(_CAMERA_SEED + 1), 3.0)
    if pattern.kind != "blobs":
        return None
    share = np.float32(pattern.levels_shift * np.sqrt(1 - stays))
    return share * grain(np.random.default_rng(pattern.seed + 1), (HEIGHT_PX, WIDTH_PX), pattern.size_px)


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
        self._rng, self._nuisance = rng, nuisance
        self._faults = rng.spawn(1)[0]  # draws of its own: one nuisance does not change what is drawn for another
        self._noise_shift = _NOISE_SHIFT * (1.0 if nuisance.depth_noise is None else nuisance.depth_noise)
        self._grain = nuisance.depth_grain
        self._keep = _TIME_CORRELATION if self._grain is None else self._grain[1]
        self._table = openni_table()
        kind, stays = nuisance.depth_pattern, nuisance.depth_pattern_stays
        own = 1.0 if stays is None else stays
        self._pattern = fixed_pattern(own) if kind is None else pattern_of(kind, own)
        self._dots = None if stays is None else texture_of_dots(kind, stays)
        self._fine, self._coarse = self._blobs(), blobs(rng, _COARSE_PX)
        self._patchy = blobs(rng, 2.0)
        self._closing = blobs(rng, 6.0)
        self._ragged = grain(self._faults, (HEIGHT_PX, WIDTH_PX), 2.0)

    def frame(self, depth_m: NDArray[np.float64], time_s: float = 0.0) -> NDArray[np.uint16]:
        """Return the next frame, shape (H, W), millimetres; 0 where the sensor sees nothing.

        Parameters
        ----------
        depth_m : ndarray, shape (H, W)
            Exact depth along the optical axis.
        time_s : float
            Since the recording began, for what drifts.
        """
        noise = self._noise()
        missing = self._missing(depth_m)
        seen_m = self._at_edges(depth_m)
        if self._nuisance.depth_exponent is not None:
            noise *= (seen_m / _REFERENCE_M).astype(np.float32) ** np.float32(self._nuisance.depth_exponent - 2)
        always = self._pattern if self._dots is None else self._pattern + _seen_dots(self._dots, seen_m)
        shift = shift_of_depth(seen_m) + always + noise + _SHIFTS_PER_M * self._common_m(time_s)
        reported = self._report(shift)
        reported[missing] = 0
        return reported

    def _report(self, shift: NDArray[np.float64]) -> NDArray[np.uint16]:
        """Return what the driver makes of shifts: its own levels, or whole millimetres of finer or coarser ones."""
        step = self._nuisance.depth_step
        if step is None:
            return self._table[np.clip(np.rint(shift), 0, SHIFT_COUNT - 1).astype(np.intp)]
        depth_m = depth_of_shift(step * np.rint(np.clip(shift, 0, SHIFT_COUNT - 1) / step))
        return np.rint(1000 * depth_m).astype(np.uint16)

    def _common_m(self, time_s: float) -> float:
        """Return the error that all pixels share, at the distance of reference."""
        bias_m, drift_m_s = self._nuisance.depth_bias_m, self._nuisance.depth_drift_m_s
        return (0.0 if bias_m is None else bias_m) + (0.0 if drift_m_s is None else drift_m_s * time_s)

    def _at_edges(self, depth_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return depth as the sensor mistakes it at edges."""
        seen_m = depth_m
        if self._nuisance.depth_fattening_px is not None:
            seen_m = fatten(seen_m, self._nuisance.depth_fattening_px, _RAGGED_PX * self._ragged)
        if self._nuisance.depth_flying is not None:
            seen_m = mix(seen_m, self._nuisance.depth_flying, self._faults)
        return seen_m

    def _blobs(self) -> NDArray[np.float32]:
        """Return fine noise of unit variance, shape (H, W)."""
        if self._grain is None:
            return blobs(self._rng, _FINE_PX)
        return grain(self._rng, (HEIGHT_PX, WIDTH_PX), self._grain[0])

    def _noise(self) -> NDArray[np.float32]:
        """Return the noise of the next frame in shift units: blobs, weakly correlated in time."""
        keep, fresh = np.float32(self._keep), np.float32(np.sqrt(1 - self._keep**2))
        self._fine = keep * self._fine + fresh * self._blobs()
        self._coarse = keep * self._coarse + fresh * blobs(self._rng, _COARSE_PX)
        coarse_share = 0.0 if self._grain is not None else 1 - _FINE_SHARE
        fine, coarse = (np.float32(self._noise_shift * np.sqrt(share)) for share in (1 - coarse_share, coarse_share))
        return fine * self._fine + coarse * self._coarse

    def _missing(self, depth_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        missing = shadow(depth_m) & (self._closing > _quantile(_CLOSED_SHADOWS))
        chance = _edge_chance(depth_m)
        # half of the patchiness stands still, half is new in every frame
        patches = np.float32(np.sqrt(0.5)) * (self._patchy + blobs(self._rng, 2.0))
        missing |= patches > _threshold(chance, self._nuisance.depth_edge_holes)
        if self._nuisance.depth_grazing_rad is not None:
            missing |= grazing(depth_m, self._nuisance.depth_grazing_rad, _RAGGED_RAD * self._ragged)
        missing[:, WIDTH_PX - DEAD_COLUMNS_PX :] = True
        return missing


def _seen_dots(texture: NDArray[np.float32], depth_m: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the texture of the dots where they are seen: the projector's column is to the left by the disparity."""
    disparity_px = np.rint(_FOCAL_BASELINE_PX_M / depth_m).astype(np.intp)
    column = (np.arange(WIDTH_PX) - disparity_px) % WIDTH_PX
    return np.take_along_axis(texture, column, axis=1)


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
    beside = np.abs(np.diff(depth_m, axis=1)) > EDGE_M
    above = np.abs(np.diff(depth_m, axis=0)) > EDGE_M
    edge[:, 1:] |= beside
    edge[:, :-1] |= beside
    edge[1:] |= above
    edge[:-1] |= above
    distance = cv2.distanceTransform((~edge).astype(np.uint8), cv2.DIST_L2, 3)
    return np.searchsorted(_EDGE_DISTANCE_PX[1:-1], distance.ravel()).reshape(distance.shape)


def _threshold(kind: NDArray[np.intp], times: float | None) -> NDArray[np.float32]:
    shares = [share if times is None else min(times * share, 0.9) for share in _EDGE_MISSING]
    levels = np.array([-_quantile(share) for share in shares], dtype=np.float32)
    return levels[kind]


def _quantile(share: float) -> float:
    """Return the value below which `share` of a standard normal variable lies."""
    return NormalDist().inv_cdf(share)
