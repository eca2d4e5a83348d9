"""``garment verify`` and ``gc``: whether what is kept is what was stored, and what of it nobody needs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from garment_dataset.cli.output import FiltersArgument, JsonOption, WorkspaceOption, print_json, print_table, say
from garment_dataset.cli.status import open_session

if TYPE_CHECKING:
    from collections.abc import Iterator

    from garment_dataset.engine.verify import Finding
    from garment_dataset.workspace.collecting import Rubbish
    from garment_dataset.workspace.session import Session


def verify(
    filters: FiltersArgument = None,
    bags: Annotated[bool, typer.Option("--bags", help="Read the bags' bytes once more, too.")] = False,
    recompute: Annotated[
        int, typer.Option("--recompute", min=0, metavar="N", help="Make N fresh results once more, and compare.")
    ] = 0,
    seed: Annotated[int, typer.Option("--seed", help="Which N.")] = 0,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """Read everything back: every object, every published file; exit 1 with the names of what is not as stored."""
    with open_session(workspace, filters or (), ()) as session:
        findings = list(_read_back(session, bags=bags))
        count = 0
        if recompute:
            for node, finding in _recomputed(session, recompute, seed):
                count += 1
                findings += [finding] if finding is not None else []
                say(f"{'DIFFERS' if finding else 'equal':8}{node}")
        files = sum(1 for _ in session.store.objects)
    if as_json:
        print_json({"objects": files, "recomputed": count, "findings": [finding._asdict() for finding in findings]})
    elif findings:
        print_table(["where", "what"], findings)
    if findings:
        say(f"{len(findings)} findings; `garment build` makes anew what is damaged or gone")
        raise typer.Exit(1)
    again = f", {count} results came out the same once more" if recompute else ""
    say(f"all {files} objects, and all that is published of them, are as stored{again}")


def _read_back(session: Session, *, bags: bool) -> Iterator[Finding]:
    from garment_dataset.engine.verify import check_objects, check_published, check_sources

    before = session.store.index.published()
    yield from check_objects(session.store)
    found = list(check_published(session.store, [node.id for node in session.graph]))
    session.reload(everything=False)
    if session.store.index.published() != before:  # a build went on meanwhile
        found = list(check_published(session.store, [node.id for node in session.graph]))
    yield from found
    if bags:
        yield from check_sources(session.graph, session.store)


def _recomputed(session: Session, count: int, seed: int) -> Iterator[tuple[object, Finding | None]]:
    from garment_dataset.engine.verify import recompute

    return recompute(session.graph, session.plan(), session.codes, session.store, count=count, seed=seed)


def gc(
    delete: Annotated[bool, typer.Option("--delete", help="Remove it; without this, it is only listed.")] = False,
    no_wait: Annotated[
        bool, typer.Option("--no-wait", help="Do not wait for a build that is at work; exit 4.")
    ] = False,
    workspace: WorkspaceOption = None,
    as_json: JsonOption = False,
) -> None:
    """List what nothing asks for any more: files of renamed bags and dropped stages, unpublished results, remains."""
    from garment_dataset.engine.locking import write_lock
    from garment_dataset.workspace import collecting

    with open_session(workspace, (), ()) as session:
        if delete:
            folder = session.layout.private_dir
            with write_lock(folder, what="garment gc", wait=not no_wait, tell=lambda text: say(f"garment: {text}")):
                session.reload(everything=True)
                found = collecting.find_rubbish(session)
                collecting.remove(session, found)
        else:
            found = collecting.find_rubbish(session)
        if not found:
            say("nothing to remove")
        elif as_json:
            print_json([{"path": str(each.path), "bytes": each.size_bytes, "why": each.why} for each in found])
        else:
            _print_rubbish(session, found)
        if found:
            total = sum(each.size_bytes for each in found)
            text = "removed" if delete else "could be removed: `garment gc --delete`"
            say(f"{len(found)} files, {_size_text(total)}: {text}")


def _print_rubbish(session: Session, found: list[Rubbish]) -> None:
    root = session.layout.root
    names = [each.path.relative_to(root) if each.path.is_relative_to(root) else each.path for each in found]
    rows = [[_size_text(each.size_bytes), name, each.why] for each, name in zip(found, names, strict=True)]
    print_table(["size", "file", "why"], rows)


def _size_text(size_bytes: int) -> str:
    for unit, size in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size_bytes >= size:
            return f"{size_bytes / size:.1f} {unit}"
    return f"{size_bytes} B"
