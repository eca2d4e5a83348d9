"""Act on a plan: run what is to be run, publish what is made, keep going when a subject fails."""

from __future__ import annotations

import contextlib
import uuid
from concurrent.futures.process import BrokenProcessPool
from typing import TYPE_CHECKING, Any

from garment_dataset.engine.ahead import ReadAhead
from garment_dataset.engine.errands import Errand, Errands
from garment_dataset.engine.errors import StorageError
from garment_dataset.engine.events import Ending, Event, Report
from garment_dataset.engine.loaded import refresh_bytecode
from garment_dataset.engine.plan import State
from garment_dataset.engine.results import Failure, Result, StoredOutput
from garment_dataset.engine.schedule import Schedule
from garment_dataset.engine.sources import stat_source
from garment_dataset.engine.stock import Stock
from garment_dataset.engine.tasks import find_obstacle, make_task
from garment_dataset.engine.worker import Reading, Success, Task, Trouble, digest_task, run_task

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from garment_dataset.engine.code import Code, CodeCache
    from garment_dataset.engine.executors import Pool
    from garment_dataset.engine.graph import Graph, Node, NodeId
    from garment_dataset.engine.options import Options
    from garment_dataset.engine.plan import Plan
    from garment_dataset.engine.store import Store


_READ_AT_ONCE_BYTES = 1 << 16  # a source of no more is read sooner than it is handed to a worker


