"""Fingerprints kept in a file: of a workspace, or of all workspaces of a person.

What is kept says which files it rests on, and is used only while these have the same content: where it was computed
does not matter, and a file that is lost, damaged or out of date costs time and nothing else.
"""

from __future__ import annotations

import contextlib
import json
import os
from functools import cached_property
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.canonical import digest

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

Entry = dict[str, Any]

_TAG = "fingerprints/2"
_MOST_FILES = 16


class CodeMemory:
    """Entries by the name of a stage, read when they are first asked for.

    Parameters
    ----------
    file : Path
        Need not exist, nor be writable.
    """

    def __init__(self, file: Path) -> None:
        self.file = file

    @cached_property
    def entries(self) -> dict[str, Entry]:
        """What is kept."""
        return self._load()

    def _load(self) -> dict[str, Entry]:
        """Return what was remembered; nothing of what does not read back as written."""
        try:
            kept = json.loads(self.file.read_text("utf-8"))
            remembered: dict[str, Entry] = kept["entries"]
            return remembered if kept["check"] == digest(_TAG, remembered) else {}
        except (OSError, ValueError, KeyError, TypeError):
            return {}

    def save(self) -> None:
        """Write the entries.

        Raises
        ------
        OSError
            If the file cannot be written.
        """
        self.file.parent.mkdir(parents=True, exist_ok=True)
        write_json(self.file, {"check": digest(_TAG, self.entries), "entries": self.entries})

    def share(self, computed: Mapping[str, Entry]) -> None:
        """Add entries to what others have written meanwhile, as far as the file can be written; keep few files."""
        with contextlib.suppress(OSError):
            self.entries = {**self._load(), **computed}
            self.save()
            by_age = sorted(self.file.parent.glob("*.json"), key=lambda file: file.stat().st_mtime_ns)
            for old in by_age[:-_MOST_FILES]:
                old.unlink(missing_ok=True)


def write_json(path: Path, value: object) -> None:
    """Write a file that others may be reading: they find the old one or the new one."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.write_text(json.dumps(value, sort_keys=True), "utf-8")
    temporary.replace(path)
