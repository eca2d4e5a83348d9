"""``garment status``, ``why`` and ``dag``: one plan, shown; and what a build says, too."""

from __future__ import annotations

import json
from collections import Counter
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from garment_dataset.cli import completion
from garment_dataset.cli.fitting import fits, name_lines, wrap
from garment_dataset.cli.output import (
    FiltersArgument,
    JsonOption,
    WorkspaceOption,
    cells_of,
    print_json,
    print_table,
    terminal_width,
)
from garment_dataset.cli.saying import (
    beside,
    count_recordings,
    recalled,
    recordings_text,
    results_text,
    say_all,
    say_partial,
    what_is_settled,
)
from garment_dataset.cli.streams import legible
from garment_dataset.errors import StoreError, UsageError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from garment_dataset.engine.facts import Reason
    from garment_dataset.engine.graph import NodeId
    from garment_dataset.engine.plan import Decision, Plan
    from garment_dataset.workspace.session import Session
    from garment_dataset.workspace.settled import Settled

_SHOWN = 20

StageOption = Annotated[
    list[str] | None,
    typer.Option(
        "--stage",
        "-s",
        help="Only this stage and what feeds it; may be repeated.",
        autocompletion=completion.stages,
    ),
]


def status(
    filters: FiltersArgument = None,
    stage: StageOption = None,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
    exit_code: Annotated[bool, typer.Option("--exit-code", help="Exit with 1 when something is not fresh.")] = False,
) -> None:
    """Say what is fresh, stale, missing, blocked or failed, and why."""
    if not (filters or stage or as_json) and (settled := recalled(workspace)) is not None:
        _print_settled(settled)
        return
    with open_session(workspace, filters or (), stage or ()) as session:
        plan = session.plan()
        show_plan(plan, session, as_json=as_json)
    if exit_code and not plan.is_fresh:
        raise typer.Exit(1)


def why(
    recording: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="Name of a recording, a group of them, or position_1 and the like.",
            autocompletion=completion.recordings,
        ),
    ],
    stage: Annotated[str | None, typer.Argument(help="Only this stage.", autocompletion=completion.stages)] = None,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Say what would be done with every stage of one recording, and every reason, old -> new."""
    from garment_dataset.layout import Layout
    from garment_dataset.workspace.session import Session

    with Session.about(Layout.find(workspace), recording, [stage] if stage else ()) as session:
        decisions = [decision for decision in session.plan() if stage in {None, decision.node.stage}]
        tracebacks = {key: failure.traceback for key, failure in session.store.index.failures().items()}
        provenances = {one.node: found for one in decisions if (found := _provenance(session, one)) is not None}
        absent = [row.recording for row in session.selection.absent]
    if not decisions:
        raise UsageError(
            "nothing is built of it",
            where=recording,
            found="no bag in the recordings folder" if absent else "no pipeline names it",
            hint="`garment dag` shows which pipelines there are.",
        )
    if as_json:
        print_json([_record(decision) | {"provenance": provenances.get(decision.node)} for decision in decisions])
        return
    for decision in decisions:
        print(f"{decision.node}: {_verdict(decision)}")
        for reason in decision.reasons:
            print(f"    {reason}")
        for note in decision.notes:
            print(f"    note: {note}")
        for line in _made_from(provenances.get(decision.node, {})):
            print(f"    {line}")
        if decision.state == "failed" and (trace := tracebacks.get(decision.node)):
            print("    " + trace.rstrip().replace("\n", "\n    "))


def _provenance(session: Session, decision: Decision) -> dict[str, Any] | None:
    """Return what a fresh result's file says of its making."""
    from garment_dataset.engine.artifacts import read_provenance

    if decision.state != "fresh" or decision.key is None:
        return None
    result = session.store.results[decision.key]
    try:
        return read_provenance(session.store.table_path(result, next(iter(result.outputs)), decision.node.variant))
    except StoreError:
        return None


def _made_from(provenance: Mapping[str, Any]) -> Iterator[str]:
    """Yield what a result was made from, line by line."""
    if not provenance:
        return
    facts = provenance["facts"]
    yield from (f"parameter {name} = {json.dumps(value)}" for name, value in facts["params"].items())
    yield f"code {facts['code'][:12]}"
    for accepted in provenance.get("accepted", []):
        yield f"    made by code {accepted['code'][:12]}, accepted as equivalent: {accepted['because']}"
    yield from (f"library {name} {version}" for name, version in facts["libraries"].items())
    yield from (f"input {name}: {(content or 'left out')[:12]}" for name, content in facts["inputs"].items())
    yield f"key {provenance['key'][:12]}"


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


