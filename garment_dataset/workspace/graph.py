"""The graph that a catalog and its pipelines make: which stage is run for which recording, position or group."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from garment_dataset.engine.graph import Graph, Node, NodeId
from garment_dataset.errors import FilterError, PipelineError, StageError
from garment_dataset.stages import Group, Stage
from garment_dataset.workspace.groups import groups_of
from garment_dataset.workspace.labels import Bag, labels_of, path_of, values_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from garment_dataset.catalog import BackgroundSource, Catalog, CatalogRow
    from garment_dataset.catalog.filters import Predicate
    from garment_dataset.engine.stage import StageParams
    from garment_dataset.workspace.groups import RecordingGroup
    from garment_dataset.workspace.pipelines import Pipeline


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
        If a pipeline's recordings name what is not in the catalog, or two pipelines of one variant ask for one stage
        of one recording with different parameters, for one group with different recordings, or by different stages
        for one table.
    StageError
        If a stage's groups cannot be made, or it would take frames of a garment for the empty scene.
    """
    drawing = _Drawing(catalog)
    selected = list(rows)
    wanted = [(pipeline, _matching(catalog, pipeline)) for pipeline in pipelines]
    for pipeline, matches in wanted:
        for row in filter(matches, selected):
            for stage in pipeline.stages:
                if not isinstance(stage.per, Group):
                    drawing.add(stage, row, pipeline)
    names = {row.recording for row in selected}
    for pipeline, matches in wanted:
        members = [row for row in catalog.rows if row.path is not None and matches(row)]
        for stage in pipeline.stages:
            if isinstance(stage.per, Group):
                for group in groups_of(members, stage.per, stage.name):
                    if names.isdisjoint(group.recordings):
                        continue
                    drawing.add_group(stage, group, pipeline, is_whole=names.issuperset(group.recordings))
    stages = [stage for pipeline in pipelines for stage in pipeline.stages]
    kept = (node for node in drawing.nodes.values() if not _can_be_spared(node, stages))
    return Drawn(Graph(kept), tuple(drawing.partial))


def _can_be_spared(node: Node, stages: Iterable[Stage]) -> bool:
    """Say whether a camera position has no empty scene to run a node on, and all that read it can do without."""
    if node.blocked is None or not isinstance(node.stage, Stage) or node.stage.per != "position":
        return False
    made = {output.name for output in node.stage.outputs}
    readers = [stage for stage in stages if made & {*stage.inputs}]
    return bool(readers) and all(made & {*stage.inputs} <= stage.optional for stage in readers)


def _matching(catalog: Catalog, pipeline: Pipeline) -> Predicate:
    """Return which recordings a pipeline is for; a word that the catalog does not know would leave them all out."""
    try:
        return catalog.matching(pipeline.file.recordings)
    except FilterError as error:
        raise PipelineError(
            error.what,
            where=f"{pipeline.name}.toml, recordings: {error.where}",
            expected=error.expected,
            found=error.found,
            hint=error.hint,
        ) from error


