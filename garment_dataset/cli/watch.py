"""``garment watch``: build recordings as their bags become final. It polls: network disks tell nobody of changes."""

from __future__ import annotations

import contextlib
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from garment_dataset.cli.output import FiltersArgument, WorkspaceOption, say
from garment_dataset.errors import GarmentError, UsageError, printable

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence

    from garment_dataset.catalog.folder import FolderScan
    from garment_dataset.engine.events import Report
    from garment_dataset.workspace import Workspace
    from garment_dataset.workspace.session import Session
    from garment_dataset.workspace.watching import Batch, Needs, Outcome

_LONGEST_S = 86_400.0
_BUILD = "all builds"
_UNFINISHED = ("empty", "unindexed", "cut")
"""Kinds of conditions that a bag may be in while somebody writes or copies it."""


def watch(
    filters: FiltersArgument = None,
    settle_s: Annotated[
        float, typer.Option("--settle-s", metavar="S", help="How long a bag has to stand still before it is built.")
    ] = 5.0,
    poll_s: Annotated[float, typer.Option("--poll-s", metavar="S", help="How often the folder is looked at.")] = 2.0,
    once: Annotated[bool, typer.Option("--once", help="Build what is final, and stop.")] = False,
    jobs: Annotated[int | None, typer.Option("--jobs", "-j", min=0, help="As for `garment build`.")] = None,
    workspace: WorkspaceOption = None,
) -> None:
    """Watch the folder of bags, and build each recording when its bag is final, until Ctrl-C."""
    from garment_dataset import interrupts
    from garment_dataset.workspace import Workspace

    _refuse_seconds("--settle-s", settle_s, least_s=0.0)
    _refuse_seconds("--poll-s", poll_s, least_s=0.1)
    warnings.showwarning = _shown_once(warnings.showwarning)
    watcher = _Watcher(Workspace.find(workspace), filters or (), settle_s, jobs)
    watcher.check()
    if once:
        watcher.run_once(settle_s)
        if watcher.has_failed:
            raise typer.Exit(1)
        return
    with interrupts.stopping_well("stopped watching"):
        say(
            f"watching {watcher.place.recordings_dir}: bags are built {settle_s:g} s after they are final; Ctrl-C stops"
        )
        while True:
            watcher.look()
            time.sleep(poll_s)


def _refuse_seconds(option: str, value_s: float, *, least_s: float) -> None:
    if not least_s <= value_s <= _LONGEST_S:  # nor nan, which is neither more nor less
        expected = f"{least_s:g} to {_LONGEST_S:g} seconds"
        raise UsageError(f"no time for {option}", expected=expected, found=f"{value_s:g}")


def _shown_once(show: Callable[..., None]) -> Callable[..., None]:
    """Return what shows each warning once: every look at the folder gives the same ones."""
    seen: set[str] = set()

    def show_new(message: Warning | str, *rest: object, **more: object) -> None:
        if str(message) not in seen:
            seen.add(str(message))
            show(message, *rest, **more)

    return show_new


