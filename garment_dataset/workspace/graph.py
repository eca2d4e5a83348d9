"""The graph that a catalog and its pipelines make: which stage is run for which recording, position or group."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from garment_dataset.catalog.filters import compile_filter
from garment_dataset.catalog.rows import ROW_KEYS, UNSPECIFIED
from garment_dataset.engine.graph import Graph, Node, NodeId
from garment_dataset.engine.table import Label
from garment_dataset.errors import PipelineError, StageError
from garment_dataset.stages import Group, Stage

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from garment_dataset.catalog import BackgroundSource, Catalog, CatalogRow
    from garment_dataset.workspace.pipelines import Pipeline

    LabelValues = Mapping[str, str | int | float | None]


@dataclass(frozen=True)
class Drawn:
    """A graph, and what a selection left out of it.

    Parameters
    ----------
    graph : Graph
        Of the recordings selected.
    partial_groups : tuple of NodeId
        Nodes that are not in it because some of their recordings are not.
    """

    graph: Graph
    partial_groups: tuple[NodeId, ...]


def draw_graph(catalog: Catalog, pipelines: Sequence[Pipeline], rows: Iterable[CatalogRow]) -> Drawn:
    """Return the graph of all pipelines for some recordings that have a bag.

    A group of recordings is in it when all of its recordings are.

    Raises
    ------
    PipelineError
        If two pipelines of one variant ask for one stage of one recording with different parameters, or by different
        stages for one table.
    """
    drawing = _Drawing(catalog)
    selected = list(rows)
    for pipeline in pipelines:
        matches = compile_filter(pipeline.file.recordings, ROW_KEYS)
        for row in filter(matches, selected):
            for stage in pipeline.stages:
                if not isinstance(stage.per, Group):
                    drawing.add(stage, row, pipeline)
    names = {row.recording for row in selected}
    for pipeline in pipelines:
        matches = compile_filter(pipeline.file.recordings, ROW_KEYS)
        members = [row for row in catalog.rows if row.path is not None and matches(row)]
        for stage in pipeline.stages:
            if isinstance(stage.per, Group):
                for group in groups_of(members, stage.per, stage.name):
                    if names.isdisjoint(group.recordings):
                        continue
                    drawing.add_group(stage, group, pipeline, is_whole=names.issuperset(group.recordings))
    return Drawn(Graph(drawing.nodes.values()), tuple(drawing.partial))


@dataclass(frozen=True)
class RecordingGroup:
    """Recordings that a stage takes together.

    Parameters
    ----------
    name : str
        Made of what they share: ``GreenTowel_Ruler_pi16_0.5_R_topics_file1``.
    by : tuple of str
        The columns in which they agree.
    rows : tuple of CatalogRow
        In alphabetical order of their names.
    """

    name: str
    by: tuple[str, ...]
    rows: tuple[CatalogRow, ...]

    @property
    def recordings(self) -> tuple[str, ...]:
        """Names of the recordings."""
        return tuple(row.recording for row in self.rows)

    @property
    def labels(self) -> LabelValues:
        """What stands in the identity columns; null where the recordings differ."""
        shared = {name: {getattr(row, name) for row in self.rows} for name in ("axis", "speed", "swing_rad")}
        values = {name: next(iter(found)) if len(found) == 1 else None for name, found in shared.items()}
        return {"group": self.name, **values}

    @property
    def partition(self) -> Mapping[str, str]:
        """The hive partition of its results."""
        parts = [row.partition for row in self.rows]
        shared = {name: {part[name] for part in parts} for name in parts[0]}
        return {name: next(iter(found)) if len(found) == 1 else UNSPECIFIED for name, found in shared.items()}


def groups_of(rows: Iterable[CatalogRow], group: Group, stage: str) -> list[RecordingGroup]:
    """Put rows together that agree in the columns of a group.

    Raises
    ------
    StageError
        If the catalog has no such column.
    """
    if unknown := [name for name in group.by if name not in ROW_KEYS]:
        raise StageError(
            f"groups by {unknown[0]!r}", where=stage, expected=f"columns of the catalog: {', '.join(ROW_KEYS)}"
        )
    found: dict[str, list[CatalogRow]] = {}
    for row in sorted(rows, key=lambda row: row.recording):
        name = "_".join(_word(row, column) for column in group.by) or "all"
        found.setdefault(name, []).append(row)
    return [RecordingGroup(name, group.by, tuple(members)) for name, members in found.items()]


def _word(row: CatalogRow, column: str) -> str:
    """Write a value of a row as it stands in names: ``pi16``, ``0.5``, ``R``; other numbers with what they are of."""
    value = getattr(row, column)
    if column == "garment":
        return row.partition["garment"]
    if value is None:
        return UNSPECIFIED
    if column == "swing_rad":
        return f"pi{round(math.pi / value)}"
    if isinstance(value, str):
        return "-".join(value.split("/"))
    return f"{value:g}" if column == "speed" else f"{column}{value:g}"


class _Drawing:
    """Nodes as they come, each once."""

    def __init__(self, catalog: Catalog) -> None:
        self._catalog = catalog
        self.nodes: dict[NodeId, Node] = {}
        self._tables: dict[tuple[str, str, str], NodeId] = {}
        self.partial: list[NodeId] = []
        self._drawn: set[tuple[NodeId, str]] = set()

    def _is_drawn(self, node_id: NodeId, pipeline: Pipeline) -> bool:
        """Say whether a pipeline has asked for a node before; from now on it has."""
        asked = (node_id, pipeline.name)
        if asked in self._drawn:
            return True
        self._drawn.add(asked)
        return False

    def add(self, stage: Stage, row: CatalogRow, pipeline: Pipeline) -> NodeId:
        """Add a stage of a recording, with what feeds it; what its camera position shares is added once for all."""
        if stage.per == "position":
            return self._add_position(stage, self._catalog.background(row.topics_file), pipeline)
        bag = _Bag(row.recording, row.path, row.topics_file, row.labels, row.partition)
        return self._add_bag(stage, bag, pipeline)

    def add_group(self, stage: Stage, group: RecordingGroup, pipeline: Pipeline, *, is_whole: bool) -> None:
        """Add a stage of a group, whose recordings' nodes are there already; only note it when some are not."""
        node_id = NodeId(stage.name, group.name, pipeline.file.variant)
        if not is_whole:
            self.partial.append(node_id)
            return
        makers = pipeline.makers
        members: dict[str, tuple[NodeId, ...]] = {}
        inputs: dict[str, NodeId] = {}
        for table in filter(makers.__contains__, stage.inputs):
            if makers[table].per == stage.per:
                inputs[table] = NodeId(makers[table].name, group.name, pipeline.file.variant)
            else:
                members[table] = tuple(
                    NodeId(makers[table].name, name, pipeline.file.variant) for name in group.recordings
                )
        self._put(
            Node(
                stage=stage,
                subject=group.name,
                params=pipeline.params[stage.name],
                inputs=inputs,
                gathers=members,
                labels=_labels(stage, group.labels),
                partition=_path(group.partition),
                variant=pipeline.file.variant,
            ),
            pipeline,
        )

    def _add_bag(self, stage: Stage, bag: _Bag, pipeline: Pipeline) -> NodeId:
        """Add a stage of one bag: of a recording, or of an empty scene."""
        node_id = NodeId(stage.name, bag.name, pipeline.file.variant)
        if self._is_drawn(node_id, pipeline):
            return node_id
        inputs: dict[str, NodeId] = {}
        makers = pipeline.makers
        for table in filter(makers.__contains__, stage.inputs):
            maker = makers[table]
            if maker.per == "position":
                inputs[table] = self._add_position(maker, self._catalog.background(bag.topics_file), pipeline)
            else:
                inputs[table] = self._add_bag(maker, bag, pipeline)
        obstacles = (self.nodes[feeder].blocked for feeder in inputs.values())
        return self._put(
            Node(
                stage=stage,
                subject=bag.name,
                params=pipeline.params[stage.name],
                sources=bag.sources(stage),
                inputs=inputs,
                labels=_labels(stage, bag.labels),
                partition=_path(bag.partition),
                variant=pipeline.file.variant,
                blocked=next((obstacle for obstacle in obstacles if obstacle is not None), None),
            ),
            pipeline,
        )

    def _add_position(self, stage: Stage, source: BackgroundSource, pipeline: Pipeline) -> NodeId:
        """Add a stage of a camera position; the catalog says which bag shows its empty scene, and when."""
        node_id = NodeId(stage.name, f"position_{source.topics_file}", pipeline.file.variant)
        if self._is_drawn(node_id, pipeline):
            return node_id
        interval = {"from_s": source.from_s, "to_s": source.to_s}
        given = {name: value for name, value in interval.items() if value is not None}
        params = pipeline.params[stage.name]
        bag = _Bag(source.source, source.path, source.topics_file, source.labels, source.partition)
        inputs: dict[str, NodeId] = {}
        if source.path is not None:
            makers = pipeline.makers
            inputs = {table: self._add_bag(makers[table], bag, pipeline) for table in stage.inputs if table in makers}
        return self._put(
            Node(
                stage=stage,
                subject=node_id.subject,
                params=stage.params.model_validate({**params.model_dump(), **given}) if given else params,
                sources=bag.sources(stage),
                inputs=inputs,
                labels=_labels(stage, bag.labels),
                variant=pipeline.file.variant,
                blocked=None if source.path is not None else f"no background: {source.missing}",
            ),
            pipeline,
        )

    def _put(self, node: Node, pipeline: Pipeline) -> NodeId:
        """Keep a node, unless it is there already; refuse one that contradicts what is there."""
        known = self.nodes.setdefault(node.id, node)
        if known is not node and (known.params, known.inputs) != (node.params, node.inputs):
            raise PipelineError(
                f"two pipelines ask for stage {node.id.stage!r} of {node.subject} with different parameters",
                where=pipeline.name,
                hint="Let their `recordings` exclude each other, give both the same [params], or one a `variant`.",
            )
        for output in node.stage.outputs:
            other = self._tables.setdefault((output.name, node.subject, node.variant), node.id)
            if other != node.id:
                raise PipelineError(
                    f"two pipelines make table {output.name!r} of {node.subject} by different stages",
                    where=pipeline.name,
                    found=f"{other.stage} and {node.id.stage}",
                    hint="Let their `recordings` exclude each other, or give one a `variant`.",
                )
        return node.id


@dataclass(frozen=True, slots=True)
class _Bag:
    """A bag that nodes read, and whose rows their tables hold."""

    name: str
    path: Path | None
    topics_file: int
    labels: LabelValues
    partition: Mapping[str, str]

    def sources(self, stage: Stage) -> dict[str, Path]:
        return {name: self.path for name in stage.arguments if name in stage.sources and self.path is not None}


def _labels(stage: Stage, values: LabelValues) -> tuple[Label, ...]:
    return tuple(Label(column, values[column.name]) for column in stage.identity)


def _path(partition: Mapping[str, str]) -> str:
    return "/".join(f"{key}={value}" for key, value in partition.items())
