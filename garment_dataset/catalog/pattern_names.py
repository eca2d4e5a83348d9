"""Names by a pattern of one's own: read into parts, mended, and written with other parts."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

from garment_dataset.catalog.names import MAX_LENGTH, BackgroundName, RecordingName, parse_bag_name, plain_stem
from garment_dataset.catalog.suffixes import appended_to
from garment_dataset.errors import RecordingNameError, one_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from garment_dataset.catalog.patterns import Template

Axis = Literal["R", "B"]
BagName = RecordingName | BackgroundName

_COUNTS = ("repeat", "swing_divisor", "topics_file", "counter")
_SAFE = re.compile(r"[^\W_][\w .+-]*(?<![ .])")
"""Results and their folders are called as recordings are, and filters have signs of their own."""
_SPEED = re.compile(r"[0-9]+(?:[.p][0-9]+)?")


@dataclass(frozen=True, slots=True)
class PatternName(RecordingName):
    """What a file name says by a pattern of one's own; no convention is read into its ``name``.

    Parameters
    ----------
    texts : tuple of (str, str or None)
        Each group of the pattern, and its text.
    written : str
        The whole.
    scheme : PatternScheme
        By which it was read.
    """

    texts: tuple[tuple[str, str | None], ...] = field(kw_only=True)
    written: str = field(kw_only=True)
    scheme: PatternScheme = field(kw_only=True, repr=False)

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

    def changed(
        self,
        *,
        axis: Axis | None = None,
        swing_divisor: int | None = None,
        speed: str | None = None,
        garment: str | None = None,
        repeat: int | None = None,
    ) -> RecordingName:
        """Return this name with some of its parts changed, written as these are: see the same of the thesis' names."""
        word = next((word for word, meaning in self.scheme.axes if meaning == axis), None)
        mark = "p" if "p" in (self._text("speed") or "") else "."
        counted = "repeat" if self._text("repeat") else "counter"
        width = len(self._text(counted) or "")
        wanted = {
            "axis": word,
            "swing_divisor": None if swing_divisor is None else str(swing_divisor),
            "speed": None if speed is None else speed.replace(".", mark),
            "garment": garment,
            counted: None if repeat is None else f"{repeat:0{width}}",
        }
        texts = {group: wanted.get(group) or text if text else text for group, text in self.texts}
        name = self.scheme.parse(self.scheme.template.write(texts))
        assert isinstance(name, RecordingName)
        return name

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
        """Read a file name: see :class:`garment_dataset.catalog.schemes.Scheme`."""
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
        scheme=scheme,
    )
