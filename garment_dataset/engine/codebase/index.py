"""What the reaches of several functions share: what each statement says, and where a symbol is mentioned."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.engine.codebase.facts import facts_of
from garment_dataset.engine.codebase.modules import ModuleRef, Symbol
from garment_dataset.engine.codebase.values import Values
from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from garment_dataset.engine.codebase.modules import Module, Modules, Target
    from garment_dataset.engine.codebase.references import Facts
    from garment_dataset.engine.codebase.statements import Statement

_SETTERS = frozenset({"setattr", "delattr", "__setattr__", "__delattr__"})


class Index:
    """Facts of statements and places of mention, found out once each.

    Parameters
    ----------
    modules : Modules
        All first-party code.
    """

    def __init__(self, modules: Modules) -> None:
        self.modules = modules
        self.values = Values(modules)
        self._facts: dict[tuple[Statement, frozenset[str]], Facts] = {}
        self._names: dict[str, dict[Target, set[str]]] = {}
        self._words: dict[str, dict[str, list[Statement]]] = {}

    def facts(self, module: Module, statement: Statement, fieldless: frozenset[str]) -> Facts:
        """Return what a statement says, without the fields of the classes named."""
        key = statement, fieldless
        if key not in self._facts:
            self._facts[key] = facts_of(self.modules, module, statement, fieldless)
        return self._facts[key]

    def mentioned(self, module: Module, symbols: Iterable[Symbol]) -> list[Symbol]:
        """Return those of ``symbols`` that a module's code may refer to, in the same order."""
        words, names = self._words_of(module), self._names_of(module)
        return [symbol for symbol in symbols if symbol.name in words or symbol in names]

    def mentions(self, module: Module, symbol: Symbol, *, as_base: bool) -> list[Statement]:
        """Return the statements of a module that may refer to a symbol: all that do, and some that do not.

        Parameters
        ----------
        module : Module
            Where to look.
        symbol : Symbol
            What for.
        as_base : bool
            Leave out statements that take no attribute or item of it, and so cannot change its value.
        """
        words, names = self._words_of(module), self._names_of(module)
        is_own = symbol.module == module.name
        found = dict.fromkeys(module.symbols[symbol.name] if is_own else ())
        for name in {symbol.name} if is_own else sorted(names.get(symbol, ())):
            for statement in words.get(name, ()):
                if not as_base or name in statement.bases or statement.words & _SETTERS:
                    found[statement] = None
        # as an attribute of its module, or imported inside a function
        ways = {"import", *(way for target in names if isinstance(target, ModuleRef) for way in names[target])}
        for statement in () if is_own else words.get(symbol.name, ()):
            if not ways.isdisjoint(statement.words):
                found[statement] = None
        return list(found)

    def _words_of(self, module: Module) -> dict[str, list[Statement]]:
        if module.name not in self._words:
            words: dict[str, list[Statement]] = {}
            for statement in module.statements:
                for word in statement.words:
                    words.setdefault(word, []).append(statement)
            self._words[module.name] = words
        return self._words[module.name]

    def _names_of(self, module: Module) -> dict[Target, set[str]]:
        """Return what a module's imports stand for, and under which names."""
        if module.name not in self._names:
            names: dict[Target, set[str]] = {}
            imports = (each.bindings.imports for each in module.statements if not each.is_for_checkers)
            for name, target in ((word, target) for some in imports for word in some for target in some[word]):
                if self.modules.is_first_party(target.module):
                    try:
                        names.setdefault(self.modules.imported(target, set()), set()).add(name)
                    except UntraceableCodeError:
                        continue  # refused where the name is used
            self._names[module.name] = names
        return self._names[module.name]
