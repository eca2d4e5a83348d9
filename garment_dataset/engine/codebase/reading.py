"""What calls and methods read of the world, and which of it is refused: files of no input, seeds left out."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING

from garment_dataset.engine.codebase.modules import External, Symbol
from garment_dataset.engine.codebase.paths import DISPLAYS, path_argument
from garment_dataset.engine.codebase.references import Passed
from garment_dataset.engine.codebase.world import (
    PATH_METHODS,
    WRITING_METHODS,
    call_refusal,
    names_a_file,
    reads_the_world,
    unnamed_file,
    world_refusal,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.engine.codebase.modules import Modules, Target
    from garment_dataset.engine.codebase.paths import Origins
    from garment_dataset.engine.codebase.references import Facts
    from garment_dataset.engine.codebase.writer import Writer


def check_call(writer: Writer, node: ast.Call, target: Target | None) -> None:
    """Refuse a call that reads a file of no input, or makes a generator without a seed; note what it passes on."""
    origins = writer.origins
    if isinstance(target, External):
        values = [getattr(each, "value", ...) if isinstance(each, ast.Constant) else ... for each in _arguments(node)]
        unpacked = any(isinstance(each, ast.Starred) for each in node.args) or any(not w.arg for w in node.keywords)
        if (error := call_refusal(target.dotted, values, has_more=unpacked)) is not None:
            writer.refuse(error, node)
        elif names_a_file(target.dotted) and not unpacked:
            _check_path(writer, origins, node, target.dotted)
        elif target.dotted == "builtins.getattr" and len(node.args) > 1:
            _check_attribute_by_name(writer, node)
    elif isinstance(target, Symbol):
        _note_passed(writer, origins, node, target)
    elif isinstance(node.func, ast.Attribute) and node.func.attr in WRITING_METHODS and node.args:
        _check_path(writer, origins, node, node.func.attr)


def check_method(writer: Writer, node: ast.Attribute) -> None:
    """Refuse a method of a path that comes from nothing the function was given."""
    if node.attr == "expanduser":
        writer.refuse(reads_the_world("expanduser", "Give the whole path"), node)
    elif node.attr in PATH_METHODS:
        origins = writer.origins
        if origins.is_fixed(node.value) and origins.is_path(node.value):
            writer.refuse(unnamed_file(f"{ast.unparse(node.value)}.{node.attr}"), node)
        else:
            writer.names.facts.opens |= origins.parameters(node.value)


def _check_path(writer: Writer, origins: Origins, node: ast.Call, function: str) -> None:
    path = path_argument(node)
    if isinstance(path, DISPLAYS):
        return  # lines of text, for numpy.loadtxt
    if path is None:
        if not node.args and not node.keywords:
            writer.refuse(unnamed_file(f"{function}()"), node)
    elif origins.is_fixed(path):
        writer.refuse(unnamed_file(f"{function}({ast.unparse(path)})"), node)
    else:
        writer.names.facts.opens |= origins.parameters(path)


def _check_attribute_by_name(writer: Writer, node: ast.Call) -> None:
    """Refuse ``getattr(os, "environ")`` as the attribute is refused."""
    module, name = node.args[:2]
    target = writer.target(module)
    if isinstance(target, External) and isinstance(name, ast.Constant) and isinstance(name.value, str):
        dotted = f"{target.dotted}.{name.value}"
        error = world_refusal(dotted, is_called=False, is_raised=False, function=None)
        if error is None and names_a_file(dotted):
            error = unnamed_file(dotted)
        if error is not None:
            writer.refuse(error, node)


def _note_passed(writer: Writer, origins: Origins, node: ast.Call, function: Symbol) -> None:
    by_place: list[tuple[int | str, ast.expr]] = [*enumerate(node.args)]
    by_place += [(word.arg, word.value) for word in node.keywords if word.arg]
    for place, value in by_place:
        if isinstance(value, ast.Constant) and not isinstance(value.value, str):
            continue
        is_fixed, parameters = origins.is_fixed(value), origins.parameters(value)
        if is_fixed or parameters:
            passed = Passed(function, place, is_fixed, parameters, node.lineno)
            writer.names.facts.passes.append(passed)


def _arguments(node: ast.Call) -> list[ast.expr]:
    return [*node.args, *(word.value for word in node.keywords)]


def file_passed_on(modules: Modules, facts: Sequence[tuple[Symbol, Facts]]) -> tuple[Symbol, Passed] | None:
    """Return a call that gives a function, for a file that it or one it calls opens, a path made of no argument.

    Parameters
    ----------
    modules : Modules
        All first-party code.
    facts : sequence of (Symbol, Facts)
        What the statements in reach say.

    Returns
    -------
    (Symbol, Passed) or None
        Whose code the call stands in, and what it gives.
    """
    opened = {symbol: set(each.opens) for symbol, each in facts if each.opens}
    passes = [(symbol, passed) for symbol, each in facts for passed in each.passes]
    before = -1
    while before != sum(map(len, opened.values())):
        before = sum(map(len, opened.values()))
        for symbol, passed in passes:
            if passed.function in opened and _parameter(modules, passed) in opened[passed.function]:
                if passed.is_fixed:
                    return symbol, passed
                opened.setdefault(symbol, set()).update(passed.parameters)
    return None


def _parameter(modules: Modules, passed: Passed) -> str | None:
    """Return the name of the parameter that a call gives something for."""
    if isinstance(passed.place, str):
        return passed.place
    node: ast.AST = modules.module(passed.function.module).symbols[passed.function.name][-1].node
    skipped = 0
    if isinstance(node, ast.ClassDef):
        makers = (each for each in node.body if isinstance(each, ast.FunctionDef) and each.name == "__init__")
        node, skipped = next(makers, node), 1
    if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        return None
    arguments = [*node.args.posonlyargs, *node.args.args][skipped:]
    return arguments[passed.place].arg if passed.place < len(arguments) else None
