"""Names put right: what contradicts one, and the name in which that is mended."""

from __future__ import annotations

import dataclasses
import re
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.errors import RecordingNameError

if TYPE_CHECKING:
    from typing import Literal

    from garment_dataset.catalog import CatalogRow
    from garment_dataset.catalog.lint import Code
    from garment_dataset.catalog.names import RecordingName
    from garment_dataset.checks.content import Content


class Measured(NamedTuple):
    """A recording, and what it shows."""

    row: CatalogRow
    content: Content


class Change(NamedTuple):
    """Parts of a name that should be others; None leaves one as it is."""

    axis: Literal["R", "B"] | None = None
    swing_divisor: int | None = None
    speed: str | None = None
    garment: str | None = None
    repeat: int | None = None

    def also(self, other: Change) -> Change:
        """Return both changes; of a part that both change, the second."""
        return self._replace(**{part: value for part, value in other._asdict().items() if value is not None})


class Contradiction(NamedTuple):
    """One thing in which a recording is not what its name says.

    Parameters
    ----------
    recording : str
        Its name.
    code : str
        Which kind, among those of :data:`garment_dataset.catalog.lint.SEVERITIES`.
    message : str
        What the name says, and what is shown.
    change : Change
        What would mend it; an empty one when nothing says it.
    """

    recording: str
    code: Code
    message: str
    change: Change = Change()


def changed(name: RecordingName, change: Change) -> RecordingName | None:
    """Return a name with some of its parts changed; None when it does not have these parts, or would be no name."""
    text = name.name
    if change.garment is not None and name.garment is not None:
        text = change.garment + text[len(name.garment) :]
    if change.repeat is not None and name.counter is None:
        text = re.sub(r"_[0-9]{2}(?=_|$)", f"_{change.repeat:02}", text, count=1)
    if change.swing_divisor is not None:
        text = re.sub(r"pi[0-9]+$", f"pi{change.swing_divisor}", text)
    counter = f"{change.repeat:04}" if change.repeat is not None and name.counter is not None else name.counter
    try:
        found = dataclasses.replace(
            name, name=text, counter=counter, axis=change.axis or name.axis, speed=change.speed or name.speed
        )
    except RecordingNameError:
        return None
    return None if found == name else found
