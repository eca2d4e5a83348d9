"""Which names a piece of code binds, and in which scope a name is looked up: Python's own rules, on syntax alone."""

from __future__ import annotations

import ast
import bisect
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

PARAMETER, VARIABLE, DEFINITION, IMPORT = 1, 2, 4, 8
"""How a scope binds a name; flags, since it may do so in several ways."""

MODULE, CLASS, FUNCTION, TYPES = "module", "class", "function", "types"
"""Kinds of scope: lambdas and comprehensions are functions, TYPES holds the type parameters of one definition."""

Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
Comprehension = ast.ListComp | ast.SetComp | ast.DictComp | ast.GeneratorExp
_TARGETS = (ast.Tuple, ast.List, ast.Starred)


class ImportTarget(NamedTuple):
    """What an import statement gives a name: a module (``attribute`` None) or an attribute of one."""

    module: str
    attribute: str | None


@dataclass(frozen=True, slots=True)
class Home:
    """The module that a piece of code stands in.

    Parameters
    ----------
    module : str
        Dotted name.
    is_package : bool
        Whether relative imports start at the module itself.
    where : str
        Its file, for messages.
    walrus_lines : tuple of int
        The lines that hold ``:=``, sorted: elsewhere no expression binds a name.
    """

    module: str
    is_package: bool
    where: str
    walrus_lines: tuple[int, ...] = ()

    def may_bind(self, node: ast.expr) -> bool:
        """Say whether an expression may bind a name."""
        place = bisect.bisect_left(self.walrus_lines, node.lineno)
        return place < len(self.walrus_lines) and self.walrus_lines[place] <= (node.end_lineno or node.lineno)

    def absolute(self, node: ast.ImportFrom) -> str:
        """Return the dotted name of the module that a ``from`` import reads.

        Raises
        ------
        UntraceableCodeError
            If it climbs out of the package.
        """
        if node.level == 0:
            return node.module or ""
        parts = self.module.split(".")
        keep = len(parts) - node.level + (1 if self.is_package else 0)
        if keep < 1:
            raise UntraceableCodeError(
                "a relative import climbs out of its package", where=f"{self.where}:{node.lineno}"
            )
        return ".".join([*parts[:keep], *([node.module] if node.module else [])])

    def targets(self, node: ast.Import | ast.ImportFrom) -> list[tuple[str, ImportTarget, ImportTarget]]:
        """Return, per name that an import statement binds: the name, what it then stands for, and what is loaded."""
        if isinstance(node, ast.ImportFrom):
            module = self.absolute(node)
            found = [ImportTarget(module, alias.name) for alias in node.names]
            return [
                (alias.asname or alias.name, target, target)
                for alias, target in zip(node.names, found, strict=True)
                if alias.name != "*"
            ]
        return [
            (
                alias.asname or alias.name.partition(".")[0],
                ImportTarget(alias.name if alias.asname else alias.name.partition(".")[0], None),
                ImportTarget(alias.name, None),
            )
            for alias in node.names
        ]


@dataclass(slots=True)
class Bindings:
    """The names that one scope binds.

    Attributes
    ----------
    kinds : dict of str to int
        How, as flags.
    imports : dict of str to set of ImportTarget
        What the imported ones may stand for.
    loads : list of (ImportTarget, int)
        What its import statements load, in order, and on which line.
    stars : list of (str, int)
        Modules that are imported with a star, and the lines.
    outer : set of str
        Declared ``nonlocal``.
    globals : set of str
        Declared ``global``.
    """

    kinds: dict[str, int] = field(default_factory=dict)
    imports: dict[str, set[ImportTarget]] = field(default_factory=dict)
    loads: list[tuple[ImportTarget, int]] = field(default_factory=list)
    stars: list[tuple[str, int]] = field(default_factory=list)
    outer: set[str] = field(default_factory=set)
    globals: set[str] = field(default_factory=set)

    def bind(self, name: str, kind: int) -> None:
        """Note that ``name`` is bound in one more way."""
        self.kinds[name] = self.kinds.get(name, 0) | kind

    def alias(self, name: str) -> ImportTarget | None:
        """Return what ``name`` stands for when imports of one and the same thing are all that binds it."""
        if self.kinds.get(name) == IMPORT and len(self.imports[name]) == 1:
            return next(iter(self.imports[name]))
        return None


def bindings_of(nodes: Iterable[ast.AST], home: Home) -> Bindings:
    """Collect what ``nodes`` bind in the scope that they stand in; inner scopes keep what is theirs.

    Raises
    ------
    UntraceableCodeError
        If a relative import climbs out of its package.
    """
    found = Bindings()
    stack = [(node, False) for node in nodes][::-1]
    while stack:
        node, in_comprehension = stack.pop()
        if isinstance(node, ast.Name):
            if not (in_comprehension or isinstance(node.ctx, ast.Load)):
                found.bind(node.id, VARIABLE)
            continue
        if isinstance(node, ast.expr) and not isinstance(node, _TARGETS) and not home.may_bind(node):
            continue
        if not in_comprehension or isinstance(node, ast.NamedExpr):
            _bind(node, found, home)
        inner = in_comprehension or isinstance(node, Comprehension)
        stack.extend((child, inner) for child in reversed(_children_in_scope(node)))
    return found


