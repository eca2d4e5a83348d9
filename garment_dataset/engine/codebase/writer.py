"""The canonical form of a statement.

It keeps what Python executes and drops the rest: comments, docstrings, layout, quotes, parentheses, and the names of a
function's own variables, which are numbered in the order they appear. A name that leads elsewhere is written as what it
stands for, so that an alias changed to point at another function is a change, and an alias merely renamed is none.
Fields that are empty are left out, since later Pythons add such.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.codebase.paths import Origins
from garment_dataset.engine.codebase.references import References
from garment_dataset.engine.codebase.scopes import Bindings, Scope
from garment_dataset.engine.codebase.uses import GIVEN, HELD, ITERATED, METHOD, PART, READ
from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.engine.codebase.modules import Module, Modules, Target

_NOT_CODE = frozenset({"ctx", "type_comment", "kind", "type_params"})
_LOOKING = frozenset({ast.Compare, ast.BinOp, ast.UnaryOp, ast.Slice})
_HANDING_ON = frozenset({ast.Assign, ast.Return, ast.Yield, ast.YieldFrom, ast.NamedExpr})
_TRANSPARENT = frozenset({ast.BoolOp, ast.IfExp, ast.Await, ast.keyword})

_ROLES: Mapping[tuple[type[ast.AST], str], int] = {
    (ast.For, "iter"): PART | ITERATED,
    (ast.AsyncFor, "iter"): PART | ITERATED,
    (ast.Starred, "value"): PART | ITERATED,
    (ast.withitem, "context_expr"): HELD | METHOD,
    (ast.If, "test"): READ,
    (ast.IfExp, "test"): READ,
    (ast.While, "test"): READ,
    (ast.Dict, "keys"): HELD | READ,
    (ast.Set, "elts"): HELD | READ,
    (ast.MatchClass, "cls"): READ,
    (ast.BinOp, "left"): READ | PART,
    (ast.BinOp, "right"): READ | PART,
}
"""How the value in a field is used, where that is not as the whole is."""

Handlers = Mapping[type[ast.AST], Callable[["Writer", Any, int], None]]
"""What writes the kinds of syntax that need more than their fields one after the other."""


class Writer:
    """Writes the canonical form of syntax into ``out``, and has ``names`` note what it refers to.

    Attributes
    ----------
    module : Module
        Where the code stands.
    names : References
        Looks up every name.
    out : list of str
        What is written so far, ASCII only.
    tries : int
        How many ``try`` statements the walk is in: there, an import can fail.
    fieldless : frozenset of str
        The module's classes whose fields are left out.
    shared : frozenset of str
        Containers that all objects of the class around share.
    origins : Origins
        Tells where the values of expressions come from.
    """

    def __init__(self, modules: Modules, module: Module, fieldless: frozenset[str], handlers: Handlers) -> None:
        self.module = module
        self.names = References(modules, module)
        self.out: list[str] = []
        self.tries = 0
        self.fieldless = fieldless
        self.shared: frozenset[str] = frozenset()
        self._handlers = handlers
        self.origins = Origins(self.names)

    def write(self, node: ast.AST, role: int = HELD) -> None:
        """Write any node; ``role`` says how the value of an expression is used."""
        kind = type(node)
        if (handler := self._handlers.get(kind)) is not None:
            handler(self, node, role)
        elif kind in _LOOKING:
            self.generic(node, READ | ITERATED if isinstance(node, ast.Compare) else READ)
        elif kind in _HANDING_ON:
            role = GIVEN if self.names.is_later else HELD
            self.generic(node, role | PART | ITERATED if _takes_apart(node) else role)
        else:
            role = role if kind in _TRANSPARENT else HELD
            self.generic(node, role | READ if kind is ast.BoolOp else role)

    def generic(self, node: ast.AST, role: int) -> None:
        """Write a node's type and every field that is not empty."""
        self.out.append(f"({type(node).__name__}")
        for name in node._fields:
            if name not in _NOT_CODE:
                self.field(name, getattr(node, name, None), _ROLES.get((type(node), name), role))
        self.out.append(")")

    def field(self, name: str, value: object, role: int = HELD) -> None:
        """Write a named child, a list of children or a constant; nothing when there is none."""
        if isinstance(value, list):
            value = [each for each in value if not _does_nothing(each)]
        if value is None or value == []:
            return
        self.out.append(f" {name}:")
        if not isinstance(value, list):
            self._item(value, role)
            return
        self.out.append("[")
        for each in value:
            before = len(self.out)
            self._item(each, role)
            if len(self.out) > before:
                self.out.append(",")
        self.out.append("]")

    def annotation(self, name: str, node: ast.expr | None) -> None:
        """Write an annotation: what it names is named, not used."""
        before, self.names.is_annotation = self.names.is_annotation, True
        self.field(name, node)
        self.names.is_annotation = before

    def target(self, node: ast.expr) -> Target | None:
        """Return what an expression stands for, None for a value; what cannot be found out is refused."""
        try:
            return self.names.target_of(node)
        except UntraceableCodeError as error:
            self.refuse(error, node)
            return None

    def refuse(self, error: UntraceableCodeError, node: ast.AST) -> None:
        """Note that something cannot be followed."""
        self.names.refuse(error, node)

    @contextmanager
    def inside(
        self,
        kind: str,
        bindings: Bindings,
        node: ast.AST | None = None,
        *,
        is_later: bool = False,
        is_at_once: bool = False,
    ) -> Iterator[None]:
        """Walk in an inner scope; ``is_later`` when importing the module does not run it, but for ``is_at_once``."""
        names = self.names
        before = names.scope, names.is_later, names.is_at_once
        names.scope = Scope(kind, bindings, names.scope, node)
        names.is_at_once = is_at_once and (names.is_at_once or not names.is_later) if is_later else names.is_at_once
        names.is_later = names.is_later or is_later
        try:
            yield
        finally:
            names.scope, names.is_later, names.is_at_once = before

    def _item(self, value: object, role: int) -> None:
        if isinstance(value, ast.AST):
            self.write(value, role)
        else:
            self.out.append("~" if value is None else constant(value))


def _takes_apart(node: ast.AST) -> bool:
    """Say whether an assignment goes through its value."""
    return (
        isinstance(node, ast.Assign)
        and not isinstance(node.value, ast.Tuple)
        and any(isinstance(each, ast.Tuple | ast.List) for each in node.targets)
    )


def _does_nothing(node: object) -> bool:
    if not isinstance(node, ast.stmt):
        return False
    match node:
        case ast.Pass() | ast.Global() | ast.Nonlocal() | ast.Expr(value=ast.Constant()):
            return True
        case ast.ImportFrom(module="__future__"):
            return True
        case _:
            return False


def constant(value: object) -> str:
    """Return a constant in ASCII: equal texts mean equal type and value, on every Python."""
    match value:
        case float():
            return f"f{value.hex()}"
        case complex():
            return f"j{value.real.hex()},{value.imag.hex()}"
        case bool():
            return str(value)
        case int():
            return hex(value)  # str() refuses long ones
        case _:
            return ascii(value)
