"""What ``rosbag record`` appends to the name that it was given: a date (``-o``), and numbers of parts (``--split``)."""

from __future__ import annotations

import re
from typing import NamedTuple

_APPENDED = re.compile(
    r"(?P<given>.+?)(?:_(?P<date>[0-9]{4}-[0-9]{2}-[0-9]{2}-[0-9]{2}-[0-9]{2}-[0-9]{2}))?(?:_(?P<part>[0-9]{1,6}))?",
    re.DOTALL,
)

WHOLE = "A recording is one bag: record without --split, or join its parts:"


class Appended(NamedTuple):
    """What was given, and what was appended to it; not both the date and the part are None."""

    given: str
    date: str | None
    part: int | None

    @property
    def text(self) -> str:
        """What it is called in messages."""
        if self.part is None:
            return "a recording name with the date that `rosbag record -o` appends"
        return "a recording name with the number that `rosbag record --split` appends to a part"


def appended_to(stem: str) -> Appended | None:
    """Take apart a name, without ``.bag``, as ``rosbag record`` may have made it; None when nothing was appended."""
    found = _APPENDED.fullmatch(stem)
    if found is None or (found["date"] is None and found["part"] is None):
        return None
    return Appended(found["given"], found["date"], None if found["part"] is None else int(found["part"]))
