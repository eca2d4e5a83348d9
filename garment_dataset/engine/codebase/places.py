"""Where first-party modules lie: nothing is imported, and no file is opened."""

from __future__ import annotations

import importlib.machinery
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


class Place(NamedTuple):
    """Source of a module (None for a folder without ``__init__.py``) and, for a package, its folder."""

    file: Path | None
    folder: Path | None


class Places:
    """The places of all first-party modules, looked for when asked for.

    Parameters
    ----------
    roots : mapping of str to Path
        Folder of each first-party package, or file of a first-party module, by import name.
    """

    def __init__(self, roots: Mapping[str, Path]) -> None:
        self._roots = dict(roots)
        self._places: dict[str, Place | None] = {}
        self._entries: dict[Path, frozenset[str]] = {}
        self._extensions = tuple(importlib.machinery.EXTENSION_SUFFIXES)

    def __contains__(self, module: str) -> bool:
        """Say whether a dotted name belongs to one of the roots."""
        return module.partition(".")[0] in self._roots

    def find(self, module: str) -> Place | None:
        """Return where a module lies; None when there is none.

        Raises
        ------
        UntraceableCodeError
            If it is compiled.
        """
        if module not in self._places:
            self._places[module] = self._look_for(module)
        return self._places[module]

    def _look_for(self, module: str) -> Place | None:
        root, _, rest = module.partition(".")
        path = self._roots[root]
        if not rest and path.is_file():
            return Place(path, None)
        folder = path.joinpath(*rest.split(".")) if rest else path
        entries = self._names_in(folder)
        if "__init__.py" in entries:
            return Place(folder / "__init__.py", folder)
        beside = self._names_in(folder.parent) if rest else frozenset()
        for compiled in [folder.name + suffix for suffix in self._extensions]:
            if compiled in beside:
                raise UntraceableCodeError(
                    "compiled code cannot be followed",
                    where=folder.parent / compiled,
                    hint="Keep the Python source only",
                )
        if f"{folder.name}.py" in beside:
            return Place(folder.parent / f"{folder.name}.py", None)
        return Place(None, folder) if entries else None

    def _names_in(self, folder: Path) -> frozenset[str]:
        if folder not in self._entries:
            try:
                self._entries[folder] = frozenset(path.name for path in folder.iterdir())
            except OSError:
                self._entries[folder] = frozenset()
        return self._entries[folder]
