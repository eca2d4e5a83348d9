"""Who else changes what is in reach: statements of the imported modules that do so when they run, and functions.

``docs/fingerprint.md`` says by which kinds of values and uses they are found.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.engine.codebase.modules import Symbol
from garment_dataset.engine.codebase.uses import (
    ACTS,
    ACTS_IN_COMPANY,
    CALLED,
    CALLS,
    CHANGED,
    CHANGES,
    CODE,
    FLAT,
    FROZEN,
    HELD,
    INSTANCE,
    INTO,
    LATER,
    MAY_CHANGE,
    METHOD,
    NOW,
    PART,
    READ,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from garment_dataset.engine.codebase.index import Index
    from garment_dataset.engine.codebase.modules import Module
    from garment_dataset.engine.codebase.references import Facts
    from garment_dataset.engine.codebase.statements import Statement

EFFECTS = "<import>"
"""Stands for a module's effects where the name of a symbol would stand."""

_CALLERS = "callers"
"""Marks the search for what calls a symbol, where the kind of a value would stand."""


class Changes:
    """The search for what changes variables in reach.

    Parameters
    ----------
    index : Index
        The code base.
    facts : callable
        Gives what a statement of a module says.
    reach : callable
        Takes symbols that belong to the reach, and what they change.

    Attributes
    ----------
    acting : dict of str to set of int
        By module, the places of statements that change a variable in reach from elsewhere.
    acted_on : set of Symbol
        What they change.
    crossing : set of str
        Modules that change what another one defines.
    """

    def __init__(
        self,
        index: Index,
        facts: Callable[[Module, Statement], Facts],
        reach: Callable[[Iterable[Symbol], Symbol], None],
    ) -> None:
        self.acting: dict[str, set[int]] = {}
        self.acted_on: set[Symbol] = set()
        self.crossing: set[str] = set()
        self._index = index
        self._facts = facts
        self._reach = reach
        self._watched: dict[Symbol, None] = {}
        self._holders: dict[Symbol, Symbol] = {}
        self._changers: dict[Symbol, Symbol] = {}
        self._searched: set[tuple[Symbol, str, str]] = set()

    def search(self, executed: Iterable[str]) -> None:
        """Look through the executed modules for statements that change what is in reach."""
        before = -1
        while before != len(self._searched):
            before = len(self._searched)
            for name in list(executed):
                module = self._index.modules.module(name)
                for statement in module.setters:
                    self._note_changers(made_by(module, statement), Symbol(name, EFFECTS))
                for symbol in self._index.mentioned(module, self._watched):
                    self._search_changes(module, symbol)
                for symbol in self._index.mentioned(module, self._changers):
                    self._search_callers(module, symbol)

    def watch(self, symbol: Symbol) -> None:
        """Look for what changes a symbol."""
        self._watched[symbol] = None

    def hold(self, symbols: Iterable[Symbol], held: Symbol) -> None:
        """Note that these hold a value in reach, or a part of it: what is done to them may change it."""
        for each in symbols:
            if each != held:
                self._holders.setdefault(each, self._holders.get(held, held))
                self._watched[each] = None

    def _kind(self, symbol: Symbol) -> str:
        """Return the kind of a value; a function, class or record that holds what can change is like an object."""
        kind = self._index.values.kind(symbol)
        return INSTANCE if kind in {CODE, FROZEN} and symbol in self._holders else kind

    def _search_changes(self, module: Module, symbol: Symbol) -> None:
        kind = self._kind(symbol)
        if (symbol, module.name, kind) in self._searched:
            return
        self._searched.add((symbol, module.name, kind))
        values = self._index.values
        is_fixed = kind in {CODE, FROZEN} and not values.has_memory(symbol) and not values.has_shared_parts(symbol)
        for statement in self._index.mentions(module, symbol, as_base=is_fixed):
            if statement.is_for_checkers:
                continue
            facts = self._facts(module, statement)
            uses = facts.uses.get(symbol, 0)
            makes = made_by(module, statement)
            now, later = uses & NOW, uses >> LATER
            # a function has no methods of its own: what is called is its decorator's, as in `f.register(g)`
            changes = METHOD | CHANGED if kind == CODE and values.is_function(symbol) else CHANGES[kind]
            if self._acts(kind, now, facts, symbol):
                self._note_action(module, statement, makes, symbol)
            elif now & self._keeps(kind, symbol):
                self.hold(makes, symbol)
            if later & changes:
                self._reach(makes, symbol)
            if later & (changes | MAY_CHANGE[kind]):
                self._note_changers(makes, self._holders.get(symbol, symbol))

    def _acts(self, kind: str, now: int, facts: Facts, symbol: Symbol) -> bool:
        values = self._index.values
        if kind == CODE and now & METHOD and not now & CHANGED:
            methods = [method for owner, method in facts.methods if owner == symbol]
            return not all(values.defines(symbol, method) for method in methods)
        if kind == CODE and now & CALLED and values.has_memory(symbol):
            return True
        if now & ACTS[kind] or (facts.is_acting and now & ACTS_IN_COMPANY[kind]):
            return True
        # an operator of an object of first-party code may change its other side
        others = (other for other, uses in facts.uses.items() if uses & READ and other != symbol)
        return bool(now & READ) and kind not in {CODE, FROZEN} and any(self._kind(each) == INSTANCE for each in others)

    def _keeps(self, kind: str, symbol: Symbol) -> int:
        """Return which uses on import let something hold the value, or a part of it that can change."""
        if kind == CODE:
            values = self._index.values
            return (
                0 if values.is_enumeration(symbol) else PART | (CALLED | HELD if values.has_shared_parts(symbol) else 0)
            )
        return 0 if kind == FROZEN else HELD if kind == FLAT else HELD | PART

    def _search_callers(self, module: Module, symbol: Symbol) -> None:
        """Find what importing a module makes of a function that changes something in reach."""
        if (symbol, module.name, _CALLERS) in self._searched:
            return
        self._searched.add((symbol, module.name, _CALLERS))
        calls = CALLS if self._index.values.is_function(symbol) else CALLS | PART | READ
        for statement in self._index.mentions(module, symbol, as_base=False):
            facts = self._facts(module, statement)
            if statement.is_for_checkers or symbol not in facts.uses:
                continue
            makes = made_by(module, statement)
            if facts.uses[symbol] & calls or (facts.is_acting and facts.uses[symbol] & NOW & ~(READ | INTO)):
                self._note_action(module, statement, makes, symbol)
            self._note_changers(makes, self._changers[symbol])

    def _note_action(self, module: Module, statement: Statement, makes: list[Symbol], symbol: Symbol) -> None:
        if makes != [symbol]:
            changed = {symbol, self._holders.get(symbol, symbol), self._changers.get(symbol, symbol)}
            self.acting.setdefault(module.name, set()).add(statement.index)
            self.acted_on |= changed
            if any(each.module != module.name for each in changed):
                self.crossing.add(module.name)
        self._reach(makes, symbol)

    def _note_changers(self, symbols: Iterable[Symbol], changed: Symbol) -> None:
        for symbol in symbols:
            self._changers.setdefault(symbol, changed)


def made_by(module: Module, statement: Statement) -> list[Symbol]:
    """Return the variables that a statement binds or changes."""
    names = module.symbols.keys() & {*statement.binds, *statement.changes}
    return [Symbol(module.name, name) for name in sorted(names)]
