"""What shows the empty scene to the recordings of one camera position."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from garment_dataset.catalog.rows import LABELS, UNSPECIFIED, CatalogRow

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True, slots=True)
class BackgroundSource:
    """What shows the empty scene to the recordings of one camera position.

    Parameters
    ----------
    topics_file : int
        Number X in the names of these recordings.
    source : str
        Name of the bag: of an empty scene, or of a recording.
    from_s, to_s : float or None
        Interval of the bag, from the first to before the second, after its first colour image; None: without bound.
    path : Path or None
        The bag; None when the folder does not hold it, or was not looked at.
    missing : str
        What to provide when it is not there.
    row : CatalogRow or None
        The bag's own row, when it is a recording.
    """

    topics_file: int
    source: str
    from_s: float | None
    to_s: float | None
    path: Path | None
    missing: str
    row: CatalogRow | None

    @property
    def labels(self) -> dict[str, str | int | float | None]:
        """What stands in the identity columns of its results."""
        return self.row.labels if self.row is not None else {**dict.fromkeys(LABELS), "recording": self.source}

    @property
    def partition(self) -> dict[str, str]:
        """The hive partition of the results of its bag."""
        if self.row is not None:
            return self.row.partition
        return {"garment": "camera_default", "holding": UNSPECIFIED}

    def record(self) -> dict[str, object]:
        """Return it as plain values, for ``--json``."""
        names = ("topics_file", "source", "from_s", "to_s", "path", "missing")
        return {name: getattr(self, name) for name in names}

    def __str__(self) -> str:
        if self.from_s is None and self.to_s is None:
            return self.source
        end = "its end" if self.to_s is None else f"{self.to_s:g} s"
        return f"{self.source}, {self.from_s or 0:g} s to {end}"
