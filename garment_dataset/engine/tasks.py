"""From a node, and what feeds it, to a task: values that cross a process boundary; or to why there is none."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from garment_dataset.engine.facts import body_digest, input_digests, node_facts, node_key, notes_of
from garment_dataset.engine.worker import StoredTable, Task

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from garment_dataset.engine.code import Code
    from garment_dataset.engine.events import Report
    from garment_dataset.engine.graph import Node, NodeId
    from garment_dataset.engine.results import Result
    from garment_dataset.engine.sources import SourceStat
    from garment_dataset.engine.store import Store


def find_obstacle(node: Node, done: Mapping[NodeId, Result], report: Report) -> str | None:
    """Return why a node cannot be run, all that feeds it having ended; None when it can."""
    if node.blocked is not None:
        return node.blocked
    if node.empty_groups:
        return f"there is no {node.empty_groups[0]}"
    lacking = [feeder for feeder in node.inputs.values() if feeder not in done]
    for members in node.gathers.values():
        if all(feeder not in done for feeder in members):
            lacking += members
    return f"{lacking[0]} {report.events[lacking[0]].ending}" if lacking else None


def make_task(
    node: Node,
    code: Code,
    sources: Mapping[Path, tuple[SourceStat, str]],
    done: Mapping[NodeId, Result],
    store: Store,
    scratch_dir: Path,
) -> Task:
    """Return what a worker is to do for a node.

    Parameters
    ----------
    node : Node
        Which run.
    code : Code
        Of its stage.
    sources : mapping of Path to (SourceStat, str)
        State and content digest of its external inputs.
    done : mapping of NodeId to Result
        What is made already: all that feeds the node, except gathered tables that cannot be had.
    store : Store
        Holds them.
    scratch_dir : Path
        Where the worker writes.
    """

    def content(feeder: NodeId, table: str, labelled: bool) -> str | None:
        return done[feeder].outputs[table].digest(labelled=labelled) if feeder in done else None

    def stored(feeder: NodeId, table: str) -> StoredTable:
        path = store.table_path(done[feeder], table, feeder.variant)
        return StoredTable(path, done[feeder].outputs[table].file.digest)

    digests = input_digests(node, lambda source: sources[source][1], content)
    upstream_notes = notes_of(node, done)
    facts = node_facts(node, code, digests, upstream_notes)
    return Task(
        module=node.stage.module,
        home=node.stage.home,
        subject=node.subject,
        partition=node.partition,
        params=facts["params"],
        sources={name: (source, sources[source][0]) for name, source in node.sources.items()},
        inputs={table: stored(feeder, table) for table, feeder in node.inputs.items()},
        gathers={
            table: {feeder.subject: stored(feeder, table) for feeder in members if feeder in done}
            for table, members in node.gathers.items()
        },
        notes=_left_out(node, done),
        upstream_notes=upstream_notes,
        labels=node.labels,
        key=node_key(facts),
        facts=facts,
        body=body_digest(facts),
        code_files=code.files,
        scratch_dir=scratch_dir,
    )


def take_over(task: Task, donor: Result, store: Store) -> Task:
    """Return a task that labels another subject's tables anew: of the same body, they are what would be made."""
    tables = {
        table: StoredTable(store.objects.path(output.file.digest), output.file.digest)
        for table, output in donor.outputs.items()
    }
    return replace(task, donor=tables, donor_subject=donor.subject, donor_notes=donor.notes)


def _left_out(node: Node, done: Mapping[NodeId, Result]) -> tuple[str, ...]:
    return tuple(
        f"{feeder.subject} is left out: its {table} cannot be had"
        for table, members in node.gathers.items()
        for feeder in members
        if feeder not in done
    )
