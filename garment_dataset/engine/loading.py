"""Import the module of a stage: an installed one, or one from a folder that is not on Python's path."""

from __future__ import annotations

import importlib
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.loaded import ContentStates, FileState, file_state, note_loaded

if TYPE_CHECKING:
    from collections.abc import Iterable
    from types import ModuleType


_TESTS = ("test_", "conftest")

_Seen = tuple[FileState | None, str | None]

HOMES: dict[str, dict[str, _Seen]] = {}
"""The folders that modules were imported from, and what their files were; one at a time is on Python's path."""

_CONTENTS = ContentStates()


def load_module(name: str, home: Path | None) -> ModuleType:
    """Import a module.

    Parameters
    ----------
    name : str
        Dotted name.
    home : Path or None
        Folder that holds it, where it is not installed. What a long-lived process has loaded from this and other such
        folders is forgotten when the folder is another one than before, or a file in it was written since.
    """
    note_loaded()
    if home is None:
        return importlib.import_module(name)
    state = _state_of(home)
    if str(home) not in sys.path or HOMES.get(str(home)) != state:
        _forget((*HOMES, str(home)))
        sys.path[:] = [path for path in sys.path if path not in HOMES and path != str(home)] + [str(home)]
        importlib.invalidate_caches()
        HOMES[str(home)] = state
    written, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # it is out of date only after a second
    try:
        return importlib.import_module(name)
    finally:
        sys.dont_write_bytecode = written


def load_stage(module: str, home: Path | None) -> Any:  # noqa: ANN401 - what a module calls STAGE
    """Return ``STAGE`` of a module; raises as :func:`load_module` does, and AttributeError where it has none."""
    return load_module(module, home).STAGE


def modules_of(home: Path) -> dict[str, Path]:
    """Return the modules and packages of a folder by name, tests left out."""
    if not home.is_dir():
        return {}
    names = {path.stem: path for path in sorted(home.glob("*.py")) if not path.name.startswith(_TESTS)}
    files = {name: path for name, path in names.items() if name.isidentifier()}  # not what editors leave: .#lengths.py
    return files | {path.parent.name: path.parent for path in sorted(home.glob("*/__init__.py"))}


def _state_of(home: Path) -> dict[str, _Seen]:
    """Return state and content of every file that a module of a folder may be made of.

    The state too, as only that tells later that what is loaded is what is there (:func:`edited_since_loaded`).
    """
    places = modules_of(home).values()
    files = (file for place in places for file in (place.rglob("*.py") if place.is_dir() else (place,)))
    return {str(file): (file_state(str(file)), _CONTENTS(str(file))) for file in files}


def _forget(homes: Iterable[str]) -> None:
    """Have Python read the modules of some folders anew; tests, which nothing here imports, stay."""
    folders = tuple(f"{place}{os.sep}" for home in homes for place in (home, Path(home).resolve()))
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        # a folder without __init__.py has no file
        places = (file,) if file else getattr(module, "__path__", ())
        if not name.startswith(_TESTS) and any(place.startswith(folders) for place in places):
            del sys.modules[name]
