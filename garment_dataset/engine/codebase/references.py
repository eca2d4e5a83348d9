"""What the names in a statement stand for, and in which way each is used."""

from __future__ import annotations

import ast
import sys
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.engine.codebase.classes import may_call_its_arguments, only_stores
from garment_dataset.engine.codebase.effects import root_name
from garment_dataset.engine.codebase.modules import External, ModuleRef, Symbol
from garment_dataset.engine.codebase.rules import located, module_as_value, refusal_of
from garment_dataset.engine.codebase.scopes import CLASS, DEFINITION, MODULE, PARAMETER, Bindings, Scope
from garment_dataset.engine.codebase.uses import CALLED, CHANGED, GIVEN, HELD, INTO, ITERATED, LATER, LENT, PART, READ
from garment_dataset.engine.codebase.world import names_a_file, unnamed_file, world_refusal
from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from garment_dataset.engine.codebase.modules import Module, Modules, Target
    from garment_dataset.engine.codebase.scopes import ImportTarget

_PURE = """
abs bool bytes callable complex divmod float format hasattr hash id int isinstance issubclass len ord pow print range
repr round str type
"""
_PURE_BUILTINS = frozenset(f"builtins.{name}" for name in _PURE.split())
_GOING_THROUGH = "all any dict enumerate frozenset iter list max min reversed set sorted sum tuple zip"
_GOING_THROUGH_BUILTINS = frozenset(f"builtins.{name}" for name in _GOING_THROUGH.split()) | {"numpy.array"}
_IMPLICIT = frozenset({"__class__", "__module__", "__qualname__"})


def is_harmless(dotted: str) -> bool:
    """Say whether a builtin does nothing to its arguments but look at them, go through them or keep them."""
    return dotted in _PURE_BUILTINS or dotted in _GOING_THROUGH_BUILTINS


def _role_in_library(dotted: str) -> int:
    if dotted in _PURE_BUILTINS:
        return READ
    return PART | ITERATED if dotted in _GOING_THROUGH_BUILTINS else LENT


class Passed(NamedTuple):
    """What a call gives a first-party function for one of its parameters.

    Parameters
    ----------
    function : Symbol
        The function called.
    place : int or str
        Which argument, by position or keyword.
    is_fixed : bool
        Whether it is made of nothing that the calling function was given.
    parameters : frozenset of str
        The parameters of the calling function with which it begins.
    line : int
        Where.
    """

    function: Symbol
    place: int | str
    is_fixed: bool
    parameters: frozenset[str]
    line: int


@dataclass(slots=True)
class Facts:
    """What one statement says.

    Attributes
    ----------
    digest : str
        sha256 of its canonical form.
    uses : dict of Symbol to int
        First-party names it refers to, and how.
    methods : set of (Symbol, str)
        Which methods of them it calls while the module is imported.
    libraries : set of str
        Third-party top-level names it refers to.
    consulted : set of str
        Modules read to find out what its names stand for.
    loads : list of (ImportTarget, int)
        What its import statements load, and on which line.
    is_active : bool
        Whether importing the module makes it call something.
    is_acting : bool
        Whether that may do something to what the statement mentions: more than look at it or store it.
    opens : set of str
        Parameters of the function it defines that name files which the function reads or writes.
    passes : list of Passed
        What it gives to first-party functions that could be such a name.
    problems : list of UntraceableCodeError
        What in it cannot be followed.
    """

    digest: str = ""
    uses: dict[Symbol, int] = field(default_factory=dict)
    methods: set[tuple[Symbol, str]] = field(default_factory=set)
    libraries: set[str] = field(default_factory=set)
    consulted: set[str] = field(default_factory=set)
    loads: list[tuple[ImportTarget, int]] = field(default_factory=list)
    is_active: bool = False
    is_acting: bool = False
    opens: set[str] = field(default_factory=set)
    passes: list[Passed] = field(default_factory=list)
    problems: list[UntraceableCodeError] = field(default_factory=list)


