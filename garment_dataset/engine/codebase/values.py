"""What kind of value a module variable has, as far as its definition shows: who may change it, and how."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING

from garment_dataset.engine.codebase.classes import (
    is_declared_frozen,
    is_enumeration,
    is_frozen,
    last_name,
    target_of,
)
from garment_dataset.engine.codebase.modules import External, Symbol
from garment_dataset.engine.codebase.uses import CODE, CONTAINER, FLAT, FROZEN, INSTANCE, UNKNOWN

if TYPE_CHECKING:
    from garment_dataset.engine.codebase.modules import Module, Modules
    from garment_dataset.engine.codebase.statements import Statement

_FREEZING = """
builtins.abs builtins.bool builtins.bytes builtins.chr builtins.complex builtins.divmod builtins.float
builtins.hash builtins.int builtins.len builtins.object builtins.ord builtins.pow builtins.range
builtins.repr builtins.round builtins.str builtins.sum builtins.type
collections.namedtuple datetime.date datetime.datetime datetime.timedelta decimal.Decimal fractions.Fraction
operator.attrgetter operator.itemgetter pathlib.Path pathlib.PurePath pathlib.PurePosixPath re.compile struct.Struct
typing.NamedTuple typing.NewType typing.ParamSpec typing.TypeVar typing.TypeVarTuple
"""
_FROZEN_CALLS = frozenset(_FREEZING.split())
_COLLECTING = """
builtins.bytearray builtins.dict builtins.list builtins.set builtins.sorted
collections.Counter collections.OrderedDict collections.deque
"""
_CONTAINER_CALLS = frozenset(_COLLECTING.split())
_COMPREHENSIONS = (ast.ListComp, ast.DictComp, ast.SetComp)
_COPYING_CALLS = frozenset({"builtins.tuple", "builtins.frozenset"})
_MUTABLE = (ast.List, ast.Dict, ast.Set, *_COMPREHENSIONS, ast.Call)
_PLAIN_WRAPPERS = frozenset({"staticmethod", "classmethod", "property", "contextmanager", "overload", "override"})


class Values:
    """Kinds of module variables, found out once each.

    Parameters
    ----------
    modules : Modules
        All first-party code.
    """

    def __init__(self, modules: Modules) -> None:
        self._modules = modules
        self._kinds: dict[Symbol, str] = {}
        self._enumerations: dict[Symbol, bool] = {}

    def kind(self, symbol: Symbol) -> str:
        """Return the kind of a symbol's value; what several statements make is UNKNOWN or an INSTANCE."""
        if symbol not in self._kinds:
            self._kinds[symbol] = UNKNOWN  # while it is looked at: it may be defined through itself
            self._kinds[symbol] = self._find(symbol)
        return self._kinds[symbol]

    def defines(self, symbol: Symbol, method: str) -> bool:
        """Say whether a symbol is a class with such a method in its own body."""
        return all(
            isinstance(each.node, ast.ClassDef)
            and any(isinstance(item, ast.FunctionDef) and item.name == method for item in each.node.body)
            for each in self._statements(symbol)
        )

    def is_function(self, symbol: Symbol) -> bool:
        """Say whether a symbol is a function and nothing else."""
        return all(isinstance(each.node, ast.FunctionDef | ast.AsyncFunctionDef) for each in self._statements(symbol))

    def has_memory(self, symbol: Symbol) -> bool:
        """Say whether a symbol is a function that a decorator, or a default that can change, may let remember."""
        return any(
            any(last_name(each) not in _PLAIN_WRAPPERS for each in statement.node.decorator_list)
            or any(
                isinstance(each, _MUTABLE) for each in [*statement.node.args.defaults, *statement.node.args.kw_defaults]
            )
            for statement in self._statements(symbol)
            if isinstance(statement.node, ast.FunctionDef | ast.AsyncFunctionDef)
        )

    def has_shared_parts(self, symbol: Symbol) -> bool:
        """Say whether a symbol is a class with containers of its own, which all its objects and subclasses share."""
        return any(
            isinstance(item, ast.Assign | ast.AnnAssign)
            and (isinstance(item.value, _MUTABLE[:-1]) or _makes_container(item.value))
            for statement in self._statements(symbol)
            if isinstance(statement.node, ast.ClassDef)
            for item in statement.node.body
        )

    def is_enumeration(self, symbol: Symbol) -> bool:
        """Say whether a symbol is a class of members that never change."""
        if symbol not in self._enumerations:
            self._enumerations[symbol] = all(is_enumeration(each.node) for each in self._statements(symbol))
        return self._enumerations[symbol]

    def _statements(self, symbol: Symbol) -> tuple[Statement, ...]:
        return self._modules.module(symbol.module).symbols[symbol.name]

    def _find(self, symbol: Symbol) -> str:
        module = self._modules.module(symbol.module)
        if module.is_definition(symbol.name):
            return CODE
        statements = module.symbols[symbol.name]
        kinds = {self._kind_after(module, each, symbol.name) for each in statements if symbol.name in each.binds}
        kind = kinds.pop() if len(kinds) == 1 else INSTANCE
        return CONTAINER if kind == FLAT and len(statements) > 1 else kind

    def _kind_after(self, module: Module, statement: Statement, name: str) -> str:
        match statement.node:
            case ast.Assign(targets=targets, value=value) if all(isinstance(each, ast.Name) for each in targets):
                return self._kind_of(module, value) if name in map(last_name, targets) else UNKNOWN
            case ast.AnnAssign(value=value):
                return FROZEN if value is None else self._kind_of(module, value)
            case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)) if len(names) == len(values):
                kinds = {self._kind_of(module, value) for value in values}
                return kinds.pop() if len(kinds) == 1 else INSTANCE
            case ast.ClassDef() | ast.FunctionDef() | ast.AsyncFunctionDef():
                return CODE
            case _:
                return UNKNOWN

    def _kind_of(self, module: Module, node: ast.expr) -> str:
        match node:
            case ast.Constant() | ast.Lambda() | ast.JoinedStr() | ast.Compare():
                kind = FROZEN
            case ast.UnaryOp(operand=part):
                kind = self._all_frozen(module, [part])
            case ast.BinOp(left=left, right=right) | ast.IfExp(body=left, orelse=right):
                kind = self._all_frozen(module, [left, right])
            case ast.Tuple(elts=parts):
                kind = self._all_frozen(module, parts, CONTAINER)
            case ast.List(elts=parts) | ast.Set(elts=parts) | ast.Dict(values=parts):
                kind = FLAT if self._all_frozen(module, parts) == FROZEN else CONTAINER
            case ast.Starred(value=part) | ast.Subscript(value=part):
                kind = self._kind_of_part(module, part)
            case ast.Name() | ast.Attribute():
                kind = self._kind_of_reference(module, node)
            case ast.Call():
                kind = self._kind_of_call(module, node)
            case _:
                kind = CONTAINER if isinstance(node, _COMPREHENSIONS) else UNKNOWN
        return kind

    def _all_frozen(self, module: Module, parts: list[ast.expr], otherwise: str = UNKNOWN) -> str:
        kinds = {self._kind_of(module, part) for part in parts}
        return FROZEN if kinds <= {FROZEN, CODE} else otherwise

    def _kind_of_part(self, module: Module, node: ast.expr) -> str:
        """Return the kind of what is in a value."""
        kind = self._kind_of(module, node)
        return FROZEN if kind in {FROZEN, FLAT} else kind if kind == INSTANCE else UNKNOWN

    def _kind_of_reference(self, module: Module, node: ast.expr) -> str:
        target = target_of(self._modules, module, node)
        if isinstance(target, Symbol):
            return self.kind(target)
        if target is None and isinstance(node, ast.Attribute):
            base = target_of(self._modules, module, node.value)
            if isinstance(base, Symbol) and self.kind(base) == CODE:
                return FROZEN if self.is_enumeration(base) else UNKNOWN
            kind = self._kind_of(module, node.value)
            return kind if kind in {FROZEN, INSTANCE} else UNKNOWN
        return FROZEN if isinstance(target, External) else UNKNOWN

    def _kind_of_call(self, module: Module, node: ast.Call) -> str:
        target = target_of(self._modules, module, node.func)
        parts = [*node.args, *(word.value for word in node.keywords)]
        if isinstance(target, External):
            return self._kind_from_library(module, target.dotted, parts)
        if not isinstance(target, Symbol):
            return UNKNOWN
        if is_declared_frozen(self._modules, target):
            return FROZEN
        is_record = all(is_frozen(each.node) for each in self._statements(target))
        return self._all_frozen(module, parts, INSTANCE) if is_record else INSTANCE

    def _kind_from_library(self, module: Module, dotted: str, parts: list[ast.expr]) -> str:
        if dotted in _FROZEN_CALLS:
            return FROZEN
        if dotted in _CONTAINER_CALLS or dotted in _COPYING_CALLS:
            is_flat = all(self._kind_of_part(module, part) == FROZEN for part in parts)
            return (FLAT if dotted in _CONTAINER_CALLS else FROZEN) if is_flat else CONTAINER
        return INSTANCE if dotted == "collections.defaultdict" else UNKNOWN


def _makes_container(node: ast.expr | None) -> bool:
    return isinstance(node, ast.Call) and f"{last_name(node.func)}" in {
        name.rpartition(".")[2] for name in _CONTAINER_CALLS
    } | {"defaultdict"}
