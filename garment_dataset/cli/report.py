"""``garment report``: an offline site of the workspace."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from garment_dataset.cli.output import FiltersArgument, WorkspaceOption, say

_FOLDER = "report"


def report(
    filters: FiltersArgument = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder of the site. [default: report/ in the workspace]", show_default=False),
    ] = None,
    opens: Annotated[bool, typer.Option("--open", help="Show it in the browser.")] = False,
    workspace: WorkspaceOption = None,
) -> None:
    """Write a site about the workspace, to be read offline: state, quality, findings, and a page per recording."""
    from garment_dataset.layout import Layout
    from garment_dataset.report.site import Site, read_manifest, require_extra

    require_extra()
    from garment_dataset.report.gathering import gather
    from garment_dataset.report.writing import write_report
    from garment_dataset.workspace.session import Session

    place = Layout.find(workspace)
    folder = place.root / _FOLDER if out is None else out
    site = Site(folder)
    began = time.perf_counter()
    with Session(place, filters or ()) as session:
        facts, checks = gather(session, read_manifest(folder).get("checks", {}))
    written = write_report(facts, site, {"checks": checks}, lambda name: say(f"drawing {name}"))
    for fault in written.faults:
        say(f"not whole: {fault}")
    counts = {"made": written.made, "unchanged": written.kept, "removed": written.removed}
    said = ", ".join(f"{len(names)} {what}" for what, names in counts.items() if names)
    say(f"{said}, {time.perf_counter() - began:.1f} s")
    print(written.index)
    if opens:
        import webbrowser

        webbrowser.open(written.index.resolve().as_uri())