class References:
    """Looks names up and notes their uses, while a writer walks a statement of ``module``.

    Attributes
    ----------
    scope : Scope
        Where the walk is.
    is_later : bool
        Whether it is in a function's body.
    is_at_once : bool
        Whether that may be called by the very statement that makes it: it is a lambda's.
    is_annotation : bool
        Whether it is in an annotation: what that names is only named.
    is_lenient : bool
        Whether it is in a string that may or may not be an annotation.
    is_raised : bool
        Whether it is in a ``raise``.
    is_in_fieldless : bool
        Whether it is in a class whose fields are left out.
    owner : Symbol or None
        The class of the module that it is in.
    """

    def __init__(self, modules: Modules, module: Module) -> None:
        self.facts = Facts()
        self.scope = Scope(MODULE, Bindings(), None)
        self.is_later = False
        self.is_at_once = False
        self.is_annotation = False
        self.is_lenient = False
        self.is_raised = False
        self.is_in_fieldless = False
        self.owner: Symbol | None = None
        self.modules = modules
        self._module = module
        self._numbers: dict[tuple[Scope, str], int] = {}

    def refuse(self, error: UntraceableCodeError, node: ast.AST) -> None:
        """Note that something cannot be followed."""
        if not self.is_lenient:
            where = f"{self._module.home.where}:{getattr(node, 'lineno', 0)}"
            self.facts.problems.append(located(error, where))

    def target_of(self, node: ast.AST) -> Target | None:
        """Return what a name, or a chain of attributes of modules, stands for; None for a value.

        Raises
        ------
        UntraceableCodeError
            If that cannot be found out.
        """
        if isinstance(node, ast.Name):
            scope = self.scope.find(node.id)
            if scope is None:
                return self._resolve(node.id)
            alias = None if scope.kind == CLASS else scope.bindings.alias(node.id)
            return None if alias is None else self.imported(alias)
        if isinstance(node, ast.Attribute):
            base = self.target_of(node.value)
            if isinstance(base, ModuleRef):
                trail: set[str] = set()
                try:
                    return self.modules.attribute(base.module, node.attr, trail)
                finally:
                    self._consult(trail)
            if isinstance(base, External):
                return External(f"{base.dotted}.{node.attr}")
        return None

    def imported(self, target: ImportTarget) -> Target:
        """Return what an import statement gives; raises as :meth:`target_of`."""
        trail: set[str] = set()
        try:
            return self.modules.imported(target, trail)
        finally:
            self._consult(trail)

    def bind(self, name: str) -> str:
        """Return the canonical form of a name that is bound here."""
        scope = self.scope.find(name)
        return self._local(scope, name) if scope is not None else f"s{self._module.name!a}:{name!a}"

    def use(self, node: ast.Name, role: int) -> str:
        """Note the use of a name and return its canonical form."""
        scope = self.scope.find(node.id)
        try:
            target = self.target_of(node)
        except UntraceableCodeError as error:
            self.refuse(error, node)
            return f"?{node.id!a}"
        if target is not None:
            return self.refer(target, node, role)
        if scope is None:
            if node.id not in _IMPLICIT:
                hint = "Import it by name; a star import hides where names come from"
                self.refuse(UntraceableCodeError("a name that nothing defines", found=node.id, hint=hint), node)
            return f"i{node.id!a}"
        if scope.kind == CLASS:
            self._fall_through(node, role)
        if node.id == "cls" and role & CHANGED:
            self.change_owner()
        return self._local(scope, node.id)

    def refer(self, target: Target, node: ast.AST, role: int) -> str:
        """Note the use of what a name stands for and return its canonical form."""
        match target:
            case ModuleRef(module):
                self.refuse(module_as_value(module), node)
                return f"m{module!a}"
            case External(dotted):
                if (error := refusal_of(dotted) or self._world_refusal(dotted, role)) is not None:
                    self.refuse(error, node)
                root = dotted.partition(".")[0]
                if root not in sys.stdlib_module_names:
                    self.facts.libraries.add(root)
                return f"x{dotted!a}"
            case Symbol():
                flags = 0 if self.is_annotation else role << LATER if self.is_later else role
                if self.is_at_once and not self.is_annotation:
                    flags |= role
                self.facts.uses[target] = self.facts.uses.get(target, 0) | flags
                return f"s{target.module!a}:{target.name!a}"

    def _world_refusal(self, dotted: str, role: int) -> UntraceableCodeError | None:
        if self.is_annotation:
            return None
        is_called = bool(role & CALLED)
        function = self.scope.function if dotted == "builtins.hash" else None
        error = world_refusal(dotted, is_called=is_called, is_raised=self.is_raised, function=function)
        is_type = dotted.rpartition(".")[2][:1].isupper()
        if error is None and not is_called and not is_type and names_a_file(dotted):
            return unnamed_file(f"{dotted} as a value")
        return error

    def change_owner(self) -> None:
        """Note that a method changes the class it belongs to."""
        if self.owner is not None:
            self.facts.uses[self.owner] = self.facts.uses.get(self.owner, 0) | CHANGED << LATER

    def argument_role(self, function: ast.expr, target: Target | None) -> int:
        """Return what a call may do with its arguments."""
        if isinstance(target, External):
            return _role_in_library(target.dotted)
        if isinstance(target, Symbol):
            return self._role_in(target)
        if target is None and isinstance(function, ast.Attribute):
            if isinstance(function.value, ast.Constant | ast.JoinedStr):
                return PART | ITERATED  # a method of a text
            root = root_name(function)
            is_own = root is not None and self.scope.find(root) is None and isinstance(self._resolve(root), Symbol)
            return GIVEN if is_own else HELD
        return HELD

    def _role_in(self, target: Symbol) -> int:
        if only_stores(self.modules, target):
            return HELD
        return GIVEN if may_call_its_arguments(self.modules, target) else INTO

    def _resolve(self, name: str) -> Target | None:
        trail: set[str] = set()
        try:
            return self.modules.resolve(self._module, name, trail)
        finally:
            self._consult(trail)

    def _consult(self, trail: set[str]) -> None:
        self.facts.consulted.update(step for step in trail if ":" not in step)

    def _fall_through(self, node: ast.Name, role: int) -> None:
        """Note the module's value of a name: a class body sees it until it binds its own."""
        try:
            target = self._resolve(node.id)
        except UntraceableCodeError as error:
            self.refuse(error, node)
            return
        if isinstance(target, Symbol):
            self.refer(target, node, role)

    def _local(self, scope: Scope, name: str) -> str:
        kinds = scope.bindings.kinds[name]
        if scope.kind == CLASS:
            return f"c{name!a}"
        if kinds & PARAMETER:
            return f"p{name!a}"
        if kinds & DEFINITION:
            return f"d{name!a}"
        return f"v{self._numbers.setdefault((scope, name), len(self._numbers))}"