class _Watcher:
    """Looks at a folder, tells the state machine, builds what it says, and prints a line for each news."""

    def __init__(self, place: Workspace, filters: Sequence[str], settle_s: float, jobs: int | None) -> None:
        from garment_dataset.workspace.watching import Watching

        self.place = place
        self.has_failed = False
        self._filters = tuple(filters)
        self._jobs = jobs
        self._known = Watching(settle_s)
        self._paths: dict[str, Path] = {}
        self._said: dict[str, str] = {}
        self._said_once: set[str] = set()
        self._is_open = False

    def check(self) -> None:
        """Refuse what no build could begin with; say which filters find nothing yet."""
        with self._session() as session:
            session.catalog.matching(self._filters)
            if self._filters and (why := session.catalog.why_nothing(self._filters)):
                say(f"garment: {why}")

    def run_once(self, settle_s: float) -> None:
        """Look twice, and build what did not change in between."""
        self._see()
        if self._paths:
            time.sleep(settle_s)
        self._see()
        self._build()

    def look(self) -> None:
        """Look once; a catalog or pipeline that somebody is at work on is said once, and waited for."""
        try:
            self._see()
            self._build()
        except GarmentError as error:
            if error.exit_code != UsageError.exit_code:
                raise  # nothing can be written, and no bag will change that
            self._say("failed", _BUILD, str(error))
        else:
            self._said.pop(_BUILD, None)

    def _see(self) -> None:
        """Look at the folder and into the bags that have settled."""
        from garment_dataset.catalog.folder import scan
        from garment_dataset.catalog.schemes import scheme_of

        found = scan(self.place.recordings_dir, scheme_of(self.place))
        paths = {str(bag.name): bag.path for bag in found.bags}
        states = {name: state for name, path in paths.items() if (state := _state_of(path)) is not None}
        self._paths = {name: paths[name] for name in states}
        there = {*states, *map(str, found.unfinished), _BUILD}
        self._said = {key: line for key, line in self._said.items() if key in there}
        self._say_others(found)
        seen = self._known.see(time.monotonic(), states)
        for name in seen.changed:
            self._say("still written", name)
        self._known.judge({name: self._judge(name) for name in seen.settled})
        self._is_open = self._is_open or bool(seen.settled)

    def _judge(self, name: str) -> bool:
        """Say what keeps a bag that has settled from being final; return whether nothing does."""
        from garment_dataset.bags.condition import look
        from garment_dataset.catalog.names import BackgroundName
        from garment_dataset.catalog.schemes import scheme_of

        if (condition := look(self._paths[name])) is None:
            if isinstance(scheme_of(self.place).parse(name), BackgroundName):
                self._say("final", name, "an empty scene")
            return True
        if condition.kind in _UNFINISHED:
            self._say("still written", name, f"{condition.text}. If nobody is at work on it: {condition.hint}")
        else:
            self._fail(name, f"{condition.text}. {condition.hint}")
        return False

    def _build(self) -> None:
        """Build what has become final, all of it together."""
        if not self._is_open:
            return
        with self._session() as session:
            needs = self._needs(session)
        batch = self._known.due(needs)
        for name, others in self._known.held(needs).items():
            self._say("waiting", name, f"for {' and '.join(others)}, not final")
        if batch.due:
            outcomes = self._run(batch)
            self._known.built(batch, needs, [name for name, outcome in outcomes.items() if outcome.word == "failed"])
        self._is_open = False

    def _needs(self, session: Session) -> Needs:
        """Return what is wanted and what that needs; say once which names are in no table."""
        from garment_dataset.workspace.watching import needs_of

        matches = session.catalog.matching(self._filters)
        rows = [row for row in session.selection.rows if matches(row)]
        for row in rows:
            if row.state == "unexpected" and row.recording in self._paths:
                self._say_once("unknown", row.recording, "not in recordings.csv; it is built all the same")
        return needs_of(session.graph, [row.recording for row in rows], {p: name for name, p in self._paths.items()})

    def _run(self, batch: Batch) -> dict[str, Outcome]:
        """Build a batch as `garment build` does, and say what became of it."""
        from garment_dataset.workspace import building
        from garment_dataset.workspace.watching import idle_report, outcome_of

        with self._session([*batch.due, *batch.along]) as session:
            # a look every minute, by cron, is not to fill the log with builds that did nothing
            if (report := idle_report(session.plan(), session.graph)) is None:
                say(f"building {len(batch.due)} of {len(batch.due) + len(batch.along)} recordings that are final")
                report = building.build(session, jobs=self._jobs, tell=lambda text: say(f"garment: {text}"))
            outcomes = {name: outcome_of(report, session.graph, name) for name in batch.due}
        self._say_outcomes(report, outcomes)
        return outcomes

    def _say_outcomes(self, report: Report, outcomes: Mapping[str, Outcome]) -> None:
        """Say what became of the recordings that were due, with what is known to be wrong with those that are built."""
        from garment_dataset.cli.saying import QUALITY_STAGE
        from garment_dataset.engine.events import Ending

        judged = [event for event in report.events.values() if event.node.stage == QUALITY_STAGE]
        verdicts = {event.node.subject: event.notes for event in judged}
        for name, outcome in outcomes.items():
            if outcome.word == "failed":
                self._fail(name, outcome.text)
            elif outcome.word != "fresh":
                took = f" in {outcome.seconds:.2f} s" if outcome.word == "built" else ""
                self._say(outcome.word, name, "; ".join([outcome.text + took, *verdicts.get(name, ())]))
        if fresh := [name for name, outcome in outcomes.items() if outcome.word == "fresh"]:
            _print("fresh", fresh[0] if len(fresh) == 1 else f"{len(fresh)} recordings", "")
        for event in report.of(Ending.FAILED):
            # what failed of several recordings together is said of none of them
            if not any(outcome.text.startswith(f"{event.node}: ") for outcome in outcomes.values()):
                self._fail(str(event.node), event.message)

    def _say_others(self, found: FolderScan) -> None:
        """Say which bags of the folder are not built under the names that they have."""
        for path in found.unfinished:
            self._say("still written", self._shown(path), key=str(path))
        for path, error in found.refused:
            self._say_once("left out", self._shown(path), f"{error.what} (`garment lint`)")
        for each in found.duplicates:
            self._say_once("left out", self._shown(each.bag.path), f"{self._shown(each.used.path)} is the one used")

    def _shown(self, path: Path) -> str:
        return str(path.relative_to(self.place.recordings_dir))

    def _fail(self, name: str, text: str) -> None:
        self.has_failed = True
        self._say("failed", name, text)

    def _say(self, word: str, name: str, text: str = "", *, key: str | None = None) -> None:
        """Print a line, unless it was the last one on the same."""
        if self._said.get(key or name) != f"{word} {text}":
            self._said[key or name] = f"{word} {text}"
            _print(word, name, text)

    def _say_once(self, word: str, name: str, text: str) -> None:
        if name not in self._said_once:
            self._said_once.add(name)
            _print(word, name, text)

    @contextlib.contextmanager
    def _session(self, names: Sequence[str] = ()) -> Iterator[Session]:
        from garment_dataset.workspace.session import Session

        with Session(self.place, names) as session:
            yield session


def _print(word: str, name: str, text: str) -> None:
    line = printable(f"{word:14}{name}  {text}".rstrip())
    # whoever reads a pipe reads it now; and a signal ends this process without writing what is left
    print(time.strftime("%H:%M:%S"), line, flush=True)


def _state_of(path: Path) -> Hashable | None:
    """Return what changes when somebody writes to a bag, or puts another in its place; None when it is gone."""
    from garment_dataset.engine.sources import stat_source

    state = stat_source(path)
    return None if state is None else (path, state)
