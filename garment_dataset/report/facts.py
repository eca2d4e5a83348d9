"""What a report shows, as plain values: pages are made of these alone, and their keys are digests of these."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from garment_dataset.features.quality import RecordingQuality


@dataclass(frozen=True, slots=True)
class NodeFact:
    """How one node stands.

    Parameters
    ----------
    stage, subject, variant : str
        Which node.
    state : str
        ``fresh``, ``stale``, ``missing``, ``blocked`` or ``failed``.
    certain : bool
        False where it is run only if what feeds it comes out different.
    reasons, notes : tuple of str
        Why it is not fresh; what its stage said of data left out.
    key : str or None
        Of the result that is published, and shown.
    made_from : mapping
        Facts of that result: parameters, code, libraries, inputs; empty where there is none.
    accepted : tuple of str
        Which changes of code were declared equivalent.
    """

    stage: str
    subject: str
    variant: str
    state: str
    certain: bool
    reasons: tuple[str, ...]
    notes: tuple[str, ...]
    key: str | None
    made_from: Mapping[str, Any] = field(default_factory=dict)
    accepted: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """Its state in a word; with a question mark where that is not certain."""
        return self.state if self.certain else f"{self.state}?"


@dataclass(frozen=True, slots=True)
class FindingFact:
    """One finding of ``garment lint`` or ``garment check``.

    Parameters
    ----------
    source : {"lint", "check"}
        Which command says it.
    severity, code, subject, message, hint
        As the command says.
    """

    source: str
    severity: str
    code: str
    subject: str
    message: str
    hint: str | None = None


@dataclass(frozen=True, slots=True)
class RecordingFacts:
    """Everything that the page of one recording is made of, but for the contents of results and bag.

    Parameters
    ----------
    recording : str
        Its name.
    page : str
        Its file in the folder of recordings.
    row : mapping
        Its row of the catalog, without paths.
    nodes : tuple of NodeFact
        Of the recording itself.
    findings : tuple of FindingFact
        About it.
    quality : RecordingQuality
        The worst verdict, and figures.
    bag : str or None
        Digest of the bag's content; None where there is no bag.
    path : Path or None
        Where the bag is; not part of what is shown.
    """

    recording: str
    page: str
    row: Mapping[str, Any]
    nodes: tuple[NodeFact, ...]
    findings: tuple[FindingFact, ...]
    quality: RecordingQuality
    bag: str | None
    path: Path | None

    @property
    def is_bag_as_built(self) -> bool:
        """Whether the bag is the one that the results were made of."""
        read = {
            digest for node in self.nodes if not node.variant for digest in node.made_from.get("inputs", {}).values()
        }
        return self.bag is not None and self.bag in read

    @property
    def tables(self) -> tuple[str, ...]:
        """Stages of the usual variant of which there is a result."""
        return tuple(node.stage for node in self.nodes if node.key is not None and not node.variant)


@dataclass(frozen=True, slots=True)
class StageFact:
    """One stage of the pipelines, for the picture.

    Parameters
    ----------
    name : str
        Of the stage.
    reads, makes : tuple of str
        Sources and tables.
    per : str
        What one run covers.
    pipelines : tuple of str
        Who names it.
    counts : mapping of str to int
        Number of nodes by state.
    """

    name: str
    reads: tuple[str, ...]
    makes: tuple[str, ...]
    per: str
    pipelines: tuple[str, ...]
    counts: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class SiteFacts:
    """Everything that a report is made of.

    Parameters
    ----------
    title : str
        Heading.
    recordings : sequence of RecordingFacts
        In the order of the catalog.
    others : sequence of NodeFact
        Nodes of camera positions and groups.
    findings : sequence of FindingFact
        All of them.
    stages : sequence of StageFact
        Of all pipelines.
    columns : mapping of str to str
        Columns of one's own in the catalog, with their units.
    folder : Path
        The features.
    root : Path
        The workspace: not shown.
    """

    title: str
    recordings: Sequence[RecordingFacts]
    others: Sequence[NodeFact]
    findings: Sequence[FindingFact]
    stages: Sequence[StageFact]
    columns: Mapping[str, str]
    folder: Path
    root: Path
