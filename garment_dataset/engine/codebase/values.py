"""What kind of value a module variable has, as far as its definition shows: who may change it, and how."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING

from garment_dataset.engine.codebase.modules import External, Symbol
from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from garment_dataset.engine.codebase.modules import Module, Modules, Target
    from garment_dataset.engine.codebase.statements import Statement

CODE, FROZEN, CONTAINER, INSTANCE, UNKNOWN = "code", "frozen", "container", "instance", "unknown"
"""A function or class; what never changes; a builtin container; an object of first-party code; anything else."""

_FREEZING = """
builtins.abs builtins.bool builtins.bytes builtins.chr builtins.complex builtins.divmod builtins.float
builtins.frozenset builtins.hash builtins.int builtins.len builtins.object builtins.ord builtins.pow builtins.range
builtins.repr builtins.round builtins.str builtins.sum builtins.tuple builtins.type
collections.namedtuple datetime.date datetime.datetime datetime.timedelta decimal.Decimal fractions.Fraction
operator.attrgetter operator.itemgetter pathlib.Path pathlib.PurePath pathlib.PurePosixPath re.compile struct.Struct
typing.NamedTuple typing.NewType typing.ParamSpec typing.TypeVar typing.TypeVarTuple
"""
_FROZEN_CALLS = frozenset(_FREEZING.split())
_COLLECTING = """
builtins.bytearray builtins.dict builtins.list builtins.set builtins.sorted
collections.Counter collections.OrderedDict collections.defaultdict collections.deque
"""
_CONTAINER_CALLS = frozenset(_COLLECTING.split())
_DISPLAYS = (ast.List, ast.Dict, ast.Set, ast.ListComp, ast.DictComp, ast.SetComp)
_FROZEN_BASES = frozenset({"NamedTuple", "Enum", "IntEnum", "StrEnum", "Flag", "IntFlag"})


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

    def kind(self, symbol: Symbol) -> str:
        """Return the kind of a symbol's value; what several statements make is UNKNOWN or an INSTANCE."""
        if symbol not in self._kinds:
            self._kinds[symbol] = UNKNOWN  # while it is looked at: it may be defined through itself
            self._kinds[symbol] = self._find(symbol)
        return self._kinds[symbol]

    def defines(self, symbol: Symbol, method: str) -> bool:
        """Say whether a symbol is a class with such a method in its own body."""
        statements = self._modules.module(symbol.module).symbols[symbol.name]
        return all(
            isinstance(each.node, ast.ClassDef)
            and any(isinstance(item, ast.FunctionDef) and item.name == method for item in each.node.body)
            for each in statements
        )

    def is_function(self, symbol: Symbol) -> bool:
        """Say whether a symbol is a function and nothing else."""
        statements = self._modules.module(symbol.module).symbols[symbol.name]
        return all(isinstance(each.node, ast.FunctionDef | ast.AsyncFunctionDef) for each in statements)

    def _find(self, symbol: Symbol) -> str:
        module = self._modules.module(symbol.module)
        if module.is_definition(symbol.name):
            return CODE
        kinds = {self._kind_after(module, each) for each in module.symbols[symbol.name] if symbol.name in each.binds}
        return kinds.pop() if len(kinds) == 1 else INSTANCE

    def _kind_after(self, module: Module, statement: Statement) -> str:
        match statement.node:
            case ast.Assign(targets=[ast.Name()], value=value):
                return self._kind_of(module, value)
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
                kind = self._all_frozen(module, parts)
            case ast.Starred(value=part) | ast.Subscript(value=part):
                kind = self._kind_of(module, part)
            case ast.Name() | ast.Attribute():
                kind = self._kind_of_reference(module, node)
            case ast.Call(func=function):
                kind = self._kind_of_call(self._target(module, function))
            case _:
                kind = CONTAINER if isinstance(node, _DISPLAYS) else UNKNOWN
        return kind

    def _all_frozen(self, module: Module, parts: list[ast.expr]) -> str:
        kinds = {self._kind_of(module, part) for part in parts}
        return FROZEN if kinds <= {FROZEN, CODE} else UNKNOWN

    def _kind_of_reference(self, module: Module, node: ast.expr) -> str:
        target = self._target(module, node)
        if isinstance(target, Symbol):
            return self.kind(target)
        if target is None and isinstance(node, ast.Attribute):
            return self._kind_of(module, node.value)
        return FROZEN if isinstance(target, External) else UNKNOWN

    def _kind_of_call(self, target: Target | None) -> str:
        if isinstance(target, External):
            if target.dotted in _FROZEN_CALLS:
                return FROZEN
            return CONTAINER if target.dotted in _CONTAINER_CALLS else UNKNOWN
        if isinstance(target, Symbol):
            statements = self._modules.module(target.module).symbols[target.name]
            return FROZEN if all(_is_frozen_class(each.node) for each in statements) else INSTANCE
        return UNKNOWN

    def _target(self, module: Module, node: ast.expr) -> Target | None:
        try:
            if isinstance(node, ast.Name):
                return self._modules.resolve(module, node.id, set())
            if isinstance(node, ast.Attribute):
                base = self._target(module, node.value)
                if isinstance(base, External):
                    return External(f"{base.dotted}.{node.attr}")
                if base is not None and not isinstance(base, Symbol):
                    return self._modules.attribute(base.module, node.attr, set())
        except UntraceableCodeError:
            pass  # refused where the code is written out
        return None


def _is_frozen_class(node: ast.stmt) -> bool:
    if not isinstance(node, ast.ClassDef):
        return False
    return any(last_name(base) in _FROZEN_BASES for base in node.bases) or any(
        isinstance(each, ast.Call)
        and last_name(each.func) == "dataclass"
        and any(
            word.arg == "frozen" and isinstance(word.value, ast.Constant) and word.value.value is True
            for word in each.keywords
        )
        for each in node.decorator_list
    )


def last_name(node: ast.expr) -> str | None:
    """Return the name, or the last name of a dotted one; None for any other expression."""
    match node:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name
        case _:
            return None
