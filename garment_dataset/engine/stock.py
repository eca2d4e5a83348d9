"""What a run finds in the store, puts there, and learns not to trust."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.engine.events import Ending
from garment_dataset.engine.graph import NodeId
from garment_dataset.engine.tasks import take_over

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from garment_dataset.engine.graph import Node
    from garment_dataset.engine.results import Result
    from garment_dataset.engine.store import Store
    from garment_dataset.engine.worker import Task


class Stock:
    """The results of a store, as one run uses them.

    Parameters
    ----------
    store : Store
        Where they are.
    orphans : frozenset of tuple of str
        Published nodes that no graph has any more.

    Attributes
    ----------
    distrusted : set of str
        Keys of results with a file that turned out damaged, though size and time were as stored.
    """

    def __init__(self, store: Store, orphans: frozenset[tuple[str, ...]]) -> None:
        self._store = store
        self._orphans = orphans
        self._published = store.index.published()
        self._made: set[str] = set()
        self._lost: set[str] = set()
        self._by_body: dict[str, list[Result]] = {}
        for key in sorted(store.results):
            self._by_body.setdefault(store.results[key].body, []).append(store.results[key])
        self.distrusted: set[str] = set()

    def find(self, node: Node, key: str, *, forced: bool) -> tuple[Result, Ending] | None:
        """Return the result of a key if it is there, published, and how it got there; None when it has to be made.

        With ``forced``, only what was made in this run counts.

        Raises
        ------
        StorageError
            If it cannot be published.
        """
        found = self._store.results.get(key)
        if found is None or (forced and key not in self._made):
            return None
        is_trusted = key not in self.distrusted or key in self._made
        is_published = is_trusted and not forced and self._published.get(node.id) == key
        if is_published and self._store.holds(found) and self._store.is_published(found, node.variant):
            return found, Ending.FRESH
        if self._store.holds(found) or self._store.restore(found, node.variant):
            self._store.publish(found, node.variant)
            self._published[node.id] = key
            return found, Ending.LINKED
        return None

    def add(self, result: Result, node: Node) -> None:
        """Keep a result that was just made, and publish it.

        Raises
        ------
        StorageError
            If that cannot be written.
        """
        with self._store.index.transaction():
            self._store.remember(result)
            self._store.publish(result, node.variant)
        self._made.add(result.key)
        self._published[node.id] = result.key

    def with_donor(self, task: Task) -> Task:
        """Return a task that takes the tables of another subject, where there are some of the same body."""
        for donor in self._by_body.get(task.body, ()):
            if donor.key not in self.distrusted and donor.key != task.key and self._store.holds(donor):
                return take_over(task, donor, self._store)
        return task

    def withdraw_moved(self, done: Mapping[NodeId, Result]) -> None:
        """Take away what is published of subjects that are gone, and whose results go on under another name.

        A subject has moved when a result of it has the body of one that is done; then all of it goes that is done under
        the other name. The objects stay.
        """
        orphans = sorted(NodeId(*node) for node in self._orphans)
        bodies = {(node.stage, node.variant, result.body): node.subject for node, result in done.items()}
        moved: dict[tuple[str, str], str] = {}
        for node in orphans:
            result = self._store.results.get(self._published.get(node, ""))
            name = None if result is None else bodies.get((node.stage, node.variant, result.body))
            if name is not None:
                moved[node.subject, node.variant] = name
        for node in orphans:
            name = moved.get((node.subject, node.variant))
            if name is not None and node._replace(subject=name) in done:
                self._store.withdraw(node, self._store.results.get(self._published.pop(node, "")))

    def distrust(self, damaged: Path, feeders: Mapping[NodeId, Result]) -> NodeId | None:
        """Discard an object that turned out damaged.

        Returns
        -------
        NodeId or None
            Whose it was: that node has to be run again, if it is among ``feeders``. None when it is nobody's, or when
            this run has made it anew before: then the disk is failing.
        """
        for node_id, result in feeders.items():
            for table, output in result.outputs.items():
                stored = self._store.objects.path(output.file.digest)
                published = self._store.feature_path(table, result.partition, result.subject, node_id.variant)
                if damaged in {stored, published}:
                    return node_id if self._discard(result) else None
        for donors in self._by_body.values():
            for donor in donors:
                if damaged.stem in {output.file.digest for output in donor.outputs.values()} and self._discard(donor):
                    return NodeId(donor.stage, donor.subject, "")
        return None

    def _discard(self, result: Result) -> bool:
        """Discard the damaged objects of a result; say whether that was the first time."""
        for output in result.outputs.values():
            if not self._store.objects.is_what_it_says(output.file.digest):
                self._store.objects.discard(output.file.digest)
        if result.key in self._lost:
            return False
        self._lost.add(result.key)
        self._made.discard(result.key)
        self.distrusted.add(result.key)
        return True
