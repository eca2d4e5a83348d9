"""The statements of a module: which names each binds, which values it changes, and whether it acts beyond those."""

from __future__ import annotations

import ast
import functools
import re
import unicodedata
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from garment_dataset.engine.codebase.effects import (
    is_borrowed,
    is_made_for_its_effect,
    may_set,
    names_read_in,
    outcomes,
    sets_something,
)
from garment_dataset.engine.codebase.scopes import IMPORT, Bindings, bindings_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from garment_dataset.engine.codebase.scopes import Home

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
    def sets_later(self) -> bool:
        """Whether it defines what may set something in a library when it is called."""
        is_definition = isinstance(self.node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        return is_definition and may_set(self.source)

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
    own -= {name for node, _, names in found if is_borrowed(node) for name in names.kinds}
    names_read = functools.cache(lambda: names_read_in(tree))
    statements = []
    for index, (node, for_checkers, names) in enumerate(found):
        acts_on = set(outcomes(node, own))
        changes = frozenset(name for name in acts_on if name is not None)
        first = min([node.lineno, *(each.lineno for each in getattr(node, "decorator_list", ()))])
        text = "\n".join(lines[first - 1 : node.end_lineno])
        has_effect = None in acts_on or is_made_for_its_effect(node, names, names_read) or sets_something(node, text)
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
