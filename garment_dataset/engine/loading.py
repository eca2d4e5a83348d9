"""Import the module of a stage: an installed one, or one from a folder that is not on Python's path."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from types import ModuleType


HOMES: set[str] = set()
"""The folders that modules were imported from; at any time one of them is on Python's path."""


def load_module(name: str, home: Path | None) -> ModuleType:
    """Import a module.

    Parameters
    ----------
    name : str
        Dotted name.
    home : Path or None
        Folder that holds it, where it is not installed. Modules of the same names from other such folders, which a
        long-lived process may have loaded before, are forgotten.
    """
    if home is not None:
        for other in modules_of(home):
            loaded = sys.modules.get(other)
            if loaded is not None and not _lies_in(loaded, home):
                _forget(other)
        if str(home) not in sys.path:
            sys.path[:] = [path for path in sys.path if path not in HOMES] + [str(home)]
            importlib.invalidate_caches()
        HOMES.add(str(home))
    return importlib.import_module(name)


def load_stage(module: str, home: Path | None) -> Any:  # noqa: ANN401 - what a module calls STAGE
    """Return ``STAGE`` of a module; raises as :func:`load_module` does, and AttributeError where it has none."""
    return load_module(module, home).STAGE


def modules_of(home: Path) -> dict[str, Path]:
    """Return the modules and packages of a folder by name, tests left out."""
    if not home.is_dir():
        return {}
    files = {path.stem: path for path in sorted(home.glob("*.py")) if not path.name.startswith(("test_", "conftest"))}
    return files | {path.parent.name: path.parent for path in sorted(home.glob("*/__init__.py"))}


def _lies_in(module: ModuleType, home: Path) -> bool:
    file = getattr(module, "__file__", None)
    return file is not None and Path(file).resolve().is_relative_to(home.resolve())


def _forget(name: str) -> None:
    for loaded in [each for each in sys.modules if each == name or each.startswith(f"{name}.")]:
        del sys.modules[loaded]
