"""A workspace opened for planning and building: catalog, pipelines and engine put together."""

from __future__ import annotations

import difflib
import json
import os
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from garment_dataset.catalog import Catalog
from garment_dataset.engine.code import CodeCache
from garment_dataset.engine.plan import State, make_plan
from garment_dataset.engine.store import Store
from garment_dataset.errors import FilterError, MissingExtraError, UsageError
from garment_dataset.workspace.graph import draw_graph
from garment_dataset.workspace.known_stages import KnownStages
from garment_dataset.workspace.pipelines import load_pipelines

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from pathlib import Path
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
        self.catalog = Catalog.load(layout.catalog_dir).with_folder(layout.recordings_dir)
        known = KnownStages.of(layout)
        self.pipelines = load_pipelines(layout.pipelines_dir, known)
        named = {stage.name: stage for pipeline in self.pipelines for stage in pipeline.stages}
        self.stages: list[Stage] = [named[name] for name in known.names if name in named]
        self.selection = self._select(filters)
        drawn = draw_graph(self.catalog, self.pipelines, self.selection.rows)
        self.graph = drawn.graph if not stages else self._restrict(drawn.graph, stages)
        self.partial_groups = drawn.partial_groups
        self._roots = known.roots()
        self.store = Store(layout.private_dir, layout.features_dir)

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
                if nearest := difflib.get_close_matches(name, names, n=1):
                    raise FilterError(error.what, found=error.found, hint=f"Did you mean {nearest[0]}?") from error
                raise
            session.graph = session.graph.restricted_to(wanted)
            return session

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.store.close()

    def _select(self, filters: Sequence[str]) -> Selection:
        rows = self.catalog.select(filters)
        if filters and not rows:
            raise FilterError("no recording matches", found=" ".join(filters), hint="`garment list` shows them all.")
        present = tuple(row for row in rows if row.path is not None)
        return Selection(present, tuple(row for row in rows if row.path is None))

    def _restrict(self, graph: Graph, stages: Iterable[str]) -> Graph:
        known = [stage.name for stage in self.stages]
        for name in stages:
            if name not in known:
                nearest = difflib.get_close_matches(name, known, n=1)
                hint = f"Did you mean {nearest[0]!r}?" if nearest else None
                raise UsageError(f"no stage {name!r}", expected=f"one of {known}", hint=hint)
        return graph.restricted_to(node.id for node in graph if node.stage.name in stages)

    @cached_property
    def _code_cache(self) -> CodeCache:
        return CodeCache(self.layout.private_dir / "code", self._roots)

    @cached_property
    def codes(self) -> dict[str, Code]:
        """The code of every stage that a pipeline names."""
        return self._code_cache.codes(self.stages)

    def plan(self) -> Plan:
        """Decide about every node; nothing is run."""
        return make_plan(self.graph, self.codes, self.store)

    def forget_digests(self) -> None:
        """Have the content of every selected bag read anew, whatever size and time say."""
        self.store.index.forget_sources([str(path) for node in self.graph for path in node.sources.values()])

    def run(
        self,
        plan: Plan,
        *,
        jobs: int | None = None,
        scheduler: str | None = None,
        retry_failed: bool = False,
        forced: bool = False,
        emit: Callable[[Event], None] = lambda _: None,
    ) -> Report:
        """Act on a plan.

        Parameters
        ----------
        plan : Plan
            As :meth:`plan` returned it.
        jobs : int, optional
            Worker processes; 0 runs everything in this process. By default one per usable processor, and no more than
            there are recordings. On a cluster, the number of tasks at a time; by default one per worker.
        scheduler : str, optional
            Address of a Dask scheduler, on whose workers everything is run.
        retry_failed : bool
            Run again what failed before with the very same inputs.
        forced : bool
            Run everything, fresh or not.
        emit : callable
            Told of every node's ending as it happens.
        """
        from garment_dataset.engine.run import Options, Run

        subjects = {decision.node.subject for decision in plan if forced or decision.state is not State.FRESH}
        with self._workers(jobs, scheduler, len(subjects)) as (pool, slots):
            report = Run(
                self.graph,
                plan,
                codes=self.codes,
                code_cache=self._code_cache,
                store=self.store,
                pool=pool,
                options=Options(slots=slots, retry_failed=retry_failed, forced=forced),
                emit=emit,
            ).finish()
        self._describe_tables(report)
        return report

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

    def _describe_tables(self, report: Report) -> None:
        """Write each table's schema beside its files, for readers that drop Arrow's metadata."""
        built = {(node.stage, node.variant) for node in report.events}
        for pipeline in self.pipelines:
            for stage in pipeline.stages:
                if (stage.name, pipeline.file.variant) not in built:
                    continue
                for output in stage.outputs:
                    folder = self.store.folder(pipeline.file.variant) / output.name
                    if folder.is_dir():
                        described = output.describe(stage.identity, stage.partitions)
                        _write_if_changed(folder / "_schema.json", json.dumps(described, indent=2) + "\n")


def _write_if_changed(path: Path, text: str) -> None:
    if path.is_file() and path.read_text("utf-8") == text:
        return
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.write_text(text, "utf-8")
    temporary.replace(path)
