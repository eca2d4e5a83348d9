"""What ``garment lint --rename`` prints and does."""

from __future__ import annotations

from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING

import typer

from garment_dataset.cli.output import print_json, say
from garment_dataset.errors import printable

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from garment_dataset.catalog import Catalog
    from garment_dataset.catalog.lint import Finding
    from garment_dataset.catalog.renaming import RenamePlan
    from garment_dataset.workspace import Workspace


@contextmanager
def ready_to_rename(place: Workspace, *, to_apply: bool) -> Iterator[None]:
    """Finish a renaming that was interrupted and keep builds out, or say only that there is one."""
    from garment_dataset.workspace.renames import finish_renames, is_interrupted, locked

    with locked(place) if to_apply else nullcontext():
        if to_apply:
            finish_renames(place, lambda old, new: say(printable(f"finished what was interrupted: {old} -> {new}")))
        elif is_interrupted(place):
            say("garment: a renaming was interrupted: `garment lint --rename --apply` finishes it")
        yield


def rename(place: Workspace, catalog: Catalog, findings: Sequence[Finding], *, to_apply: bool, as_json: bool) -> None:
    """Print which bags get which names, and rename them if that is wanted; exit with 1 when any keeps a wrong one."""
    from garment_dataset.workspace.renames import apply_renames, plan_for

    if catalog.found is None:
        return
    plan = plan_for(place, findings, catalog.found)
    if to_apply:
        apply_renames(place, plan.renames)
    if as_json:
        print_json(_record(plan, to_apply=to_apply))
    else:
        for line in _report(plan, to_apply=to_apply):
            print(printable(line.replace(f"{place.root}/", "")))
    if plan.refused or (plan.renames and not to_apply):
        raise typer.Exit(1)


def _record(plan: RenamePlan, *, to_apply: bool) -> dict[str, object]:
    return {
        "applied": to_apply,
        "renames": [{"path": rename.path, "name": rename.name} for rename in plan.renames],
        "refused": [{"path": each.path, "names": each.names, "reason": each.reason} for each in plan.refused],
    }


def _report(plan: RenamePlan, *, to_apply: bool) -> Iterator[str]:
    verb = "renamed" if to_apply else "rename"
    for each in plan.renames:
        yield f"{verb} {each.path} -> {each.name}"
    for refused in plan.refused:
        yield f"refused {refused.path} -> {' or '.join(refused.names)}: {refused.reason}"
    if not (plan.renames or plan.refused):
        yield "nothing to rename"
        return
    counts = f"{len(plan.renames)} renamed" if to_apply else f"{len(plan.renames)} to rename"
    counts += f", {len(plan.refused)} refused" if plan.refused else ""
    after = "`garment build` moves their results along" if to_apply else "`--apply` does it"
    yield f"{counts}; {after}" if plan.renames else counts
