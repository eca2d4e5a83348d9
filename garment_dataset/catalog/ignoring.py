"""What a ``.garmentignore`` in the folder of bags leaves out: a small part of the patterns of ``.gitignore``.

One pattern a line; empty lines and lines that begin with ``#`` say nothing. ``*`` stands for any letters but ``/``,
``?`` for one, ``[a-c]`` for one of some and ``[!a-c]`` for one of no such; ``**`` between slashes for any folders. A
pattern without a slash, or with one at its end alone, is looked for at any depth; any other begins at the folder of
bags. With a slash at its end it is for folders. ``!`` in front takes back what a pattern above has left out. The last
pattern that fits decides; in a folder that is left out nothing is looked at.
"""

from __future__ import annotations

import os
import re
import unicodedata
from dataclasses import dataclass
from typing import TYPE_CHECKING

from garment_dataset.errors import CatalogError
from garment_dataset.files import hint_of, read_text

if TYPE_CHECKING:
    from pathlib import Path

IGNORE_FILE = ".garmentignore"
"""Name of the file; only the one at the top of the folder of bags is read."""


@dataclass(frozen=True, slots=True)
class _Rule:
    path: re.Pattern[str]
    folders_only: bool
    takes_back: bool


@dataclass(frozen=True, slots=True)
class Ignoring:
    """The patterns of one file, in their order; without any, nothing is left out."""

    rules: tuple[_Rule, ...] = ()

    def leaves_out(self, path: str, *, is_folder: bool) -> bool:
        """Say whether something is left out.

        Parameters
        ----------
        path : str
            Relative to the folder of bags, with ``/`` between its parts.
        is_folder : bool
            Whether it is one.
        """
        path = unicodedata.normalize("NFC", path)
        for rule in reversed(self.rules):
            if (is_folder or not rule.folders_only) and rule.path.fullmatch(path):
                return not rule.takes_back
        return False


def read_ignoring(folder: Path) -> Ignoring:
    """Read the file in a folder of bags, if there is one.

    Raises
    ------
    CatalogError
        If it cannot be read, or a pattern is none of the documented kinds.
    """
    path = folder / IGNORE_FILE
    if not os.path.lexists(path):
        return Ignoring()
    try:
        lines = unicodedata.normalize("NFC", read_text(path, max_bytes=1_000_000)).split("\n")
    except (OSError, ValueError) as error:
        found, hint = error, hint_of(error)
        raise CatalogError("cannot be read", where=path, expected="patterns", found=found, hint=hint) from error
    rules = []
    for number, line in enumerate(lines, 1):
        text = line.strip()
        if text and not text.startswith("#"):
            try:
                rules.append(compile_pattern(text))
            except ValueError as error:
                what, hint = error.args
                raise CatalogError(what, where=f"{path}, line {number}", found=repr(text), hint=hint) from None
    return Ignoring(tuple(rules))


def compile_pattern(text: str) -> _Rule:
    """Read one pattern.

    Raises
    ------
    ValueError
        If it is none of the documented kinds: what is wrong, and what to do.
    """
    body = text.removeprefix("!").strip()
    folders_only = body.endswith("/")
    parts = body.removesuffix("/").split("/")
    anchored = len(parts) > 1
    if parts[0] == "" and anchored:
        parts = parts[1:]
    if any(part in ("", ".", "..") for part in parts):
        raise ValueError("a pattern that nothing can fit", "Paths begin at the folder of bags, without ./ and ../.")
    if "\\" in body:
        raise ValueError("a backslash in a pattern", "Between folders stands /; a letter itself is written [*].")
    expression = "" if anchored else "(?:.*/)?"
    for place, part in enumerate(parts):
        is_last = place == len(parts) - 1
        if part == "**":
            expression += ".+" if is_last else "(?:.*/)?"
        else:
            expression += _translated(part) + ("" if is_last else "/")
    return _Rule(re.compile(expression, re.DOTALL), folders_only, text.startswith("!"))


def _translated(part: str) -> str:
    """Return the regular expression of the part of a pattern between two slashes."""
    if "**" in part:
        raise ValueError("** beside other letters", "Write ** between slashes, or * for letters of one name.")
    expression, rest = "", part
    while rest:
        if rest[0] == "[":
            found = re.match(r"\[(!?)(\]?[^\]]*)\]", rest)
            if found is None or not found[2]:
                raise ValueError("a [ that is not closed", "Write [[] for the letter itself.")
            expression += _letters(found[1] == "!", found[2])
            rest = rest[found.end() :]
        else:
            expression += {"*": "[^/]*", "?": "[^/]"}.get(rest[0], re.escape(rest[0]))
            rest = rest[1:]
    return expression


def _letters(negated: bool, letters: str) -> str:
    """Return the regular expression of one of some letters, or of one of no such."""
    escaped = re.sub(r"([\[\]^&|~])", r"\\\1", letters)
    try:
        re.compile(expression := f"(?:(?!/)[{'^' if negated else ''}{escaped}])")
    except re.error:
        raise ValueError("a range of letters backwards", "Write [a-c], from the first to the last.") from None
    return expression
