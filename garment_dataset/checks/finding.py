"""What a check finds wrong with one recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "note"]


@dataclass(frozen=True, slots=True)
class CheckFinding:
    """One thing that is not as it should be.

    Parameters
    ----------
    code : str
        Which check, such as ``rate``; stable.
    severity : {"error", "warning", "note"}
        error: nothing, or something wrong, would be made of the recording; warning: some of it is lost or in doubt;
        note: a fact worth knowing.
    recording : str
        Its name.
    message : str
        What is wrong: what was expected, what was found.
    hint : str or None
        What to do about it.
    topic : str or None
        Where, if it is about one topic.
    time_s : float or None
        When, in seconds after the recording begins, if it is about an instant.
    """

    code: str
    severity: Severity
    recording: str
    message: str
    hint: str | None = None
    topic: str | None = None
    time_s: float | None = None
