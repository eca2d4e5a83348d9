"""The canonical form of what makes scopes and binds names: functions, classes, comprehensions, imports, handlers."""

from __future__ import annotations

import ast
import sys
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.codebase.classes import may_act_on_subclasses
from garment_dataset.engine.codebase.modules import ModuleRef, Symbol
from garment_dataset.engine.codebase.scopes import (
    CLASS,
    FUNCTION,
    MODULE,
    TYPES,
    Bindings,
    bindings_of,
    function_bindings,
    type_parameter_bindings,
)
from garment_dataset.engine.codebase.uses import CALLED, GIVEN, HELD, ITERATED, PART, READ
from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from collections.abc import Callable

    from garment_dataset.engine.codebase.scopes import Comprehension
    from garment_dataset.engine.codebase.writer import Writer

_UNSTORED = frozenset({"ClassVar", "Final", "InitVar", "PrivateAttr", "exclude", "exclude_if"})


def _function(writer: Writer, node: ast.FunctionDef | ast.AsyncFunctionDef, _role: int) -> None:
    writer.out.append(f"({type(node).__name__} {node.name!a}")
    writer.field("decorators", node.decorator_list, CALLED)
    _note_activity(writer, node.decorator_list)
    with writer.inside(TYPES, type_parameter_bindings(node)):
        writer.field("types", list(getattr(node, "type_params", ())))
        writer.field("args", node.args)
        writer.annotation("returns", node.returns)
        bindings = function_bindings(node.args, node.body, writer.module.home)
        _refuse_global_writes(writer, bindings, node)
        with writer.inside(FUNCTION, bindings, node, is_later=True):
            writer.field("body", node.body)
    writer.out.append(")")


def _lambda(writer: Writer, node: ast.Lambda, _role: int) -> None:
    writer.out.append("(Lambda")
    writer.field("args", node.args)
    bindings = function_bindings(node.args, [node.body], writer.module.home)
    with writer.inside(FUNCTION, bindings, node, is_later=True, is_at_once=True):
        writer.field("body", node.body, GIVEN)
    writer.out.append(")")


def _argument(writer: Writer, node: ast.arg, _role: int) -> None:
    writer.out.append(f"(arg {node.arg!a}")
    writer.annotation("annotation", node.annotation)
    writer.out.append(")")


def _class(writer: Writer, node: ast.ClassDef, _role: int) -> None:
    names = writer.names
    is_top = names.scope.kind == MODULE
    around = names.owner, writer.shared
    writer.out.append(f"(ClassDef {node.name!a}")
    writer.field("decorators", node.decorator_list, CALLED)
    _note_activity(writer, [*node.decorator_list, *node.keywords])
    names.facts.is_active = names.facts.is_active or (bool(node.bases) and not names.is_later)
    bindings = bindings_of(node.body, writer.module.home)
    _refuse_global_writes(writer, bindings, node)
    with writer.inside(TYPES, type_parameter_bindings(node)):
        writer.field("types", list(getattr(node, "type_params", ())))
        is_acted_on = any(_acts_on_subclasses(writer, base) for base in node.bases)
        writer.field("bases", node.bases, CALLED if is_acted_on else HELD)
        writer.field("keywords", node.keywords, CALLED | GIVEN)
        if is_top:
            names.owner, writer.shared = Symbol(writer.module.name, node.name), _shared_containers(node)
        with writer.inside(CLASS, bindings):
            skips = names.is_in_fieldless = is_top and node.name in writer.fieldless
            writer.field("body", [each for each in node.body if not (skips and _skip_field(writer, each))])
            names.is_in_fieldless = False
    names.owner, writer.shared = around
    writer.out.append(")")


def _acts_on_subclasses(writer: Writer, base: ast.expr) -> bool:
    target = writer.target(base)
    return not isinstance(target, Symbol) or may_act_on_subclasses(writer.names.modules, target)


def _shared_containers(node: ast.ClassDef) -> frozenset[str]:
    """Return the class variables whose values look like containers: what one object does to them, all see."""
    found = set()
    for each in node.body:
        match each:
            case ast.Assign(value=ast.Call(func=ast.Name(id="field" | "Field"))):
                continue
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.List() | ast.Dict() | ast.Set() | ast.Call()):
                found.add(name)
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.List() | ast.Dict() | ast.Set()):
                found.add(name)
    return frozenset(found)


def _skip_field(writer: Writer, node: ast.stmt) -> bool:
    """Say whether a statement declares a field whose value is in the key; its annotation is followed, not written."""
    if not isinstance(node, ast.AnnAssign) or not isinstance(node.target, ast.Name) or node.target.id.startswith("_"):
        return False
    if any(_word(each) in _UNSTORED for each in ast.walk(node)):
        return False
    written, writer.out = writer.out, []
    writer.annotation("annotation", node.annotation)
    writer.out = written
    return True


def _word(node: ast.AST) -> str | None:
    match node:
        case ast.Name(id=word) | ast.Attribute(attr=word) | ast.keyword(arg=word):
            return word
        case ast.Constant(value=str(text)):
            return text.rpartition(".")[2].partition("[")[0]  # a quoted annotation
        case _:
            return None


