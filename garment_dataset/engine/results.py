"""What a store holds: objects, results made of them, failures."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

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
    def from_footers(cls, footers: Iterable[tuple[StoredFile, Mapping[str, Any]]]) -> Iterator[Result]:
        """Put results together from the footers of their files, each yielded when the last of its tables has come.

        A result with a table missing is left out. So are files of another format: their keys name nothing that can be
        wanted again. Of two files of one table the later counts: the result is then yielded once more.
        """
        outputs: dict[str, dict[str, StoredOutput]] = {}
        for file, footer in footers:
            if footer.get("facts", {}).get("format") != FORMAT:
                continue
            found = outputs.setdefault(footer["key"], {})
            found[footer["table"]] = StoredOutput(file, footer["content"], footer["rows"], footer["labelled"])
            if set(found) == set(footer["tables"]):
                yield cls(
                    footer["key"],
                    footer["facts"]["stage"],
                    footer["subject"],
                    footer["partition"],
                    dict(found),
                    footer["facts"],
                    tuple(footer["notes"]),
                    footer["body"],
                )


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
