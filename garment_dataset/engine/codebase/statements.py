"""The statements of a module: which names each binds, which values it changes, and whether it acts beyond those."""

from __future__ import annotations

import ast
import functools
import re
import unicodedata
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from garment_dataset.engine.codebase.scopes import IMPORT, Bindings, bindings_of

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

    from garment_dataset.engine.codebase.scopes import Home

_CHANGING = """
add append appendleft clear difference_update discard extend extendleft insert intersection_update pop popitem popleft
remove reverse rotate setdefault sort subtract symmetric_difference_update update
fill itemset partition put resize setfield setflags byteswap
"""
CHANGING_METHODS = frozenset(_CHANGING.split())
"""Methods of containers and arrays that change the object they are called on."""

_WORD = re.compile(r"\w+")
_BASE = re.compile(r"(\w+)\s*[.\[)#\\]")


@dataclass(frozen=True, eq=False)
class Statement:
    """One statement at the top of a module, compound ones whole.

    Attributes
    ----------
    node : ast.stmt
        Its syntax.
    index : int
        Its place in the module, from 0.
    is_for_checkers : bool
        Whether it stands under ``if TYPE_CHECKING``.
    bindings : Bindings
        The module's names that it binds.
    changes : frozenset of str
        The module's own variables whose values it changes (``X.append(1)``, ``X[0] = 1``).
    has_effect : bool
        Whether it acts on more than those: ``np.seterr(...)``.
    source : str
        Its lines.
    """

    node: ast.stmt
    index: int
    is_for_checkers: bool
    bindings: Bindings
    changes: frozenset[str]
    has_effect: bool
    source: str

    @property
    def binds(self) -> Mapping[str, int]:
        """The module's names that it binds, and how."""
        return self.bindings.kinds

    @cached_property
    def words(self) -> frozenset[str]:
        """Every identifier in it, and words of comments and strings: cheap, to rule statements out by."""
        return frozenset(_WORD.findall(self.source))

    @cached_property
    def bases(self) -> frozenset[str]:
        """Every identifier of which an attribute or item may be taken, and more: to rule statements out by."""
        return frozenset(_BASE.findall(self.source))


def statements_of(tree: ast.Module, source: str, home: Home) -> tuple[Statement, ...]:
    """Take a module apart.

    Raises
    ------
    UntraceableCodeError
        If a relative import climbs out of its package.
    """
    lines = (source if source.isascii() else unicodedata.normalize("NFKC", source)).split("\n")
    found = [(node, for_checkers, bindings_of([node], home)) for node, for_checkers in _flat(tree.body)]
    own = {name for _, _, names in found for name, kind in names.kinds.items() if kind != IMPORT}
    names_read = functools.cache(lambda: _names_read(tree))
    statements = []
    for index, (node, for_checkers, names) in enumerate(found):
        outcomes = set(_outcomes(node, own))
        has_effect = None in outcomes or _is_made_for_its_effect(node, names, names_read)
        changes = frozenset(name for name in outcomes if name is not None)
        first = min([node.lineno, *(each.lineno for each in getattr(node, "decorator_list", ()))])
        text = "\n".join(lines[first - 1 : node.end_lineno])
        statements.append(Statement(node, index, for_checkers, names, changes, has_effect and not for_checkers, text))
    return tuple(statements)


def _flat(body: Sequence[ast.stmt]) -> Iterator[tuple[ast.stmt, bool]]:
    """Yield the top statements: those under ``if TYPE_CHECKING`` one by one, those of a script's main block never."""
    for node in body:
        match node:
            case ast.If(test=ast.Name(id="TYPE_CHECKING") | ast.Attribute(attr="TYPE_CHECKING")):
                yield from ((child, True) for child in node.body)
                yield from ((child, False) for child in node.orelse)
            case ast.If(test=ast.Compare(left=ast.Name(id="__name__"), ops=[ast.Eq()])):
                yield from ((child, False) for child in node.orelse)
            case _:
                yield node, False


def root_name(node: ast.AST) -> str | None:
    """Return the name that a chain of attributes and items begins with."""
    while isinstance(node, ast.Attribute | ast.Subscript | ast.Starred):
        node = node.value
    return node.id if isinstance(node, ast.Name) else None


def _outcomes(node: ast.stmt, own: Collection[str]) -> Iterator[str | None]:
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
            yield from _target_outcomes([item.optional_vars for item in node.items if item.optional_vars], own)
        case _:
            pass
    if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        for child in _child_statements(node):
            yield from _outcomes(child, own)


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


def _is_made_for_its_effect(node: ast.stmt, names: Bindings, names_read: Callable[[], frozenset[str]]) -> bool:
    """Say whether a call's result goes to a private name that nobody reads, as in ``_ = np.seterr(all="raise")``."""
    if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None or not names.kinds:
        return False
    private = all(name.startswith("_") and (name == "_" or not name.endswith("__")) for name in names.kinds)
    if not private or not any(isinstance(each, ast.Call) for each in ast.walk(node.value)):
        return False
    return names_read().isdisjoint(names.kinds)


def _names_read(tree: ast.Module) -> frozenset[str]:
    return frozenset(
        node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)
    )
