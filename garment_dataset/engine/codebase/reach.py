"""Everything first-party that the result of a function can depend on: the transitive closure over names.

Besides what a name leads to, three things belong to the reach:

- the statements that bind *or change* a module variable, wherever importing the modules of the reach runs them; also
  through another name for it, or by calling a function that changes it (a decorator that registers what it is given);
- the functions that change a variable in reach when they are called;
- what a module does on import beyond its own variables (``np.seterr(...)``), for every module that is imported.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from garment_dataset.engine.codebase.changes import EFFECTS, Changes, made_by
from garment_dataset.engine.codebase.modules import Symbol, with_parents
from garment_dataset.engine.codebase.reading import file_passed_on
from garment_dataset.engine.codebase.rules import located, reached_through
from garment_dataset.engine.codebase.uses import CODE, FROZEN, NOW
from garment_dataset.engine.codebase.world import unnamed_file
from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from garment_dataset.engine.codebase.index import Index
    from garment_dataset.engine.codebase.modules import Module
    from garment_dataset.engine.codebase.references import Facts
    from garment_dataset.engine.codebase.scopes import ImportTarget
    from garment_dataset.engine.codebase.statements import Statement


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
        self._changes = Changes(index, self.facts, self._reach_all)
        self._reach(entry, entry)
        while self._queue:
            while self._queue or self._imports:
                if self._imports:
                    self._take_module(*self._imports.pop())
                else:
                    self._take_symbol(self._queue.pop())
            self._changes.search(self.executed)
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
            self._changes.watch(symbol)
        for statement in self.statements(symbol):
            self._take_statement(module, statement, symbol)
            if symbol.name in statement.binds and self._index.values.kind(symbol) not in {CODE, FROZEN}:
                self._changes.hold(made_by(module, statement), symbol)  # `A = B = []`

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

    def ordered(self, module: Module) -> list[int]:
        """Return the places of a module's statements whose order counts, since they change or read one variable."""
        found = self._changes.acting.get(module.name, set()) | {
            index for index, _ in self._readings.get(module.name, ())
        }
        return sorted(found) if len(found) > 1 else []

    def crossing(self) -> set[str]:
        """Return the modules that change or read what another module defines and some module changes."""
        return self._changes.crossing | {
            name for name, found in self._readings.items() if any(each.module != name for _, each in found)
        }

    @cached_property
    def _readings(self) -> dict[str, set[tuple[int, Symbol]]]:
        """By module, the places of statements that use on import what is changed from elsewhere, and what they use."""
        found: dict[str, set[tuple[int, Symbol]]] = {}
        for symbol in self.symbols if self._changes.acted_on else ():
            module = self._modules.module(symbol.module)
            for each in self.statements(symbol):
                uses = self.facts(module, each).uses
                used = {other for other in self._changes.acted_on & uses.keys() if uses[other] & NOW}
                found.setdefault(module.name, set()).update((each.index, other) for other in used)
        return found

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

    def _reach_all(self, symbols: Iterable[Symbol], by: Symbol) -> None:
        for symbol in symbols:
            self._reach(symbol, by if by in self.symbols else self.entry)
