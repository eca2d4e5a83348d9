"""The canonical form of expressions: names, attributes, items, calls, constants and formatted strings."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.codebase.classes import last_name, only_stores
from garment_dataset.engine.codebase.effects import CHANGING_METHODS, CHANGING_OPERATORS
from garment_dataset.engine.codebase.modules import External, ModuleRef, Symbol
from garment_dataset.engine.codebase.reading import check_call, check_method
from garment_dataset.engine.codebase.references import is_harmless
from garment_dataset.engine.codebase.rules import MODULE_FUNCTIONS, REFUSED_ATTRIBUTES, module_as_value
from garment_dataset.engine.codebase.uses import CALLED, CHANGED, GIVEN, HELD, LENT, METHOD, PART, READ
from garment_dataset.engine.codebase.writer import constant
from garment_dataset.engine.errors import UntraceableCodeError

if TYPE_CHECKING:
    from collections.abc import Callable

    from garment_dataset.engine.codebase.modules import Target
    from garment_dataset.engine.codebase.writer import Writer


def _constant(writer: Writer, node: ast.Constant, _role: int) -> None:
    writer.out.append(constant(node.value))
    if isinstance(node.value, str) and writer.names.is_annotation:
        _quoted(writer, node.value)


def _quoted(writer: Writer, text: str) -> None:
    """Follow a string in an annotation, if it is code."""
    try:
        node = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError):
        return
    before, writer.names.is_lenient = writer.names.is_lenient, True
    writer.field("quoted", node)
    writer.names.is_lenient = before


def _singleton(writer: Writer, node: ast.MatchSingleton, _role: int) -> None:
    writer.out.append(f"(MatchSingleton {node.value})")


def _name(writer: Writer, node: ast.Name, role: int) -> None:
    is_load = isinstance(node.ctx, ast.Load)
    writer.out.append(writer.names.use(node, role) if is_load else writer.names.bind(node.id))


def _attribute(writer: Writer, node: ast.Attribute, role: int) -> None:
    names = writer.names
    if node.attr in REFUSED_ATTRIBUTES:
        hint = "Name what is meant"
        writer.refuse(UntraceableCodeError("cannot be followed statically", found=node.attr, hint=hint), node)
    is_stored, is_called = not isinstance(node.ctx, ast.Load), bool(role & CALLED)
    if is_stored:
        role = CHANGED
        _refuse_write_to_module(writer, node)
    if (target := writer.target(node)) is not None:
        writer.out.append(names.refer(target, node, role))
        return
    if not names.is_annotation and not is_stored:
        check_method(writer, node)
    if role & CHANGED and not is_stored and (node.attr == "__class__" or node.attr in writer.shared):
        names.change_owner()
    changes = node.attr in CHANGING_METHODS or node.attr in CHANGING_OPERATORS
    if not changes:  # a method that changes the object holds it, even where it is not called
        role = of_part(role & ~CALLED)
    if is_called:
        role = role & ~CALLED | (CHANGED if changes else METHOD)
        if not names.is_later and isinstance(base := writer.target(node.value), Symbol):
            names.facts.methods.add((base, node.attr))
    writer.out.append(f"(Attribute {node.attr!a}")
    writer.field("value", node.value, role)
    writer.out.append(")")


def _refuse_write_to_module(writer: Writer, node: ast.Attribute) -> None:
    if isinstance(module := writer.target(node.value), ModuleRef):
        error = UntraceableCodeError(
            "a module's variable is written from outside",
            found=f"{module.module}.{node.attr}",
            hint="Pass the value as an argument",
        )
        writer.refuse(error, node)


def _subscript(writer: Writer, node: ast.Subscript, role: int) -> None:
    writer.out.append("(Subscript")
    writer.field("value", node.value, of_part(role) if isinstance(node.ctx, ast.Load) else CHANGED)
    special = last_name(node.value) if writer.names.is_annotation else None
    if special in {"Literal", "Annotated"}:
        _values(writer, node.slice, types=1 if special == "Annotated" else 0)
    else:
        writer.field("slice", node.slice, READ)
    writer.out.append(")")


def _values(writer: Writer, node: ast.expr, *, types: int) -> None:
    """Write what stands in ``Literal[...]``, or in ``Annotated[...]`` after its type: values; strings are no code."""
    elements = node.elts if isinstance(node, ast.Tuple) else [node]
    writer.field("types", elements[:types])
    writer.names.is_annotation = False
    writer.field("values", elements[types:], READ)
    writer.names.is_annotation = True


def _call(writer: Writer, node: ast.Call, role: int) -> None:
    names = writer.names
    if names.is_annotation and writer.module.annotations_run and not names.is_lenient:
        names.is_annotation = False
        _call(writer, node, role)
        names.is_annotation = True
        return
    target = writer.target(node.func)
    if not names.is_later and not names.is_annotation:
        names.facts.is_active = True
        names.facts.is_acting = names.facts.is_acting or not _only_looks(writer, target, node.keywords)
    dotted = target.dotted if isinstance(target, External) else None
    if dotted in MODULE_FUNCTIONS:
        _refuse_reach_into_module(writer, node, dotted.removeprefix("builtins."))
    if dotted == "builtins.type" and role & CHANGED:
        names.change_owner()
    if not names.is_annotation:
        check_call(writer, node, target)
    given = _argument_role(writer, node, target)
    sets = dotted is not None and dotted.strip("_").endswith(("setattr", "delattr"))
    writer.out.append("(Call")
    writer.field("func", node.func, CALLED)
    writer.field("first", node.args[:1], CHANGED if sets else given)
    writer.field("args", node.args[1:], given)
    # `max(values, key=function)` calls what it is given, `dict(name=value)` keeps it whole
    writer.field("keywords", node.keywords, given | LENT if isinstance(target, External) else given)
    writer.out.append(")")


def of_part(role: int) -> int:
    """Return how a value is used of which an attribute or item is used in this way."""
    return role & (CHANGED | READ) | (PART if role & ~(CHANGED | READ) else 0)


def _only_looks(writer: Writer, target: Target | None, keywords: list[ast.keyword]) -> bool:
    """Say whether a call does nothing to its arguments, nor to what they hold, but look at it or keep it."""
    if isinstance(target, External):
        return is_harmless(target.dotted) and not any(word.arg in {"key", "file"} for word in keywords)
    return isinstance(target, Symbol) and only_stores(writer.names.modules, target)


def _argument_role(writer: Writer, node: ast.Call, target: Target | None) -> int:
    try:
        return writer.names.argument_role(node.func, target)
    except UntraceableCodeError:
        return HELD  # refused where the function itself is written


def _refuse_reach_into_module(writer: Writer, node: ast.Call, function: str) -> None:
    if not node.args and not node.keywords:
        hint = "Name the variables"
        writer.refuse(UntraceableCodeError("cannot be followed statically", found=f"{function}()", hint=hint), node)
    elif node.args and isinstance(module := writer.target(node.args[0]), ModuleRef):
        writer.refuse(module_as_value(module.module, function), node)


def _assignment(writer: Writer, node: ast.AnnAssign, _role: int) -> None:
    writer.out.append(f"(AnnAssign {node.simple}")
    writer.field("target", node.target)
    writer.annotation("annotation", node.annotation)
    writer.field("value", node.value, GIVEN if writer.names.is_later else HELD)
    writer.out.append(")")


def _augmented(writer: Writer, node: ast.AugAssign, _role: int) -> None:
    if isinstance(node.target, ast.Name):
        writer.names.use(node.target, CHANGED)  # in place where the value allows it, whoever else holds it
    writer.generic(node, READ)


def _formatted(writer: Writer, node: ast.FormattedValue, _role: int) -> None:
    writer.out.append(f"(FormattedValue {node.conversion}")
    writer.field("value", node.value, READ)
    if isinstance(node.format_spec, ast.JoinedStr) and node.format_spec.values:
        writer.field("spec", node.format_spec)
    writer.out.append(")")


def _string(writer: Writer, node: ast.JoinedStr, _role: int) -> None:
    """Write an f-string; Pythons differ in how they cut its fixed text into pieces."""
    writer.out.append("(JoinedStr")
    text = ""
    for value in node.values:
        if isinstance(value, ast.Constant):
            text += str(value.value)
            continue
        writer.out.append(f" {text!a} ")
        text = ""
        writer.write(value, READ)
    writer.out.append(f" {text!a})")


EXPRESSIONS: dict[type[ast.AST], Callable[[Writer, Any, int], None]] = {
    ast.Constant: _constant,
    ast.MatchSingleton: _singleton,
    ast.Name: _name,
    ast.Attribute: _attribute,
    ast.Subscript: _subscript,
    ast.Call: _call,
    ast.AnnAssign: _assignment,
    ast.AugAssign: _augmented,
    ast.FormattedValue: _formatted,
    ast.JoinedStr: _string,
}
"""How each kind of node is written."""