def open_session(workspace: Path | None, filters: Sequence[str], stages: Sequence[str]) -> Session:
    """Open the workspace that a command is about."""
    from garment_dataset.layout import Layout
    from garment_dataset.workspace.session import Session

    return Session(Layout.find(workspace), filters, stages)


def named(node: NodeId) -> dict[str, Any]:
    """Return a node's names as JSON; the subject of a camera position or a group stands there, too."""
    return {"stage": node.stage, "recording": node.subject, "variant": node.variant or None}


def _record(decision: Decision) -> dict[str, Any]:
    """Return a decision as JSON, in the product's words."""
    own = {name: value for name, value in decision.to_json().items() if name not in {"stage", "subject", "variant"}}
    return {**named(decision.node), **own}


def _verdict(decision: Decision) -> str:
    if decision.state == "stale" and decision.stored:
        return "stale, but the result wanted is in the store: it will be linked"
    if decision.state == "stale" and not decision.certain:
        return "perhaps stale: run only if what feeds it comes out different"
    return decision.state.value


def show_plan(plan: Plan, session: Session, *, as_json: bool) -> None:
    """Print what is to be done and why, and what is known to be wrong with what is fresh."""
    decisions = list(plan)
    absent = len(session.selection.absent)
    if as_json:
        counts = {state.value: count for state, count in plan.counts().items()}
        print_json({"counts": counts, "absent": absent, "decisions": [_record(decision) for decision in decisions]})
        return
    say_partial(session)
    if decisions and plan.is_fresh:
        _print_settled(what_is_settled(plan, session))
        return
    if decisions:
        _print_matrix(decisions, session)
        _print_reasons(decisions)
    results, recordings = results_text(len(decisions)), recordings_text(count_recordings(session))
    counts_text = ", ".join(f"{count} {state.value}" for state, count in plan.counts().items() if count)
    print(f"{results} of {recordings}: {counts_text or 'nothing to build'}")
    if absent:
        print(_ABSENT.format(absent))
    say_all(beside(plan, session))


_ABSENT = "{} recordings of the catalog have no bag here (`garment list state=missing`)"


def _print_settled(settled: Settled) -> None:
    results = results_text(settled.results)
    print(f"{results} of {recordings_text(settled.recordings)}: {settled.results} fresh")
    if settled.absent:
        print(_ABSENT.format(settled.absent))
    say_all(settled.said)


def _print_matrix(decisions: list[Decision], session: Session) -> None:
    stages = [stage.name for stage in session.stages]
    states: dict[str, dict[str, str]] = {}
    for decision in decisions:
        mark = "" if decision.certain else "?"
        variant = f" ({decision.node.variant})" if decision.node.variant else ""
        states.setdefault(decision.node.subject + variant, {})[decision.node.stage] = decision.state.value + mark
    open_states = {subject: found for subject, found in states.items() if set(found.values()) != {"fresh"}}
    columns = ["recording", *stages]
    rows = cells_of([subject, *(found.get(stage, "") for stage in stages)] for subject, found in open_states.items())
    width = terminal_width()
    if fits(columns, rows, width) or width is None:
        print_table(columns, rows)
    else:
        _print_alike(open_states, width)


def _print_alike(states: Mapping[str, Mapping[str, str]], width: int) -> None:
    """Print, where the matrix is too wide, each row of it once, over the names of all that have it."""
    alike: dict[str, list[str]] = {}
    for subject, by_stage in states.items():
        stages_in: dict[str, list[str]] = {}
        for stage, state in by_stage.items():
            stages_in.setdefault(state, []).append(stage)
        text = "; ".join(f"{state} {', '.join(stages)}" for state, stages in stages_in.items())
        alike.setdefault(text, []).append(legible(subject))
    for text, subjects in alike.items():
        print("\n".join(wrap(f"{len(subjects)} with {text}:", width)))
        print("\n".join(name_lines(subjects[:_SHOWN], width)))
        if len(subjects) > _SHOWN:
            print(f"  ... and {len(subjects) - _SHOWN} more (`garment status | less` names them all)")


def _print_reasons(decisions: list[Decision]) -> None:
    found = Counter((decision.node.stage, _grouped(reason)) for decision in decisions for reason in decision.reasons)
    rows = [[count, stage, reason] for (stage, reason), count in found.items()]
    if rows:
        print_table(["nodes", "stage", "reason"], rows[:_SHOWN])
    if len(rows) > _SHOWN:
        print(f"... and {len(rows) - _SHOWN} more reasons (`garment why NAME`, or --json for all)")


def _grouped(reason: Reason) -> str:
    """Return a reason's text; of what stands above in the graph only the stage, so that recordings count together."""
    return f"upstream {reason.name.partition(':')[0]}: {reason.new}" if reason.kind == "upstream" else str(reason)
