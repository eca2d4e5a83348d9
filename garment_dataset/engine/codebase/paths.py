"""Where the path of a file comes from: from what a function is given, or from code and parameters alone.

A path is *fixed* when it begins with a constant, a variable of a module, the parameters, or with what first-party code
makes of nothing else; it is *declared* when it begins with an argument. What begins with anything else is neither.
"""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING

from garment_dataset.engine.codebase.classes import target_of
from garment_dataset.engine.codebase.modules import External, Symbol
from garment_dataset.engine.codebase.scopes import CLASS, PARAMETER
from garment_dataset.engine.codebase.world import FIRST_DECIDES, PATH_CLASSES
from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from garment_dataset.engine.codebase.modules import Target
    from garment_dataset.engine.codebase.references import References
    from garment_dataset.engine.codebase.scopes import Scope

PARAMETERS = "params"
"""The argument by which the engine hands a stage its parameters."""

DISPLAYS = (ast.List, ast.Tuple, ast.Set, ast.ListComp, ast.GeneratorExp)
"""What is no path where a path is expected, but lines of text."""

_IN_MEMORY = frozenset({":memory:", b":memory:"})
_GIVING = (ast.Assign, ast.AnnAssign, ast.NamedExpr, ast.For, ast.comprehension, ast.withitem)
_DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
_PATH_WORDS = """
file filename path fname source src database name dir top pathname where filepath_or_buffer path_or_buf io
"""
_PATH_ARGUMENTS = frozenset(_PATH_WORDS.split())


class Origins:
    """Tells, for expressions in a statement whose names are looked up, with what their values begin."""

    def __init__(self, names: References) -> None:
        self._names = names
        self._values: dict[ast.AST, Mapping[str, list[ast.expr]]] = {}
        self._open: set[tuple[Scope, str]] = set()
        self._results: dict[ast.Call, bool] = {}

    def is_fixed(self, node: ast.expr) -> bool:
        """Say whether a path is made of nothing that the function was given."""
        return any(map(self._is_leaf_fixed, self._leaves(node)))

    def is_path(self, node: ast.expr) -> bool:
        """Say whether an expression begins with a path or with the parameters, as far as the code shows it."""
        return any(map(self._is_leaf_path, self._leaves(node, through_paths=False)))

    def parameters(self, node: ast.expr) -> frozenset[str]:
        """Return the parameters of the function at the top of the module with which a path begins."""
        names = (leaf.id for leaf in self._leaves(node) if isinstance(leaf, ast.Name))
        scopes = ((name, self._names.scope.find(name)) for name in names)
        return frozenset(name for name, scope in scopes if scope is not None and scope.is_outermost)

    def _target(self, node: ast.expr) -> Target | None:
        try:
            return self._names.target_of(node)
        except UntraceableCodeError:
            return None  # refused where it is written

    def _values_of(self, node: ast.AST | None, name: str) -> Sequence[ast.expr]:
        if node is None:
            return ()
        if node not in self._values:
            self._values[node] = _values_by_name(node)
        return self._values[node].get(name, ())

    def _leaves(self, node: ast.expr, *, through_paths: bool = True) -> Iterator[ast.expr]:
        """Yield what an expression begins with: constants, parameters, names of modules, calls."""
        match node:
            case ast.Name(id=name):
                yield from self._leaves_of_name(node, name, through_paths=through_paths)
                return
            case ast.Call():
                parts = self._beginnings_of_call(node, through_paths=through_paths)
            case ast.Attribute(value=value):
                parts = [value] if self._target(node) is None else None
            case _:
                parts = _beginnings(node)
        if parts is None:
            yield node
        else:
            for part in parts:
                yield from self._leaves(part, through_paths=through_paths)

    def _leaves_of_name(self, node: ast.Name, name: str, *, through_paths: bool) -> Iterator[ast.expr]:
        scope = self._names.scope.find(name)
        if scope is None or scope.bindings.kinds[name] & PARAMETER:
            yield node
        elif scope.kind != CLASS and (scope, name) not in self._open:
            self._open.add((scope, name))
            values = self._values_of(scope.node, name)
            found = [leaf for value in values for leaf in self._leaves(value, through_paths=through_paths)]
            self._open.discard((scope, name))
            yield from found

    def _beginnings_of_call(self, node: ast.Call, *, through_paths: bool) -> Sequence[ast.expr] | None:
        target = self._target(node.func)
        if isinstance(target, External):
            return _arguments(node)[:1] or None if through_paths and _gives_its_first(target.dotted) else None
        match node.func:
            case ast.Attribute(value=ast.Constant() | ast.JoinedStr()) if target is None:
                return _arguments(node)  # "{}/x".format(path), "".join([path])
            case ast.Attribute(value=value) if target is None:
                owner = self._target(value)
                is_object = isinstance(owner, Symbol) and self._is_object(owner)
                return _arguments(node) or [value] if is_object else [value]
            case _:
                return None

    def _is_leaf_fixed(self, leaf: ast.expr) -> bool:
        match leaf:
            case ast.Constant(value=value):
                return isinstance(value, str | bytes | int) and value not in _IN_MEMORY
            case ast.JoinedStr():
                return True
            case ast.Call(func=function):
                return self._is_result_fixed(leaf, self._target(function))
            case ast.Name() | ast.Attribute():
                return self._is_reference_fixed(leaf, self._target(leaf))
            case _:
                return False

    def _is_result_fixed(self, node: ast.Call, target: Target | None) -> bool:
        if isinstance(target, External):
            return _gives_its_first(target.dotted)  # of nothing: where the process stands
        if node not in self._results:
            self._results[node] = False  # while it is looked at: it may be made of itself
            self._results[node] = isinstance(target, Symbol) and all(map(self.is_fixed, _arguments(node)))
        return self._results[node]

    def _is_reference_fixed(self, node: ast.Name | ast.Attribute, target: Target | None) -> bool:
        if target is not None or not isinstance(node, ast.Name):
            return target is not None
        if node.id == PARAMETERS or (node.id == "self" and self._names.is_in_fieldless):
            return True
        scope = self._names.scope.find(node.id)
        default = None if scope is None else _default_of(scope.node, node.id)
        return default is not None and self.is_fixed(default)

    def _is_leaf_path(self, leaf: ast.expr) -> bool:
        match leaf:
            case ast.Call(func=function):
                target = self._target(function)
                return isinstance(target, External) and target.dotted.startswith("pathlib.")
            case ast.Name() | ast.Attribute():
                target = self._target(leaf)
                if isinstance(target, Symbol):
                    return self._holds_paths(target) and not self._is_object(target)
                return isinstance(leaf, ast.Name)
            case _:
                return False

    def _is_object(self, symbol: Symbol) -> bool:
        """Say whether a module variable is code, or an object of first-party code: its methods are in reach."""
        modules = self._names.modules
        module = modules.module(symbol.module)
        for each in module.symbols[symbol.name]:
            value = getattr(each.node, "value", None)
            is_made = isinstance(value, ast.Call) and isinstance(target_of(modules, module, value.func), Symbol)
            if not is_made and not isinstance(each.node, _DEFINITIONS):
                return False
        return True

    def _holds_paths(self, symbol: Symbol) -> bool:
        modules = self._names.modules
        module = modules.module(symbol.module)
        targets = (
            target_of(modules, module, call.func)
            for statement in module.symbols[symbol.name]
            if not isinstance(statement.node, _DEFINITIONS)
            for call in ast.walk(statement.node)
            if isinstance(call, ast.Call)
        )
        return any(isinstance(each, External) and each.dotted in PATH_CLASSES for each in targets)


