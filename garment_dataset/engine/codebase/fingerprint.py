"""The code fingerprint of a function: a name for all first-party code that its result can depend on.

Two versions of the code have the same fingerprint when they differ only in comments, docstrings, layout, names of local
variables, or in code out of reach; ``docs/fingerprint.md`` says what counts and why. It is found by reading the source:
nothing is imported.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from garment_dataset.engine.canonical import digest
from garment_dataset.engine.codebase.changes import EFFECTS
from garment_dataset.engine.codebase.index import Index
from garment_dataset.engine.codebase.libraries import library_versions
from garment_dataset.engine.codebase.modules import Modules, Symbol, with_parents
from garment_dataset.engine.codebase.reach import Reach
from garment_dataset.engine.codebase.uses import NOW
from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping
    from pathlib import Path

__all__ = ["CodeBase", "Fingerprint", "changed_parts", "fingerprint", "library_versions"]

_VERSION = "code/1"
_PART_DIGITS = 16
_ACTING = "<changes>"
"""Stands for the statements that change variables from elsewhere, where the name of a variable would stand."""


@dataclass(frozen=True, slots=True)
class Fingerprint:
    """What a function's result depends on, besides its arguments.

    Parameters
    ----------
    digest : str
        sha256 of all of ``parts``, 64 hex digits.
    parts : mapping of str to str
        Digest, 16 hex digits, of each function, class and variable in reach, by ``module:name``, sorted; under
        ``module:<import>`` of what importing a module does beyond its own variables.
    libraries : tuple of str
        Third-party top-level import names in reach, sorted; their versions are :func:`library_versions`.
    files : tuple of Path
        Source files and package folders consulted, sorted: while they stay as they are, so does the fingerprint.
    states : mapping of Path to str
        Digest of the content of each of the files, as it was read.
    """

    digest: str
    parts: Mapping[str, str]
    libraries: tuple[str, ...]
    files: tuple[Path, ...]
    states: Mapping[Path, str] = field(compare=False)


class CodeBase:
    """First-party packages as source, parsed once for any number of fingerprints.

    Parameters
    ----------
    roots : mapping of str to Path
        Folder of each package, or file of each module, by import name. What is neither here nor in the standard library
        is third-party.
    """

    def __init__(self, roots: Mapping[str, Path]) -> None:
        self._modules = Modules(roots)
        self._index = Index(self._modules)

    def fingerprint(self, entry: str, *, fields_excluded: Collection[str] = ()) -> Fingerprint:
        """Return the fingerprint of a function, class or variable.

        Parameters
        ----------
        entry : str
            ``module:name``.
        fields_excluded : collection of str
            Classes, as ``module:Class``, whose annotated fields do not count because their values are in the key; their
            methods, validators and class variables do.

        Raises
        ------
        UntraceableCodeError
            If there is no such function, or it reaches code that cannot be followed.
        """
        module, _, name = entry.partition(":")
        if not name or not self._modules.is_first_party(module):
            raise UntraceableCodeError("not first-party code", expected="module:name", found=entry)
        target = self._modules.attribute(module, name, set())
        if not isinstance(target, Symbol):
            raise UntraceableCodeError("not first-party code", where=entry, found=".".join(target))
        reach = Reach(self._index, target, fields_excluded)
        parts = self._parts(reach)
        return Fingerprint(
            digest=digest(_VERSION, [str(target), parts]),
            parts={symbol: part[:_PART_DIGITS] for symbol, part in sorted(parts.items())},
            libraries=tuple(sorted(reach.libraries)),
            files=(files := tuple(sorted(self._files(reach)))),
            states={path: self._modules.states[path] for path in files if path in self._modules.states},
        )

    def _parts(self, reach: Reach) -> dict[str, str]:
        parts = {str(symbol): self._part(reach, symbol) for symbol in reach.symbols}
        if len(order := self._import_order(reach)) > 1:
            parts[f"{reach.entry.module}:<import order>"] = digest("import-order/1", order)
        return parts

    def _part(self, reach: Reach, symbol: Symbol) -> str:
        module = self._modules.module(symbol.module)
        several = {
            name: [each.index for each in made]
            for name, made in module.symbols.items()
            if len(made) > 1 and name != symbol.name and Symbol(module.name, name) in reach.symbols
        }
        if module.effects and symbol.name != EFFECTS:
            several[EFFECTS] = [each.index for each in module.effects]
        acting = reach.ordered(module)
        made = []
        for each in reach.statements(symbol):
            facts = reach.facts(module, each)
            # what a statement finds in a variable that several statements make depends on where it stands among them
            places = [
                [name, sum(index < each.index for index in indices)]
                for name, indices in sorted(several.items())
                if facts.is_active or facts.uses.get(Symbol(module.name, name), 0) & NOW
            ]
            if acting and (facts.is_active or each.index in acting):
                places.append([_ACTING, sum(index < each.index for index in acting)])
            made.append([facts.digest, each.is_for_checkers, places])
        return digest("symbol/1", made)

    def _import_order(self, reach: Reach) -> list[str]:
        """Return the modules that act when they are imported, in the order in which importing the entry's runs them."""
        order: dict[str, None] = {}
        crossing = reach.crossing()
        seen: set[str] = set()

        def visit(names: Iterable[str]) -> None:
            for name in names:
                if name not in seen:
                    seen.add(name)
                    module = self._modules.module(name)
                    for target, _ in module.loads:
                        visit(self._modules.loaded(target))
                    if module.effects or name in crossing:
                        order[name] = None

        visit(with_parents(reach.entry.module))
        visit(sorted(reach.executed))
        return list(order)

    def _files(self, reach: Reach) -> set[Path]:
        modules = [self._modules.module(parent) for name in reach.consulted for parent in with_parents(name)]
        return {path for module in modules for path in (module.file, module.folder) if path is not None}


def fingerprint(entry: str, *, roots: Mapping[str, Path], fields_excluded: Collection[str] = ()) -> Fingerprint:
    """Return the fingerprint of one function; :class:`CodeBase` serves for several, and says what the arguments are."""
    return CodeBase(roots).fingerprint(entry, fields_excluded=fields_excluded)


def changed_parts(
    old: Mapping[str, str], new: Mapping[str, str]
) -> list[tuple[str, Literal["changed", "added", "removed"]]]:
    """Return what differs between the ``parts`` of two fingerprints: each name and how, in order of the names."""
    found: list[tuple[str, Literal["changed", "added", "removed"]]] = []
    for name in sorted(old.keys() | new.keys()):
        if name not in old:
            found.append((name, "added"))
        elif name not in new:
            found.append((name, "removed"))
        elif old[name] != new[name]:
            found.append((name, "changed"))
    return found
