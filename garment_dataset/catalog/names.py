r"""The grammar of file names, and its inverse.

A recording is called ``name_speed_AX`` (thesis table 4.2): a name that the operator chose, the speed as typed, the axis
R or B and the number of the topics file. Older files have the recorder's counter of four digits after the speed
(``towel16_0.1_0006_R2``). Empty scenes are called ``camera_default_<position>``.

::

    recording  = name "_" speed [ "_" counter ] "_" axis topics
    name       = token { "_" token }            the first token begins with a letter
    token      = letter or digit, then letters, digits and "-"
    speed      = "0" or 1..99 without leading zero, optionally "." and digits
    counter    = four digits
    axis       = "R" | "B"
    topics     = 1..99
    background = "camera_default_" position

A speed never has four digits, so nothing is ambiguous. Table B.3 prints a point for the underscore before the speed
(``pi16.0.5_B1``): that form is read, and never written.

Within ``name`` the data set's files follow ``<Garment>_<Holding>[_<NN>][_pi<D>]``, where NN counts repeats and ``pi16``
is a swing of pi/16. A name that does not is still a whole, valid name: its garment and holding are unknown; a last
token ``pi<D>`` is read as the swing all the same.
"""

from __future__ import annotations

import math
import re
import unicodedata
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from garment_dataset.catalog.suffixes import appended_to
from garment_dataset.errors import RecordingNameError

_PART = r"[A-Za-z0-9][A-Za-z0-9-]*"
_WORD = r"[A-Za-z][A-Za-z0-9-]*"
_TAIL = r"(?P<speed>(?:0|[1-9][0-9]?)(?:\.[0-9]+)?)(?:_(?P<counter>[0-9]{4}))?_(?P<axis>[RB])(?P<topics>[1-9][0-9]?)"
_RECORDING = re.compile(rf"(?P<name>{_WORD}(?:_{_PART})*)_{_TAIL}")
_BACKGROUND = re.compile(r"camera_default_(?P<position>0|[1-9][0-9]*)")
_DOTTED = re.compile(r"(?P<head>.*_pi[0-9]+)\.(?P<tail>[0-9]+\.[0-9].*)")
_CONVENTION = re.compile(
    rf"""(?P<garment>{_WORD})
         _(?!pi[0-9]+(?:_|$))(?P<holding>{_WORD})
         (?:_(?P<repeat>[0-9]{{2}}))?
         (?:_pi[1-9][0-9]{{0,2}})?""",
    re.VERBOSE,
)
_SWING = re.compile(r"(?:.*_)?pi(?P<divisor>[1-9][0-9]{0,2})")

_MAX_FILE_NAME = 255
MAX_LENGTH = _MAX_FILE_NAME - len(".parquet")
"""Results are called as their recording is, and no file system takes a longer name."""

_FORM = "<name>_<speed>[_<counter>]_<R|B><topics file>.bag"
_EXAMPLE = "GreenTowel_Corner_01_pi16_0.5_R1.bag"


