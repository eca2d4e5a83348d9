"""What each build did, when, by whom and with which code: one line of JSON when it begins, one when it ends."""

from __future__ import annotations

import json
import os
import platform
import sys
import time
import uuid
from typing import TYPE_CHECKING, Any, Self

from garment_dataset.engine.events import Ending
from garment_dataset.engine.locking import now_text, user_name
from garment_dataset.errors import StorageError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from garment_dataset.engine.code import Code
    from garment_dataset.engine.events import Report

_FILE = "log.jsonl"


class BuildLog:
    """The entry of a build that is under way.

    Parameters
    ----------
    folder : Path
        The workspace's private folder.
    name : str
        Tells the two lines of one build from those of others.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self._folder = folder
        self._name = name
        self._started = time.monotonic()

    @classmethod
    def begin(cls, folder: Path, codes: Mapping[str, Code], command: str = "") -> Self:
        """Write that a build begins.

        Raises
        ------
        StorageError
            If that cannot be written.
        """
        from importlib import metadata

        log = cls(folder, uuid.uuid4().hex[:12])
        log.write(
            {
                "begun": now_text(),
                "command": command or " ".join([os.path.basename(sys.argv[0] or "python"), *sys.argv[1:]]),  # noqa: PTH119
                "user": user_name(),
                "host": platform.node(),
                "pid": os.getpid(),
                "version": metadata.version("garment-dataset"),
                "python": platform.python_version(),
                "code": {stage: code.digest[:12] for stage, code in sorted(codes.items())},
            }
        )
        return log

    def end(self, report: Report) -> None:
        """Write what became of it; raises as :meth:`begin` does."""
        failed = [{"node": str(event.node), "message": event.message} for event in report.of(Ending.FAILED)]
        counts = {ending.value: len(report.of(ending)) for ending in Ending if report.of(ending)}
        seconds = round(time.monotonic() - self._started, 2)
        self.write({"ended": now_text(), "seconds": seconds, "counts": counts, "failed": failed})

    def write(self, entry: Mapping[str, Any]) -> None:
        """Append a line."""
        path = self._folder / _FILE
        try:
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"build": self._name, **entry}, ensure_ascii=False) + "\n")
        except OSError as error:
            raise StorageError("the log cannot be written", where=path, found=error.strerror or error) from error


def read_log(folder: Path) -> list[dict[str, Any]]:
    """Return what is known of every build, the oldest first; one without ``ended`` was ended from outside.

    A line that cannot be read, such as one that a crash of the machine cut off, is passed over.
    """
    path = folder / _FILE
    builds: dict[str, dict[str, Any]] = {}
    lines = path.read_text("utf-8", errors="replace").splitlines() if path.is_file() else []
    for line in lines:
        try:
            entry = json.loads(line)
            builds.setdefault(entry["build"], {}).update(entry)
        except (ValueError, KeyError, TypeError):
            continue
    return [entry for entry in builds.values() if "begun" in entry]
