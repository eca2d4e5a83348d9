"""What one statement of a module does when it is executed: which values it changes, whether it acts beyond."""

from __future__ import annotations

import ast
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Sequence

    from garment_dataset.engine.codebase.scopes import Bindings

_CHANGING = """
add append appendleft clear difference_update discard extend extendleft insert intersection_update pop popitem popleft
move_to_end remove reverse rotate setdefault sort subtract symmetric_difference_update update
fill itemset partition put resize setfield setflags byteswap
"""
CHANGING_METHODS = frozenset(_CHANGING.split())
"""Methods of containers and arrays that change the object they are called on."""

_OPERATORS = """
setitem delitem iadd isub imul imatmul itruediv ifloordiv imod ipow iand ior ixor init setstate self
"""
CHANGING_OPERATORS = frozenset(f"__{name}__" for name in _OPERATORS.split())
"""The same of operators spelled out; the last leads from a method back to its object."""

_LOOKING = """
all any bool dict enumerate float frozenset get getattr hasattr int isinstance issubclass items keys len list max min
range reversed round set sorted str sum tuple type values zip
"""
_LOOKING_CALLS = frozenset(_LOOKING.split())
_SETTER = re.compile(
    r"\b(?:set(?:[A-Z_]\w*|err\w*|locale|context|recursionlimit)|seed|filterwarnings|simplefilter|register\w*)\s*\("
)
"""Calls that set something for everybody, as libraries name them: ``np.seterr(``, ``cv2.setNumThreads(``."""


def root_name(node: ast.AST) -> str | None:
    """Return the name that a chain of attributes and items begins with."""
    while isinstance(node, ast.Attribute | ast.Subscript | ast.Starred):
        node = node.value
    return node.id if isinstance(node, ast.Name) else None


def outcomes(node: ast.stmt, own: Collection[str]) -> Iterator[str | None]:
    """Yield the own variables whose values a statement changes, and None for an effect elsewhere."""
    match node:
        case ast.Expr(value=ast.Constant()):
            return
        case ast.Expr(value=ast.Call(func=ast.Attribute(attr=attr, value=value))) if attr in CHANGING_METHODS:
            yield root_name(value) if root_name(value) in own else None
        case ast.Expr() | ast.Raise() | ast.Assert():
            yield None
        case ast.Assign() | ast.Delete():
            yield from _target_outcomes(node.targets, own)
        case ast.AnnAssign() | ast.AugAssign() | ast.For() | ast.AsyncFor():
            yield from _target_outcomes([node.target], own)
        case ast.With() | ast.AsyncWith():
            yield None  # something is entered and left
            yield from _target_outcomes([item.optional_vars for item in node.items if item.optional_vars], own)
        case ast.ClassDef():
            inner = (child for child in _child_statements(node) if not isinstance(child, ast.Assign))
            yield from (None for child in inner if None in outcomes(child, ()))
        case _:
            yield from (None for each in _heads(node) if _acts(each))
    if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        for child in _child_statements(node):
            yield from outcomes(child, own)


def _heads(node: ast.stmt) -> list[ast.expr]:
    """Return the expressions that a compound statement only looks at."""
    match node:
        case ast.If(test=test) | ast.While(test=test):
            return [test]
        case ast.Match(subject=subject, cases=cases):
            return [subject, *(each.guard for each in cases if each.guard is not None)]
        case _:
            return []


def is_borrowed(node: ast.stmt) -> bool:
    """Say whether a statement names what belongs to everybody: ``decimal.getcontext()``."""
    match node:
        case ast.Assign(value=ast.Call(func=function)):
            name = _last_name(function) or ""
            return name.startswith("get") and name not in {"get", "getattr"}
        case _:
            return False


def _acts(node: ast.expr) -> bool:
    """Say whether an expression calls something that may do more than look."""
    calls = (each.func for each in ast.walk(node) if isinstance(each, ast.Call))
    return any(_last_name(each) not in _LOOKING_CALLS for each in calls)


def may_set(source: str) -> bool:
    """Say whether source may set something in a library."""
    return _SETTER.search(source) is not None


def sets_something(node: ast.stmt, source: str) -> bool:
    """Say whether a statement sets something in a library when it is executed, wherever its result goes."""
    stack: list[ast.AST] = [node] if may_set(source) else []
    while stack:
        each = stack.pop()
        if isinstance(each, ast.Call) and _SETTER.match(f"{_last_name(each.func)}("):
            return True
        match each:
            case ast.FunctionDef() | ast.AsyncFunctionDef():
                stack += [*each.decorator_list, *each.args.defaults, *filter(None, each.args.kw_defaults)]
            case ast.Lambda():
                stack += [*each.args.defaults, *filter(None, each.args.kw_defaults)]
            case _:
                stack += ast.iter_child_nodes(each)
    return False


def _child_statements(node: ast.AST) -> Iterator[ast.stmt]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.stmt):
            yield child
        elif isinstance(child, ast.ExceptHandler | ast.match_case):
            yield from _child_statements(child)


def _target_outcomes(targets: Sequence[ast.expr], own: Collection[str]) -> Iterator[str | None]:
    for target in targets:
        match target:
            case ast.Tuple() | ast.List():
                yield from _target_outcomes(target.elts, own)
            case ast.Starred():
                yield from _target_outcomes([target.value], own)
            case ast.Attribute() | ast.Subscript():
                yield root_name(target) if root_name(target) in own else None
            case _:
                pass


def is_made_for_its_effect(node: ast.stmt, names: Bindings, names_read: Callable[[], frozenset[str]]) -> bool:
    """Say whether a call's result goes to a private name that nobody reads, as in ``_ = np.seterr(all="raise")``."""
    if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None or not names.kinds:
        return False
    private = all(name.startswith("_") and (name == "_" or not name.endswith("__")) for name in names.kinds)
    if not private or not any(isinstance(each, ast.Call) for each in ast.walk(node.value)):
        return False
    return names_read().isdisjoint(names.kinds)


def names_read_in(tree: ast.Module) -> frozenset[str]:
    """Return the names that a module looks up, anywhere."""
    return frozenset(
        node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)
    )


def _last_name(node: ast.expr) -> str | None:
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else None
