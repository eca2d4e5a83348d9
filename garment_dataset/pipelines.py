"""Pipeline files: which stages, for which recordings, with which knobs; and the graph they and the catalog make."""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, ValidationError

from garment_dataset.engine.graph import Graph, Node, NodeId, producers
from garment_dataset.errors import PipelineError
from garment_dataset.filters import compile_filter
from garment_dataset.stages import STAGES

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from garment_dataset.catalog import BackgroundSource, Catalog, CatalogRow
    from garment_dataset.engine.stage import Stage, StageParams


class Pipeline(BaseModel):
    """One file of ``pipelines/``.

    Parameters
    ----------
    name : str
        The file's name without ``.toml``.
    description : str
        What it is for.
    recordings : tuple of str
        Filter terms, as on the command line.
    stages : tuple of str
        Names of stages; those that feed them must be named too.
    params : mapping of str to mapping
        By stage, the parameters that differ from the defaults.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    description: str = ""
    recordings: tuple[str, ...] = ()
    stages: tuple[str, ...]
    params: dict[str, dict[str, Any]] = {}

    def resolved(self, stages: Mapping[str, Stage], path: Path) -> dict[str, StageParams]:
        """Return the parameters of every stage named here, defaults filled in.

        Raises
        ------
        PipelineError
            If a stage or parameter is unknown, a value does not fit, or a stage that feeds another is not named.
        """
        for name in (*self.stages, *self.params):
            if name not in stages:
                raise PipelineError(f"unknown stage {name!r}", where=path, expected=f"one of {sorted(stages)}")
        made = producers(stages.values())
        for name in self.stages:
            for table in stages[name].inputs:
                if made[table].name not in self.stages:
                    raise PipelineError(
                        f"stage {name!r} reads table {table!r}",
                        where=path,
                        found=list(self.stages),
                        hint=f"Add {made[table].name!r} to its stages.",
                    )
        return {name: _params(stages[name], self.params.get(name, {}), path) for name in self.stages}


def _params(stage: Stage, given: Mapping[str, Any], path: Path) -> StageParams:
    try:
        return stage.params.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(part) for part in first["loc"])
        known = ", ".join(stage.params.model_fields)
        expected = f"one of {known}" if first["type"] == "extra_forbidden" else first["msg"]
        raise PipelineError(
            f"[params.{stage.name}] {name}", where=path, expected=expected, found=first.get("input")
        ) from error


def load_pipelines(folder: Path) -> list[tuple[Path, Pipeline]]:
    """Read every ``*.toml`` of a folder, in the order of their names.

    Raises
    ------
    PipelineError
        If there is none, or one cannot be read.
    """
    pipelines = [(path, _load(path)) for path in sorted(folder.glob("*.toml"))]
    if not pipelines:
        raise PipelineError("no pipeline files", where=folder, expected="at least one NAME.toml")
    return pipelines


def _load(path: Path) -> Pipeline:
    try:
        return Pipeline.model_validate({"name": path.stem, **tomllib.loads(path.read_text("utf-8"))})
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise PipelineError("cannot be read as TOML", where=path, found=error) from error
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(part) for part in first["loc"])
        raise PipelineError(f"{name!r}: {first['msg']}", where=path, found=first.get("input")) from error


class GraphBuilder:
    """Makes the graph of a catalog and its pipelines.

    Parameters
    ----------
    catalog : Catalog
        Which recordings there are, and where.
    pipelines : sequence of (Path, Pipeline)
        As :func:`load_pipelines` returns them.
    stages : iterable of Stage
        All that can be named.
    """

    def __init__(
        self, catalog: Catalog, pipelines: Sequence[tuple[Path, Pipeline]], stages: Iterable[Stage] = STAGES
    ) -> None:
        self._catalog = catalog
        self._stages = {stage.name: stage for stage in stages}
        self._made = producers(self._stages.values())
        self._pipelines = [(path, pipeline, pipeline.resolved(self._stages, path)) for path, pipeline in pipelines]
        self._nodes: dict[NodeId, Node] = {}

    @property
    def stages(self) -> list[Stage]:
        """The stages that some pipeline names, in the order of :data:`STAGES`."""
        named = {name for _, pipeline, _ in self._pipelines for name in pipeline.stages}
        return [stage for name, stage in self._stages.items() if name in named]

    def build(self, rows: Iterable[CatalogRow]) -> Graph:
        """Return the graph of all pipelines for these recordings.

        Raises
        ------
        PipelineError
            If two pipelines ask for one stage of one recording with different parameters.
        """
        self._nodes = {}
        matches = [
            (pipeline, params, compile_filter(pipeline.recordings, self._catalog.filter_keys))
            for _, pipeline, params in self._pipelines
        ]
        for row in rows:
            for pipeline, params, matches_row in matches:
                if matches_row(row):
                    for name in pipeline.stages:
                        self._add(self._stages[name], row, params, pipeline)
        return Graph(self._nodes.values())

    def _add(self, stage: Stage, row: CatalogRow, params: Mapping[str, StageParams], pipeline: Pipeline) -> NodeId:
        """Add a stage of a recording, with what feeds it; what its camera position shares is added once for all."""
        if stage.per == "background":
            return self._add_background(stage, self._catalog.background(row.topics_file), params, pipeline)
        return self._add_bag(stage, row.recording, row.path, params, pipeline, topics_file=row.topics_file)

    def _add_bag(
        self,
        stage: Stage,
        bag: str,
        path: Path | None,
        params: Mapping[str, StageParams],
        pipeline: Pipeline,
        *,
        topics_file: int,
    ) -> NodeId:
        """Add a stage of one bag: of a recording, or of an empty scene."""
        node_id = NodeId(stage.name, bag)
        if self._has(node_id, params[stage.name], pipeline):
            return node_id
        inputs: dict[str, NodeId] = {}
        for table in stage.inputs:
            maker = self._made[table]
            if maker.per == "background":
                inputs[table] = self._add_background(maker, self._catalog.background(topics_file), params, pipeline)
            else:
                inputs[table] = self._add_bag(maker, bag, path, params, pipeline, topics_file=topics_file)
        obstacles = (self._nodes[feeder].blocked for feeder in inputs.values())
        self._nodes[node_id] = Node(
            stage=stage,
            subject=bag,
            params=params[stage.name],
            sources={name: path for name in stage.arguments if name in stage.sources and path is not None},
            inputs=inputs,
            labels=self._catalog.labels(bag),
            partition="/".join(f"{key}={value}" for key, value in self._catalog.partition(bag).items()),
            blocked=next((obstacle for obstacle in obstacles if obstacle is not None), None),
        )
        return node_id

    def _add_background(
        self, stage: Stage, source: BackgroundSource, params: Mapping[str, StageParams], pipeline: Pipeline
    ) -> NodeId:
        """Add a stage of a camera position; the catalog says which bag shows its empty scene, and when."""
        node_id = NodeId(stage.name, f"position_{source.topics_file}")
        interval = {"from_s": source.from_s, "to_s": source.to_s}
        given = {name: value for name, value in interval.items() if value is not None}
        own = stage.params.model_validate({**params[stage.name].model_dump(), **given})
        if self._has(node_id, own, pipeline):
            return node_id
        inputs: dict[str, NodeId] = {}
        if source.path is not None:
            inputs = {
                table: self._add_bag(
                    self._made[table], source.source, source.path, params, pipeline, topics_file=source.topics_file
                )
                for table in stage.inputs
            }
        self._nodes[node_id] = Node(
            stage=stage,
            subject=node_id.subject,
            params=own,
            sources={
                name: source.path for name in stage.arguments if name in stage.sources and source.path is not None
            },
            inputs=inputs,
            labels=self._catalog.labels(source.source),
            blocked=None if source.path is not None else f"no background: {source.missing}",
        )
        return node_id

    def _has(self, node_id: NodeId, params: StageParams, pipeline: Pipeline) -> bool:
        """Say whether a node is there already, with these very parameters."""
        if node_id not in self._nodes:
            return False
        if self._nodes[node_id].params != params:
            raise PipelineError(
                f"two pipelines ask for stage {node_id.stage!r} of {node_id.subject} with different parameters",
                where=pipeline.name,
                hint="Let their `recordings` exclude each other, or give both the same [params].",
            )
        return True
