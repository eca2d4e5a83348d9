"""Names of array types, for annotations: what a function takes and gives, by element.

Imported by type checkers alone, so that naming a type loads nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
"""Measured quantities."""

IntArray = NDArray[np.int64]
"""Counts, indices, and stamps in ns."""

BoolArray = NDArray[np.bool_]
"""Masks."""

DepthImage = NDArray[np.uint16]
"""(H, W), millimetres along the optical axis; 0 means no return."""

ColorImage = NDArray[np.uint8]
"""(H, W, 3), red, green, blue."""
