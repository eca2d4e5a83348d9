"""What a user of the engine can get wrong, one class each.

Every message is one line with the same five parts: *what* is wrong, *where*, what was *expected*, what was *found*
and what to do next (*hint*). The command line prints that line and nothing else; a bug keeps its traceback.
"""

from __future__ import annotations

from typing import ClassVar

_MAX_PART = 500
"""Letters of one part of a message: enough for every path and list that a person wants to read."""


class ReportedError(Exception):
    """Root of everything a user can cause or mend.

    Parameters
    ----------
    what : str
        What is wrong, in a few words.
    where : object, optional
        The file, row, message or option concerned.
    expected, found : object, optional
        What should have been there and what was there instead.
    hint : str, optional
        What to do next.
    """

    exit_code: ClassVar[int] = 2

    def __init__(
        self,
        what: str,
        *,
        where: object = None,
        expected: object = None,
        found: object = None,
        hint: str | None = None,
    ) -> None:
        super().__init__(what)
        self.what = what
        self.where = None if where is None else str(where)
        self.expected = None if expected is None else str(expected)
        self.found = None if found is None else str(found)
        self.hint = hint

    def __str__(self) -> str:
        what = _plain(self.what)
        text = what if self.where is None else f"{_plain(self.where)}: {what}"
        facts = [
            f"{label} {_plain(value)}"
            for label, value in (("expected", self.expected), ("found", self.found))
            if value is not None
        ]
        if facts:
            text += ": " + ", ".join(facts)
        if self.hint:
            text += f". {_plain(self.hint)}"
        return text

    def __reduce__(self) -> tuple[object, ...]:
        """Cross a process boundary whole: pickle's default would lose the keyword-only parts."""
        return _rebuild, (type(self), self.__dict__.copy(), self.args)

    def parts(self) -> dict[str, str | None]:
        """Return the parts for ``--json``."""
        return {
            "error": type(self).__name__,
            "what": self.what,
            "where": self.where,
            "expected": self.expected,
            "found": self.found,
            "hint": self.hint,
        }


def _plain(text: str) -> str:
    """Write one part of a message on one line, whatever a file held: no control letters, and not all of a long cell."""
    text = " ".join(text.split())
    if len(text) > _MAX_PART:
        text = f"{text[: _MAX_PART - 150]} [...] {text[-140:]}"
    return printable(text)


def printable(text: str) -> str:
    """Return a text with control letters, and bytes of a file name that are no letters, written as escapes."""
    return text if text.isprintable() else "".join(each if each.isprintable() else ascii(each)[1:-1] for each in text)


def _rebuild(kind: type[ReportedError], state: dict[str, object], args: tuple[str, ...]) -> ReportedError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class StageError(ReportedError):
    """A stage whose declaration does not fit together."""


class UntraceableCodeError(ReportedError):
    """Code that a stage reaches in a way that cannot be followed statically."""


class CodeChangedError(ReportedError):
    """Code that was edited between the moment its key was computed and the moment it ran."""


class SourceError(ReportedError):
    """An external input that cannot be read."""


class SourceChangedError(SourceError):
    """An external input that changed while it was read."""


class TableError(ReportedError):
    """Columns that do not fit the declared schema of a table."""


class StoreError(ReportedError):
    """A stored result that is not there, or a file that is none."""


class StorageError(ReportedError):
    """A store that cannot be written, locked or trusted: for want of space or permission, or by damage."""

    exit_code = 1


class ResultDamagedError(StorageError):
    """A stored result whose bytes are not those that were stored."""


class LockedError(ReportedError):
    """Another process writes the store, and nobody wants to wait for it."""

    exit_code = 4


class ClusterError(ReportedError):
    """A cluster that cannot be reached, or workers that do not fit this process."""


class ClusterLostError(ClusterError):
    """A cluster that went away while it was working."""

    exit_code = 1


class DataWarning(UserWarning):
    """Something in the data that was left out of a result, and that its owner should know of."""
