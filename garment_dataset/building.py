"""Builds of a workspace: the catalog, the pipelines and the engine put together."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from garment_dataset.engine.code import CodeCache
from garment_dataset.engine.plan import State, make_plan
from garment_dataset.engine.store import Store
from garment_dataset.errors import FilterError
from garment_dataset.pipelines import GraphBuilder, load_pipelines

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import TracebackType
    from typing import Self

    from garment_dataset.catalog import Catalog, CatalogRow
    from garment_dataset.engine.code import Code
    from garment_dataset.engine.graph import Graph
    from garment_dataset.engine.plan import Plan
    from garment_dataset.engine.run import Event, Report
    from garment_dataset.engine.stage import Stage
    from garment_dataset.workspace import Workspace

PACKAGE = Path(__file__).parent


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
    workspace : Workspace
        Where.
    filters : sequence of str
        Which recordings; empty for all.
    stages : sequence of str
        Which stages, with what feeds them; empty for all.

    Raises
    ------
    FilterError
        If no recording matches the filters, or a stage is unknown.
    """

    def __init__(self, workspace: Workspace, filters: Sequence[str] = (), stages: Sequence[str] = ()) -> None:
        self.workspace = workspace
        self.catalog: Catalog = workspace.catalog()
        builder = GraphBuilder(self.catalog, load_pipelines(workspace.pipelines_dir))
        self.stages: list[Stage] = builder.stages
        self.selection = self._select(filters)
        graph = builder.build(self.selection.rows)
        self.graph = graph if not stages else self._restrict(graph, stages)
        self._code_cache = CodeCache(workspace.private_dir / "code", {PACKAGE.name: PACKAGE})
        self.codes: dict[str, Code] = self._code_cache.codes(self.stages)
        self.store = Store(workspace.private_dir, workspace.features_dir)

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

    def _restrict(self, graph: Graph, stages: Sequence[str]) -> Graph:
        known = [stage.name for stage in self.stages]
        for name in stages:
            if name not in known:
                raise FilterError(f"no stage {name!r}", expected=f"one of {known}")
        return graph.restricted_to(node.id for node in graph if node.stage.name in stages)

    def plan(self) -> Plan:
        """Decide about every node; nothing is run."""
        return make_plan(self.graph, self.codes, self.store)

    def forget_digests(self) -> None:
        """Have the content of every selected bag read anew, whatever size and time say."""
        self.store.index.forget_sources([str(path) for node in self.graph for path in node.sources.values()])

    def build(
        self,
        plan: Plan,
        *,
        jobs: int | None = None,
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
            there are recordings.
        retry_failed : bool
            Run again what failed before with the very same inputs.
        forced : bool
            Run everything, fresh or not.
        emit : callable
            Told of every node's ending as it happens.
        """
        from garment_dataset.engine.executors import Pool, local_executor, usable_cpus
        from garment_dataset.engine.run import Build, Options

        subjects = {decision.node.subject for decision in plan if forced or decision.state is not State.FRESH}
        workers = min(usable_cpus(), max(1, len(subjects))) if jobs is None else jobs
        build = Build(
            self.graph,
            plan,
            codes=self.codes,
            code_cache=self._code_cache,
            store=self.store,
            pool=Pool(lambda: local_executor(workers)),
            options=Options(slots=max(1, workers), retry_failed=retry_failed, forced=forced),
            emit=emit,
        )
        report = build.run()
        self._describe_tables(report)
        return report

    def _describe_tables(self, report: Report) -> None:
        """Write each table's schema beside its files, for readers that drop Arrow's metadata."""
        built = {node.stage for node in report.events}
        for output in (output for stage in self.stages if stage.name in built for output in stage.outputs):
            folder = self.workspace.features_dir / output.name
            if folder.is_dir():
                _write_if_changed(folder / "_schema.json", json.dumps(output.describe(), indent=2) + "\n")


def _write_if_changed(path: Path, text: str) -> None:
    if path.is_file() and path.read_text("utf-8") == text:
        return
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.write_text(text, "utf-8")
    temporary.replace(path)
