"""``garment doctor``: what this machine and this workspace are like."""

from __future__ import annotations

import dataclasses
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from garment_dataset.cli.output import JsonOption, WorkspaceOption, print_json, say
from garment_dataset.errors import GarmentError

if TYPE_CHECKING:
    from garment_dataset.doctor import Check
    from garment_dataset.layout import Layout


def doctor(workspace: WorkspaceOption = None, as_json: JsonOption = False) -> None:
    """Check this machine, and the workspace if there is one; exit with 1 when there is a fault."""
    from garment_dataset.doctor import examine

    layout, broken = _layout(workspace)
    checks = [*broken, *examine(layout)]
    counts = Counter(check.state for check in checks)
    if as_json:
        root = None if layout is None else str(layout.root)
        print_json({"workspace": root, "counts": counts, "checks": [dataclasses.asdict(check) for check in checks]})
    else:
        for check in checks:
            print(check)
        say(", ".join(f"{counts[state]} {state}" for state in ("ok", "warning", "fault")))
    if counts["fault"]:
        raise typer.Exit(1)


def _layout(path: Path | None) -> tuple[Layout | None, list[Check]]:
    """Return the workspace that is meant, and what is wrong with it; outside of one, there is nothing wrong."""
    from garment_dataset.doctor import Check
    from garment_dataset.layout import Layout, workspace_above

    if path is None and workspace_above(Path.cwd()) is None:
        return None, [Check("workspace", "ok", "none at or above this folder: only the machine is checked")]
    try:
        layout = Layout.find(path)
    except GarmentError as error:
        return None, [Check("workspace", "fault", str(error))]
    return layout, [Check("workspace", "ok", str(layout.root))]
