"""What a Xtion's colour camera makes of a scene: exposure drift, dark borders, a soft lens, Bayer noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from garment_dataset.simulate.nuisance_color import USUAL_COLOR, AutoExposure, ColorNuisance
from garment_dataset.simulate.raster import HEIGHT_PX, WIDTH_PX

if TYPE_CHECKING:
    from numpy.typing import NDArray

_NOISE_LEVELS = (3.4, 2.5, 3.8)
_NOISE_RADIUS_PX = 0.76
_TARGET_LEVEL = 128.0  # of a picture's mean: middle grey
_EXPOSURE_SHARE, _BALANCE_SHARE = 0.012, 0.006
_DRIFT_CORRELATION = 0.85
_BORDER_SHARE = 0.22
_LENS_PX = 0.6


def border_shading() -> NDArray[np.float32]:
    """Return the share of light that reaches each pixel, shape (H, W, 1): less at the left and right borders."""
    across = (np.arange(WIDTH_PX) - (WIDTH_PX - 1) / 2) / (WIDTH_PX / 2)
    down = (np.arange(HEIGHT_PX) - (HEIGHT_PX - 1) / 2) / (HEIGHT_PX / 2)
    light = 1 - _BORDER_SHARE * across[None, :] ** 4 - 0.03 * down[:, None] ** 4
    return light.astype(np.float32)[..., None]


class ColorSensor:
    """Turns noiseless colour images into what the camera reports, one frame after the other.

    Parameters
    ----------
    rng : numpy.random.Generator
        The noise of this recording.
    nuisance : ColorNuisance
        What is unusual about room, light and camera.
    """

    def __init__(self, rng: np.random.Generator, nuisance: ColorNuisance = USUAL_COLOR) -> None:
        self._rng = rng
        self._light = border_shading()
        self._drift = rng.standard_normal(4)
        self._white = np.empty((HEIGHT_PX, WIDTH_PX, 3), dtype=np.float32)
        kernel = cv2.getGaussianKernel(7, _NOISE_RADIUS_PX)
        times = 1.0 if nuisance.color_noise is None else nuisance.color_noise
        self._flicker = 1.0 if nuisance.flicker is None else nuisance.flicker
        self._lens_px = _LENS_PX if nuisance.blur_px is None else nuisance.blur_px
        self._auto = nuisance.auto_exposure
        self._followed: NDArray[np.float64] | None = None
        self._scale = np.array(_NOISE_LEVELS, dtype=np.float32) * np.float32(times / np.sum(kernel**2))

    def frame(self, pixels: NDArray[np.float32]) -> NDArray[np.uint8]:
        """Return the next frame, shape (H, W, 3), of the exact image `pixels`, same shape, 0 to 255."""
        fresh = np.sqrt(1 - _DRIFT_CORRELATION**2)
        self._drift = _DRIFT_CORRELATION * self._drift + fresh * self._rng.standard_normal(4)
        drift = self._flicker * self._drift
        gain = (1 + _EXPOSURE_SHARE * drift[0]) * (1 + _BALANCE_SHARE * drift[1:])
        image = soften(pixels, self._lens_px)
        image *= self._light
        if self._auto is not None:
            gain = gain * self._follow(self._auto, image.mean(axis=(0, 1), dtype=np.float64))
        np.multiply(image, gain.astype(np.float32), out=image)
        self._rng.standard_normal(dtype=np.float32, out=self._white)
        noise = cv2.GaussianBlur(self._white, (7, 7), _NOISE_RADIUS_PX)
        np.multiply(noise, self._scale, out=self._white)
        image += self._white
        return as_bytes(image)

    def _follow(self, auto: AutoExposure, mean: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the gain of each channel; the camera was on before the recording began."""
        grey = mean.mean()
        wanted = (_TARGET_LEVEL / grey) ** auto.exposure * (grey / mean) ** auto.balance
        before = wanted if self._followed is None else self._followed
        self._followed = before + auto.rate * (wanted - before)
        return self._followed


def soften(pixels: NDArray[np.float32], radius_px: float = _LENS_PX) -> NDArray[np.float32]:
    """Return the image as a lens of finite sharpness shows it, whose blur has a standard deviation of `radius_px`."""
    side_px = 5 if radius_px <= _LENS_PX else 9
    return cv2.GaussianBlur(pixels, (side_px, side_px), radius_px).astype(np.float32, copy=False)


def as_bytes(pixels: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the image in whole levels, 0 to 255."""
    whole = np.rint(pixels)
    return np.clip(whole, 0, 255, out=whole).astype(np.uint8)
