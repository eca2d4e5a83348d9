"""Edits of source files: mutations, each of which changes what some line does, and edits that change nothing."""

from __future__ import annotations

import ast
import copy
import random
import re
from collections.abc import Iterator
from dataclasses import dataclass

OPERATORS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Add,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mod,
    ast.Mod: ast.FloorDiv,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.USub: ast.UAdd,
}


@dataclass(frozen=True)
class Mutation:
    """A file's source with one thing changed.

    Parameters
    ----------
    what : str
        Which kind of change, and where.
    source : str
        The whole file afterwards.
    """

    what: str
    source: str


@dataclass(frozen=True)
class Place:
    """A node that may be changed, by its position in a walk of the tree, and the lines of the statement around it."""

    number: int
    lines: frozenset[int]


def places(tree: ast.Module, excluded: frozenset[str]) -> list[Place]:
    """Return the nodes that may be changed; ``excluded`` names classes whose fields are no code."""
    numbers = {id(node): number for number, node in enumerate(ast.walk(tree))}
    found: list[Place] = []

    def visit(node: ast.AST, lines: frozenset[int], *, is_field: bool) -> None:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            return
        if isinstance(node, ast.stmt):
            is_compound = bool(getattr(node, "body", None))
            last = node.lineno if is_compound else (node.end_lineno or node.lineno)
            lines = frozenset(range(node.lineno, last + 1))
            is_field = is_field and isinstance(node, ast.AnnAssign)
        if not is_field and mutable(node):
            found.append(Place(numbers[id(node)], lines))
        in_fields = isinstance(node, ast.ClassDef) and node.name in excluded
        for name, value in ast.iter_fields(node):
            if name in {"annotation", "returns", "type_params"}:
                continue
            for child in value if isinstance(value, list) else [value]:
                is_docstring = isinstance(node, ast.Expr) and isinstance(child, ast.Constant)
                if isinstance(child, ast.AST) and not is_docstring:
                    visit(child, lines, is_field=is_field or (in_fields and name == "body"))

    visit(tree, frozenset(), is_field=False)
    return found


def mutable(node: ast.AST) -> bool:
    """Say whether :func:`mutate` can change a node."""
    match node:
        case ast.Constant(value=value):
            return isinstance(value, bool | int | float | str)
        case ast.Call(args=[first, second, *_]):
            return ast.dump(first) != ast.dump(second)
        case ast.Assign() | ast.AugAssign() | ast.Return(value=ast.expr()) | ast.If() | ast.While():
            return True
        case ast.Expr(value=value):
            return not isinstance(value, ast.Constant)
        case ast.BinOp(op=operator) | ast.BoolOp(op=operator) | ast.UnaryOp(op=operator) | ast.Compare(ops=[operator]):
            return type(operator) in OPERATORS  # the parser shares operators: only what holds one has a place
        case _:
            return False


def mutate(source: str, place: Place) -> Mutation:
    """Change one node of a file."""
    tree = ast.parse(source)
    every = list(ast.walk(tree))
    node = every[place.number]
    parents = {id(child): parent for parent in every for child in ast.iter_child_nodes(parent)}
    what = f"{type(node).__name__} on line {min(place.lines, default=0)}"
    match node:
        case ast.Constant(value=bool(value)):
            node.value = not value
        case ast.Constant(value=str(value)):
            node.value = f"{value}x"
        case ast.Constant(value=int(value) | float(value)):
            node.value = value + 1
        case ast.Call(args=[first, second, *rest]):
            node.args = [second, first, *rest]
        case ast.If() | ast.While():
            node.test = ast.UnaryOp(ast.Not(), node.test)
        case ast.Return():
            node.value = None
        case ast.stmt():
            _replace(parents[id(node)], node, ast.Pass())
        case ast.BinOp() | ast.BoolOp() | ast.UnaryOp():
            node.op = OPERATORS[type(node.op)]()  # type: ignore[assignment]
        case ast.Compare():
            node.ops = [OPERATORS[type(node.ops[0])]()]  # type: ignore[list-item]
    return Mutation(what, ast.unparse(ast.fix_missing_locations(tree)))


def _replace(parent: ast.AST, old: ast.AST, new: ast.AST) -> None:
    for name, value in ast.iter_fields(parent):
        if value is old:
            setattr(parent, name, new)
        elif isinstance(value, list):
            setattr(parent, name, [new if each is old else each for each in value])


# -- edits that change nothing


def harmless(source: str, dice: random.Random) -> Iterator[Mutation]:
    """Yield a file after each kind of edit that no program can see."""
    lines = source.split("\n")
    tree = ast.parse(source)
    starts = [node.lineno for node in tree.body]
    line = dice.choice(starts)
    first = min([line, *(each.lineno for node in tree.body for each in getattr(node, "decorator_list", []))]) - 1
    yield Mutation("a comment and blank lines", "\n".join([*lines[:first], "", "# a remark", "", *lines[first:]]))
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    if not functions:
        return
    function = dice.choice(functions)
    yield Mutation(f"the docstring of {function.name}", _with_docstring(tree, function))
    start, end = _span(function)
    indent = " " * function.col_offset
    text = "\n".join(indent + each for each in ast.unparse(function).split("\n"))
    if '"""' not in text and "'''" not in text and "\\n" not in text:
        yield Mutation(f"the layout of {function.name}", "\n".join([*lines[: start - 1], text, *lines[end:]]))
    for function in dice.sample(functions, len(functions)):
        if renamed := _renamed(source, function, dice):
            yield Mutation(f"a local variable of {function.name}", renamed)
            break


def _span(node: ast.FunctionDef) -> tuple[int, int]:
    return min([node.lineno, *(each.lineno for each in node.decorator_list)]), node.end_lineno or node.lineno


def _with_docstring(tree: ast.Module, function: ast.FunctionDef) -> str:
    number = [id(node) for node in ast.walk(tree)].index(id(function))
    copied = copy.deepcopy(tree)
    node = list(ast.walk(copied))[number]
    assert isinstance(node, ast.FunctionDef)
    has_one = ast.get_docstring(node) is not None
    node.body[: int(has_one)] = [ast.Expr(ast.Constant("Say something else."))]
    return ast.unparse(ast.fix_missing_locations(copied))


def _renamed(source: str, function: ast.FunctionDef, dice: random.Random) -> str | None:
    """Rename one local of a function without inner scopes, wherever it stands as a word of its own."""
    every = list(ast.walk(function))
    inner = (
        ast.Lambda,
        ast.ListComp,
        ast.SetComp,
        ast.DictComp,
        ast.GeneratorExp,
        ast.Global,
        ast.Nonlocal,
        ast.ClassDef,
    )
    if any(isinstance(node, inner) or (isinstance(node, ast.FunctionDef) and node is not function) for node in every):
        return None
    arguments = {node.arg for node in every if isinstance(node, ast.arg)}
    stored = {node.id for node in every if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)} - arguments
    elsewhere = {node.attr for node in every if isinstance(node, ast.Attribute)}
    elsewhere |= {node.arg for node in every if isinstance(node, ast.keyword) and node.arg}
    texts = " ".join(str(node.value) for node in every if isinstance(node, ast.Constant))
    names = sorted(name for name in stored - elsewhere if not re.search(rf"\b{name}\b", texts))
    if not names:
        return None
    name = dice.choice(names)
    start, end = _span(function)
    lines = source.split("\n")
    text = "\n".join(lines[start - 1 : end])
    return "\n".join([*lines[: start - 1], re.sub(rf"\b{name}\b", f"{name}_renamed", text), *lines[end:]])
