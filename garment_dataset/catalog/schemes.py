"""By which scheme bags are named: the thesis' grammar, or a pattern of one's own under ``[names]`` in garment.toml.

For both writing inverts reading: ``str()`` of a name that was read is the text, and reads back as the same parts. A
pattern that cannot promise that is refused (:mod:`garment_dataset.catalog.patterns`), and so is a name that does not
keep it.
"""

from __future__ import annotations

import re
import unicodedata
import warnings
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Literal, Protocol

from garment_dataset.catalog.names import (
    MAX_LENGTH,
    BackgroundName,
    RecordingName,
    parse_bag_name,
    plain_stem,
    repair_name,
)
from garment_dataset.catalog.patterns import Template, template_of
from garment_dataset.catalog.suffixes import appended_to
from garment_dataset.errors import RecordingNameError, WorkspaceError, did_you_mean, one_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from garment_dataset.layout import Layout, NamesSettings

Axis = Literal["R", "B"]
BagName = RecordingName | BackgroundName

_WORD = re.compile(r"[A-Za-z][A-Za-z0-9-]*")
_GROUPS = ("name", "garment", "holding", "repeat", "swing_divisor", "speed", "axis", "topics_file", "counter")
_COUNTS = ("repeat", "swing_divisor", "topics_file", "counter")
_SAFE = re.compile(r"[^\W_][\w .+-]*(?<![ .])")
"""Results and their folders are called as recordings are, and filters have signs of their own."""
_SPEED = re.compile(r"[0-9]+(?:[.p][0-9]+)?")


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


@dataclass(frozen=True, slots=True)
class PatternName(RecordingName):
    """What a file name says by a pattern of one's own; no convention is read into its ``name``.

    Parameters
    ----------
    texts : tuple of (str, str or None)
        Each group of the pattern, and its text.
    written : str
        The whole.
    """

    texts: tuple[tuple[str, str | None], ...] = ()
    written: str = ""

    def __post_init__(self) -> None:
        pass  # the scheme has looked at it

    def __str__(self) -> str:
        return self.written

    @property
    def garment(self) -> str | None:
        """Text of the group ``garment``."""
        return self._text("garment")

    @property
    def holding(self) -> str | None:
        """Text of the group ``holding``."""
        return self._text("holding")

    @property
    def repeat(self) -> int | None:
        """Number of the group ``repeat``, else of ``counter``."""
        digits = self._text("repeat") or self.counter
        return None if digits is None else int(digits)

    @property
    def swing_divisor(self) -> int | None:
        """Number of the group ``swing_divisor``."""
        digits = self._text("swing_divisor")
        return None if digits is None else int(digits)

    def _text(self, group: str) -> str | None:
        return dict(self.texts).get(group) or None


@dataclass(frozen=True)
class PatternScheme:
    """Names by a pattern of one's own, beside those of empty scenes.

    Parameters
    ----------
    pattern : re.Pattern
        With a named group for each part.
    template : Template
        How names are written.
    axes : tuple of (str, {"R", "B"})
        What the words of the group ``axis`` mean; the word "" is that of all names of a pattern without the group.
    speed : str or None
        Speed of all names of a pattern without the group.
    """

    pattern: re.Pattern[str]
    template: Template
    axes: tuple[tuple[str, Axis], ...]
    speed: str | None

    def parse(self, text: str) -> BagName:
        """Read a file name: see :class:`Scheme`."""
        stem = unicodedata.normalize("NFC", text).removesuffix(".bag")
        found = _read(self, stem)
        if not isinstance(found, str):
            return found
        nearest = self.repair(text)
        hint = None if nearest is None else f"Did you mean {nearest}.bag?"
        raise RecordingNameError(found, expected=f"one by {self.pattern.pattern}", found=repr(text), hint=hint)

    def repair(self, text: str) -> str | None:
        """Mend a path in front, suffixes behind, and the case of letters where the pattern wants another."""
        stem = plain_stem(unicodedata.normalize("NFC", text))
        appended = appended_to(stem)
        stems = (stem,) if appended is None or appended.part else (stem, appended.given)
        mended = (candidate for each in stems for candidate in self._mended(each))
        return next((candidate for candidate in mended if not isinstance(_read(self, candidate), str)), None)

    def is_word(self, text: str) -> bool:
        """Say whether results can be called so."""
        return _SAFE.fullmatch(text) is not None

    def _mended(self, stem: str) -> Iterator[str]:
        """Yield a name as it is, and with the case of fixed text, of the axis, and of all of its parts mended."""
        yield stem
        found = re.fullmatch(self.pattern.pattern, stem, re.IGNORECASE)
        if found is None:
            return
        for change in (str, str.lower, str.upper):
            texts = {group: text and change(text) for group, text in found.groupdict().items()}
            if (axis := texts.get("axis")) is not None:
                texts["axis"] = next((word for word, _ in self.axes if word.casefold() == axis.casefold()), axis)
            yield self.template.write(texts)


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


