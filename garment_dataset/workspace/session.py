"""A workspace opened for planning and building: catalog, pipelines and engine put together."""

from __future__ import annotations

import os
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from garment_dataset.catalog import Catalog
from garment_dataset.engine.code import CodeCache
from garment_dataset.engine.graph import NodeId
from garment_dataset.engine.plan import State, make_plan
from garment_dataset.engine.store import Store
from garment_dataset.errors import FilterError, MissingExtraError, UsageError, did_you_mean, one_of
from garment_dataset.workspace.graph import draw_graph
from garment_dataset.workspace.known_stages import KnownStages
from garment_dataset.workspace.pipelines import load_pipelines
from garment_dataset.workspace.user_cache import user_cache_dir

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from types import TracebackType
    from typing import Self

    from garment_dataset.catalog import CatalogRow
    from garment_dataset.engine.code import Code
    from garment_dataset.engine.events import Event, Report
    from garment_dataset.engine.executors import Pool
    from garment_dataset.engine.graph import Graph
    from garment_dataset.engine.plan import Plan
    from garment_dataset.layout import Layout
    from garment_dataset.stages import Stage


@dataclass(frozen=True)
class Selection:
    """What a command is about.

    Parameters
    ----------
    rows : tuple of CatalogRow
        The recordings that match, and have a bag.
    absent : tuple of CatalogRow
        Those that match and have none.
    """

    rows: tuple[CatalogRow, ...]
    absent: tuple[CatalogRow, ...]


