"""From a workspace to the facts of its report: one plan, the catalog, what lint and check find."""

from __future__ import annotations

import hashlib
import re
from collections import Counter, defaultdict
from functools import cache
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.sources import digest_source, stat_source
from garment_dataset.errors import GarmentError, printable
from garment_dataset.features.quality import RecordingQuality, read_quality
from garment_dataset.report.facts import NodeFact, RecordingFacts, SiteFacts, StageFact
from garment_dataset.report.findings import Findings
from garment_dataset.stages import Group

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from garment_dataset.engine.plan import Decision, Plan
    from garment_dataset.layout import Layout
    from garment_dataset.workspace.session import Session

_PLAIN = re.compile(r"[A-Za-z0-9_.-]{1,120}")
_PATHS = ("path",)


def gather(session: Session, known_checks: Mapping[str, Any]) -> tuple[SiteFacts, dict[str, Any]]:
    """Return what a report shows, and what is to be remembered of the checks.

    Parameters
    ----------
    session : Session
        A workspace opened for planning; its selection is what the report is of.
    known_checks : mapping
        What an earlier call returned: bags that have not changed are not read again.

    Returns
    -------
    facts : SiteFacts
        Without paths of this machine in any text that is shown.
    checks : dict
        JSON-like.
    """
    plain = without_paths(session.layout)
    nodes = _nodes(session, session.plan(), plain)
    rows = [*session.selection.rows, *session.selection.absent]
    order = {row.recording: number for number, row in enumerate(session.catalog.rows)}
    rows.sort(key=lambda row: order[row.recording])
    digest_of = cache(lambda path: _bag_digest(session, path))
    findings = Findings(session, plain, known_checks)
    found = findings.of(rows, digest_of)
    quality = _quality(session)
    about = defaultdict(list)
    for finding in found:
        about[finding.subject.removesuffix(".bag")].append(finding)
    recordings = [
        RecordingFacts(
            printable(row.recording),
            page_of(row.recording),
            {name: _shown(value) for name, value in row.record().items() if name not in _PATHS},
            tuple(nodes.get(row.recording, ())),
            tuple(about[printable(row.recording)]),
            quality.get(row.recording, RecordingQuality()),
            None if row.path is None else digest_of(row.path),
            row.path,
        )
        for row in rows
    ]
    names = {row.recording for row in session.catalog.rows}
    others = [node for subject, found_nodes in nodes.items() if subject not in names for node in found_nodes]
    layout = session.layout
    columns = {column.name: column.unit or "" for column in session.catalog.tables.columns}
    stages = _stages(session, nodes)
    facts = SiteFacts(
        "Recordings of moving cloth", recordings, others, found, stages, columns, layout.features_dir, layout.root
    )
    return facts, findings.remembered


def page_of(recording: str) -> str:
    """Return the name of a recording's page: its own, or, where that is no name for a file of a site, a digest."""
    if _PLAIN.fullmatch(recording) and not recording.startswith("."):
        return f"{recording}.html"
    raw = recording.encode("utf-8", "surrogateescape")
    words = re.sub(r"[^A-Za-z0-9_-]+", "-", printable(recording)).strip("-")[:60]
    return f"{words or 'recording'}-{hashlib.sha256(raw).hexdigest()[:12]}.html"


def without_paths(layout: Layout) -> Callable[[str], str]:
    """Return what takes folders of this machine out of a text: reports of equal workspaces are equal.

    Parameters
    ----------
    layout : Layout
        The workspace: of what lies in it, paths from its root are left; of folders elsewhere, their names.
    """
    shown = {str(layout.root): "", str(layout.root.resolve()): ""}
    for folder in (layout.recordings_dir, layout.features_dir, layout.catalog_dir, layout.pipelines_dir):
        if not folder.is_relative_to(layout.root):
            shown[str(folder)] = f"{folder.name}/"
    longest_first = sorted(shown.items(), key=lambda each: -len(each[0]))

    def plain(text: str) -> str:
        for folder, name in longest_first:
            text = text.replace(f"{folder}/", name).replace(folder, name.rstrip("/") or ".")
        return printable(text)

    return plain


def _bag_digest(session: Session, path: Path) -> str | None:
    """Return the digest of a bag's content: what the index knows, if the bag is as it was then; else it is read."""
    stat, known = session.store.index.source_digests().get(str(path), (None, None))
    if known is not None and stat == stat_source(path):
        return known
    try:
        return digest_source(path)
    except GarmentError:
        return None


def _nodes(session: Session, plan: Plan, plain: Callable[[str], str]) -> dict[str, list[NodeFact]]:
    """Return the nodes of the plan by subject."""
    index = session.store.index
    published = index.published()
    failures = index.failures()
    found: dict[str, list[NodeFact]] = {}
    for decision in plan:
        node = decision.node
        key = published.get(node)
        made_from = (session.store.facts(key) or {}) if key is not None else {}
        failure = failures.get(node)
        reasons = [plain(str(reason)) for reason in decision.reasons]
        if failure is not None and decision.state == "failed":
            reasons = [plain(f"{failure.kind}: {failure.message}")]
        found.setdefault(node.subject, []).append(
            NodeFact(
                node.stage,
                printable(node.subject),
                node.variant,
                decision.state.value,
                decision.certain,
                tuple(reasons),
                tuple(plain(note) for note in decision.notes),
                key,
                made_from,
                _accepted(session, decision),
            )
        )
    return found


def _accepted(session: Session, decision: Decision) -> tuple[str, ...]:
    """Return the changes of code that a result's file says were declared equivalent."""
    from garment_dataset.engine.artifacts import read_provenance

    result = None if decision.key is None else session.store.results.get(decision.key)
    if result is None or decision.state != "fresh":
        return ()
    try:
        path = session.store.table_path(result, next(iter(result.outputs)), decision.node.variant)
        said = read_provenance(path).get("accepted", [])
    except GarmentError:
        return ()
    return tuple(f"made by code {each['code'][:12]}, accepted as equivalent: {each['because']}" for each in said)


def _quality(session: Session) -> dict[str, RecordingQuality]:
    try:
        return read_quality(session.layout.features_dir)
    except GarmentError:
        return {}  # the node of the stage says what is wrong with it


def _shown(value: object) -> object:
    """Return a value of the catalog as JSON has it; dates as text."""
    if isinstance(value, str):
        return printable(value)
    return value if value is None or isinstance(value, bool | int | float) else str(value)


def _stages(session: Session, nodes: Mapping[str, Sequence[NodeFact]]) -> list[StageFact]:
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for found in nodes.values():
        for node in found:
            counts[node.stage][node.state] += 1
    made = {output.name for stage in session.stages for output in stage.outputs}
    pipelines = defaultdict(list)
    for pipeline in session.pipelines:
        for stage in pipeline.stages:
            pipelines[stage.name].append(pipeline.name)
    return [
        StageFact(
            stage.name,
            tuple(name for name in stage.arguments if name in stage.sources or name in made),
            tuple(output.name for output in stage.outputs),
            f"group of equal {', '.join(stage.per.by)}" if isinstance(stage.per, Group) else str(stage.per),
            tuple(dict.fromkeys(pipelines[stage.name])),
            dict(counts[stage.name]),
        )
        for stage in session.stages
    ]
