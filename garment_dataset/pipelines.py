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

    from garment_dataset.catalog import Catalog, CatalogRow
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
        node_id = NodeId(stage.name, row.recording)
        if node_id in self._nodes:
            if self._nodes[node_id].params != params[stage.name]:
                raise PipelineError(
                    f"two pipelines ask for stage {stage.name!r} of {row.recording} with different parameters",
                    where=pipeline.name,
                    hint="Let their `recordings` exclude each other, or give both the same [params].",
                )
            return node_id
        inputs = {table: self._add(self._made[table], row, params, pipeline) for table in stage.inputs}
        self._nodes[node_id] = Node(
            stage=stage,
            subject=row.recording,
            params=params[stage.name],
            sources={name: row.path for name in stage.arguments if name in stage.sources and row.path is not None},
            inputs=inputs,
            labels=self._catalog.labels(row.recording),
            partition="/".join(f"{key}={value}" for key, value in self._catalog.partition(row.recording).items()),
        )
        return node_id