class Session:
    """A workspace opened for planning and building.

    Parameters
    ----------
    layout : Layout
        Where.
    filters : sequence of str
        Which recordings; empty for all.
    stages : sequence of str
        Which stages, with what feeds them; empty for all.

    Raises
    ------
    FilterError
        If no recording matches the filters.
    UsageError
        If a stage is unknown.
    """

    def __init__(self, layout: Layout, filters: Sequence[str] = (), stages: Sequence[str] = ()) -> None:
        self.layout = layout
        self._filters = tuple(filters)
        self._stage_names = tuple(stages)
        self._subject = ""
        self._planned: Plan | None = None
        self._read()
        self.store = Store(layout.private_dir, layout.features_dir)

    def _read(self) -> None:
        """Read everything that a person edits."""
        layout = self.layout
        self.catalog = Catalog.of(layout)
        known = KnownStages.of(layout)
        self.pipelines = load_pipelines(layout.pipelines_dir, known, self.catalog.filter_keys)
        named = {stage.name: stage for pipeline in self.pipelines for stage in pipeline.stages}
        self.stages: list[Stage] = [named[name] for name in known.names if name in named]
        self.selection = self._select(self._filters)
        drawn = draw_graph(self.catalog, self.pipelines, self.selection.rows)
        self.graph = drawn.graph if not self._stage_names else self._restrict(drawn.graph, self._stage_names)
        if self._subject:
            self.graph = self.graph.restricted_to(node.id for node in self.graph if node.subject == self._subject)
        self.partial_groups = [
            node_id for node_id in drawn.partial_groups if not self._stage_names or node_id.stage in self._stage_names
        ]
        self._roots = known.roots()
        shared_dir = user_cache_dir()
        self._code_cache = CodeCache(
            layout.private_dir / "code", self._roots, None if shared_dir is None else shared_dir / "code"
        )
        for name in ("codes", "_whole_graph"):
            self.__dict__.pop(name, None)

    def reload(self, *, everything: bool) -> None:
        """Read the index anew if another process has written it; and, on demand, all that a person edits."""
        if everything:
            self._read()
        elif self.store.is_current:
            return
        self._planned = None
        self.store.close()
        self.store = Store(self.layout.private_dir, self.layout.features_dir)

    @classmethod
    def about(cls, layout: Layout, name: str, stages: Sequence[str] = ()) -> Self:
        """Open a workspace for one recording, or for another subject of a node: a group, or a camera position.

        Raises
        ------
        FilterError
            If there is nothing of that name; the hint gives the nearest.
        """
        try:
            return cls(layout, [name], stages)
        except FilterError as error:
            session = cls(layout, (), stages)
            wanted = [node.id for node in session.graph if node.subject == name]
            if not wanted:
                session.store.close()
                names = [row.recording for row in session.catalog.rows] + [node.subject for node in session.graph]
                if hint := did_you_mean(name, names):
                    raise FilterError(error.what, found=error.found, hint=hint) from error
                raise
            session.graph = session.graph.restricted_to(wanted)
            session._subject = name
            return session

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.store.close()

    def _select(self, filters: Sequence[str]) -> Selection:
        rows = self.catalog.some(filters)
        present = tuple(row for row in rows if row.path is not None)
        return Selection(present, tuple(row for row in rows if row.path is None))

    def _restrict(self, graph: Graph, stages: Iterable[str]) -> Graph:
        known = [stage.name for stage in self.stages]
        for name in stages:
            if name not in known:
                raise UsageError(f"no stage {name!r}", expected=one_of(known), hint=did_you_mean(name, known))
        return graph.restricted_to(node.id for node in graph if node.stage.name in stages)

    @cached_property
    def codes(self) -> dict[str, Code]:
        """The code of every stage that a pipeline names."""
        return self._code_cache.codes(self.stages)

    def plan(self) -> Plan:
        """Decide about every node; nothing is run."""
        self._planned = make_plan(self.graph, self.codes, self.store)
        return self._planned

    def forget_digests(self) -> None:
        """Have the content of every selected bag read anew, whatever size and time say."""
        self._planned = None
        self.store.index.forget_sources([str(path) for node in self.graph for path in node.sources.values()])

    def act(
        self,
        *,
        jobs: int | None = None,
        scheduler: str | None = None,
        retry_failed: bool = False,
        forced: bool = False,
        is_planned: bool = False,
        emit: Callable[[Event], None] = lambda _: None,
        begin: Callable[[NodeId], None] = lambda _: None,
    ) -> Report:
        """Act on a plan, under the lock: see :func:`garment_dataset.workspace.building.build`.

        With ``is_planned`` on the one that was made last, unless the workspace was read anew since.
        """
        from garment_dataset.engine.options import Options
        from garment_dataset.engine.run import Run

        plan = (self._planned if is_planned else None) or self.plan()
        self._planned = None
        subjects = {decision.node.subject for decision in plan if forced or decision.state is not State.FRESH}
        self.store.prepare()
        with self._workers(jobs, scheduler, len(subjects)) as (pool, slots):
            return Run(
                self.graph,
                plan,
                codes=self.codes,
                code_cache=self._code_cache,
                store=self.store,
                pool=pool,
                options=Options(
                    slots,
                    retry_failed,
                    forced,
                    frozenset(self.orphans()),
                    # the workers of a cluster have memories of their own
                    ahead=slots if scheduler is None else 0,
                ),
                emit=emit,
                begin=begin,
            ).finish()

    @contextmanager
    def _workers(self, jobs: int | None, scheduler: str | None, subjects: int) -> Iterator[tuple[Pool, int]]:
        """Yield where tasks run, and how many at a time."""
        from garment_dataset.engine.executors import Pool, local_executor, usable_cpus

        if scheduler is None:
            workers = min(usable_cpus(), max(1, subjects)) if jobs is None else jobs
            yield Pool(lambda: local_executor(workers)), max(1, workers)
            return
        try:
            from garment_dataset.engine.cluster import open_cluster
        except ImportError as error:
            raise MissingExtraError("a cluster needs Dask", hint="pip install 'garment-dataset[dask]'") from error
        homes = frozenset(stage.home for stage in self.stages if stage.home is not None)
        libraries = {name: version for code in self.codes.values() for name, version in code.libraries.items()}
        with open_cluster(
            scheduler, roots=self._roots, homes=homes, libraries=libraries, shared_dir=self.store.scratch_dir
        ) as (executor, workers):
            yield Pool(lambda: executor), jobs or workers

    @cached_property
    def _whole_graph(self) -> Graph:
        """The graph of all recordings that have a bag, and all stages."""
        rows = tuple(row for row in self.catalog.rows if row.path is not None)
        is_whole = self.selection.rows == rows and not self._stage_names and not self._subject
        return self.graph if is_whole else draw_graph(self.catalog, self.pipelines, rows).graph

    def orphans(self) -> list[NodeId]:
        """Return the published nodes that nothing asks for any more.

        None where there is no bag at all: then the folder of recordings is elsewhere for now.
        """
        published = (NodeId(*node) for node in self.store.index.published())
        gone = [node_id for node_id in published if node_id not in self.graph]
        if not gone or not len(self._whole_graph):
            return []
        return [node_id for node_id in gone if node_id not in self._whole_graph]

    def orphaned_files(self) -> dict[Path, str]:
        """Return the Parquet files in the features folder that nothing asks for any more, with why; sorted."""
        if not len(self._whole_graph):
            return {}
        # text, not Path: every build looks at all files
        wanted = {
            self.store.feature_name(output.name, node.partition, node.subject, node.variant)
            for node in self._whole_graph
            for output in node.stage.outputs
        }
        found = [Path(name) for name in _files_below(str(self.layout.features_dir)) if name not in wanted]
        return {path: self._why_orphaned(path) for path in sorted(found)}

    def _why_orphaned(self, path: Path) -> str:
        parts = path.relative_to(self.layout.features_dir).parts
        variant = parts[0].removeprefix("variant=") if parts[0].startswith("variant=") else ""
        table = parts[1 if variant else 0]
        asked = [pipeline for pipeline in self.pipelines if pipeline.file.variant == variant]
        if not asked:
            return f"no pipeline has the variant {variant!r}"
        if all(output.name != table for pipeline in asked for stage in pipeline.stages for output in stage.outputs):
            return "no pipeline makes this table"
        if any(node.subject == path.stem for node in self._whole_graph):
            return "nothing makes it there any more"
        return "no recording, group or camera position of this name has a bag"


def _files_below(folder: str) -> Iterator[str]:
    """Yield the Parquet files in a folder and those below it, what is hidden left out."""
    try:
        with os.scandir(folder) as entries:
            seen = [entry for entry in entries if not entry.name.startswith((".", "_"))]
    except OSError:
        return
    for entry in seen:
        if entry.is_dir():
            yield from _files_below(entry.path)
        elif entry.name.endswith(".parquet"):
            yield entry.path
