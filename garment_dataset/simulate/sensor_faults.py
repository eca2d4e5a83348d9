"""What other depth sensors do to an image, fault by fault, on exact depths or on masks of shape (H, W)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from garment_dataset.simulate.scene import DEPTH_CAMERA

if TYPE_CHECKING:
    from numpy.typing import NDArray

EDGE_M = 0.1
"""Neighbouring depths that differ by more are an edge."""


def grain(rng: np.random.Generator, shape: tuple[int, int], radius_px: float) -> NDArray[np.float32]:
    """Return white noise smoothed by a Gaussian of a radius, of unit variance."""
    white = rng.standard_normal(shape, dtype=np.float32)
    kernel = cv2.getGaussianKernel(2 * int(np.ceil(4 * radius_px)) + 1, radius_px)
    smooth = cv2.sepFilter2D(white, -1, kernel, kernel, borderType=cv2.BORDER_REFLECT_101)
    field: NDArray[np.float32] = (smooth / (kernel**2).sum()).astype(np.float32)
    return field


def fatten(depth_m: NDArray[np.float64], radius_px: float, ragged: NDArray[np.float32]) -> NDArray[np.float64]:
    """Let what is nearer grow over what is behind it.

    Parameters
    ----------
    depth_m : ndarray, shape (H, W)
        Exact depth.
    radius_px : float
        By how much on average.
    ragged : ndarray, shape (H, W)
        Deviation from that along the edges, in pixels.
    """
    grown = depth_m.copy()
    for step in range(1, int(np.ceil(radius_px + 2)) + 1):
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * step + 1, 2 * step + 1))
        nearest = cv2.erode(depth_m, kernel)
        reached = (ragged > step - 0.5 - radius_px) & (depth_m - nearest > EDGE_M)
        # what a smaller step has reached is nearer to its edge and stays
        grown = np.where(reached & (grown == depth_m), nearest, grown)
    return grown


def mix(depth_m: NDArray[np.float64], share: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Let a share of the pixels at edges lie anywhere between both surfaces (flying pixels)."""
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    nearest, farthest = cv2.erode(depth_m, cross), cv2.dilate(depth_m, cross)
    chosen = (farthest - nearest > EDGE_M) & (rng.random(depth_m.shape) < share)
    between = nearest + rng.random(depth_m.shape) * (farthest - nearest)
    return np.where(chosen, between, depth_m)


def grazing(depth_m: NDArray[np.float64], limit_rad: float, ragged: NDArray[np.float32]) -> NDArray[np.bool_]:
    r"""Return where a surface is seen at too flat an angle.

    Parameters
    ----------
    depth_m : ndarray, shape (H, W)
        Exact depth.
    limit_rad : float
        Angle from the normal.
    ragged : ndarray, shape (H, W)
        Deviation from that, in radians.

    Notes
    -----
    In a pinhole image the normal of a surface is along :math:`(f q_u, f q_v, q - (u - c_x) q_u - (v - c_y) q_v)` with
    the inverse depth q; the ray is :math:`(u - c_x, v - c_y, f) / f`.
    """
    focal = DEPTH_CAMERA.focal_px
    inverse = 1.0 / depth_m
    down, across = np.gradient(inverse)
    v, u = np.indices(depth_m.shape, dtype=np.float64)
    u -= DEPTH_CAMERA.cx_px
    v -= DEPTH_CAMERA.cy_px
    normal = np.sqrt((focal * across) ** 2 + (focal * down) ** 2 + (inverse - u * across - v * down) ** 2)
    cosine = inverse / normal / np.sqrt(1 + (u**2 + v**2) / focal**2)
    flat: NDArray[np.bool_] = np.arccos(np.clip(cosine, 0, 1)) > limit_rad + ragged
    return flat
