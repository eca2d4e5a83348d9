"""Axes of a silhouette from its second central moments, with MATLAB's ``regionprops`` conventions.

A pixel is a unit square, not a point: its own second moment, 1/12, is added to both variances, as MATLAB does and
scikit-image does not. The sums are exact: integers throughout, divided once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import BoolArray

_PIXEL_VARIANCE_PX2 = 1.0 / 12.0


@dataclass(frozen=True, slots=True)
class Axes:
    """Centroid and axes of the ellipse with the second central moments of a region (thesis 5.2.2).

    Parameters
    ----------
    area_px : int
        Number of pixels.
    centroid_u_px, centroid_v_px : float
        Mean pixel position; the centre of the first pixel is (0, 0).
    major_px, minor_px : float
        Full lengths of the axes: 4 times the square root of the eigenvalues of the covariance.
    orientation_rad : float
        Of the major axis, counter-clockwise as displayed, from the u axis, in (-pi/2, pi/2]. As v points down, the axis
        runs along (cos, -sin) in (u, v). 0 when both axes are equal.
    """

    area_px: int
    centroid_u_px: float
    centroid_v_px: float
    major_px: float
    minor_px: float
    orientation_rad: float

    @property
    def downward(self) -> tuple[float, float]:
        """Unit vector (u, v) along the major axis, pointing down; to the right when the axis is level."""
        u, v = math.cos(self.orientation_rad), -math.sin(self.orientation_rad)
        return (u, v) if v > 0 or (v == 0 and u > 0) else (-u, -v)


def _raw_sums(mask: BoolArray) -> tuple[int, int, int, int, int, int, int, int]:
    """Sum 1, u, v, u^2, u v, v^2 over a region, about the corner of its bounding box; the corner comes last."""
    u0, v0, width, height = cv2.boundingRect(mask.view(np.uint8))
    u, v = np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64)
    box = mask[v0 : v0 + height, u0 : u0 + width].astype(np.float64)
    # Two matrix products give all sums; float64 holds every integer below 2^53, so they are exact
    sums = np.stack([np.ones_like(v), v, v * v]) @ (box @ np.stack([np.ones_like(u), u, u * u], axis=1))
    area, sum_u, sum_uu = (int(value) for value in sums[0])
    sum_v, sum_uv, sum_vv = int(sums[1, 0]), int(sums[1, 1]), int(sums[2, 0])
    return area, sum_u, sum_v, sum_uu, sum_uv, sum_vv, u0, v0


def region_axes(mask: BoolArray) -> Axes:
    r"""Measure a region.

    Parameters
    ----------
    mask : (H, W) bool
        The region, up to 4096 x 4096 pixels.

    Returns
    -------
    Axes
        With area 0 and NaN elsewhere for an empty region.

    Notes
    -----
    With the covariance :math:`\mu_{uu}, \mu_{uv}, \mu_{vv}` of the pixels, 1/12 added to the variances, and
    :math:`d = \sqrt{(\mu_{uu} - \mu_{vv})^2 + 4 \mu_{uv}^2}`, the lengths are
    :math:`4 \sqrt{(\mu_{uu} + \mu_{vv} \pm d) / 2}` and the orientation is
    :math:`\tfrac12 \operatorname{atan2}(-2 \mu_{uv}, \mu_{uu} - \mu_{vv})`; its sign is turned because v points down.
    """
    area, sum_u, sum_v, sum_uu, sum_uv, sum_vv, u0, v0 = _raw_sums(mask)
    if area == 0:
        return Axes(0, math.nan, math.nan, math.nan, math.nan, math.nan)
    var_uu = (area * sum_uu - sum_u**2) / area**2 + _PIXEL_VARIANCE_PX2
    var_vv = (area * sum_vv - sum_v**2) / area**2 + _PIXEL_VARIANCE_PX2
    neg_cov_uv = (sum_u * sum_v - area * sum_uv) / area**2  # never -0.0, which would turn a vertical axis round
    apart = math.hypot(var_uu - var_vv, 2 * neg_cov_uv)
    return Axes(
        area,
        u0 + sum_u / area,
        v0 + sum_v / area,
        4 * math.sqrt((var_uu + var_vv + apart) / 2),
        4 * math.sqrt((var_uu + var_vv - apart) / 2),
        math.atan2(2 * neg_cov_uv, var_uu - var_vv) / 2,
    )
