from __future__ import annotations

import numpy as np
import pytest

from garment_dataset.simulate.cloth import ClothSpec
from garment_dataset.simulate.hanging import Hanging
from garment_dataset.simulate.motion import Swing


@pytest.fixture(scope="session")
def towel() -> ClothSpec:
    """The towel as it hangs on the ruler."""
    return ClothSpec(0.36, 0.64, 0.045)


@pytest.fixture(scope="session")
def steady() -> Hanging:
    """How a very steady hand hangs a garment up."""
    return Hanging(np.eye(3), np.zeros(3), 0.0, 1.0, 0.0)


@pytest.fixture(params=["R", "B"])
def swing(request: pytest.FixtureRequest) -> Swing:
    return Swing(request.param, np.pi / 16, 0.5)
