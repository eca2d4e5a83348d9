"""Everything first-party that the result of a function can depend on: the transitive closure over names.

Besides what a name leads to, three things belong to the reach:

- the statements that bind *or change* a module variable, wherever importing the modules of the reach runs them; also
  through another name for it, or by calling a function that changes it (a decorator that registers what it is given);
- the functions that change a variable in reach when they are called;
- what a module does on import beyond its own variables (``np.seterr(...)``), for every module that is imported.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.engine.codebase.modules import Symbol, with_parents
from garment_dataset.engine.codebase.reading import file_passed_on
from garment_dataset.engine.codebase.rules import located, reached_through
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
from garment_dataset.engine.codebase.world import unnamed_file
from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from garment_dataset.engine.codebase.index import Index
    from garment_dataset.engine.codebase.modules import Module
    from garment_dataset.engine.codebase.references import Facts
    from garment_dataset.engine.codebase.scopes import ImportTarget
    from garment_dataset.engine.codebase.statements import Statement

EFFECTS = "<import>"
"""Stands for a module's effects where the name of a symbol would stand."""

_CALLERS = "callers"
"""Marks the search for what calls a symbol, where the kind of a value would stand."""


class Reach:
    """What a function reaches.

    Parameters
    ----------
    index : Index
        The code base.
    fields_excluded : collection of str
        Classes, as ``module:Class``, whose fields do not count.

    Attributes
    ----------
    entry : Symbol
        Where it starts.
    symbols : dict of Symbol to Symbol
        Functions, classes, variables and effects of modules, each with what leads to it.
    executed : dict of str to None
        Modules that are imported, in order of discovery.
    libraries : set of str
        Third-party top-level names.
    consulted : set of str
        All modules that were read on the way.

    Raises
    ------
    UntraceableCodeError
        If something in reach cannot be followed.
    """

    def __init__(self, index: Index, entry: Symbol, fields_excluded: Collection[str]) -> None:
        self.entry = entry
        self.symbols: dict[Symbol, Symbol] = {}
        self.executed: dict[str, None] = {}
        self.libraries: set[str] = set()
        self.consulted: set[str] = set()
        self._index = index
        self._modules = index.modules
        self._fields_excluded = frozenset(fields_excluded)
        self._queue: list[Symbol] = []
        self._imports: list[tuple[str, Symbol]] = []
        self._watched: dict[Symbol, None] = {}
        self._holders: set[Symbol] = set()
        self._changers: dict[Symbol, None] = {}
        self._searched: set[tuple[Symbol, str, str]] = set()
        self._reach(entry, entry)
        while self._queue:
            while self._queue or self._imports:
                if self._imports:
                    self._take_module(*self._imports.pop())
                else:
                    self._take_symbol(self._queue.pop())
            self._search()
        self._check_files()

    def facts(self, module: Module, statement: Statement) -> Facts:
        """Return what a statement says, without the fields that do not count."""
        fieldless = frozenset(name for name in statement.binds if f"{module.name}:{name}" in self._fields_excluded)
        return self._index.facts(module, statement, fieldless)

    def statements(self, symbol: Symbol) -> Iterable[Statement]:
        """Return the statements that make a symbol, in order."""
        module = self._modules.module(symbol.module)
        return module.effects if symbol.name == EFFECTS else module.symbols[symbol.name]

    def _reach(self, symbol: Symbol, by: Symbol) -> None:
        if symbol not in self.symbols:
            self.symbols[symbol] = by
            self._queue.append(symbol)

    def _take_symbol(self, symbol: Symbol) -> None:
        module = self._modules.module(symbol.module)
        for name in with_parents(symbol.module):
            self._execute(name, symbol)
        if (line := module.global_writes.get(symbol.name)) is not None:
            error = UntraceableCodeError(
                "a module variable is written through `global`",
                where=f"{module.home.where}:{line}",
                found=symbol.name,
                hint="Return the value, or keep it in an object that is passed on",
            )
            self._refuse(error, symbol)
        if symbol.name != EFFECTS:
            self._watched[symbol] = None
        for statement in self.statements(symbol):
            self._take_statement(module, statement, symbol)
            if symbol.name in statement.binds and self._index.values.kind(symbol) not in {CODE, FROZEN}:
                self._hold(_made_by(module, statement), symbol)  # `A = B = []`

    def _take_statement(self, module: Module, statement: Statement, by: Symbol) -> None:
        facts = self.facts(module, statement)
        if facts.problems:
            self._refuse(facts.problems[0], by)
        for symbol in facts.uses:
            self._reach(symbol, by)
        if not statement.is_for_checkers:
            self._load(module, facts.loads, by)
        self.libraries |= facts.libraries
        self.consulted |= facts.consulted

    def _load(self, module: Module, loads: Iterable[tuple[ImportTarget, int]], by: Symbol) -> None:
        for target, line in loads:
            try:
                for name in self._modules.loaded(target):
                    self._modules.module(name)
                    self._execute(name, by)
            except UntraceableCodeError as error:
                self._refuse(located(error, f"{module.home.where}:{line}"), by)

    def _execute(self, name: str, by: Symbol) -> None:
        if name not in self.executed:
            self.executed[name] = None
            self._imports.append((name, by))

    def _take_module(self, name: str, by: Symbol) -> None:
        module = self._modules.module(name)
        self.consulted.add(name)
        if module.effects:
            self._reach(Symbol(name, EFFECTS), by)
        self._load(module, module.loads, by)

    def _refuse(self, error: UntraceableCodeError, by: Symbol) -> None:
        chain = [by]
        while chain[-1] != self.entry:
            chain.append(self.symbols[chain[-1]])
        raise reached_through(error, [str(symbol) for symbol in reversed(chain)]) from error

    # -- which files it reads

    def _check_files(self) -> None:
        """Refuse a path that is made of no argument where a function, perhaps some calls away, opens it."""
        every = [(each, self._modules.module(each.module)) for each in self.symbols]
        facts = [(each, self.facts(module, one)) for each, module in every for one in self.statements(each)]
        if (found := file_passed_on(self._modules, facts)) is not None:
            symbol, passed = found
            error = unnamed_file(f"what is given to {passed.function.name}()")
            where = self._modules.module(symbol.module).home.where
            self._refuse(located(error, f"{where}:{passed.line}"), symbol)

    # -- who else changes what is in reach

    def _search(self) -> None:
        """Look through the executed modules for statements that change what is in reach."""
        before = -1
        while before != len(self._searched):
            before = len(self._searched)
            for name in list(self.executed):
                module = self._modules.module(name)
                for statement in module.setters:
                    self._changers.update(dict.fromkeys(_made_by(module, statement)))
                for symbol in self._index.mentioned(module, self._watched):
                    self._search_changes(module, symbol)
                for symbol in self._index.mentioned(module, self._changers):
                    self._search_callers(module, symbol)

    def _hold(self, symbols: Iterable[Symbol], held: Symbol) -> None:
        """Note that these hold a value in reach, or a part of it: what is done to them may change it."""
        found = [each for each in symbols if each != held]
        self._holders.update(found)
        self._watched.update(dict.fromkeys(found))

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
            facts = self.facts(module, statement)
            uses = facts.uses.get(symbol, 0)
            makes = _made_by(module, statement)
            now, later = uses & NOW, uses >> LATER
            # a function has no methods of its own: what is called is its decorator's, as in `f.register(g)`
            changes = METHOD | CHANGED if kind == CODE and values.is_function(symbol) else CHANGES[kind]
            if self._acts(kind, now, facts, symbol):
                self._reach_all(makes, symbol)
            elif now & self._keeps(kind, symbol):
                self._hold(makes, symbol)
            if later & changes:
                self._reach_all(makes, symbol)
            if later & (changes | MAY_CHANGE[kind]):
                self._changers.update(dict.fromkeys(makes))

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
            return 0 if values.is_enumeration(symbol) else PART | (CALLED if values.has_shared_parts(symbol) else 0)
        return 0 if kind == FROZEN else HELD if kind == FLAT else HELD | PART

    def _search_callers(self, module: Module, symbol: Symbol) -> None:
        """Find what importing a module makes of a function that changes something in reach."""
        if (symbol, module.name, _CALLERS) in self._searched:
            return
        self._searched.add((symbol, module.name, _CALLERS))
        calls = CALLS if self._index.values.is_function(symbol) else CALLS | PART | READ
        for statement in self._index.mentions(module, symbol, as_base=False):
            facts = self.facts(module, statement)
            if statement.is_for_checkers or symbol not in facts.uses:
                continue
            makes = _made_by(module, statement)
            if facts.uses[symbol] & calls or (facts.is_acting and facts.uses[symbol] & NOW & ~(READ | INTO)):
                self._reach_all(makes, symbol)
            self._changers.update(dict.fromkeys(makes))

    def _reach_all(self, symbols: Iterable[Symbol], by: Symbol) -> None:
        for symbol in symbols:
            self._reach(symbol, by if by in self.symbols else self.entry)


def _made_by(module: Module, statement: Statement) -> list[Symbol]:
    names = module.symbols.keys() & {*statement.binds, *statement.changes}
    return [Symbol(module.name, name) for name in sorted(names)]
