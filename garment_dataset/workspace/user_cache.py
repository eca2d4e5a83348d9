"""Where a person's cache is: what all workspaces of a machine can share, and can do without."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def user_cache_dir() -> Path | None:
    """Return the folder, which need not exist; None where nobody knows a home.

    ``GARMENT_CACHE_DIR`` names it; by default it lies where the system keeps such things.
    """
    if chosen := os.environ.get("GARMENT_CACHE_DIR"):
        return Path(chosen).absolute()
    folder = _general() / "garment-dataset"
    return folder if folder.is_absolute() else None


def _general() -> Path:
    home = Path(os.path.expanduser("~"))  # noqa: PTH111 - Path.home raises where nobody knows
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    if sys.platform == "darwin":
        return home / "Library" / "Caches"
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return named if named.is_absolute() else home / ".cache"  # as the standard has it