def _beginnings(node: ast.expr) -> Sequence[ast.expr] | None:
    """Return the parts of an expression that a path in it begins with; None for one without parts."""
    match node:
        case ast.BinOp(left=left, op=operator, right=right):
            return [right if isinstance(operator, ast.Mod) else left]
        case ast.IfExp(body=body, orelse=other):
            return [body, other]
        case ast.JoinedStr(values=[first, *_]):
            return [first]
        case ast.BoolOp(values=values) | ast.List(elts=values) | ast.Tuple(elts=values) | ast.Set(elts=values):
            return values
        case ast.FormattedValue() | ast.NamedExpr() | ast.Starred() | ast.Subscript():
            return [node.value]
        case _:
            return None


def _gives_its_first(dotted: str) -> bool:
    """Say whether something external gives the path that it is given."""
    return dotted in FIRST_DECIDES or dotted.startswith(("pathlib.", "os.path."))


def _arguments(node: ast.Call) -> list[ast.expr]:
    return [*node.args, *(word.value for word in node.keywords)]


def _default_of(node: ast.AST | None, name: str) -> ast.expr | None:
    """Return the default of a function's parameter."""
    if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
        return None
    positional = [*node.args.posonlyargs, *node.args.args]
    with_default = positional[len(positional) - len(node.args.defaults) :]
    pairs = [*zip(with_default, node.args.defaults, strict=True)]
    pairs += [
        (each, default) for each, default in zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True) if default
    ]
    return next((default for each, default in pairs if each.arg == name), None)


def path_argument(node: ast.Call) -> ast.expr | None:
    """Return the argument of a call that names a file; None when there is none."""
    if node.args:
        return node.args[0]
    return next((word.value for word in node.keywords if word.arg in _PATH_ARGUMENTS), None)


def _values_by_name(node: ast.AST) -> Mapping[str, list[ast.expr]]:
    """Return what the statements of a function give its variables, as far as they show it."""
    found: dict[str, list[ast.expr]] = {}
    for each in ast.walk(node):
        if isinstance(each, _GIVING):
            for target, value in _given(each):
                if isinstance(target, ast.Name):
                    found.setdefault(target.id, []).append(value)
    return found


def _given(node: ast.AST) -> Iterator[tuple[ast.expr, ast.expr]]:
    match node:
        case ast.Assign(targets=targets, value=value):
            yield from ((target, value) for target in targets)
        case ast.AnnAssign(target=target, value=ast.expr() as value) | ast.NamedExpr(target=target, value=value):
            yield target, value
        case ast.For(target=target, iter=value) | ast.comprehension(target=target, iter=value):
            yield target, value
        case ast.withitem(context_expr=value, optional_vars=ast.expr() as target):
            yield target, value
