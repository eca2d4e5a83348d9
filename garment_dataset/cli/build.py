"""``garment build``, ``status``, ``why`` and ``dag``: one plan, shown or acted on."""

from __future__ import annotations

from collections import Counter
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from garment_dataset.cli.output import FiltersArgument, JsonOption, WorkspaceOption, print_json, print_table, say
from garment_dataset.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from garment_dataset.engine.events import Report
    from garment_dataset.engine.facts import Reason
    from garment_dataset.engine.graph import NodeId
    from garment_dataset.engine.plan import Decision, Plan
    from garment_dataset.workspace.session import Session

StageOption = Annotated[
    list[str] | None, typer.Option("--stage", "-s", help="Only this stage and what feeds it; may be repeated.")
]


def build(
    filters: FiltersArgument = None,
    stage: StageOption = None,
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", "-j", min=0, help="Worker processes; 0: none, run in this one. [default: one per CPU]"),
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
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Build what is missing or stale, and nothing else."""
    with _session(workspace, filters or (), stage or ()) as session:
        if rehash:
            session.forget_digests()
        plan = session.plan()
        _refuse_nothing(session, plan)
        if dry_run:
            _show_plan(plan, session, as_json=as_json)
            return
        if {decision.state.value for decision in plan} <= {"fresh", "blocked"} and not force:
            _say_idle(plan, session, as_json=as_json)
            return
        from garment_dataset.cli.progress import progress

        open_nodes = [decision for decision in plan if force or decision.state != "fresh"]
        try:
            with progress(len(open_nodes)) as tell:
                report = session.run(plan, jobs=jobs, retry_failed=failed, forced=force, emit=tell)
        except KeyboardInterrupt:
            say("garment: interrupted; what was finished is kept, `garment build` goes on from there")
            raise typer.Exit(130) from None
    _summarise(report, session, as_json=as_json)


def status(
    filters: FiltersArgument = None,
    stage: StageOption = None,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
    exit_code: Annotated[bool, typer.Option("--exit-code", help="Exit with 1 when something is not fresh.")] = False,
) -> None:
    """Say what is fresh, stale, missing, blocked or failed, and why."""
    with _session(workspace, filters or (), stage or ()) as session:
        plan = session.plan()
        _show_plan(plan, session, as_json=as_json)
    if exit_code and not plan.is_fresh:
        raise typer.Exit(1)


def why(
    recording: Annotated[
        str, typer.Argument(metavar="NAME", help="Name of a recording, a group of them, or position_1 and the like.")
    ],
    stage: Annotated[str | None, typer.Argument(help="Only this stage.")] = None,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Say, for every stage of one recording, what would be done with it and every reason, old -> new."""
    from garment_dataset.layout import Layout
    from garment_dataset.workspace.session import Session

    with Session.about(Layout.find(workspace), recording, [stage] if stage else ()) as session:
        decisions = [decision for decision in session.plan() if stage in {None, decision.node.stage}]
        tracebacks = {key: failure.traceback for key, failure in session.store.index.failures().items()}
        absent = [row.recording for row in session.selection.absent]
    if not decisions:
        raise UsageError(
            "nothing is built of it",
            where=recording,
            found="no bag in the recordings folder" if absent else "no pipeline names it",
            hint="`garment dag` shows which pipelines there are.",
        )
    if as_json:
        print_json([_record(decision) for decision in decisions])
        return
    for decision in decisions:
        print(f"{decision.node}: {_verdict(decision)}")
        for reason in decision.reasons:
            print(f"    {reason}")
        if decision.state == "failed" and (trace := tracebacks.get(decision.node)):
            print("    " + trace.rstrip().replace("\n", "\n    "))


class DagForm(StrEnum):
    """How the graph of stages is drawn."""

    TEXT = "text"
    MERMAID = "mermaid"


def dag(
    form: Annotated[DagForm, typer.Option("--form", help="Text, or Mermaid for documents.")] = DagForm.TEXT,
    params: Annotated[bool, typer.Option("--params", help="Show every stage's parameters, defaults included.")] = False,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Draw the graph of stages: what each reads, and which tables it makes."""
    from garment_dataset.cli import dag as drawing
    from garment_dataset.layout import Layout

    pipelines = drawing.load(Layout.find(workspace))
    if as_json:
        print_json(drawing.to_json(pipelines))
    elif form is DagForm.MERMAID:
        print(drawing.to_mermaid(pipelines))
    else:
        print(drawing.to_text(pipelines, params=params))


def _session(workspace: Path | None, filters: Sequence[str], stages: Sequence[str]) -> Session:
    from garment_dataset.layout import Layout
    from garment_dataset.workspace.session import Session

    return Session(Layout.find(workspace), filters, stages)


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


def _named(node: NodeId) -> dict[str, Any]:
    """Return a node's names as JSON; the subject of a camera position or a group stands there, too."""
    return {"stage": node.stage, "recording": node.subject, "variant": node.variant or None}


def _record(decision: Decision) -> dict[str, Any]:
    """Return a decision as JSON, in the product's words."""
    own = {name: value for name, value in decision.to_json().items() if name not in {"stage", "subject", "variant"}}
    return {**_named(decision.node), **own}


def _verdict(decision: Decision) -> str:
    if decision.state == "stale" and decision.stored:
        return "stale, but the result wanted is in the store: it will be linked"
    if decision.state == "stale" and not decision.certain:
        return "perhaps stale: run only if what feeds it comes out different"
    return decision.state.value


def _show_plan(plan: Plan, session: Session, *, as_json: bool) -> None:
    decisions = list(plan)
    absent = len(session.selection.absent)
    if as_json:
        counts = {state.value: count for state, count in plan.counts().items()}
        print_json({"counts": counts, "absent": absent, "decisions": [_record(decision) for decision in decisions]})
        return
    if decisions and not plan.is_fresh:
        _print_matrix(decisions, session)
        _print_reasons(decisions)
    counts_text = ", ".join(f"{count} {state.value}" for state, count in plan.counts().items() if count)
    print(f"{_results(len(decisions))} of {_recordings(session)}: {counts_text or 'nothing to build'}")
    if absent:
        print(f"{absent} recordings of the catalog have no bag here (`garment list state=missing`)")
    _say_partial(session)


def _print_matrix(decisions: list[Decision], session: Session) -> None:
    stages = [stage.name for stage in session.stages]
    states: dict[str, dict[str, str]] = {}
    for decision in decisions:
        mark = "" if decision.certain else "?"
        variant = f" ({decision.node.variant})" if decision.node.variant else ""
        states.setdefault(decision.node.subject + variant, {})[decision.node.stage] = decision.state.value + mark
    rows = [
        [subject, *(by_stage.get(stage, "") for stage in stages)]
        for subject, by_stage in states.items()
        if set(by_stage.values()) != {"fresh"}
    ]
    print_table(["recording", *stages], rows)


def _print_reasons(decisions: list[Decision]) -> None:
    found = Counter((decision.node.stage, _grouped(reason)) for decision in decisions for reason in decision.reasons)
    rows = [[count, stage, reason] for (stage, reason), count in found.items()]
    shown = 20
    if rows:
        print_table(["nodes", "stage", "reason"], rows[:shown])
    if len(rows) > shown:
        print(f"... and {len(rows) - shown} more reasons (`garment why NAME`, or --json for all)")


def _grouped(reason: Reason) -> str:
    """Return a reason's text; of what stands above in the graph only the stage, so that recordings count together."""
    return f"upstream {reason.name.partition(':')[0]}: {reason.new}" if reason.kind == "upstream" else str(reason)


def _say_idle(plan: Plan, session: Session, *, as_json: bool) -> None:
    """Say that nothing is to be run: without the parts of the engine that run something."""
    counts = {state.value: count for state, count in plan.counts().items() if count}
    if as_json:
        print_json({"counts": counts, "events": []})
    if plan.is_fresh:
        say(f"nothing to do: all {_results(len(session.graph))} of {_recordings(session)} are fresh")
        return
    _say_blocked(session)
    say("nothing to do: " + ", ".join(f"{count} {state}" for state, count in counts.items()))


def _say_partial(session: Session) -> None:
    if session.partial_groups:
        names = ", ".join(dict.fromkeys(node.subject for node in session.partial_groups))
        say(f"left out, since not all of their recordings are selected: {names}")


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
                **_named(event.node),
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
    _say_partial(session)
    say(", ".join(f"{count} {name}" for name, count in counts.items() if count))
    if report.of(Ending.BUILT) or report.of(Ending.LINKED):
        say(f"results: {session.layout.features_dir}")
    if failures:
        raise typer.Exit(1)


def _results(count: int) -> str:
    return "1 result" if count == 1 else f"{count} results"


def _recordings(session: Session) -> str:
    count = len({row.recording for row in session.selection.rows} & {node.subject for node in session.graph})
    return "1 recording" if count == 1 else f"{count} recordings"