def _type_alias(writer: Writer, node: Any, _role: int) -> None:  # noqa: ANN401 - ast.TypeAlias, from Python 3.12 on
    writer.out.append("(TypeAlias")
    writer.field("name", node.name)
    with writer.inside(TYPES, type_parameter_bindings(node)):
        writer.field("types", node.type_params)
        writer.annotation("value", node.value)
    writer.out.append(")")


def _comprehension(writer: Writer, node: Comprehension, _role: int) -> None:
    writer.out.append(f"({type(node).__name__}")
    writer.field("iter", node.generators[0].iter, PART | ITERATED)
    bindings = bindings_of([each.target for each in node.generators], writer.module.home)
    with writer.inside(FUNCTION, bindings, node):
        for index, each in enumerate(node.generators):
            writer.out.append(" async for" if each.is_async else " for")
            writer.field("target", each.target)
            writer.field("iter", each.iter if index else None, PART | ITERATED)
            writer.field("if", each.ifs, READ)
        for name in ("key", "value", "elt"):
            writer.field(name, getattr(node, name, None))
    writer.out.append(")")


def _import(writer: Writer, node: ast.Import | ast.ImportFrom, _role: int) -> None:
    """Write an import only where it decides something; else what it binds is written wherever it is used."""
    names = writer.names
    for name, target, loaded in writer.module.home.targets(node):
        names.facts.loads.append((loaded, node.lineno))
        try:
            found = names.imported(target)
        except UntraceableCodeError as error:
            writer.refuse(error, node)
            continue
        is_alias = _is_alias(writer, name)
        if is_alias and not writer.tries:
            continue
        writer.out.append(f"(import {loaded.module!a} {loaded.attribute!a} {names.bind(name)})")
        if not isinstance(found, ModuleRef):
            names.refer(found, node, HELD)
        elif not is_alias:
            hint = "Import what is needed from it by name"
            what = "a name that stands for a module and for something else"
            writer.refuse(UntraceableCodeError(what, found=f"{name} for {found.module}", hint=hint), node)


def _is_alias(writer: Writer, name: str) -> bool:
    """Say whether a name only ever stands for what one import gives."""
    scope = writer.names.scope.find(name)
    if scope is None:
        return name in writer.module.aliases
    return scope.kind != CLASS and scope.bindings.alias(name) is not None


def _try(writer: Writer, node: ast.Try, role: int) -> None:
    writer.tries += 1
    writer.generic(node, role)
    writer.tries -= 1


def _raise(writer: Writer, node: ast.Raise, role: int) -> None:
    before, writer.names.is_raised = writer.names.is_raised, True
    writer.generic(node, role)
    writer.names.is_raised = before


def _handler(writer: Writer, node: ast.ExceptHandler, _role: int) -> None:
    writer.out.append("(ExceptHandler")
    writer.field("type", node.type)
    _bound(writer, node.name)
    writer.field("body", node.body)
    writer.out.append(")")


def _pattern(writer: Writer, node: ast.MatchAs | ast.MatchStar, _role: int) -> None:
    writer.out.append(f"({type(node).__name__}")
    writer.field("pattern", getattr(node, "pattern", None))
    _bound(writer, node.name)
    writer.out.append(")")


def _mapping_pattern(writer: Writer, node: ast.MatchMapping, _role: int) -> None:
    writer.out.append("(MatchMapping")
    writer.field("keys", node.keys)
    writer.field("patterns", node.patterns)
    _bound(writer, node.rest)
    writer.out.append(")")


def _bound(writer: Writer, name: str | None) -> None:
    if name is not None:
        writer.out.append(f" as {writer.names.bind(name)}")


def _note_activity(writer: Writer, nodes: list[Any]) -> None:
    """Note that a definition calls something when it is executed."""
    if nodes and not writer.names.is_later:
        writer.names.facts.is_active = writer.names.facts.is_acting = True


def _refuse_global_writes(writer: Writer, bindings: Bindings, node: ast.AST) -> None:
    if written := sorted(bindings.globals & bindings.kinds.keys()):
        error = UntraceableCodeError(
            "a module variable is written through `global`",
            found=", ".join(written),
            hint="Return the value, or keep it in an object that is passed on",
        )
        writer.refuse(error, node)


DEFINITIONS: dict[type[ast.AST], Callable[[Writer, Any, int], None]] = {
    ast.FunctionDef: _function,
    ast.AsyncFunctionDef: _function,
    ast.Lambda: _lambda,
    ast.arg: _argument,
    ast.ClassDef: _class,
    ast.ListComp: _comprehension,
    ast.SetComp: _comprehension,
    ast.DictComp: _comprehension,
    ast.GeneratorExp: _comprehension,
    ast.Import: _import,
    ast.ImportFrom: _import,
    ast.Try: _try,
    ast.TryStar: _try,
    ast.ExceptHandler: _handler,
    ast.Raise: _raise,
    ast.MatchAs: _pattern,
    ast.MatchStar: _pattern,
    ast.MatchMapping: _mapping_pattern,
}
"""How each kind of node is written."""

if sys.version_info >= (3, 12):
    DEFINITIONS[ast.TypeAlias] = _type_alias
