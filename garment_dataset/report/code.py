"""What made a page, beside the facts on it: the report's own code and templates, and the libraries that draw."""

from __future__ import annotations

import functools
import hashlib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_PACKAGE = Path(__file__).parents[1]
_LIBRARIES = ("jinja2", "matplotlib", "numpy", "opencv-python-headless", "pandas", "plotly")


@functools.cache
def room_digest(*rooms: str) -> str:
    """Return a digest of all files of some rooms of the package.

    Parameters
    ----------
    *rooms : str
        Their folders.
    """
    state = hashlib.sha256()
    for room in rooms:
        for path in sorted((_PACKAGE / room).rglob("*")):
            if path.is_file() and path.suffix != ".pyc":
                state.update(f"{path.relative_to(_PACKAGE).as_posix()}\n".encode() + path.read_bytes() + b"\0")
    return state.hexdigest()


@functools.cache
def report_code() -> dict[str, str]:
    """Return what pages depend on beside facts: code by digest, libraries by version."""
    found = {"code": room_digest("report", "view")}
    for name in _LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found