@lru_cache(maxsize=2**14)  # tables, folder and results ask for the same names
def _read(scheme: PatternScheme, stem: str) -> BagName | str:
    """Return what a name says, or why it is none."""
    if stem.startswith("camera_default_"):
        try:
            if isinstance(background := parse_bag_name(stem), BackgroundName):
                return background
        except RecordingNameError:
            pass  # then it is one of the pattern's, or none
    if (found := scheme.pattern.fullmatch(stem)) is None:
        appended = appended_to(stem)
        return "not a recording name by the pattern in garment.toml" if appended is None else appended.text
    texts = found.groupdict()
    if (wrong := _wrong_whole(stem) or _wrong_part(scheme, texts)) is not None:
        return wrong
    again = scheme.pattern.fullmatch(scheme.template.write(texts))
    if again is None or again[0] != stem or again.groupdict() != texts:
        return "a recording name that could not be written from its parts"
    return _name(scheme, texts, stem)


def _wrong_whole(stem: str) -> str | None:
    """Return why results could not be called so."""
    if len(stem.encode(errors="replace")) > MAX_LENGTH:
        return f"a recording name of more than {MAX_LENGTH} bytes: its results would be called as it is"
    if plain_stem(stem) != stem or not _SAFE.fullmatch(stem):
        return "a recording name that results cannot have (a letter or digit, then also _ . + - and spaces)"
    return None


def _wrong_part(scheme: PatternScheme, texts: Mapping[str, str | None]) -> str | None:
    """Return which part of a name says nothing that can be used."""
    if "speed" in texts and _SPEED.fullmatch(texts["speed"] or "") is None:
        return f"a recording name whose speed is no number, but {texts['speed']!r}"
    if "axis" in texts and texts["axis"] not in dict(scheme.axes):
        return f"a recording name whose axis is {texts['axis']!r}, not {one_of(word for word, _ in scheme.axes)}"
    for part in _COUNTS:
        text = texts.get(part)
        if text is not None and (re.fullmatch("[0-9]{1,9}", text) is None or (part == "topics_file" and not int(text))):
            return f"a recording name whose {part} is no count, but {text!r}"
    if not (texts.get("name") or texts.get("garment")):
        return "a recording name that does not say what is recorded"
    return None


def _name(scheme: PatternScheme, texts: Mapping[str, str | None], stem: str) -> PatternName:
    speed = scheme.speed if scheme.speed is not None else (texts["speed"] or "").replace("p", ".")
    whole = texts.get("name") or "_".join(filter(None, (texts.get("garment"), texts.get("holding"))))
    return PatternName(
        name=whole,
        speed=speed,
        axis=dict(scheme.axes)[texts.get("axis") or ""],
        topics_file=int(texts.get("topics_file") or 1),
        counter=texts.get("counter"),
        texts=tuple(texts.items()),
        written=stem,
    )
