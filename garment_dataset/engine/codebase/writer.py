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

from garment_dataset.engine.codebase.references import GIVEN, HELD, READ, References
from garment_dataset.engine.codebase.scopes import Bindings, Scope
from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.engine.codebase.modules import Module, Modules, Target

_NOT_CODE = frozenset({"ctx", "type_comment", "kind", "type_params"})
_LOOKING = frozenset({ast.Compare, ast.BinOp, ast.UnaryOp, ast.Slice})
_HANDING_ON = frozenset({ast.Assign, ast.Return, ast.Yield, ast.YieldFrom, ast.NamedExpr})
_TRANSPARENT = frozenset({ast.BoolOp, ast.IfExp, ast.Starred, ast.Await, ast.keyword})

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
    """

    def __init__(self, modules: Modules, module: Module, fieldless: frozenset[str], handlers: Handlers) -> None:
        self.module = module
        self.names = References(modules, module)
        self.out: list[str] = []
        self.tries = 0
        self.fieldless = fieldless
        self.shared: frozenset[str] = frozenset()
        self._handlers = handlers

    def write(self, node: ast.AST, role: int = HELD) -> None:
        """Write any node; ``role`` says how the value of an expression is used."""
        kind = type(node)
        if (handler := self._handlers.get(kind)) is not None:
            handler(self, node, role)
        elif kind in _LOOKING:
            self.generic(node, READ)
        elif kind in _HANDING_ON:
            self.generic(node, GIVEN if self.names.is_later else HELD)
        else:
            self.generic(node, role if kind in _TRANSPARENT else HELD)

    def generic(self, node: ast.AST, role: int) -> None:
        """Write a node's type and every field that is not empty."""
        self.out.append(f"({type(node).__name__}")
        for name in node._fields:
            if name not in _NOT_CODE:
                self.field(name, getattr(node, name, None), role)
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
    def inside(self, kind: str, bindings: Bindings, *, is_later: bool = False) -> Iterator[None]:
        """Walk in an inner scope; ``is_later`` when importing the module does not run it."""
        before = self.names.scope, self.names.is_later
        self.names.scope = Scope(kind, bindings, self.names.scope)
        self.names.is_later = self.names.is_later or is_later
        try:
            yield
        finally:
            self.names.scope, self.names.is_later = before

    def _item(self, value: object, role: int) -> None:
        if isinstance(value, ast.AST):
            self.write(value, role)
        else:
            self.out.append("~" if value is None else constant(value))


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