class Run:
    """One run over a graph. This process alone writes the index and publishes, and it holds the lock.

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
    begin : callable
        Told of every node that work is handed over for.
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
        begin: Callable[[NodeId], None] = lambda _: None,
    ) -> None:
        self._graph = graph
        self._plan = plan
        self._codes = codes
        self._code_cache = code_cache
        self._store = store
        self._stock = Stock(store, options.orphans)
        self._errands = Errands(pool)
        self._options = options
        self._emit = emit
        self._begin = begin
        self._scratch_dir = store.scratch_dir / uuid.uuid4().hex
        self._failures = store.index.failures()
        self._digests = store.index.source_digests()
        self._troubles: dict[str, Trouble] = {}
        self._suspects: dict[NodeId, Node] = {}
        self._done: dict[NodeId, Result] = {}
        self.report = Report()
        self._take_fresh()
        self._schedule = Schedule(graph, self._done)
        to_read = (path for node in graph if node.id not in self._done for path in node.sources.values())
        self._ahead = ReadAhead(to_read, options.ahead)

    def finish(self) -> Report:
        """Make everything that is not fresh, and say what became of every node.

        Raises
        ------
        StorageError
            If there is no place to work in.
        """
        self._store.prepare()
        refresh_bytecode(sorted({file for code in self._codes.values() for file in code.files}))
        try:
            self._scratch_dir.mkdir(parents=True)
        except OSError as error:
            raise StorageError("no scratch space", where=self._scratch_dir, found=error.strerror or error) from error
        try:
            while True:
                while (node := self._next()) is not None:
                    self._start(node)
                if not self._errands:
                    self._errands.close()
                    self._stock.withdraw_moved(self._done)
                    return self.report
                self._collect()
        except BaseException:
            self._errands.kill()
            raise
        finally:
            self._ahead.close()
            with contextlib.suppress(StorageError):
                self._store.clear_scratch()

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
                found = self._store.results[decision.key]
                self._done[decision.node] = found
                self.report.events[decision.node] = Event(decision.node, Ending.FRESH, notes=found.notes)

    def _next(self) -> Node | None:
        """Return what to start now; whoever ran when a worker died is tried again alone, to find the culprit."""
        if self._suspects:
            return None if self._errands else next(iter(self._suspects.values()))
        return self._schedule.take() if self._errands.at_work < self._options.slots else None

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
                reading = Reading(path, stat)
                if stat.size_bytes <= _READ_AT_ONCE_BYTES:
                    self._digested(node, reading, digest_task(reading))
                else:
                    self._submit(node, digest_task, reading)
                return
        sources = {path: self._digests[str(path)] for path in node.sources.values()}
        task = make_task(node, self._codes[node.stage.name], sources, self._done, self._store, self._scratch_dir)
        try:
            if self._is_settled(node, task.key):
                return
        except StorageError as error:
            self._fail(node, task.key, Trouble(type(error).__name__, str(error), is_passing=True))
            return
        self._submit(node, run_task, task if self._options.forced else self._stock.with_donor(task))

    def _is_settled(self, node: Node, key: str) -> bool:
        """Deal with a node that needs no work: fresh, in the store already, or known to fail."""
        if key in self._troubles:
            self._fail(node, key, self._troubles[key])
            return True
        if (found := self._stock.find(node, key, forced=self._options.forced)) is not None:
            result, ending = found
            self._end(Event(node.id, ending, notes=result.notes), result)
            return True
        if self._options.forced:
            return False
        failure = self._failures.get(node.id)
        if failure is not None and failure.key == key and not self._options.retry_failed:
            self._end(Event(node.id, Ending.FAILED, message=failure.message, is_repeated=True))
            return True
        return False

    def _submit(self, node: Node, function: Callable[[Any], Any], work: Task | Reading) -> None:
        """Hand over work; a node that needs the very same as another looks again when that is done."""
        if self._errands.wait_for_twin(node, work.key):
            return
        try:
            self._begin(node.id)
            for path in node.sources.values():
                self._ahead.came_to(path)
            self._errands.hand_over(Errand(node, work), function)
        except BrokenProcessPool:
            # a worker has died since the last look, before this node had any part in it
            self._restart_pool()
            self._look_again(node)

    def _look_again(self, *nodes: Node) -> None:
        for node in nodes:
            if node.id not in self._suspects:
                self._schedule.put_back(node.id)

    def _collect(self) -> None:
        """Wait for a task to end, and deal with all that have; with a death last, since it takes the others along."""
        back = self._errands.collect()
        for (node, work), outcome, twins in sorted(back, key=lambda each: self._schedule.order(each.errand.node)):
            if isinstance(work, Task):
                assert not isinstance(outcome, str)
                self._finish(node, work, outcome)
            else:
                assert not isinstance(outcome, Success)
                self._digested(node, work, outcome)
            self._look_again(*twins)
        if self._errands.has_death:
            self._restart_pool()

    def _restart_pool(self) -> None:
        """Deal with a worker that died and took the pool with it: whoever ran alone is to blame, else each is tried."""
        interrupted, twins = self._errands.give_up()
        if len(interrupted) == 1 and interrupted[0].node.id in self._suspects:
            node, work = interrupted[0]
            self._fail(node, work.key, Trouble("WorkerDied", "its worker died twice: killed, or out of memory"))
        else:
            self._suspects |= {node.id: node for node, _ in interrupted}
        self._look_again(*twins)

    def _digested(self, node: Node, reading: Reading, found: str | Trouble) -> None:
        if isinstance(found, Trouble):
            self._fail(node, reading.key, found)
            return
        with contextlib.suppress(StorageError):  # then it is read once more, next time
            self._store.index.set_source_digest(*reading, found)
        self._digests[reading.key] = (reading.stat, found)
        self._start(node)

    def _finish(self, node: Node, task: Task, ended: Success | Trouble) -> None:
        """Store and publish what a task made, unless something is wrong with it."""
        if isinstance(ended, Success) and not self._code_cache.is_as_read(node.stage):
            message = "its code was edited during the build; nothing made of it was kept"
            for written in ended.outputs.values():
                written.path.unlink(missing_ok=True)
            ended = Trouble("CodeChanged", message, is_passing=True)
        if isinstance(ended, Success):
            try:
                self._keep(node, task, ended)
            except StorageError as error:
                ended = Trouble(type(error).__name__, str(error), is_passing=True)
        if isinstance(ended, Trouble) and not self._is_healed(node, ended):
            self._fail(node, task.key, ended)

    def _keep(self, node: Node, task: Task, made: Success) -> None:
        outputs, replaced = {}, False
        for table, written in made.outputs.items():
            file, was_damaged = self._store.objects.take_in(written.path, written.digest)
            outputs[table] = StoredOutput(file, written.content, written.rows, written.labelled)
            replaced |= was_damaged
        result = Result(
            task.key, node.stage.name, node.subject, node.partition, outputs, task.facts, made.notes, task.body
        )
        self._stock.add(result, node)
        message = "replaces what was damaged in the store" if replaced or task.key in self._stock.distrusted else ""
        ending = Ending.BUILT
        if task.donor:
            ending, message = Ending.RELABELLED, f"from {task.donor_subject}"
        event = Event(node.id, ending, made.seconds, message=message, notes=made.notes, counts=made.counts)
        self._end(event, result)

    def _is_healed(self, node: Node, trouble: Trouble) -> bool:
        """Have a stored table that turned out damaged made anew, and then the node that was to read it."""
        if trouble.damaged is None:
            return False
        feeder = self._stock.distrust(
            trouble.damaged, {each: self._done[each] for each in node.feeders if each in self._done}
        )
        if feeder is None:
            return False
        if feeder in self._done:
            del self._done[feeder]
            self.report.events.pop(feeder, None)
            self._schedule.put_back(feeder)
        self._suspects.pop(node.id, None)
        self._schedule.put_back(node.id)
        return True

    def _fail(self, node: Node, key: str, trouble: Trouble) -> None:
        """End a node with a failure; it stands until the key changes, unless it is a passing one."""
        if not trouble.is_passing:
            self._troubles[key] = trouble
        before = self._failures.get(node.id)
        attempts = before.attempts + 1 if before is not None and before.key == key else 1
        known_by = "" if trouble.is_passing else key
        with contextlib.suppress(StorageError):  # a full disk: what is said now has to do
            said = trouble.kind, trouble.message, trouble.traceback
            self._store.index.set_failure(Failure(*node.id, known_by, *said, attempts))
        self._end(Event(node.id, Ending.FAILED, message=trouble.message))

    def _end(self, event: Event, result: Result | None = None) -> None:
        self.report.events[event.node] = event
        self._suspects.pop(event.node, None)
        if result is not None:
            self._done[event.node] = result
        self._schedule.end(event.node)
        self._emit(event)
