"""``garment build``: act on a plan, and say what became of it."""

from __future__ import annotations

import contextlib
import time
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from garment_dataset.cli.output import FiltersArgument, JsonOption, WorkspaceOption, noting_warnings, print_json, say
from garment_dataset.cli.saying import (
    QUALITY_STAGE,
    beside,
    left_out_lines,
    orphan_lines,
    quality_lines,
    recalled,
    recordings_text,
    results_text,
    say_all,
    say_partial,
    what_is_settled,
)
from garment_dataset.cli.status import StageOption, named, open_session, show_plan
from garment_dataset.errors import StorageError, UsageError

if TYPE_CHECKING:
    from garment_dataset.engine.events import Report
    from garment_dataset.engine.plan import Plan
    from garment_dataset.workspace.session import Session
    from garment_dataset.workspace.settled import Settled


def build(
    filters: FiltersArgument = None,
    stage: StageOption = None,
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", "-j", min=0, help="Worker processes; 0: none, run in this one. [default: one per CPU]"),
    ] = None,
    engine: Annotated[
        Literal["local", "dask"], typer.Option("--engine", help="Where to run: on this machine, or on a Dask cluster.")
    ] = "local",
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="ADDRESS", help="Address of the cluster's scheduler.")
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", "-n", help="Say what would be done, and why; do nothing.")
    ] = False,
    failed: Annotated[
        bool, typer.Option("--failed", help="Try again what failed before with the same inputs.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", "-f", help="Run everything selected, fresh or not.")] = False,
    rehash: Annotated[
        bool, typer.Option("--rehash", help="Read the bags' content anew, whatever size and time say.")
    ] = False,
    no_wait: Annotated[
        bool, typer.Option("--no-wait", help="Do not wait for another build of this workspace; exit 4.")
    ] = False,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Build what is missing or stale, and nothing else."""
    _check_engine(engine, scheduler, jobs)
    is_of_all = not (filters or stage)
    if is_of_all and not (dry_run or force or rehash) and (settled := recalled(workspace)) is not None:
        _say_settled(settled, as_json=as_json)
        return
    from garment_dataset.engine.executors import server_ahead

    began_ns = time.time_ns()
    with (
        server_ahead(0 if dry_run or scheduler else jobs),
        noting_warnings() as shown,
        open_session(workspace, filters or (), stage or ()) as session,
    ):
        plan = session.plan()
        _refuse_nothing(session, plan)
        if dry_run:
            show_plan(plan, session, as_json=as_json)
            return
        is_idle = {decision.state.value for decision in plan} <= {"fresh", "blocked"}
        if is_idle and not force and not rehash:
            settled = _finish_idle(plan, session, as_json=as_json)
            if settled is not None and is_of_all and not shown:
                _remember(settled, session, began_ns)
            return
        from garment_dataset.cli.progress import progress
        from garment_dataset.workspace import building

        open_nodes = [decision for decision in plan if force or decision.state != "fresh"]
        with progress(decision.node for decision in open_nodes) as (begin, tell):
            report = building.build(
                session,
                jobs=jobs,
                scheduler=scheduler,
                retry_failed=failed,
                forced=force,
                rehash=rehash,
                wait=not no_wait,
                is_planned=True,
                emit=tell,
                begin=begin,
                tell=lambda text: say(f"garment: {text}"),
            )
        _summarise(report, session, as_json=as_json)


def _check_engine(engine: str, scheduler: str | None, jobs: int | None) -> None:
    """Refuse options that do not go together."""
    if engine == "local" and scheduler is not None:
        raise UsageError("--scheduler is for --engine dask", found=f"--scheduler {scheduler} without it")
    if engine == "dask" and scheduler is None:
        raise UsageError("--engine dask needs --scheduler", hint="`dask scheduler` prints its address.")
    if engine == "dask" and jobs == 0:
        raise UsageError("--jobs 0 runs in this process, --engine dask on a cluster", hint="Leave one of them out.")


def _refuse_nothing(session: Session, plan: Plan) -> None:
    if list(plan):
        return
    absent = len(session.selection.absent)
    found = f"{absent} recordings of the catalog without a bag" if absent else "no recording"
    raise UsageError(
        "nothing to build",
        where=session.layout.recordings_dir,
        expected="bags of recordings that a pipeline names",
        found=found,
        hint="`garment list` shows which there are.",
    )


def _finish_idle(plan: Plan, session: Session, *, as_json: bool) -> Settled | None:
    """Say that nothing is to be run, without the parts of the engine that run something; return it if all is fresh.

    A build that was killed may have left out what comes last, so that is looked at all the same.
    """
    from garment_dataset.workspace.building import tidy

    with contextlib.suppress(StorageError):  # somebody who may only read has nothing to do, too
        tidy(session)
    if plan.is_fresh:
        settled = what_is_settled(plan, session)
        _say_settled(settled, as_json=as_json)
        return settled
    counts = {state.value: count for state, count in plan.counts().items() if count}
    if as_json:
        print_json({"counts": counts, "events": []})
    _say_blocked(session)
    say("nothing to do: " + ", ".join(f"{count} {state}" for state, count in counts.items()))
    say_all(beside(plan, session))
    return None


def _say_settled(settled: Settled, *, as_json: bool) -> None:
    if as_json:
        print_json({"counts": {"fresh": settled.results}, "events": []})
    results, recordings = results_text(settled.results), recordings_text(settled.recordings)
    say(f"nothing to do: all {results} of {recordings} are fresh")
    say_all(settled.said)


def _remember(settled: Settled, session: Session, began_ns: int) -> None:
    """Have the next build know at once that nothing is to be done, as long as nothing changes."""
    from garment_dataset.workspace.settled import remember

    code = {path for code in session.codes.values() for path in code.files}
    remember(session.layout, settled, code, began_ns)


def _say_blocked(session: Session) -> None:
    for message in dict.fromkeys(node.blocked for node in session.graph if node.blocked is not None):
        say(f"blocked: {message}")


def _summarise(report: Report, session: Session, *, as_json: bool) -> None:
    from garment_dataset.engine.events import Ending

    counts = {ending.value: len(report.of(ending)) for ending in Ending}
    failures = report.of(Ending.FAILED)
    if as_json:
        events: list[dict[str, Any]] = [
            {
                **named(event.node),
                "ending": event.ending.value,
                "message": event.message,
                "is_repeated": event.is_repeated,
                "notes": list(event.notes),
            }
            for event in report.events.values()
        ]
        print_json({"counts": counts, "events": events})
    if failures:
        say(f"{len(failures)} failed:")
        for event in failures:
            say(f"  {event.node}: {event.message}")
        say("`garment why NAME` shows where; `garment build --failed` tries again")
    _say_blocked(session)
    say_partial(session)
    say_all((*left_out_lines(session), *orphan_lines(session)))
    say(", ".join(f"{count} {name}" for name, count in counts.items() if count))
    if any(report.of(ending) for ending in (Ending.BUILT, Ending.LINKED, Ending.RELABELLED)):
        say(f"results: {session.layout.features_dir}")
    judged = [event for event in report.events.values() if event.node.stage == QUALITY_STAGE]
    say_all(quality_lines({event.node.subject: event.notes for event in judged}))
    if failures:
        raise typer.Exit(1)