def _children_in_scope(node: ast.AST) -> list[ast.AST]:
    match node:
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            return [*node.decorator_list, *node.args.defaults, *filter(None, node.args.kw_defaults)]
        case ast.Lambda():
            return [*node.args.defaults, *filter(None, node.args.kw_defaults)]
        case ast.ClassDef():
            return [*node.decorator_list, *node.bases, *node.keywords]
        case _:
            return list(ast.iter_child_nodes(node))


def _bind(node: ast.AST, found: Bindings, home: Home) -> None:
    match node:
        case ast.NamedExpr(target=ast.Name() as target):
            found.bind(target.id, VARIABLE)
        case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
            found.bind(node.name, DEFINITION)
        case ast.ExceptHandler(name=str(name)) | ast.MatchAs(name=str(name)) | ast.MatchStar(name=str(name)):
            found.bind(name, VARIABLE)
        case ast.MatchMapping(rest=str(name)):
            found.bind(name, VARIABLE)
        case ast.Import() | ast.ImportFrom():
            _bind_import(node, found, home)
        case ast.Global():
            found.globals.update(node.names)
        case ast.Nonlocal():
            found.outer.update(node.names)
        case _:
            pass


def _bind_import(node: ast.Import | ast.ImportFrom, found: Bindings, home: Home) -> None:
    for name, target, loaded in home.targets(node):
        found.bind(name, IMPORT)
        found.imports.setdefault(name, set()).add(target)
        found.loads.append((loaded, node.lineno))
    if isinstance(node, ast.ImportFrom) and any(alias.name == "*" for alias in node.names):
        found.stars.append((home.absolute(node), node.lineno))
        found.loads.append((ImportTarget(home.absolute(node), None), node.lineno))


class Scope:
    """One scope of a module.

    Attributes
    ----------
    kind : str
        Of a module, a class, a function or type parameters.
    bindings : Bindings
        The names it binds.
    parent : Scope or None
        The scope around.
    node : ast.AST or None
        The syntax it belongs to, of functions and comprehensions.
    """

    __slots__ = ("bindings", "kind", "node", "parent")

    def __init__(self, kind: str, bindings: Bindings, parent: Scope | None, node: ast.AST | None = None) -> None:
        self.kind = kind
        self.bindings = bindings
        self.parent = parent
        self.node = node

    @property
    def is_outermost(self) -> bool:
        """Whether it is that of a function at the top of a module, or of ``__init__`` of a class there."""
        around = self.around
        if around is not None and around.kind == CLASS and self.function == "__init__":
            around = around.around
        return self.kind == FUNCTION and (around is None or around.kind == MODULE)

    @property
    def around(self) -> Scope | None:
        """The scope around that is not one of type parameters."""
        around = self.parent
        while around is not None and around.kind == TYPES:
            around = around.parent
        return around

    @property
    def function(self) -> str | None:
        """Name of the function it is in."""
        scope: Scope | None = self
        while scope is not None and not isinstance(scope.node, ast.FunctionDef | ast.AsyncFunctionDef):
            scope = scope.parent
        return None if scope is None else getattr(scope.node, "name", None)

    def find(self, name: str) -> Scope | None:
        """Return the scope that ``name`` belongs to when used here; None for the module's, or nobody's."""
        scope: Scope | None = self
        sees_class = True
        while scope is not None and scope.kind != MODULE:
            bindings = scope.bindings
            if scope.kind != CLASS or sees_class:
                if name in bindings.globals:
                    return None
                if name in bindings.kinds and name not in bindings.outer:
                    return scope
            sees_class = sees_class and scope.kind == TYPES
            scope = scope.parent
        return None


def function_bindings(arguments: ast.arguments, body: Iterable[ast.AST], home: Home) -> Bindings:
    """Return what a function or lambda binds: its parameters, and what its body does."""
    found = bindings_of(body, home)
    every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs, arguments.vararg, arguments.kwarg]
    for argument in filter(None, every):
        found.bind(argument.arg, PARAMETER)
    return found


def type_parameter_bindings(node: ast.AST) -> Bindings:
    """Return the type parameters of a definition; a Python before 3.12 knows none."""
    found = Bindings()
    for parameter in getattr(node, "type_params", ()):
        found.bind(parameter.name, PARAMETER)
    return found


def global_writes(tree: ast.Module, home: Home) -> Mapping[str, int]:
    """Return the module variables that functions or classes write through ``global``, each with a line."""
    found: dict[str, int] = {}
    for node in ast.walk(tree):
        if isinstance(node, Definition):
            bindings = bindings_of(node.body, home)
            for name in bindings.globals & bindings.kinds.keys():
                found.setdefault(name, node.lineno)
    return found
