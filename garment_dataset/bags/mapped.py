"""Files as memory: nothing is read before it is looked at, and nothing beyond the end."""

from __future__ import annotations

import mmap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


def mapped(path: Path) -> memoryview:
    """Return a read-only view of a file that is not empty; it must not shrink while anybody holds the view."""
    with path.open("rb") as file:
        return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
