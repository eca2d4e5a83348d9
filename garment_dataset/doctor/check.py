"""What a check is, and how a check that fails itself is said."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

State = Literal["ok", "warning", "fault"]
"""ok: as it should be; warning: works, but may surprise; fault: something will fail."""


@dataclass(frozen=True, slots=True)
class Check:
    """One line about the machine or the workspace.

    Parameters
    ----------
    name : str
        What was looked at.
    state : {"ok", "warning", "fault"}
        How it is.
    text : str
        What was found.
    hint : str, optional
        What would mend it.
    """

    name: str
    state: State
    text: str
    hint: str | None = None

    def __str__(self) -> str:
        hint = "" if self.hint is None else f". {self.hint}"
        return " ".join(f"{self.state:7}  {self.name}: {self.text}{hint}".split("\n"))


def guarded(name: str, checks: Callable[[], Iterable[Check]]) -> list[Check]:
    """Make checks; one that fails itself becomes a warning that says why."""
    made: list[Check] = []
    try:
        made.extend(checks())
    except Exception as error:  # noqa: BLE001 - whatever is odd about a machine must not hide the other checks
        made.append(Check(name, "warning", f"cannot be checked: {type(error).__name__}: {error}"))
    return made


def size_text(size_bytes: float) -> str:
    """Return a number of bytes in words."""
    for unit, factor in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6)):
        if size_bytes >= factor:
            return f"{size_bytes / factor:.1f} {unit}"
    return f"{size_bytes / 1e3:.0f} kB"
