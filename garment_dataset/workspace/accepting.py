"""Declare a change of code equivalent: results keep their values under the key of the new code, and say so."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.plan import State

if TYPE_CHECKING:
    from garment_dataset.engine.plan import Decision
    from garment_dataset.workspace.session import Session

_EQUIVALENT = frozenset({"code", "library"})


def acceptable(session: Session, stages: tuple[str, ...] = ()) -> list[Decision]:
    """Return the decisions about what is stale for nothing but its code or a library's version.

    Parameters
    ----------
    session : Session
        What it is about.
    stages : tuple of str
        Which stages; empty for all.
    """
    return [
        decision
        for decision in session.plan()
        if decision.state is State.STALE
        and decision.key is not None
        and {reason.kind for reason in decision.reasons} <= _EQUIVALENT
        and (not stages or decision.node.stage in stages)
    ]


def accept(session: Session, decision: Decision, because: str) -> None:
    """Give a published result the key that is wanted now; the caller has the lock.

    Its files are written anew, since they carry the key; the rows are the same. The footer keeps every acceptance:
    which code made the values, under which key, and why that was said to be the same.

    Raises
    ------
    StorageError
        If what is published is damaged, or cannot be written.
    """
    from garment_dataset.engine.artifacts import read_labelled, read_provenance, write_artifact
    from garment_dataset.engine.facts import body_digest
    from garment_dataset.engine.objects import file_digest, sync

    store, node = session.store, session.graph[decision.node]
    old = store.results[store.index.published()[decision.node]]
    facts = decision.facts or {}
    outputs = {}
    for table, output in old.outputs.items():
        path = store.table_path(old, table, node.variant)
        footer: dict[str, Any] = read_provenance(path)
        entry = {"code": footer["facts"]["code"], "key": old.key, "because": because}
        footer |= {"key": decision.key, "facts": facts, "body": body_digest(facts)}
        footer["accepted"] = [*footer.get("accepted", []), entry]
        store.scratch_dir.mkdir(parents=True, exist_ok=True)
        scratch = store.scratch_dir / f"accepted-{table}.parquet"
        write_artifact(read_labelled(path, output.file.digest), scratch, footer)
        sync([scratch])
        file, _ = store.objects.take_in(scratch, file_digest(scratch))
        outputs[table] = output._replace(file=file)
    accepted = replace(old, key=str(decision.key), outputs=outputs, facts=facts, body=body_digest(facts))
    store.remember(accepted)
    store.publish(accepted, node.variant)
