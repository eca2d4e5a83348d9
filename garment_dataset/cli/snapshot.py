"""``garment export OUT``: a self-contained copy of results for whoever has not this package."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from garment_dataset.cli.output import FiltersArgument, JsonOption, WorkspaceOption, print_json, say
from garment_dataset.errors import UsageError


def snapshot(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="A new folder, or a snapshot that is replaced.", show_default=False)
    ],
    filters: FiltersArgument = None,
    table: Annotated[list[str] | None, typer.Option("--table", help="Only this table; may be given again.")] = None,
    variant: Annotated[str, typer.Option("--variant", help="Of this variant of the results.")] = "",
    since: Annotated[
        Path | None, typer.Option("--since", help="Say what is new since this snapshot; by default since OUT's.")
    ] = None,
    verify: Annotated[bool, typer.Option("--verify", help="Write nothing; say whether OUT is as written.")] = False,
    as_json: JsonOption = False,
    workspace: WorkspaceOption = None,
) -> None:
    """Write a snapshot: Parquet that every reader takes, what describes it, sums, and a data card."""
    if verify:
        if filters or table or variant or since:
            raise UsageError("what was exported is verified as a whole", expected="`garment export --verify OUT`")
        _verify(out, as_json=as_json)
        return
    from garment_dataset.layout import Layout
    from garment_dataset.snapshot.changes import changes
    from garment_dataset.snapshot.contents import gather
    from garment_dataset.snapshot.folders import refuse_foreign
    from garment_dataset.snapshot.writing import MANIFEST, read_manifest, write_snapshot
    from garment_dataset.workspace.session import Session

    refuse_foreign(out)
    before = since or (out if (out / MANIFEST).is_file() else None)
    old = None if before is None else read_manifest(before)
    with Session(Layout.find(workspace), filters or ()) as session:
        contents = gather(session, table or (), variant)
        write_snapshot(contents, out)
    new = read_manifest(out)
    changed = None if old is None else changes(old, new)
    if as_json:
        told = ("version", "content", "tables", "recordings", "left_out")
        print_json({"out": str(out), **{name: new[name] for name in told}, "changes": changed})
        return
    for line in changed or ():
        print(line)
    if changed == []:
        say("nothing has changed since")
    rows = sum(each["rows"] for each in new["tables"].values())
    say(f"{len(new['recordings'])} recordings, {len(new['tables'])} tables, {rows} rows; version {new['version']}")
    if new["left_out"]:
        name, why = next(iter(new["left_out"].items()))
        say(f"left out: {len(new['left_out'])}, first {name}: {why} (README.md and snapshot.json name them)")
    say(f"snapshot: {out}")


def _verify(out: Path, *, as_json: bool) -> None:
    """Compare a snapshot with its sums; exit 1 where it is not as written."""
    from garment_dataset.snapshot.sums import compare, read_sums
    from garment_dataset.snapshot.writing import MANIFEST, read_manifest

    found, files = compare(out), len(read_sums(out))
    if as_json:
        print_json({"files": files, "changed": found.changed, "missing": found.missing, "added": found.added})
    else:
        for word, names in (("changed", found.changed), ("missing", found.missing), ("not in the sums", found.added)):
            for name in names:
                print(f"{word}: {name}")
        if not found:
            version = f", version {read_manifest(out)['version']}" if (out / MANIFEST).is_file() else ""
            say(f"{out}: all {files} files are as written{version}")
    if found:
        sys.exit(1)