@dataclass(frozen=True, slots=True)
class RecordingName:
    """What one file name says, and nothing that the bag itself says.

    Parameters
    ----------
    name : str
        The operator's part, ``GreenTowel_Corner_01_pi16``.
    speed : str
        As typed: ``0.5`` and ``0.50`` are different names of equal speeds.
    axis : {"R", "B"}
        R: the garment moves along the optical axis; B: across it.
    topics_file : int
        Number of the topics file, 1 to 99.
    counter : str, optional
        The recorder's counter, four digits.

    Raises
    ------
    RecordingNameError
        If the parts do not make a name that reads back as these very parts.
    """

    name: str
    speed: str
    axis: Literal["R", "B"]
    topics_file: int
    counter: str | None = None

    def __post_init__(self) -> None:
        found = _RECORDING.fullmatch(text := str(self))
        parts = (self.name, self.speed, self.counter, self.axis, self.topics_file)
        if found is None or _parts(found) != parts or len(text) > MAX_LENGTH:
            raise _refusal(text)

    def __str__(self) -> str:
        counter = "" if self.counter is None else f"_{self.counter}"
        return f"{self.name}_{self.speed}{counter}_{self.axis}{self.topics_file}"

    @property
    def garment(self) -> str | None:
        """Name of the garment; None when ``name`` follows no convention."""
        return self._convention("garment")

    @property
    def holding(self) -> str | None:
        """How the garment is held; None when ``name`` follows no convention."""
        return self._convention("holding")

    @property
    def repeat(self) -> int | None:
        """Number of the repeat: NN of the name, else the recorder's counter."""
        digits = self._convention("repeat") or self.counter
        return None if digits is None else int(digits)

    @property
    def swing_divisor(self) -> int | None:
        """16 for a swing of pi/16; None when the last token of ``name`` is no swing."""
        found = _SWING.fullmatch(self.name)
        return None if found is None else int(found["divisor"])

    @property
    def swing_rad(self) -> float | None:
        """Swing of the gripper's axis, in radians."""
        divisor = self.swing_divisor
        return None if divisor is None else math.pi / divisor

    def changed(
        self,
        *,
        axis: Literal["R", "B"] | None = None,
        swing_divisor: int | None = None,
        speed: str | None = None,
        garment: str | None = None,
        repeat: int | None = None,
    ) -> RecordingName:
        """Return this name with some of its parts changed; those that it does not have stay away.

        Raises
        ------
        RecordingNameError
            If that would be no name.
        """
        text = self.name
        if garment is not None and self.garment is not None:
            text = garment + text[len(self.garment) :]
        if repeat is not None and self.counter is None:
            text = re.sub(r"_[0-9]{2}(?=_|$)", f"_{repeat:02}", text, count=1)
        if swing_divisor is not None:
            text = re.sub(r"pi[0-9]+$", f"pi{swing_divisor}", text)
        counter = f"{repeat:04}" if repeat is not None and self.counter is not None else self.counter
        return RecordingName(text, speed or self.speed, axis or self.axis, self.topics_file, counter)

    def _convention(self, part: str) -> str | None:
        found = _CONVENTION.fullmatch(self.name)
        return None if found is None else found[part]


@dataclass(frozen=True, slots=True)
class BackgroundName:
    """The name of a bag of the empty scene.

    Parameters
    ----------
    position : int
        Position of the camera, from 0.

    Raises
    ------
    RecordingNameError
        If the position is no such number.
    """

    position: int

    def __post_init__(self) -> None:
        found = _BACKGROUND.fullmatch(text := str(self))
        if found is None or int(found["position"]) != self.position or len(text) > MAX_LENGTH:
            raise _refusal(text)

    def __str__(self) -> str:
        return f"camera_default_{self.position}"

    @property
    def topics_file(self) -> int:
        """Number X of the recordings whose background this is."""
        return self.position + 1


def parse_bag_name(text: str) -> RecordingName | BackgroundName:
    """Read a file name, with or without ``.bag``; ``str()`` of the result is the canonical name.

    Raises
    ------
    RecordingNameError
        If the grammar does not admit the whole text; the hint gives the nearest valid form where one exists.

    Examples
    --------
    >>> parse_bag_name("FelShirt_Free_pi16.0.5_B1.bag").swing_divisor
    16
    >>> str(parse_bag_name("FelShirt_Free_pi16.0.5_B1.bag"))
    'FelShirt_Free_pi16_0.5_B1'
    """
    if (name := _read(text.removesuffix(".bag"))) is None:
        raise _refusal(text)
    return name


def repair_name(text: str) -> str | None:
    """Return the nearest valid name, without ``.bag``, or None when nothing less than a guess would make one.

    Mended are the separators, the decimal comma, the case of the axis and of ``.bag``, a missing topics number (taken
    as 1), leading zeros, letters outside ASCII, a path in front, suffixes behind, and what ``rosbag record`` appends;
    but a part that is not the first is no recording.
    """
    last = plain_stem(text)
    if len(last) > _MAX_FILE_NAME:
        return None
    letters = (letter for letter in unicodedata.normalize("NFKD", last) if not unicodedata.combining(letter))
    plain = "".join(letter if letter.isascii() else "_" for letter in letters)
    # In "pi16.0_5" the point and the underscore have changed places.
    plain = re.sub(r"(pi[0-9]+)[.,]([0-9]+)_([0-9]+)(?=_)", r"\1_\2.\3", plain)
    if (candidate := _repaired(plain)) is None and (appended := appended_to(plain)) is not None and not appended.part:
        candidate = _repaired(appended.given)
    return None if candidate is None or _read(candidate) is None else candidate


