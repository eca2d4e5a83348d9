"""Act on a plan: run what is to be run, publish what is made, keep going when a subject fails."""

from __future__ import annotations

import heapq
import shutil
import uuid
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.events import Ending, Event, Report
from garment_dataset.engine.index import Failure, Result, StoredOutput
from garment_dataset.engine.plan import State
from garment_dataset.engine.sources import SourceStat, stat_source
from garment_dataset.engine.tasks import make_task
from garment_dataset.engine.worker import Success, Task, Trouble, digest_task, run_task

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from garment_dataset.engine.code import Code, CodeCache
    from garment_dataset.engine.executors import Pool
    from garment_dataset.engine.graph import Graph, Node, NodeId
    from garment_dataset.engine.plan import Plan
    from garment_dataset.engine.store import Store


@dataclass(frozen=True)
class Options:
    """How a graph is run.

    Parameters
    ----------
    slots : int
        Number of tasks to keep running.
    retry_failed : bool
        Run again what failed before with the very same inputs.
    forced : bool
        Run everything, fresh or not.
    """

    slots: int = 1
    retry_failed: bool = False
    forced: bool = False


class Run:
    """One run over a graph. This process alone writes the index and publishes.

    Parameters
    ----------
    graph, plan : Graph, Plan
        What is to be made, and what was decided about it.
    codes : mapping of str to Code
        The code of each stage by name.
    code_cache : CodeCache
        Asked once more before a result is published: code edited meanwhile must not be credited with it.
    store : Store
        Where results go.
    pool : Pool
        Where tasks run.
    options : Options
        See there.
    emit : callable
        Told of every node's ending as it happens.
    """

    def __init__(
        self,
        graph: Graph,
        plan: Plan,
        *,
        codes: Mapping[str, Code],
        code_cache: CodeCache,
        store: Store,
        pool: Pool,
        options: Options,
        emit: Callable[[Event], None],
    ) -> None:
        self._graph = graph
        self._plan = plan
        self._codes = codes
        self._code_cache = code_cache
        self._store = store
        self._pool = pool
        self._options = options
        self._emit = emit
        self._scratch_dir = store.scratch_dir / uuid.uuid4().hex
        self._results = store.index.results()
        self._published = store.index.published()
        self._failures = store.index.failures()
        self._digests = store.index.source_digests()
        self._nodes = list(graph)
        self._order = {node.id: number for number, node in enumerate(self._nodes)}
        self._running: dict[Future[Any], tuple[Node, Task | tuple[Path, SourceStat]]] = {}
        self._suspects: list[Node] = []
        self._died: set[NodeId] = set()
        self._done: dict[NodeId, Result] = {}
        self.report = Report()
        self._twins: dict[str, list[Node]] = {}
        self._take_fresh()
        open_nodes = {node.id for node in self._nodes if node.id not in self._done}
        self._waiting = {
            node.id: sum(feeder not in self._done and feeder in open_nodes for feeder in node.feeders)
            for node in self._nodes
            if node.id in open_nodes
        }
        self._ready = [self._order[node_id] for node_id, count in self._waiting.items() if not count]

    def finish(self) -> Report:
        """Make everything that is not fresh, and say what became of every node."""
        self._scratch_dir.mkdir(parents=True)
        heapq.heapify(self._ready)
        try:
            while True:
                self._fill()
                if not self._running:
                    return self.report
                self._collect()
        finally:
            self._pool.close()
            shutil.rmtree(self._scratch_dir, ignore_errors=True)

    def _take_fresh(self) -> None:
        """Count what the plan found fresh as done: it costs nothing more.

        A node that gathers what failed before is looked at again once that was tried again.
        """
        for decision in self._plan:
            if self._options.retry_failed and any(
                feeder not in self._done for feeder in self._graph[decision.node].feeders
            ):
                continue
            if decision.state is State.FRESH and decision.key is not None and not self._options.forced:
                found = self._results[decision.key]
                self._done[decision.node] = found
                self.report.events[decision.node] = Event(decision.node, Ending.FRESH, notes=found.notes)

    def _fill(self) -> None:
        """Start tasks. Those that were running when a worker died are tried again one by one, to find the culprit."""
        while self._suspects and not self._running:
            self._start(self._suspects.pop())
        while self._ready and not self._suspects and len(self._running) < self._options.slots:
            self._start(self._nodes[heapq.heappop(self._ready)])

    def _start(self, node: Node) -> None:
        """Bring a node as far as possible without work; submit what work it needs."""
        if (obstacle := self._obstacle(node)) is not None:
            self._end(Event(node.id, Ending.BLOCKED, message=obstacle))
            return
        for path in node.sources.values():
            stat = stat_source(path)
            if stat is None:
                self._end(Event(node.id, Ending.BLOCKED, message=f"{path} is not there"))
                return
            if self._digests.get(str(path), (None,))[0] != stat:
                self._running[self._pool.submit(digest_task, path, stat)] = (node, (path, stat))
                return
        sources = {name: (path, *self._digests[str(path)]) for name, path in node.sources.items()}
        code = self._codes[node.stage.name]
        task = make_task(node, code, sources, self._done, self._store.object_path, self._scratch_dir)
        if self._settled(node, task):
            return
        if task.key in self._twins:
            self._twins[task.key].append(node)
            return
        self._twins[task.key] = []
        self._running[self._pool.submit(run_task, task)] = (node, task)

    def _obstacle(self, node: Node) -> str | None:
        if node.blocked is not None:
            return node.blocked
        lacking = next((feeder for feeder in node.inputs.values() if feeder not in self._done), None)
        for members in node.gathers.values():
            if not any(feeder in self._done for feeder in members):
                lacking = lacking or members[0]
        return None if lacking is None else f"{lacking} {self.report.events[lacking].ending}"

    def _settled(self, node: Node, task: Task) -> bool:
        """Deal with a node that needs no work: fresh, in the store already, or known to fail."""
        if self._options.forced:
            return False
        found = self._results.get(task.key)
        if (
            found is not None
            and self._published.get(node.id) == task.key
            and self._store.is_published(found, node.variant)
        ):
            self._end(Event(node.id, Ending.FRESH, notes=found.notes), found)
            return True
        if found is not None and self._store.holds(found):
            self._store.publish(found, node.variant)
            self._end(Event(node.id, Ending.LINKED, notes=found.notes), found)
            return True
        failure = self._failures.get(node.id)
        if failure is not None and failure.key == task.key and not self._options.retry_failed:
            self._end(Event(node.id, Ending.FAILED, message=failure.message, is_repeated=True))
            return True
        return False

    def _collect(self) -> None:
        """Wait for a task to end, and deal with all that have."""
        finished, _ = wait(self._running, return_when=FIRST_COMPLETED)
        for future in sorted(finished, key=lambda future: self._order[self._running[future][0].id]):
            if isinstance(future.exception(), BrokenProcessPool):
                self._restart_pool()
                return
            node, work = self._running.pop(future)
            if isinstance(work, Task):
                self._finish(node, work, future.result())
                for twin in self._twins.pop(work.key):
                    heapq.heappush(self._ready, self._order[twin.id])
            else:
                self._digested(node, *work, future.result())

    def _restart_pool(self) -> None:
        """Deal with a worker that died and took the pool with it: whoever ran alone is to blame, else each is tried."""
        interrupted = [node for node, _ in self._running.values()]
        tasks = [work for _, work in self._running.values()]
        twins = [twin for waiting in self._twins.values() for twin in waiting]
        self._twins.clear()
        self._running.clear()
        self._pool.restart()
        for twin in twins:
            heapq.heappush(self._ready, self._order[twin.id])
        if len(interrupted) == 1 and interrupted[0].id in self._died:
            message = "its worker process died twice: killed, or out of memory"
            key = tasks[0].key if isinstance(tasks[0], Task) else ""
            self._fail(interrupted[0], key, Trouble("WorkerDied", message, ""))
            return
        self._died.update(node.id for node in interrupted)
        self._suspects += interrupted[::-1]

    def _digested(self, node: Node, path: Path, stat: SourceStat, found: str | Trouble) -> None:
        if isinstance(found, Trouble):
            self._fail(node, "", found)
            return
        self._store.index.set_source_digest(path, stat, found)
        self._digests[str(path)] = (stat, found)
        self._start(node)

    def _finish(self, node: Node, task: Task, ended: Success | Trouble) -> None:
        if isinstance(ended, Success) and not self._code_cache.is_as_read(node.stage):
            message = "its code was edited during the build; nothing made of it was kept"
            for output in ended.outputs.values():
                output.path.unlink()
            ended = Trouble("CodeChanged", message, "")
        if isinstance(ended, Trouble):
            self._fail(node, task.key, ended)
            return
        outputs = {
            table: StoredOutput(self._store.adopt(written.path, written.digest), written.content, written.rows)
            for table, written in ended.outputs.items()
        }
        result = Result(task.key, node.stage.name, node.subject, node.partition, outputs, task.facts, ended.notes)
        self._results[result.key] = result
        with self._store.index.transaction():
            self._store.index.add_result(result)
            self._store.publish(result, node.variant)
        self._end(Event(node.id, Ending.BUILT, ended.seconds, notes=ended.notes), result)

    def _fail(self, node: Node, key: str, trouble: Trouble) -> None:
        before = self._failures.get(node.id)
        attempts = before.attempts + 1 if before is not None and before.key == key else 1
        self._store.index.set_failure(
            Failure(*node.id, key, trouble.kind, trouble.message, trouble.traceback, attempts)
        )
        self._end(Event(node.id, Ending.FAILED, message=trouble.message))

    def _end(self, event: Event, result: Result | None = None) -> None:
        self.report.events[event.node] = event
        if result is not None:
            self._done[event.node] = result
        for node_id in self._graph.downstream(event.node):
            if node_id in self._waiting:
                self._waiting[node_id] -= 1
                if not self._waiting[node_id]:
                    heapq.heappush(self._ready, self._order[node_id])
        self._emit(event)
