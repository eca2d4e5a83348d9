"""Which node comes next: those whose feeders have ended, in the graph's order; a node may have to be done again."""

from __future__ import annotations

import heapq
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Container

    from garment_dataset.engine.graph import Graph, Node, NodeId


class Schedule:
    """The nodes of a graph that have not ended.

    Parameters
    ----------
    graph : Graph
        All nodes.
    done : container of NodeId
        Those that have ended already.
    """

    def __init__(self, graph: Graph, done: Container[NodeId]) -> None:
        self._graph = graph
        self._nodes = list(graph)
        self._order = {node.id: number for number, node in enumerate(self._nodes)}
        self._open = {node.id for node in self._nodes if node.id not in done}
        self._taken: set[NodeId] = set()
        self._ready = [self._order[node_id] for node_id in self._open if self._is_ready(node_id)]
        heapq.heapify(self._ready)

    def order(self, node: Node) -> int:
        """Return where a node stands in the graph."""
        return self._order[node.id]

    def take(self) -> Node | None:
        """Return the first node that is ready, and that nobody has taken; None when there is none."""
        while self._ready:
            node = self._nodes[heapq.heappop(self._ready)]
            if node.id in self._open and node.id not in self._taken and self._is_ready(node.id):
                self._taken.add(node.id)
                return node
        return None

    def put_back(self, node_id: NodeId) -> None:
        """Have a node that was taken, or had ended, taken again once it is ready."""
        self._open.add(node_id)
        self._taken.discard(node_id)
        heapq.heappush(self._ready, self._order[node_id])

    def end(self, node_id: NodeId) -> None:
        """Count a node as ended; whoever waits for it alone is ready."""
        self._open.discard(node_id)
        self._taken.discard(node_id)
        for reader in self._graph.downstream(node_id):
            if reader in self._open and self._is_ready(reader):
                heapq.heappush(self._ready, self._order[reader])

    def _is_ready(self, node_id: NodeId) -> bool:
        return self._open.isdisjoint(self._graph[node_id].feeders)
