"""``garment log`` and ``accept``: what builds did, and what a person has declared to be the same."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from garment_dataset.cli import completion
from garment_dataset.cli.output import FiltersArgument, JsonOption, WorkspaceOption, print_json, print_table, say
from garment_dataset.cli.status import open_session
from garment_dataset.errors import UsageError

if TYPE_CHECKING:
    from garment_dataset.engine.graph import NodeId
    from garment_dataset.workspace.session import Session


def log(
    count: Annotated[int, typer.Option("--count", "-n", min=1, help="How many builds, the last ones.")] = 20,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Say what each build did, when, by whom and with which version; --json with the code of every stage."""
    from garment_dataset.layout import Layout
    from garment_dataset.workspace.log import read_log

    builds = read_log(Layout.find(workspace).private_dir)[-count:]
    if as_json:
        print_json(builds)
    elif not builds:
        say("no build yet")
    else:
        columns = ["begun", "by", "version", "seconds", "what came of it", "command"]
        print_table(columns, [_row(build) for build in builds])


def _row(build: dict[str, Any]) -> list[object]:
    counts = build.get("counts", {})
    ended = ", ".join(f"{number} {name}" for name, number in counts.items()) if "ended" in build else "was ended"
    person = f"{build.get('user')}@{build.get('host')}"
    return [build["begun"], person, build.get("version"), build.get("seconds"), ended, build.get("command")]


def accept(
    stage: Annotated[
        str,
        typer.Argument(
            help="Whose change of code is to make no difference; `all` for every stage.",
            autocompletion=completion.stages,
        ),
    ],
    filters: FiltersArgument = None,
    because: Annotated[
        str, typer.Option("--because", "-m", help="Why the values are the same; kept with every result.")
    ] = "",
    dry_run: Annotated[bool, typer.Option("--dry-run", "-n", help="Say for which results; change nothing.")] = False,
    workspace: Annotated[Path | None, typer.Option("--workspace", "-w", envvar="GARMENT_WORKSPACE")] = None,
) -> None:
    """Declare a change of code equivalent: what is stale for that alone becomes fresh, and keeps a note of it."""
    from garment_dataset.engine.locking import write_lock
    from garment_dataset.workspace import accepting

    stages = () if stage == "all" else (stage,)
    with open_session(workspace, filters or (), stages) as session:
        if dry_run:
            nodes = [decision.node for decision in accepting.acceptable(session, stages)]
        else:
            if not because.strip():
                raise UsageError(
                    "no reason given", where="--because", hint="Say in a sentence why the values are equal."
                )
            with write_lock(
                session.layout.private_dir, what="garment accept", wait=True, tell=lambda text: say(f"garment: {text}")
            ):
                session.reload(everything=True)
                session.store.prepare()
                nodes = _accept_all(session, stages, because.strip())
                session.store.clear_scratch()
    for node in nodes:
        print(f"{'would accept' if dry_run else 'accepted'}  {node}")
    if not nodes:
        hint = "`garment status` says what is stale, and why."
        raise UsageError("nothing is stale for its code alone", where=stage, hint=hint)


def _accept_all(session: Session, stages: tuple[str, ...], because: str) -> list[NodeId]:
    """Accept from the sources downward: what reads an accepted result is looked at again."""
    from garment_dataset.workspace import accepting

    accepted: list[NodeId] = []
    while found := accepting.acceptable(session, stages):
        for decision in found:
            accepting.accept(session, decision, because)
            accepted.append(decision.node)
    return accepted
