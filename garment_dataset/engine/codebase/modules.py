"""First-party modules as syntax: where they lie, what they define, and what a name in them stands for.

Nothing is imported: a module is read and parsed, once per :class:`Modules`.
"""

from __future__ import annotations

import ast
import builtins
import importlib.util
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.engine.codebase.places import Places
from garment_dataset.engine.codebase.rules import MODULE_VARIABLES
from garment_dataset.engine.codebase.scopes import DEFINITION, Bindings, Home, ImportTarget, global_writes
from garment_dataset.engine.codebase.statements import Statement, statements_of
from garment_dataset.engine.errors import UntraceableCodeError
from garment_dataset.engine.loaded import state_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path


class Symbol(NamedTuple):
    """A name that a first-party module defines."""

    module: str
    name: str

    def __str__(self) -> str:
        return f"{self.module}:{self.name}"


class ModuleRef(NamedTuple):
    """A first-party module itself."""

    module: str


class External(NamedTuple):
    """Something of the standard library, of a third party, or built in."""

    dotted: str


Target = Symbol | ModuleRef | External
"""What a name may stand for."""

_BUILTINS = frozenset(dir(builtins)) - {"_"}  # which an interactive Python adds
_MODULE_NAMES = MODULE_VARIABLES | {"__name__", "__package__", "__doc__", "__annotations__"}


@dataclass(frozen=True, eq=False)
class Module:
    """One first-party module.

    Attributes
    ----------
    home : Home
        Its name and place.
    file : Path or None
        Its source; None for a folder without ``__init__.py``.
    folder : Path or None
        Where its submodules lie, when it is a package.
    statements : tuple of Statement
        Its top level, in order.
    aliases : mapping of str to ImportTarget
        Names that only imports of one thing bind.
    symbols : mapping of str to tuple of Statement
        Every other name, with the statements that bind or change it, in order.
    loads : tuple of (ImportTarget, int)
        What importing it imports, in order, and on which line.
    global_writes : mapping of str to int
        Its variables that functions write through ``global``, and where.
    """

    home: Home
    file: Path | None
    folder: Path | None
    statements: tuple[Statement, ...]
    aliases: Mapping[str, ImportTarget]
    symbols: Mapping[str, tuple[Statement, ...]]
    loads: tuple[tuple[ImportTarget, int], ...]
    global_writes: Mapping[str, int]

    @property
    def name(self) -> str:
        """Its dotted name."""
        return self.home.module

    @property
    def effects(self) -> tuple[Statement, ...]:
        """The statements that act beyond the module's own variables."""
        return tuple(statement for statement in self.statements if statement.has_effect)

    @cached_property
    def setters(self) -> tuple[Statement, ...]:
        """The definitions that may set something in a library when they are called."""
        return tuple(statement for statement in self.statements if statement.sets_later)

    @cached_property
    def annotations_run(self) -> bool:
        """Whether importing it evaluates annotations."""
        return not any(
            isinstance(each.node, ast.ImportFrom) and each.node.module == "__future__" for each in self.statements[:3]
        )

    @cached_property
    def loaded_submodules(self) -> frozenset[str]:
        """The submodules that it imports from: they become its variables, without any statement that says so."""
        prefix = f"{self.name}."
        names = (target.module.removeprefix(prefix) for target, _ in self.loads if target.module.startswith(prefix))
        return frozenset(name.partition(".")[0] for name in names)

    def is_definition(self, name: str) -> bool:
        """Say whether ``name`` is a function or class, and never anything else."""
        return all(statement.binds.get(name, DEFINITION) == DEFINITION for statement in self.symbols[name])


