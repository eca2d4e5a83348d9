"""What a snapshot holds: gathered once, before anything is written."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from garment_dataset.catalog.rows import UNSPECIFIED
from garment_dataset.engine.plan import State
from garment_dataset.engine.table import Column
from garment_dataset.errors import StoreError, UsageError, did_you_mean, one_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence
    from pathlib import Path

    from garment_dataset.catalog import CatalogRow
    from garment_dataset.engine.plan import Decision
    from garment_dataset.layout import SnapshotSettings
    from garment_dataset.stages.stage import Stage
    from garment_dataset.workspace.session import Session

PLACES = (
    Column(
        "garment", "string", "", "name of the garment; camera_default: an empty scene; null: several", nullable=True
    ),
    Column("holding", "string", "", "how the garment is held; null: not stated, or several", nullable=True),
)
"""Columns for what stands in the paths of results: files of a snapshot lie in one folder a table."""

_CATALOG_FILES = ("garments.csv", "holdings.csv", "backgrounds.csv")


@dataclass(frozen=True, slots=True)
class Piece:
    """One result file.

    Parameters
    ----------
    table, subject : str
        What it holds, and of which recording, camera position or group of recordings.
    source : Path
        Where it lies.
    digest : str
        The sha256 that its bytes must have.
    places : mapping of str to str or None
        What its path says, by the names of :data:`PLACES`; empty where the path says nothing.
    """

    table: str
    subject: str
    source: Path
    digest: str
    places: Mapping[str, str | None]

    @property
    def name(self) -> str:
        """Path of its copy in the snapshot."""
        return f"{self.table}/{self.subject}.parquet"


@dataclass(frozen=True)
class Contents:
    """All that goes into a snapshot.

    Parameters
    ----------
    pieces : tuple of Piece
        Result files, by table and subject.
    schemas : mapping of str to dict
        Descriptions of their tables, those of :data:`PLACES` among the columns.
    rows : tuple of CatalogRow
        The catalog's rows of the chosen recordings.
    left_out : mapping of str to str
        Results that were asked for and are not there, and why.
    catalog_files : tuple of Path
        The catalog's tables of garments, holdings and empty scenes.
    settings : SnapshotSettings
        What a person says of the data set.
    variant : str
        Whose results; empty for the usual ones.
    """

    pieces: tuple[Piece, ...]
    schemas: Mapping[str, dict[str, Any]]
    rows: tuple[CatalogRow, ...]
    left_out: Mapping[str, str]
    catalog_files: tuple[Path, ...]
    settings: SnapshotSettings
    variant: str = ""

    @property
    def recordings(self) -> list[str]:
        """Names of the recordings of which there is a result."""
        subjects = {piece.subject for piece in self.pieces}
        return [row.recording for row in self.rows if row.recording in subjects]


def gather(session: Session, tables: Collection[str] = (), variant: str = "") -> Contents:
    """Find the results of a workspace's selection that are as they should be, and say what is left out.

    Parameters
    ----------
    session : Session
        The workspace, with the recordings selected.
    tables : collection of str
        Which tables; all by default.
    variant : str
        Whose results; by default those of the pipelines without a variant.

    Raises
    ------
    UsageError
        If there is no such table or variant.
    StoreError
        If a result is stale, or there is none at all.
    """
    stages = _stages(session, variant)
    known = [output.name for stage in stages for output in stage.outputs]
    for table in tables:
        if table not in known:
            raise UsageError(f"no table {table!r}", expected=one_of(known), hint=did_you_mean(table, known))
    wanted = set(tables) or set(known)
    makers = {stage.name for stage in stages if wanted & {output.name for output in stage.outputs}}
    decisions = [each for each in session.plan() if each.node.variant == variant and each.node.stage in makers]
    _refuse_stale([each for each in decisions if each.state is State.STALE])
    fresh = [each for each in decisions if each.state is State.FRESH]
    left_out = {str(each.node): _why(each) for each in decisions if each.state is not State.FRESH}
    left_out |= {row.recording: "there is no bag" for row in session.selection.absent}
    placed = {stage.name for stage in stages if stage.partitions}
    found = (piece for each in fresh for piece in _pieces(session, each, wanted, is_placed=each.node.stage in placed))
    pieces = sorted(found, key=lambda each: each.name)
    if not pieces:
        why = Counter(map(_why, decisions)).most_common(1)
        raise StoreError("nothing to export", found=why[0][0] if why else "no bag", hint="`garment build` makes it.")
    there = {piece.table for piece in pieces}
    schemas = {output.name: _described(stage, output.name) for stage in stages for output in stage.outputs}
    return Contents(
        tuple(pieces),
        {name: schemas[name] for name in sorted(there)},
        (*session.selection.rows, *session.selection.absent),
        dict(sorted(left_out.items())),
        tuple(path for name in _CATALOG_FILES if (path := session.layout.catalog_dir / name).is_file()),
        session.layout.snapshot,
        variant,
    )


def _stages(session: Session, variant: str) -> list[Stage]:
    of_variant = [pipeline for pipeline in session.pipelines if pipeline.file.variant == variant]
    if not of_variant:
        known = sorted({pipeline.file.variant for pipeline in session.pipelines} - {""})
        raise UsageError(
            f"no variant {variant!r}",
            expected=one_of(known) if known else "none: no pipeline names one",
            hint=did_you_mean(variant, known),
        )
    return list({stage.name: stage for pipeline in of_variant for stage in pipeline.stages}.values())


def _refuse_stale(stale: Sequence[Decision]) -> None:
    if stale:
        first = f"{stale[0].node}: {', '.join(map(str, stale[0].reasons))}"
        raise StoreError(
            "results are stale, and a snapshot would not be what it says",
            found=f"{len(stale)} of them, first {first}",
            hint="`garment build` makes them anew.",
        )


def _why(decision: Decision) -> str:
    said = "; ".join(str(reason) for reason in decision.reasons)
    return f"{decision.state.value}: {said}" if said else decision.state.value


def _pieces(session: Session, decision: Decision, wanted: set[str], *, is_placed: bool) -> Iterator[Piece]:
    assert decision.key is not None
    result, store = session.store.results[decision.key], session.store
    parts = dict(part.split("=", 1) for part in result.partition.split("/") if part)
    said = {key: None if word == UNSPECIFIED else word for key, word in parts.items()}
    # the empty scene of a camera position is decoded as recordings are, and lies in no partition
    places = {column.name: said.get(column.name) for column in PLACES} if is_placed else {}
    for table, output in result.outputs.items():
        if table in wanted:
            path = store.feature_path(table, result.partition, result.subject, decision.node.variant)
            yield Piece(table, result.subject, path, output.file.digest, places)


def _described(stage: Stage, table: str) -> dict[str, Any]:
    """Describe a table as a snapshot has it: without partitions, whose keys are columns."""
    output = next(each for each in stage.outputs if each.name == table)
    identity = list(stage.identity)
    if stage.partitions:
        identity[1:1] = PLACES
    return output.describe(identity) | {"stage": stage.name}
