"""Random fields such as a depth sensor's errors make."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from garment_dataset.arrays import FloatArray

SHAPE = (240, 320)


def blobs(rng: np.random.Generator, radius_px: float) -> FloatArray:
    """Return a field of unit variance."""
    white = rng.standard_normal(SHAPE)
    if radius_px == 0:
        return white
    field = cv2.GaussianBlur(white, (0, 0), radius_px)
    return np.asarray(field / field.std())