def plain_stem(text: str) -> str:
    """Return a file name without a path in front and suffixes behind: of bags, of copies, of open and old bags."""
    last = re.split(r"[/\\]", text)[-1].strip()
    return last if len(last) > _MAX_FILE_NAME else _SUFFIXES.sub("", last)


def _repaired(plain: str) -> str | None:
    if (found := _LOOSE_BACKGROUND.fullmatch(plain)) is not None:
        return f"camera_default_{int(found['position'])}"
    return None if (found := _LOOSE_RECORDING.fullmatch(plain)) is None else _tightened(found)


def _tightened(loose: re.Match[str]) -> str:
    """Write what :data:`_LOOSE_RECORDING` found in the order and with the separators of the grammar."""
    # A hyphen is a letter to the grammar; it stays one where something else separates the words.
    separators = r"[^A-Za-z0-9-]+" if re.search(r"[_.\s]", loose["name"]) else r"[^A-Za-z0-9]+"
    words = [word for part in re.split(separators, loose["name"]) if (word := part.strip("-"))]
    whole, _, digits = loose["speed"].replace(",", ".").partition(".")
    speed = ".".join(filter(None, (whole.lstrip("0") or "0", digits)))
    axis = loose["axis"].upper() + (loose["topics"].lstrip("0") or "1")
    return "_".join(filter(None, (*words, speed, loose["counter"], axis)))


_GAP = r"[^A-Za-z0-9]+"
_SUFFIXES = re.compile(r"(?:\s*\([0-9]+\)|\.(?:bag|active|orig|part))+\s*$", re.IGNORECASE)
_LOOSE_BACKGROUND = re.compile(rf"camera{_GAP}default{_GAP}(?P<position>[0-9]+)", re.IGNORECASE)
_LOOSE_RECORDING = re.compile(
    rf"""(?P<name>.+?){_GAP}?
         (?P<speed>[0-9]+[.,]?[0-9]*|[.,][0-9]+)
         (?:{_GAP}(?P<counter>[0-9]{{4}}))?
         {_GAP}(?P<axis>[RB])(?:{_GAP})?(?P<topics>[0-9]*)""",
    re.VERBOSE | re.IGNORECASE,
)


@lru_cache(maxsize=2**14)  # tables, folder and results ask for the same names
def _read(stem: str) -> RecordingName | BackgroundName | None:
    if len(stem) > MAX_LENGTH:
        return None
    if (found := _RECORDING.fullmatch(stem)) is None and (dotted := _DOTTED.fullmatch(stem)) is not None:
        found = _RECORDING.fullmatch(f"{dotted['head']}_{dotted['tail']}")
    if found is not None:
        name, speed, counter, axis, topics_file = _parts(found)
        return RecordingName(name, speed, axis, topics_file, counter)
    if (found := _BACKGROUND.fullmatch(stem)) is not None:
        return BackgroundName(int(found["position"]))
    return None


def _parts(found: re.Match[str]) -> tuple[str, str, str | None, Literal["R", "B"], int]:
    axis: Literal["R", "B"] = "R" if found["axis"] == "R" else "B"
    return found["name"], found["speed"], found["counter"], axis, int(found["topics"])


def _refusal(text: str) -> RecordingNameError:
    if (length := len(text.removesuffix(".bag"))) > MAX_LENGTH:
        what, most = "a recording name that is too long", f"at most {MAX_LENGTH} letters before .bag"
        return RecordingNameError(what, expected=most, found=length, hint="Its results would be called as it is.")
    nearest = repair_name(text)
    hint = f"For example {_EXAMPLE}." if nearest is None else f"Did you mean {nearest}.bag?"
    appended = appended_to(plain_stem(text))
    known = appended is not None and repair_name(appended.given) is not None
    what = appended.text if appended is not None and known else "not a recording name"
    return RecordingNameError(what, expected=_FORM, found=repr(text), hint=hint)
