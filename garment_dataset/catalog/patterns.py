"""Patterns of names, taken apart so that a name can be written from its parts, and not only read.

Outside its groups a pattern says fixed text alone; then writing what was read gives the very text, whatever it was.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

_GROUP = re.compile(r"\(\?P<(?P<name>[^>]*)>")
_LETTERS = re.compile(r"\[\^?(?:\\.|[^\\])(?:\\.|[^\]\\])*\]", re.DOTALL)
"""One of some letters, ``[a-z]``; a ``]`` that comes first is one of them."""
_SPECIAL = ".^$*+?{}[]|()"


@dataclass(frozen=True, slots=True)
class _Group:
    """A named group: its text stands here."""

    name: str


@dataclass(frozen=True, slots=True)
class _Optional:
    """What stands here when its groups have text."""

    pieces: tuple[_Piece, ...]


_Piece = str | _Group | _Optional


@dataclass(frozen=True, slots=True)
class Template:
    """How a name is written from the texts of its groups."""

    pieces: tuple[_Piece, ...]

    def write(self, texts: Mapping[str, str | None]) -> str:
        """Write a name; parts of it that may be missing are there when their groups have a text."""
        return "".join(_written(piece, texts) for piece in self.pieces)


def template_of(pattern: str) -> Template:
    """Take a pattern apart that :mod:`re` takes.

    Raises
    ------
    ValueError
        If names could not be written by it: the reason, and what to do.
    """
    pieces, end = _pieces(pattern, 0)
    if end < len(pattern):
        raise ValueError(f"a ) that closes nothing, at letter {end + 1}", "Write \\) for the letter itself.")
    return Template(pieces)


def _written(piece: _Piece, texts: Mapping[str, str | None]) -> str:
    if isinstance(piece, str):
        return piece
    if isinstance(piece, _Group):
        return texts.get(piece.name) or ""
    has_text = any(texts.get(each.name) is not None for each in piece.pieces if isinstance(each, _Group))
    return "".join(_written(each, texts) for each in piece.pieces) if has_text else ""


def _pieces(pattern: str, start: int) -> tuple[tuple[_Piece, ...], int]:
    """Return the pieces from a place on, and where they end: at a closing bracket or at the end of all."""
    found: list[_Piece] = []
    place = start
    while place < len(pattern) and pattern[place] != ")":
        if (group := _GROUP.match(pattern, place)) is not None:
            end = _end_of(pattern, group.end())
            piece, place = _counted(pattern, end + 1, _Group(group["name"]))
            found.append(piece)
        elif pattern.startswith("(?:", place):
            inner, end = _pieces(pattern, place + 3)
            if pattern[end + 1 : end + 2] != "?" or not any(isinstance(each, _Group) for each in inner):
                hint = "Write (?:...)? around fixed text and at least one group."
                raise ValueError(f"brackets that are no part with a group, at letter {place + 1}", hint)
            piece, place = _counted(pattern, end + 1, _Optional(inner))
            found.append(piece)
        else:
            letter, place = _letter(pattern, place)
            found.append(letter)
    return tuple(found), place


def _counted(pattern: str, place: int, piece: _Group | _Optional) -> tuple[_Piece, int]:
    """Return a piece with what is said behind it of how often it comes, and the place behind that."""
    after = pattern[place : place + 1]
    if after == "?" and pattern[place + 1 : place + 2] not in ("?", "+"):
        return (piece if isinstance(piece, _Optional) else _Optional((piece,))), place + 1
    if after and after in "?*+{":
        hint = "Put the repetition into the group, or write ? alone."
        raise ValueError(f"a group that is repeated, at letter {place + 1}", hint)
    return piece, place


def _letter(pattern: str, place: int) -> tuple[str, int]:
    """Return one letter of fixed text, and the place behind it."""
    letter, end = pattern[place], place + 1
    if letter == "\\":
        letter, end = pattern[place + 1], place + 2
        if letter.isalnum():
            hint = "Put it into a named group: what stands in none is not remembered."
            raise ValueError(f"\\{letter} outside the groups, at letter {place + 1}", hint)
    elif letter in _SPECIAL:
        hint = f"Put it into a named group, or write \\{letter} for the letter itself."
        raise ValueError(f"{letter!r} outside the groups, at letter {place + 1}", hint)
    if pattern[end : end + 1] and pattern[end] in "?*+{":
        raise ValueError(f"{pattern[end]!r} outside the groups, at letter {end + 1}", "Put it into a named group.")
    return letter, end


def _end_of(pattern: str, place: int) -> int:
    """Return where the group ends whose inside begins at a place: a pattern that was compiled has an end."""
    depth = 0
    while pattern[place] != ")" or depth:
        if pattern[place] == "\\":
            place += 1
        elif (letters := _LETTERS.match(pattern, place)) is not None:
            place = letters.end() - 1
        depth += {"(": 1, ")": -1}.get(pattern[place], 0)
        place += 1
    return place