class Modules:
    """All first-party modules, read when asked for.

    Parameters
    ----------
    roots : mapping of str to Path
        Folder of each first-party package, or file of a first-party module, by import name.

    Attributes
    ----------
    states : dict of Path to str
        Digest of the content of every file that was read, as it was read.
    """

    def __init__(self, roots: Mapping[str, Path]) -> None:
        self._places = Places(roots)
        self._modules: dict[str, Module] = {}
        self.states: dict[Path, str] = {}

    def is_first_party(self, module: str) -> bool:
        """Say whether a dotted name belongs to one of the roots."""
        return module in self._places

    def exists(self, module: str) -> bool:
        """Say whether there is such a first-party module."""
        try:
            return self._places.find(module) is not None
        except UntraceableCodeError:
            return True  # compiled: reading it says so

    def module(self, name: str) -> Module:
        """Return a module, parsed.

        Raises
        ------
        UntraceableCodeError
            If its source is missing, compiled or no valid Python, or it star-imports first-party names.
        """
        if name not in self._modules:
            self._modules[name] = self._read(name)
        return self._modules[name]

    def resolve(self, module: Module, name: str, trail: set[str]) -> Target | None:
        """Return what a global name of ``module`` stands for, or None for nothing.

        Parameters
        ----------
        module : Module
            Where the name is used.
        name : str
            The name.
        trail : set of str
            Gathers the modules that had to be consulted.

        Raises
        ------
        UntraceableCodeError
            If it leads into a module that cannot be read, or that does not define it.
        """
        if name in module.aliases:
            return self.imported(module.aliases[name], trail)
        if name in module.symbols:
            return Symbol(module.name, name)
        if name in module.loaded_submodules:
            return ModuleRef(f"{module.name}.{name}")
        if name in _MODULE_NAMES or name in _BUILTINS:
            return External(f"builtins.{name}")
        return None

    def imported(self, target: ImportTarget, trail: set[str]) -> Target:
        """Return what an import gives, through any number of re-exports; raises as :meth:`resolve` does."""
        if not self.is_first_party(target.module):
            return External(target.module if target.attribute is None else f"{target.module}.{target.attribute}")
        if target.attribute is None:
            trail.add(self.module(target.module).name)
            return ModuleRef(target.module)
        return self.attribute(target.module, target.attribute, trail)

    def attribute(self, module_name: str, name: str, trail: set[str]) -> Target:
        """Return what an attribute of a first-party module stands for; raises as :meth:`resolve` does."""
        module = self.module(module_name)
        if (step := f"{module_name}:{name}") in trail:
            raise UntraceableCodeError("imports go round in a circle", found=step)
        trail |= {module_name, step}
        submodule = f"{module_name}.{name}"
        alias = module.aliases.get(name)
        is_bound = name in module.symbols or (alias is not None and alias != ImportTarget(module_name, name))
        is_submodule = module.folder is not None and self.exists(submodule)
        if is_submodule and not is_bound:
            trail.add(self.module(submodule).name)
            return ModuleRef(submodule)
        if is_submodule and (alias is None or alias.module != submodule):
            raise UntraceableCodeError(
                "one name for two things",
                found=f"{name}, defined in {module_name} and a submodule of it too",
                hint="Rename one of them",
            )
        found = self.resolve(module, name, trail) if is_bound or name in _MODULE_NAMES else None
        if found is None:
            raise UntraceableCodeError(
                "made by __getattr__" if "__getattr__" in module.symbols else "no such name in the module",
                found=step,
                hint="Define it in the module, or import it there by name",
            )
        return found

    def loaded(self, target: ImportTarget) -> list[str]:
        """Return the first-party modules that an import runs, outermost package first."""
        if not self.is_first_party(target.module):
            return []
        name = target.module
        if target.attribute is not None and self.exists(f"{name}.{target.attribute}"):
            name = f"{name}.{target.attribute}"
        return with_parents(name)

    def _parse(self, file: Path) -> tuple[ast.Module, str]:
        try:
            content = file.read_bytes()
            self.states[file] = state_of(content)
            source = importlib.util.decode_source(content)
            return ast.parse(source), source
        except (OSError, SyntaxError, ValueError, RecursionError, MemoryError) as error:
            line = f":{error.lineno}" if isinstance(error, SyntaxError) and error.lineno else ""
            raise UntraceableCodeError("cannot be read as Python", where=f"{file}{line}", found=error) from error

    def _read(self, name: str) -> Module:
        if (found := self._places.find(name)) is None:
            raise UntraceableCodeError(
                "no such module", found=name, hint="Its file is missing, or its package is not declared as first-party"
            )
        file, folder = found
        tree, source = self._parse(file) if file is not None else (ast.Module([], []), "")
        walrus_lines = tuple(number for number, line in enumerate(source.split("\n"), 1) if ":=" in line)
        home = Home(name, folder is not None, str(file or folder), walrus_lines)
        statements = statements_of(tree, source, home)
        for statement in statements:
            for module, line in statement.bindings.stars:
                if self.is_first_party(module):
                    raise UntraceableCodeError(
                        "a star import cannot be followed",
                        where=f"{home.where}:{line}",
                        found=f"from {module} import *",
                        hint="Import by name",
                    )
        names = _merge(statement.bindings for statement in statements)
        aliases = {name: target for name in names.kinds if (target := names.alias(name)) is not None}
        symbols = {
            name: tuple(each for each in statements if name in each.binds or name in each.changes)
            for name in names.kinds
            if name not in aliases
        }
        loads = tuple(each for some in statements if not some.is_for_checkers for each in some.bindings.loads)
        writes = global_writes(tree, home) if "global" in source else {}
        return Module(home, file, folder, statements, aliases, symbols, loads, writes)


def with_parents(module: str) -> list[str]:
    """Return a dotted name after those of the packages around it."""
    parts = module.split(".")
    return [".".join(parts[: count + 1]) for count in range(len(parts))]


def _merge(every: Iterable[Bindings]) -> Bindings:
    merged = Bindings()
    for names in every:
        for name, kind in names.kinds.items():
            merged.bind(name, kind)
        for name, targets in names.imports.items():
            merged.imports.setdefault(name, set()).update(targets)
    return merged
