"""What a user can get wrong, one class each.

Every message is one line with the same five parts: *what* is wrong, *where*, what was *expected*, what was *found*
and what to do next (*hint*). The command line prints that line and nothing else; a bug keeps its traceback.
"""

from __future__ import annotations

from typing import ClassVar


class GarmentError(Exception):
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
        text = self.what if self.where is None else f"{self.where}: {self.what}"
        facts = [
            f"{label} {value}"
            for label, value in (("expected", self.expected), ("found", self.found))
            if value is not None
        ]
        if facts:
            text += ": " + ", ".join(facts)
        if self.hint:
            text += f". {self.hint}"
        return " ".join(text.split())

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


def _rebuild(kind: type[GarmentError], state: dict[str, object], args: tuple[str, ...]) -> GarmentError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class RecordingNameError(GarmentError):
    """A file name that the grammar of table 4.2 does not admit."""


class FilterError(GarmentError):
    """A filter term that names no column or cannot be read."""


class CatalogError(GarmentError):
    """A table of the catalog that cannot be read or contradicts itself."""


class WorkspaceError(GarmentError):
    """No workspace here, or one whose configuration cannot be read."""


class PipelineError(GarmentError):
    """A pipeline file that names an unknown stage, parameter or recording."""


class StageError(GarmentError):
    """A stage whose declaration does not fit together."""


class UntraceableCodeError(GarmentError):
    """Code that a stage reaches in a way that cannot be followed statically."""


class BagError(GarmentError):
    """A recording that cannot be opened or read."""


class MessageError(GarmentError):
    """One message of a bag that does not fit its own description."""


class TransformError(GarmentError):
    """A question that the recorded transforms cannot answer."""


class TableError(GarmentError):
    """Columns that do not fit the declared schema of a table."""


class StoreError(GarmentError):
    """A stored result that is missing or damaged."""


class MissingExtraError(GarmentError):
    """A command whose optional dependencies are not installed."""


class DataWarning(UserWarning):
    """Something in the data that was left out of a result, and that its owner should know of."""
