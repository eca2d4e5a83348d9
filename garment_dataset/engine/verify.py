"""Read everything back: whether what lies in the store, and where users look, is what was stored."""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.engine.objects import file_digest
from garment_dataset.engine.plan import State
from garment_dataset.engine.sources import digest_source, stat_source
from garment_dataset.engine.tasks import make_task
from garment_dataset.engine.worker import Trouble, run_task

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from garment_dataset.engine.code import Code
    from garment_dataset.engine.graph import Graph, NodeId
    from garment_dataset.engine.plan import Plan
    from garment_dataset.engine.results import Result
    from garment_dataset.engine.store import Store


class Finding(NamedTuple):
    """Something that is not what it should be: where, and what."""

    where: str
    what: str


def check_objects(store: Store) -> Iterator[Finding]:
    """Read every object, and yield those whose bytes are not what their names say, or that a result lacks."""
    there = set()
    for path in store.objects:
        there.add(path.stem)
        if not store.objects.is_what_it_says(path.stem):
            _distrust(path)
            yield Finding(str(path), "its bytes are not those that were stored")
    for result in store.results.values():
        for table, output in result.outputs.items():
            if output.file.digest not in there:
                place = store.objects.path(output.file.digest)
                yield Finding(str(place), f"is gone: {table} of {result.stage} {result.subject}")


def check_published(store: Store, nodes: Iterable[NodeId]) -> Iterator[Finding]:
    """Read every published file of some nodes, and yield those that are not what the index says."""
    published = store.index.published()
    for node in nodes:
        result = store.results.get(published.get(node, ""))
        if result is None:
            continue
        for table, output in result.outputs.items():
            path = store.feature_path(table, result.partition, result.subject, node.variant)
            if not path.is_file():
                yield Finding(str(path), f"is not there: {node}")
            elif path.stat().st_size != output.file.size_bytes or file_digest(path) != output.file.digest:
                _distrust(path)
                yield Finding(str(path), f"is not what {node} made")


def _distrust(path: Path) -> None:
    """Give a damaged file another time, so that the next build looks into it."""
    with contextlib.suppress(OSError):
        os.utime(path)


def check_sources(graph: Graph, store: Store) -> Iterator[Finding]:
    """Read every source whose digest is known, and yield those that have other bytes at the same size and time."""
    known = store.index.source_digests()
    for path in dict.fromkeys(path for node in graph for path in node.sources.values()):
        stat, digest = known.get(str(path), (None, ""))
        if stat is None:
            yield Finding(str(path), "was never read")
        elif stat != stat_source(path):
            yield Finding(str(path), "has changed since it was read: the next build looks into it")
        elif digest_source(path) != digest:
            yield Finding(str(path), "has other bytes than when it was read, at the same size and time")


def recompute(
    graph: Graph, plan: Plan, codes: Mapping[str, Code], store: Store, *, count: int, seed: int = 0
) -> Iterator[tuple[NodeId, Finding | None]]:
    """Make some fresh results once more, and compare the bytes.

    Parameters
    ----------
    graph, plan, codes, store
        As for a run; nothing of the store is changed.
    count : int
        How many nodes, drawn by ``seed``; all when there are fewer.

    Yields
    ------
    NodeId
        Which one.
    Finding or None
        How it differs, if it does.
    """
    keys = {decision.node: decision.key for decision in plan if decision.state is State.FRESH}
    fresh = {node_id: store.results[key] for node_id, key in keys.items() if key is not None}
    drawn = random.Random(seed).sample(sorted(fresh), min(count, len(fresh)))  # noqa: S311 - a sample, no secret
    known = store.index.source_digests()
    sources = {Path(path): found for path, found in known.items()}
    for node_id in drawn:
        scratch = Path(tempfile.mkdtemp(prefix="verify-"))
        try:
            node = graph[node_id]
            task = make_task(node, codes[node.stage.name], sources, fresh, store, scratch)
            yield node_id, _difference(node_id, run_task(task), fresh[node_id])
        finally:
            shutil.rmtree(scratch, ignore_errors=True)


def _difference(node_id: NodeId, made: object, stored: Result) -> Finding | None:
    if isinstance(made, Trouble):
        return Finding(str(node_id), f"cannot be made again: {made.message}")
    outputs = getattr(made, "outputs", {})
    for table, output in stored.outputs.items():
        if outputs[table].content != output.content:
            return Finding(str(node_id), f"{table} comes out with other values")
        if outputs[table].digest != output.file.digest:
            return Finding(str(node_id), f"{table} comes out with the same values and other bytes")
    return None
