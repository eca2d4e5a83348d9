"""Names put right: what contradicts one, and the name in which that is mended."""

from __future__ import annotations

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
    try:
        found = name.changed(**change._asdict())
    except RecordingNameError:
        return None
    return None if found == name else found
