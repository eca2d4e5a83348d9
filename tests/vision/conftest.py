"""Synthetic depth frames: a sheet z = f(y) before a camera like the Xtion's, exact, or rounded as depth images are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest

from garment_dataset.vision.depth.cloud import Cloud, Intrinsics

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from garment_dataset.vision.depth.cloud import Point

    FloatArray = NDArray[np.float64]
    Profile = Callable[[FloatArray], FloatArray]


CAMERA = Intrinsics(fx_px=570.0, fy_px=569.0, cx_px=319.5, cy_px=239.5)  # fx != fy: a swap shows
SHAPE = (480, 640)


def render(profile: Profile, top_y_m: float, bottom_y_m: float, half_width_m: float = 0.2) -> FloatArray:
    """Return the exact depth of every pixel of a sheet z = f(y), the same for all x, and NaN beside it.

    A row sees the sheet where y = f(y) (v - cy) / fy: solved by bisection.
    """
    slope = (np.arange(SHAPE[0]) - CAMERA.cy_px) / CAMERA.fy_px
    low, high = np.full(SHAPE[0], top_y_m - 0.5), np.full(SHAPE[0], bottom_y_m + 0.5)
    for _ in range(60):
        middle = (low + high) / 2
        below = middle > profile(middle) * slope
        low, high = np.where(below, low, middle), np.where(below, middle, high)
    inside = (low >= top_y_m) & (low <= bottom_y_m)
    z_m = np.where(inside, profile(low), np.nan)[:, None]
    x_m = z_m * ((np.arange(SHAPE[1]) - CAMERA.cx_px) / CAMERA.fx_px)
    return np.where(np.abs(x_m) <= half_width_m, z_m, np.nan)


def openni_levels_mm() -> NDArray[np.int64]:
    """Return every depth that an OpenNI sensor can report."""
    metres = ((np.arange(1053) - 800) / 4 - 0.375) * 0.1052
    return np.unique(np.floor(10 * (metres * 120 / (7.5 - metres) + 120)).astype(np.int64))


def to_image(depth_m: FloatArray, *, openni: bool) -> NDArray[np.uint16]:
    """Return a depth image: 0 for NaN, else the nearest millimetre or the nearest level of an OpenNI sensor."""
    depth_mm = np.nan_to_num(depth_m * 1000)
    if openni:
        levels = openni_levels_mm()
        nearest = levels[np.searchsorted((levels[1:] + levels[:-1]) / 2, depth_mm)]
        depth_mm = np.where(depth_mm > 0, nearest, 0)
    return np.rint(depth_mm).astype(np.uint16)


def disturb(depth_m: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return depths as a real sensor errs before it rounds to its levels, of which the spacing is z² / 342.205 m.

    In blobs, with correlations 0.64, 0.50, 0.29 and 0.13 at 1, 2, 4 and 8 px (measured middles: 0.59, 0.45, 0.32,
    0.24), 0.57 levels strong, to which the rounding adds up to 0.64; and by column, in bands of 56 px, 0.43 levels.
    """
    noise = np.zeros(SHAPE)
    for share, blur_px in ((0.3, 0.0), (0.35, 1.2), (0.35, 4.0)):
        white = rng.standard_normal(SHAPE)
        part = cv2.GaussianBlur(white, (0, 0), blur_px) if blur_px else white
        noise += np.sqrt(share) * part / part.std()
    bands = np.repeat(rng.normal(0, 0.43, 13), 56)[rng.integers(56) :][: SHAPE[1]]
    return depth_m + (0.57 * noise + bands) * depth_m**2 / 342.205


def full_cloud(
    depth_mm: NDArray[np.uint16] | FloatArray,
    intrinsics: Intrinsics,
    gripper_m: Point,
    *,
    band_half_width_m: float,
    strip_half_width_m: float,
) -> Cloud:
    """Back-project every pixel and test every condition on every one: what ``select_pixels`` must equal."""
    v, u = np.indices(depth_mm.shape)
    z_mm = np.nan_to_num(depth_mm.astype(np.float64))
    z_m = z_mm / 1000
    x_m = z_mm * ((u - intrinsics.cx_px) / (1000 * intrinsics.fx_px))
    y_m = z_mm * ((v - intrinsics.cy_px) / (1000 * intrinsics.fy_px))
    ee_x_m, ee_y_m, ee_z_m = gripper_m
    kept = (z_mm > 0) & (ee_z_m - band_half_width_m <= z_m) & (z_m <= ee_z_m + band_half_width_m)
    kept &= (y_m >= ee_y_m) & (np.abs(x_m - ee_x_m) < strip_half_width_m)
    return Cloud(x_m.T[kept.T], y_m.T[kept.T], z_mm.T[kept.T])


@pytest.fixture(scope="session")
def reference_cloud() -> Callable[..., Cloud]:
    """Take depth images, and exact depths in millimetres with NaN as well."""
    return full_cloud


@pytest.fixture(scope="session")
def intrinsics() -> Intrinsics:
    return CAMERA


@pytest.fixture(scope="session")
def sheet_depth_m() -> Callable[..., FloatArray]:
    return render


@pytest.fixture(scope="session")
def noisy() -> Callable[..., FloatArray]:
    return disturb


@pytest.fixture(scope="session")
def image() -> Callable[..., NDArray[np.uint16]]:
    return to_image


@pytest.fixture(scope="session")
def levels_mm() -> NDArray[np.int64]:
    return openni_levels_mm()
