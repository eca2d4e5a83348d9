"""What a check finds wrong with one recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

Severity = Literal["error", "warning", "note"]

SEVERITIES: dict[str, Severity] = {
    "unreadable": "error",
    "topic-missing": "error",
    "topic-silent": "error",
    "topic-type": "error",
    "image-size": "error",
    "image-encoding": "error",
    "dead": "error",
    "camera-missing": "error",
    "camera-uncalibrated": "error",
    "camera-size": "error",
    "gripper-missing": "error",
    "gripper-outside": "error",
    "gripper-still": "error",
    "background-missing": "error",
    "index": "warning",
    "duration": "warning",
    "begins-late": "warning",
    "ends-early": "warning",
    "rate": "warning",
    "gap": "warning",
    "doubled": "warning",
    "lost": "warning",
    "stamps": "warning",
    "image-faulty": "warning",
    "dark": "warning",
    "frozen": "warning",
    "camera-odd": "warning",
    "gripper-partial": "warning",
    "gripper-jump": "warning",
    "clock": "note",
    "reading": "note",
}
"""All codes, in the order of reports.

error: nothing, or something wrong, would be made of the recording; warning: some of it is lost or in doubt; note: a
fact worth knowing, which lets a recording pass.
"""


class Found(NamedTuple):
    """One thing that is not as the contract has it; who runs the checks knows in which recording.

    Parameters
    ----------
    code : str
        Which check, among :data:`SEVERITIES`; stable.
    message : str
        What is wrong: what was expected, what was found.
    topic : str or None
        Where, if it is about one topic.
    time_s : float or None
        When, in seconds after the recording begins, if it is about an instant.
    hint : str or None
        What to do about it.
    """

    code: str
    message: str
    topic: str | None = None
    time_s: float | None = None
    hint: str | None = None


@dataclass(frozen=True, slots=True)
class CheckFinding:
    """One thing that is not as it should be.

    Parameters
    ----------
    code : str
        Which check, among :data:`SEVERITIES`; stable.
    severity : {"error", "warning", "note"}
        See there.
    recording : str
        Its name.
    message, hint, topic, time_s
        See :class:`Found`.
    """

    code: str
    severity: Severity
    recording: str
    message: str
    hint: str | None = None
    topic: str | None = None
    time_s: float | None = None

    @classmethod
    def of(cls, recording: str, found: Found) -> CheckFinding:
        """Return what was found, as of a recording."""
        severity = SEVERITIES[found.code]
        return cls(found.code, severity, recording, found.message, found.hint, found.topic, found.time_s)
