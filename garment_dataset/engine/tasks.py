"""From a node, and what feeds it, to a task: values that cross a process boundary."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.engine.facts import member_input, node_facts, node_key, notes_of
from garment_dataset.engine.worker import Task

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from garment_dataset.engine.code import Code
    from garment_dataset.engine.graph import Node, NodeId
    from garment_dataset.engine.index import Result
    from garment_dataset.engine.sources import SourceStat


def make_task(
    node: Node,
    code: Code,
    sources: Mapping[str, tuple[Path, SourceStat, str]],
    done: Mapping[NodeId, Result],
    object_path: Callable[[str], Path],
    scratch_dir: Path,
) -> Task:
    """Return what a worker is to do for a node.

    Parameters
    ----------
    node : Node
        Which run.
    code : Code
        Of its stage.
    sources : mapping of str to (Path, SourceStat, str)
        Its external inputs by argument name, with their state and content digest.
    done : mapping of NodeId to Result
        What is made already: all that feeds the node, except gathered tables that cannot be had.
    object_path : callable
        Where the object of a digest lies.
    scratch_dir : Path
        Where the worker writes.
    """
    digests: dict[str, str | None] = {name: digest for name, (_, _, digest) in sources.items()}
    inputs = {table: done[feeder].outputs[table] for table, feeder in node.inputs.items()}
    digests |= {table: output.content for table, output in inputs.items()}
    gathers: dict[str, dict[str, Path]] = {}
    notes = []
    for table, members in node.gathers.items():
        gathers[table] = {}
        for feeder in members:
            output = done[feeder].outputs[table] if feeder in done else None
            digests[member_input(table, feeder.subject)] = output and output.content
            if output is None:
                notes.append(f"{feeder.subject} is left out: its {table} cannot be had")
            else:
                gathers[table][feeder.subject] = object_path(output.file.digest)
    upstream = notes_of(node, done)
    facts = node_facts(node, code, digests, upstream)
    return Task(
        module=node.stage.module,
        home=node.stage.home,
        subject=node.subject,
        partition=node.partition,
        params=facts["params"],
        sources={name: (path, stat) for name, (path, stat, _) in sources.items()},
        inputs={table: object_path(output.file.digest) for table, output in inputs.items()},
        gathers=gathers,
        notes=tuple(notes),
        upstream_notes=upstream,
        labels=node.labels,
        key=node_key(facts),
        facts=facts,
        scratch_dir=scratch_dir,
    )
