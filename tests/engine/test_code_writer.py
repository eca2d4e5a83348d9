"""Laws of the canonical form: what may be renamed and moved, and that no constant escapes it."""

from __future__ import annotations

import ast
import keyword
import types
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import garment_dataset
from garment_dataset.engine.codebase.fingerprint import fingerprint
from garment_dataset.engine.codebase.scopes import Home, function_bindings
from garment_dataset.engine.codebase.writer import constant

if TYPE_CHECKING:
    from collections.abc import Iterator

PACKAGE = Path(garment_dataset.__file__).parent

# every way to bind a local: {0} to {16}
SAMPLE = """
import contextlib
import numpy as np

LIMIT = 7

def helper(value, *, scale=2.5):
    {0} = value * scale
    {0} += LIMIT
    return {0}

def f(items, first, *rest, last=None, **more):
    {1}, (*{2}, {3}) = first, rest
    import math as {4}
    for {5}, {6} in enumerate(items):
        if ({7} := helper({6})) > LIMIT:
            continue
        with contextlib.suppress(ValueError) as {8}, contextlib.closing(last) as {9}:
            {1} += {9}.read(), {8}, {5}
        try:
            {10}: int = {4}.floor({7})
        except (TypeError, OSError) as {11}:
            raise RuntimeError(f"no {{{11}!r:>10}}") from {11}
        else:
            del {10}
    def inner(item):
        nonlocal {3}
        {3} = [{12} + item for {12} in {2} for {13} in {12} if {13}]
        return lambda other: (other, {3}, {1})
    match items:
        case [{14}, *{16}] | {{"a": {14}, **{16}}}:
            return inner({14}), np.sum({1}), {16}
        case {15}:
            return {{{6}: {15} for {6} in {2}}}, {3}, more
"""
FREE = {"np", "contextlib", "items", "first", "rest", "last", "more", "value", "scale", "item", "other", "f", "helper"}
TAKEN = FREE | {"inner", "LIMIT", "enumerate", "ValueError", "TypeError", "OSError", "RuntimeError", "int", "_"}

names = st.from_regex(r"[a-z_][a-z0-9_]{0,8}", fullmatch=True).filter(
    lambda name: name not in TAKEN and not keyword.iskeyword(name) and not name.startswith("__")
)
renamings = st.lists(names, min_size=17, max_size=17, unique=True)
PLAIN = [f"local_{index}" for index in range(17)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sample") / "pkg"
    folder.mkdir()
    return folder


def digest_of(folder: Path, source: str) -> str:
    (folder / "__init__.py").write_bytes(source.encode())
    return fingerprint("pkg:f", roots={"pkg": folder}).digest


@settings(max_examples=60, deadline=None)
@given(renamings)
def test_renaming_locals_keeps_the_fingerprint(folder: Path, renamed: list[str]) -> None:
    assert digest_of(folder, SAMPLE.format(*renamed)) == digest_of(folder, SAMPLE.format(*PLAIN))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 16), st.integers(0, 16))
def test_giving_two_locals_one_name_changes_it(folder: Path, one: int, other: int) -> None:
    # in scopes of their own, or one only after the other, they may share a name
    function = {index for index in range(17) if index not in {0, 12, 13}}
    assume(one != other and {one, other} <= function)
    merged = list(PLAIN)
    merged[one] = merged[other]
    source = SAMPLE.format(*merged)
    assume(_compiles(source))
    assert digest_of(folder, source) != digest_of(folder, SAMPLE.format(*PLAIN))


def _compiles(source: str) -> bool:
    try:
        compile(source, "sample", "exec")
    except SyntaxError:
        return False
    return True


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_comments_blank_lines_and_docstrings_keep_it(folder: Path, data: st.DataObject) -> None:
    lines = SAMPLE.format(*PLAIN).split("\n")
    texts = st.text(st.characters(blacklist_categories=["Cs", "Cc"]), max_size=10)
    for _ in range(data.draw(st.integers(1, 8))):
        place = data.draw(st.integers(1, len(lines) - 1))
        above = lines[place - 1]
        indent = " " * (len(above) - len(above.lstrip()) + 4)
        kind = data.draw(st.sampled_from(["comment", "blank", "docstring", "trailing"]))
        if kind == "comment":
            lines.insert(place, f"{data.draw(st.sampled_from(['', indent]))}# {data.draw(texts)}")
        elif kind == "blank":
            lines.insert(place, data.draw(st.sampled_from(["", "   ", "\t", "\x0c"])))
        elif kind == "trailing":
            lines[place - 1] += f"  # {data.draw(texts)}"
        elif above.startswith(("def ", "    def ")) and above.endswith(":"):
            lines.insert(place, f"{indent}{data.draw(texts)!r}")
    end = data.draw(st.sampled_from(["\n", "\r\n"]))
    assert digest_of(folder, end.join(lines)) == digest_of(folder, SAMPLE.format(*PLAIN))


constants = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(allow_nan=False),
    st.complex_numbers(allow_nan=False),
    st.text(),
    st.binary(),
    st.just(...),
)


@given(constants, constants)
def test_constants_have_one_form_exactly_when_they_are_the_same(one: object, other: object) -> None:
    same = type(one) is type(other) and repr(one) == repr(other)
    assert (constant(one) == constant(other)) is same
    assert constant(one).isascii()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10), st.integers() | st.text(max_size=5) | st.floats(allow_nan=False, allow_infinity=False))
def test_changing_one_constant_changes_it(folder: Path, index: int, value: object) -> None:
    tree = ast.parse(SAMPLE.format(*PLAIN))
    nodes = [node for node in ast.walk(tree) if isinstance(node, ast.Constant) and not _is_in_string(tree, node)]
    node = nodes[index % len(nodes)]
    assume(constant(node.value) != constant(value))
    node.value = value  # type: ignore[assignment]
    source = ast.unparse(tree)
    assume(_compiles(source) and ast.dump(ast.parse(source)) != ast.dump(ast.parse(SAMPLE.format(*PLAIN))))
    assert digest_of(folder, source) != digest_of(folder, SAMPLE.format(*PLAIN))


def _is_in_string(tree: ast.Module, constant: ast.Constant) -> bool:
    return any(constant in ast.walk(node) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr))


def test_scopes_are_those_of_the_compiler() -> None:
    compared = 0
    for path in sorted(PACKAGE.rglob("*.py")):
        source = path.read_text("utf-8")
        lines = tuple(number for number, line in enumerate(source.split("\n"), 1) if ":=" in line)
        home = Home("a.b.c.d", is_package=False, where=str(path), walrus_lines=lines)
        compiled = {(each.co_name, each.co_firstlineno): each for each in _code_objects(compile(source, path, "exec"))}
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.FunctionDef):
                first_line = min([node.lineno, *(each.lineno for each in node.decorator_list)])
                code = compiled[node.name, first_line]
                bindings = function_bindings(node.args, node.body, home)
                ours = bindings.kinds.keys() - bindings.globals - bindings.outer
                # before Python 3.12 a comprehension is code of its own, since then part of the function around it
                inlined = {each.id for each in ast.walk(node) if isinstance(each, ast.Name)} - ours
                theirs = {*code.co_varnames, *code.co_cellvars} - {"__class__"} - inlined
                assert ours == theirs, f"{path.name}:{node.lineno}"
                compared += 1
    assert compared > 100


def _code_objects(code: types.CodeType) -> Iterator[types.CodeType]:
    for each in code.co_consts:
        if isinstance(each, types.CodeType):
            yield each
            yield from _code_objects(each)