class _Drawing:
    """Nodes as they come, each once."""

    def __init__(self, catalog: Catalog) -> None:
        self._catalog = catalog
        self.nodes: dict[NodeId, Node] = {}
        self._tables: dict[tuple[str, str, str], NodeId] = {}
        self.partial: list[NodeId] = []
        self._drawn: set[tuple[NodeId, str]] = set()
        self._bags: dict[str, Bag] = {}
        self._backgrounds: dict[int, BackgroundSource] = {}

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
            return self._add_position(stage, self._background(row.topics_file), pipeline)
        bag = self._bags.get(row.recording)
        if bag is None:
            bag = Bag(row.recording, row.path, row.topics_file, values_of(row), path_of(row.partition))
            self._bags[row.recording] = bag
        return self._add_bag(stage, bag, pipeline)

    def _background(self, topics_file: int) -> BackgroundSource:
        if topics_file not in self._backgrounds:
            self._backgrounds[topics_file] = self._catalog.background(topics_file)
        return self._backgrounds[topics_file]

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
                labels=labels_of(stage, group.labels),
                partition=path_of(group.partition),
                variant=pipeline.file.variant,
            ),
            pipeline,
        )

    def _add_bag(self, stage: Stage, bag: Bag, pipeline: Pipeline) -> NodeId:
        """Add a stage of one bag: of a recording, or of an empty scene."""
        node_id = NodeId(stage.name, bag.name, pipeline.file.variant)
        if self._is_drawn(node_id, pipeline):
            return node_id
        inputs = self._add_feeders(stage, bag, self._background(bag.topics_file), pipeline)
        return self._put(
            Node(
                stage=stage,
                subject=bag.name,
                params=pipeline.params[stage.name],
                sources=bag.sources(stage),
                inputs=inputs,
                labels=bag.labels_for(stage),
                partition=bag.partition,
                variant=pipeline.file.variant,
                blocked=self._obstacle(inputs),
            ),
            pipeline,
        )

    def _add_position(self, stage: Stage, source: BackgroundSource, pipeline: Pipeline) -> NodeId:
        """Add a stage of a camera position; the catalog says which bag shows its empty scene, and when."""
        node_id = NodeId(stage.name, f"position_{source.topics_file}", pipeline.file.variant)
        if self._is_drawn(node_id, pipeline):
            return node_id
        topics_file = source.topics_file if source.row is None else source.row.topics_file
        labels = source.labels if source.row is None else values_of(source.row)
        bag = Bag(source.source, source.path, topics_file, labels, path_of(source.partition))
        inputs = {} if source.path is None else self._add_feeders(stage, bag, source, pipeline)
        return self._put(
            Node(
                stage=stage,
                subject=node_id.subject,
                params=_params_of_position(stage, source, pipeline),
                sources=bag.sources(stage),
                inputs=inputs,
                labels=bag.labels_for(stage),
                variant=pipeline.file.variant,
                blocked=f"no background: {source.missing}" if source.path is None else self._obstacle(inputs),
            ),
            pipeline,
        )

    def _add_feeders(self, stage: Stage, bag: Bag, source: BackgroundSource, pipeline: Pipeline) -> dict[str, NodeId]:
        """Add what feeds a stage of a bag, or of a camera position, and return it by table.

        A table that it can do without, and that cannot be had, is left out.
        """
        feeders = {
            table: self._add_position(maker, source, pipeline)
            if (maker := pipeline.makers[table]).per == "position"
            else self._add_bag(maker, bag, pipeline)
            for table in stage.inputs
            if table in pipeline.makers
        }
        return {
            table: feeder
            for table, feeder in feeders.items()
            if table not in stage.optional or self.nodes[feeder].blocked is None
        }

    def _obstacle(self, inputs: Mapping[str, NodeId]) -> str | None:
        found = (self.nodes[feeder].blocked for feeder in inputs.values())
        return next((obstacle for obstacle in found if obstacle is not None), None)

    def _put(self, node: Node, pipeline: Pipeline) -> NodeId:
        """Keep a node, unless it is there already; refuse one that contradicts what is there."""
        known = self.nodes.setdefault(node.id, node)
        if known is not node:
            self._put_beside(known, node, pipeline)
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

    def _put_beside(self, known: Node, node: Node, pipeline: Pipeline) -> None:
        """Compare a node with what another pipeline has made of it."""
        shared = {*known.inputs, *node.inputs} - ({*known.inputs} ^ {*node.inputs}) & node.stage.optional
        sides = {
            "parameters": (known.params, node.params),
            "inputs": tuple({table: each.inputs.get(table) for table in shared} for each in (known, node)),
            "recordings": (known.gathers, node.gathers),
        }
        if differing := [what for what, (old, new) in sides.items() if old != new]:
            raise PipelineError(
                f"two pipelines ask for stage {node.id.stage!r} of {node.subject} with different {differing[0]}",
                where=pipeline.name,
                hint="Let their `recordings` exclude each other, give both the same, or one a `variant`.",
            )
        if known.inputs != node.inputs:  # each pipeline has some of the tables that the stage can do without
            self.nodes[node.id] = replace(known, inputs={**known.inputs, **node.inputs})


def _params_of_position(stage: Stage, source: BackgroundSource, pipeline: Pipeline) -> StageParams:
    """Return the parameters of a stage of a camera position, with the interval that the catalog gives.

    A stage that reads tables of camera positions alone needs none: they are of the empty scene.
    """
    params = pipeline.params[stage.name]
    interval = {"from_s": source.from_s, "to_s": source.to_s}
    given = {name: value for name, value in interval.items() if value is not None}
    known = {name: value for name, value in given.items() if name in stage.params.model_fields}
    of_recordings = {table for table, maker in pipeline.makers.items() if maker.per == "recording"}
    of_bags = [name for name in stage.arguments if name in stage.sources | of_recordings]
    if known != given and of_bags:
        raise StageError(
            f"the empty scene of topics file {source.topics_file} is an interval of {source.source}",
            where=stage.name,
            expected="parameters from_s and to_s, as `background` has them",
            found=f"{', '.join(of_bags)}, of the whole bag",
        )
    return stage.params.model_validate({**params.model_dump(), **known}) if known else params
