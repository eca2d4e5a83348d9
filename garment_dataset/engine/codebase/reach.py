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
from garment_dataset.engine.codebase.references import CALLED, CHANGED, GIVEN, HELD, LATER, LENT, METHOD, NOW
from garment_dataset.engine.codebase.rules import located, reached_through
from garment_dataset.engine.codebase.values import CODE, CONTAINER, FROZEN, INSTANCE, UNKNOWN
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

_ACTS = {
    CODE: CHANGED | METHOD,
    FROZEN: CHANGED,
    CONTAINER: CHANGED | GIVEN,
    INSTANCE: CHANGED | GIVEN | METHOD | CALLED,
    UNKNOWN: CHANGED | GIVEN | METHOD | CALLED,
}
"""Uses on import that may change a value, by its kind."""

_CHANGES = {CODE: CHANGED, FROZEN: CHANGED, CONTAINER: CHANGED, INSTANCE: CHANGED | METHOD | CALLED, UNKNOWN: CHANGED}
"""Uses in a function that change a value, by its kind."""

_MAY_CHANGE = {CODE: 0, FROZEN: 0, CONTAINER: GIVEN, INSTANCE: GIVEN, UNKNOWN: GIVEN | METHOD | CALLED}
"""Uses in a function that may change a value: they count where importing the modules calls the function."""


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
        self._changers: dict[Symbol, None] = {}
        self._searched: set[tuple[Symbol, str, bool]] = set()
        self._reach(entry, entry)
        while self._queue:
            while self._queue or self._imports:
                if self._imports:
                    self._take_module(*self._imports.pop())
                else:
                    self._take_symbol(self._queue.pop())
            self._search()

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

    # -- who else changes what is in reach

    def _search(self) -> None:
        """Look through the executed modules for statements that change what is in reach."""
        before = -1
        while before != len(self._searched):
            before = len(self._searched)
            for name in list(self.executed):
                module = self._modules.module(name)
                for symbol in self._index.mentioned(module, self._watched):
                    self._search_changes(module, symbol)
                for symbol in self._index.mentioned(module, self._changers):
                    self._search_callers(module, symbol)

    def _search_changes(self, module: Module, symbol: Symbol) -> None:
        if (symbol, module.name, True) in self._searched:
            return
        self._searched.add((symbol, module.name, True))
        kind = self._index.values.kind(symbol)
        is_fixed = kind in {CODE, FROZEN}
        for statement in self._index.mentions(module, symbol, as_base=is_fixed):
            if statement.is_for_checkers:
                continue
            facts = self.facts(module, statement)
            uses = facts.uses.get(symbol, 0)
            makes = _made_by(module, statement)
            now, later = uses & NOW, uses >> LATER
            # a function has no methods of its own: what is called is its decorator's, as in `f.register(g)`
            changes = METHOD | CHANGED if kind == CODE and self._index.values.is_function(symbol) else _CHANGES[kind]
            if self._acts(kind, now, facts, symbol):
                self._reach_all(makes, symbol)
            elif not is_fixed and now & (HELD | LENT):
                self._watched.update(dict.fromkeys(makes))
            if later & changes:
                self._reach_all(makes, symbol)
            if later & (changes | _MAY_CHANGE[kind]):
                self._changers.update(dict.fromkeys(makes))

    def _acts(self, kind: str, now: int, facts: Facts, symbol: Symbol) -> bool:
        if kind == CODE and now & METHOD and not now & CHANGED:
            methods = [method for owner, method in facts.methods if owner == symbol]
            return not all(self._index.values.defines(symbol, method) for method in methods)
        return bool(now & _ACTS[kind])

    def _search_callers(self, module: Module, symbol: Symbol) -> None:
        """Find what importing a module makes of a function that changes something in reach."""
        if (symbol, module.name, False) in self._searched:
            return
        self._searched.add((symbol, module.name, False))
        for statement in self._index.mentions(module, symbol, as_base=False):
            facts = self.facts(module, statement)
            if statement.is_for_checkers or symbol not in facts.uses:
                continue
            makes = _made_by(module, statement)
            if facts.uses[symbol] & (CALLED | LENT | METHOD):
                self._reach_all(makes, symbol)
            self._changers.update(dict.fromkeys(makes))

    def _reach_all(self, symbols: Iterable[Symbol], by: Symbol) -> None:
        for symbol in symbols:
            self._reach(symbol, by if by in self.symbols else self.entry)


def _made_by(module: Module, statement: Statement) -> list[Symbol]:
    names = module.symbols.keys() & {*statement.binds, *statement.changes}
    return [Symbol(module.name, name) for name in sorted(names)]
