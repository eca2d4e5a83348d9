"""By which scheme bags are named: the thesis' grammar, or a pattern of one's own under ``[names]`` in garment.toml.

For both writing inverts reading: ``str()`` of a name that was read is the text, and reads back as the same parts. A
pattern that cannot promise that is refused (:mod:`garment_dataset.catalog.patterns`), and so is a name that does not
keep it.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from garment_dataset.catalog.names import parse_bag_name, repair_name
from garment_dataset.catalog.pattern_names import Axis, BagName, PatternName, PatternScheme
from garment_dataset.catalog.patterns import template_of
from garment_dataset.errors import WorkspaceError, did_you_mean, one_of

if TYPE_CHECKING:
    from garment_dataset.layout import Layout, NamesSettings

__all__ = ["THESIS", "BagName", "PatternName", "PatternScheme", "Scheme", "compile_scheme", "scheme_of"]

_WORD = re.compile(r"[A-Za-z][A-Za-z0-9-]*")
_GROUPS = ("name", "garment", "holding", "repeat", "swing_divisor", "speed", "axis", "topics_file", "counter")


class Scheme(Protocol):
    """How the names of bags are read, and mended."""

    def parse(self, text: str) -> BagName:
        """Read a file name, with or without ``.bag``; ``str()`` of the result is the written form.

        Raises
        ------
        RecordingNameError
            If it is none of this scheme's; the hint gives the nearest that is.
        """

    def repair(self, text: str) -> str | None:
        """Return the nearest name, without ``.bag``, or None when nothing less than a guess would make one."""

    def is_word(self, text: str) -> bool:
        """Say whether a garment or a holding can be called so."""


@dataclass(frozen=True)
class _ThesisScheme:
    """The grammar of :mod:`garment_dataset.catalog.names`."""

    def parse(self, text: str) -> BagName:
        return parse_bag_name(text)

    def repair(self, text: str) -> str | None:
        return repair_name(text)

    def is_word(self, text: str) -> bool:
        return _WORD.fullmatch(text) is not None


THESIS: Scheme = _ThesisScheme()


def scheme_of(layout: Layout) -> Scheme:
    """Return the scheme of a workspace: the thesis', unless garment.toml says another.

    Raises
    ------
    WorkspaceError
        If that is not one by which names can be read and written.
    """
    if layout.names is None:
        return THESIS
    try:
        return compile_scheme(layout.names)
    except ValueError as error:
        setting, reason, hint = error.args
        where = layout.root / "garment.toml"
        raise WorkspaceError(f"setting 'names.{setting}'", where=where, found=reason, hint=hint) from None


def compile_scheme(settings: NamesSettings) -> PatternScheme:
    """Return the scheme of a pattern.

    Raises
    ------
    ValueError
        If it is none: which setting, the reason, and what to do.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", FutureWarning)  # sets in sets will mean something else one day
            pattern = re.compile(settings.pattern)
    except (re.error, FutureWarning, RecursionError, OverflowError) as error:
        raise ValueError("pattern", f"no regular expression: {error}", None) from error
    try:
        template = template_of(settings.pattern)
    except ValueError as error:
        raise ValueError("pattern", *error.args) from None
    groups = list(pattern.groupindex)
    for group in groups:
        if group not in _GROUPS:
            raise ValueError(
                "pattern", f"a group {group!r}", did_you_mean(group, _GROUPS) or f"Groups: {one_of(_GROUPS)}."
            )
    if "name" not in groups and "garment" not in groups:
        raise ValueError("pattern", "no group that says what is recorded", "Add (?P<name>...) or (?P<garment>...).")
    return PatternScheme(pattern, template, _axes(settings, groups), _speed(settings, groups))


def _axes(settings: NamesSettings, groups: list[str]) -> tuple[tuple[str, Axis], ...]:
    given = settings.axis
    if "axis" not in groups:
        if isinstance(given, str):
            return (("", given),)
        hint = 'Add (?P<axis>...), or say which all have: axis = "R" (along the optical axis) or "B" (across it).'
        raise ValueError("axis", "names that say no axis", hint)
    words: dict[str, Axis] = {"R": "R", "B": "B"}
    if isinstance(given, str):
        raise ValueError(  # noqa: TRY004 - a setting that contradicts another
            "axis", f"{given!r}, and the pattern has a group for it", "Remove one of the two."
        )
    words = words if given is None else given
    if len(set(words.values())) < len(words):
        raise ValueError("axis", "two words for one axis: names could not be written", "Name them alike.")
    return tuple(words.items())


def _speed(settings: NamesSettings, groups: list[str]) -> str | None:
    if ("speed" in groups) == (settings.speed is not None):
        if settings.speed is None:
            raise ValueError("speed", "names that say no speed", "Add (?P<speed>...), or say it: speed = 0.5.")
        raise ValueError("speed", f"{settings.speed:g}, and the pattern has a group for it", "Remove one of the two.")
    return None if settings.speed is None else f"{settings.speed:g}"
