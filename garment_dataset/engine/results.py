"""What a store holds: objects, results made of them, failures."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

FORMAT = 3
"""Raised when the files' footers or the index change: what was made before is made anew."""

WRITER = 1
"""Version of what is done to a stage's tables before and while they are written; it is in every key.

To be raised whenever other bytes, or another content digest, would come of the same tables."""


class StoredFile(NamedTuple):
    """One object: the sha256 of its bytes, and its state when it was stored."""

    digest: str
    size_bytes: int
    mtime_ns: int


class StoredOutput(NamedTuple):
    """One table of a result: its object, digests of the rows that a stage made and of these with their labels."""

    file: StoredFile
    content: str
    rows: int
    labelled: str

    def digest(self, *, labelled: bool) -> str:
        """Return the digest that whoever reads the table depends on."""
        return self.labelled if labelled else self.content


@dataclass(frozen=True)
class Result:
    """All tables that one run of a stage made, and what they were made from.

    Parameters
    ----------
    key : str
        Digest of ``facts``.
    stage, subject : str
        What was run, and for which subject.
    partition : str
        Where under a table's folder it is published, such as ``kind=a/side=b``; may be empty.
    outputs : mapping of str to StoredOutput
        By table name.
    facts : mapping
        Parameters, code, libraries, labels and input digests: the pre-image of the key.
    notes : tuple of str
        What the stage said of data that it left out.
    body : str
        Digest of those facts that the stage's function knows of; results that differ only in their labels share it.
    """

    key: str
    stage: str
    subject: str
    partition: str
    outputs: Mapping[str, StoredOutput]
    facts: Mapping[str, Any] = field(compare=False)
    notes: tuple[str, ...] = ()
    body: str = ""

    @classmethod
    def from_footers(cls, footers: Iterable[tuple[StoredFile, Mapping[str, Any]]]) -> dict[str, Result]:
        """Put results together from the footers of their files; a result with a table missing is left out.

        So are files of another format: their keys name nothing that can be wanted again.
        """
        outputs: dict[str, dict[str, StoredOutput]] = {}
        about: dict[str, Mapping[str, Any]] = {}
        for file, footer in footers:
            if footer.get("facts", {}).get("format") != FORMAT:
                continue
            about[footer["key"]] = footer
            output = StoredOutput(file, footer["content"], footer["rows"], footer["labelled"])
            outputs.setdefault(footer["key"], {})[footer["table"]] = output
        return {
            key: cls(
                key,
                footer["facts"]["stage"],
                footer["subject"],
                footer["partition"],
                outputs[key],
                footer["facts"],
                tuple(footer["notes"]),
                footer["body"],
            )
            for key, footer in about.items()
            if set(outputs[key]) == set(footer["tables"])
        }


class Failure(NamedTuple):
    """Why a stage failed for a subject, with the key it failed with."""

    stage: str
    subject: str
    variant: str
    key: str
    kind: str
    message: str
    traceback: str
    attempts: int
