"""The graph of a build: nodes, what feeds them, and their order."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from garment_dataset.engine.errors import StageError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from garment_dataset.engine.stage import Stage, StageParams
    from garment_dataset.engine.table import Label


class NodeId(NamedTuple):
    """A stage, the subject that it is run for, and in which variant; the usual one has no name."""

    stage: str
    subject: str
    variant: str = ""

    def __str__(self) -> str:
        variant = f"@{self.variant}" if self.variant else ""
        return f"{self.stage}:{self.subject}{variant}"


@dataclass(frozen=True)
class Node:
    """One run of one stage.

    Parameters
    ----------
    stage : Stage
        What is run.
    subject : str
        What the run covers.
    params : StageParams
        Resolved parameters.
    sources : mapping of str to Path
        External inputs by argument name.
    inputs : mapping of str to NodeId
        For an input table of one subject, the node that makes it.
    gathers : mapping of str to tuple of NodeId
        For an input table of several subjects, the nodes that make it, one a subject, in order. One that cannot be had
        is left out, and the result says so; when none can, this node is blocked.
    labels : tuple of Label
        What the result's identity columns say.
    partition : str
        Where under a table's folder the result is published.
    variant : str
        Set of results that it belongs to: results that differ in parameters alone may stand side by side.
    blocked : str or None
        Why it cannot be run at all, and what to provide.

    Attributes
    ----------
    id : NodeId
        Stage, subject and variant.
    feeders : tuple of NodeId
        All nodes whose tables it reads, each once.
    """

    stage: Stage
    subject: str
    params: StageParams
    sources: Mapping[str, Path] = field(default_factory=dict)
    inputs: Mapping[str, NodeId] = field(default_factory=dict)
    gathers: Mapping[str, tuple[NodeId, ...]] = field(default_factory=dict)
    labels: tuple[Label, ...] = ()
    partition: str = ""
    variant: str = ""
    blocked: str | None = None
    id: NodeId = field(init=False, repr=False, compare=False)
    feeders: tuple[NodeId, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        gathered = (feeder for feeders in self.gathers.values() for feeder in feeders)
        object.__setattr__(self, "id", NodeId(self.stage.name, self.subject, self.variant))
        object.__setattr__(self, "feeders", tuple(dict.fromkeys((*self.inputs.values(), *gathered))))

    @property
    def empty_groups(self) -> tuple[str, ...]:
        """What is lacking of tables that it gathers, where no subject has them."""
        return tuple(f"{table} of any subject" for table, members in self.gathers.items() if not members)


class Graph:
    """Nodes in an order in which every node comes after those that feed it.

    Subjects keep the order they were given in, and so do the stages of one subject as far as their inputs allow: the
    stages of one subject stand together, so that they run while its pages are in memory.

    Raises
    ------
    StageError
        If an input is made by no node, two nodes are the same, or nodes feed each other in a circle.
    """

    def __init__(self, nodes: Iterable[Node]) -> None:
        given: dict[NodeId, Node] = {}
        for node in nodes:
            if node.id in given:
                raise StageError("two nodes of one name", where=node.id)
            for table, members in node.gathers.items():
                if len({feeder.subject for feeder in members}) < len(members):
                    raise StageError(f"gathers {table!r} of one subject twice", where=node.id)
            given[node.id] = node
        self._nodes: dict[NodeId, Node] = {}
        for node in given.values():
            self._place(node, given, ())
        self._readers: dict[NodeId, list[NodeId]] = {node_id: [] for node_id in self._nodes}
        for node in self:
            for feeder in node.feeders:
                self._readers[feeder].append(node.id)

    def _place(self, node: Node, given: Mapping[NodeId, Node], above: tuple[NodeId, ...]) -> None:
        if node.id in self._nodes:
            return
        if node.id in above:
            circle = " -> ".join(str(item) for item in (*above[above.index(node.id) :], node.id))
            raise StageError("stages feed each other in a circle", found=circle)
        for feeder in node.feeders:
            if feeder not in given:
                raise StageError("one of its inputs is made by no node", where=node.id, found=feeder)
            self._place(given[feeder], given, (*above, node.id))
        self._nodes[node.id] = node

    def __iter__(self) -> Iterator[Node]:
        return iter(self._nodes.values())

    def __len__(self) -> int:
        return len(self._nodes)

    def __getitem__(self, node_id: NodeId) -> Node:
        return self._nodes[node_id]

    def __contains__(self, node_id: object) -> bool:
        return node_id in self._nodes

    def downstream(self, node_id: NodeId) -> list[NodeId]:
        """Return the nodes that read this one's tables, in order."""
        return self._readers[node_id]

    def restricted_to(self, wanted: Iterable[NodeId]) -> Graph:
        """Return the graph of ``wanted`` and everything that feeds them."""
        keep: set[NodeId] = set()
        stack = list(wanted)
        while stack:
            node_id = stack.pop()
            if node_id not in keep:
                keep.add(node_id)
                stack.extend(self[node_id].feeders)
        return Graph(node for node in self if node.id in keep)


def producers(stages: Iterable[Stage]) -> dict[str, Stage]:
    """Return which stage makes each table.

    Raises
    ------
    StageError
        If two stages make one table, or an input is made by none.
    """
    made: dict[str, Stage] = {}
    known = list(stages)
    for stage in known:
        for output in stage.outputs:
            if output.name in made:
                makers = f"{made[output.name].name} and {stage.name}"
                raise StageError(f"table {output.name!r} is made by two stages", found=makers)
            made[output.name] = stage
    for stage in known:
        for table in stage.inputs:
            if table not in made and table not in stage.optional:
                raise StageError(
                    f"argument {table!r} is no table of any stage",
                    where=stage.name,
                    expected=f"one of {sorted(made)}, a source ({sorted(stage.sources)}) or 'params'",
                    hint="Rename the argument, or add a stage that makes the table.",
                )
    return made
