"""Names of array types, for annotations: what a function takes and gives, by element.

The names are only text when the program runs: importing them loads nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

FloatArray: TypeAlias = "NDArray[np.float64]"
"""Measured quantities."""

IntArray: TypeAlias = "NDArray[np.int64]"
"""Counts, indices, and stamps in ns."""

BoolArray: TypeAlias = "NDArray[np.bool_]"
"""Masks, and other answers yes or no."""

ByteMask: TypeAlias = "NDArray[np.uint8]"
"""(H, W), a mask as OpenCV takes it: 0 is outside."""

ColorImage: TypeAlias = "NDArray[np.uint8]"
"""(H, W, 3), red, green, blue."""

DepthImage: TypeAlias = "NDArray[np.uint16]"
"""(H, W), millimetres along the optical axis; 0 means no return."""
