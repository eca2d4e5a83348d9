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
from garment_dataset.engine.sources import stat_source
from garment_dataset.engine.tasks import find_obstacle, make_task
from garment_dataset.engine.worker import Reading, Success, Task, Trouble, digest_task, run_task

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

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
        self._running: dict[Future[Any], tuple[Node, Task | Reading]] = {}
        self._twins: dict[str, list[Node]] = {}
        self._made: set[str] = set()
        self._troubles: dict[str, Trouble] = {}
        self._suspects: dict[NodeId, Node] = {}
        self._done: dict[NodeId, Result] = {}
        self.report = Report()
        self._take_fresh()
        self._waiting = {
            node.id: sum(feeder not in self._done for feeder in node.feeders)
            for node in self._nodes
            if node.id not in self._done
        }
        self._ready = [self._order[node_id] for node_id, count in self._waiting.items() if not count]

    def finish(self) -> Report:
        """Make everything that is not fresh, and say what became of every node."""
        self._scratch_dir.mkdir(parents=True)
        heapq.heapify(self._ready)
        try:
            while True:
                while (node := self._next()) is not None:
                    self._start(node)
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
        if self._options.forced:
            return
        for decision in self._plan:
            feeders = self._graph[decision.node].feeders
            if self._options.retry_failed and any(feeder not in self._done for feeder in feeders):
                continue
            if decision.state is State.FRESH and decision.key is not None:
                found = self._results[decision.key]
                self._done[decision.node] = found
                self.report.events[decision.node] = Event(decision.node, Ending.FRESH, notes=found.notes)

    def _next(self) -> Node | None:
        """Return what to start now; whoever ran when a worker died is tried again alone, to find the culprit."""
        if self._suspects:
            return None if self._running else next(iter(self._suspects.values()))
        if self._ready and len(self._running) < self._options.slots:
            return self._nodes[heapq.heappop(self._ready)]
        return None

    def _start(self, node: Node) -> None:
        """Bring a node as far as possible without work; submit what work it needs."""
        if (obstacle := find_obstacle(node, self._done, self.report)) is not None:
            self._end(Event(node.id, Ending.BLOCKED, message=obstacle))
            return
        for path in node.sources.values():
            stat = stat_source(path)
            if stat is None:
                self._end(Event(node.id, Ending.BLOCKED, message=f"{path} is not there"))
                return
            if self._digests.get(str(path), (None,))[0] != stat:
                self._submit(node, digest_task, Reading(path, stat))
                return
        sources = {path: self._digests[str(path)] for path in node.sources.values()}
        code = self._codes[node.stage.name]
        task = make_task(node, code, sources, self._done, self._store, self._scratch_dir)
        if not self._settled(node, task.key):
            self._submit(node, run_task, task)

    def _settled(self, node: Node, key: str) -> bool:
        """Deal with a node that needs no work: fresh, in the store already, or known to fail."""
        if key in self._troubles:
            self._fail(node, key, self._troubles[key])
            return True
        if self._options.forced and key not in self._made:
            return False
        found = self._results.get(key)
        is_published = not self._options.forced and self._published.get(node.id) == key
        if found is not None and is_published and self._store.is_published(found, node.variant):
            self._end(Event(node.id, Ending.FRESH, notes=found.notes), found)
            return True
        if found is not None and self._store.holds(found):
            self._store.publish(found, node.variant)
            self._end(Event(node.id, Ending.LINKED, notes=found.notes), found)
            return True
        failure = self._failures.get(node.id)
        if failure is not None and failure.key == key and not self._options.retry_failed:
            self._end(Event(node.id, Ending.FAILED, message=failure.message, is_repeated=True))
            return True
        return False

    def _submit(self, node: Node, function: Callable[[Any], Any], work: Task | Reading) -> None:
        """Hand over work; a node that needs the very same as another looks again when that is done."""
        if work.key in self._twins:
            self._twins[work.key].append(node)
            return
        try:
            future = self._pool.submit(function, work)
        except BrokenProcessPool:
            # a worker has died since the last look, before this node had any part in it
            self._restart_pool()
            self._look_again([node])
            return
        self._running[future] = node, work
        self._twins[work.key] = []

    def _look_again(self, nodes: Iterable[Node]) -> None:
        for node in nodes:
            if node.id not in self._suspects:
                heapq.heappush(self._ready, self._order[node.id])

    def _collect(self) -> None:
        """Wait for a task to end, and deal with all that have; with a death last, since it takes the others along."""
        finished, _ = wait(self._running, return_when=FIRST_COMPLETED)
        broken = {future for future in finished if isinstance(future.exception(), BrokenProcessPool)}
        for future in sorted(finished - broken, key=lambda future: self._order[self._running[future][0].id]):
            if future not in self._running:
                continue
            node, work = self._running.pop(future)
            twins = self._twins.pop(work.key)
            if isinstance(work, Task):
                self._finish(node, work, future.result())
            else:
                self._digested(node, work, future.result())
            self._look_again(twins)
        if not broken.isdisjoint(self._running):
            self._restart_pool()

    def _restart_pool(self) -> None:
        """Deal with a worker that died and took the pool with it: whoever ran alone is to blame, else each is tried."""
        interrupted = list(self._running.values())
        twins = [twin for waiting in self._twins.values() for twin in waiting]
        self._twins.clear()
        self._running.clear()
        self._pool.restart()
        if len(interrupted) == 1 and interrupted[0][0].id in self._suspects:
            node, work = interrupted[0]
            trouble = Trouble("WorkerDied", "its worker process died twice: killed, or out of memory")
            self._fail(node, work.key, trouble)
        else:
            self._suspects |= {node.id: node for node, _ in interrupted}
        self._look_again(twins)

    def _digested(self, node: Node, reading: Reading, found: str | Trouble) -> None:
        if isinstance(found, Trouble):
            self._fail(node, reading.key, found)
            return
        self._store.index.set_source_digest(*reading, found)
        self._digests[reading.key] = (reading.stat, found)
        self._start(node)

    def _finish(self, node: Node, task: Task, ended: Success | Trouble) -> None:
        if isinstance(ended, Success) and not self._code_cache.is_as_read(node.stage):
            message = "its code was edited during the build; nothing made of it was kept"
            for output in ended.outputs.values():
                output.path.unlink()
            ended = Trouble("CodeChanged", message, is_passing=True)
        if isinstance(ended, Trouble):
            self._fail(node, task.key, ended)
            return
        outputs = {
            table: StoredOutput(self._store.adopt(written.path, written.digest), written.content, written.rows)
            for table, written in ended.outputs.items()
        }
        result = Result(task.key, node.stage.name, node.subject, node.partition, outputs, task.facts, ended.notes)
        self._results[result.key] = result
        self._made.add(result.key)
        with self._store.index.transaction():
            self._store.index.add_result(result)
            self._store.publish(result, node.variant)
        self._end(Event(node.id, Ending.BUILT, ended.seconds, notes=ended.notes), result)

    def _fail(self, node: Node, key: str, trouble: Trouble) -> None:
        """End a node with a failure; it stands until the key changes, unless it is a passing one."""
        if not trouble.is_passing:
            self._troubles[key] = trouble
        before = self._failures.get(node.id)
        attempts = before.attempts + 1 if before is not None and before.key == key else 1
        known_by = "" if trouble.is_passing else key
        self._store.index.set_failure(
            Failure(*node.id, known_by, trouble.kind, trouble.message, trouble.traceback, attempts)
        )
        self._end(Event(node.id, Ending.FAILED, message=trouble.message))

    def _end(self, event: Event, result: Result | None = None) -> None:
        self.report.events[event.node] = event
        self._suspects.pop(event.node, None)
        if result is not None:
            self._done[event.node] = result
        for node_id in self._graph.downstream(event.node):
            if node_id in self._waiting:
                self._waiting[node_id] -= 1
                if not self._waiting[node_id]:
                    heapq.heappush(self._ready, self._order[node_id])
        self._emit(event)
