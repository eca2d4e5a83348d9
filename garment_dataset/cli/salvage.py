"""``garment salvage``: what the bytes of a damaged bag still allow, in a new one."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from garment_dataset.cli.output import JsonOption, print_json, print_table, say
from garment_dataset.errors import printable

if TYPE_CHECKING:
    from garment_dataset.bags.salvage import SalvageReport

_MOST_PLACES = 10


def salvage(
    bag: Annotated[Path, typer.Argument(help="A damaged .bag, or a .bag.active that no recorder is at work on.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", help="The new bag. [default: NAME.salvaged.bag beside it]", show_default=False),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Save the messages of a damaged ROS 1 bag that can be had, in a new, sound one; the bag itself is not touched."""
    from garment_dataset.bags.salvage import salvage as save

    report = save(bag, out)
    if as_json:
        print_json(_record(report))
    else:
        _print(report)


def _record(report: SalvageReport) -> dict[str, object]:
    gaps = [gap._asdict() for gap in report.gaps]
    totals = {name: getattr(report, name) for name in ("is_sound", "kept", "doubtful", "lost")}
    return {**dataclasses.asdict(report), **totals, "gaps": gaps}


def _print(report: SalvageReport) -> None:
    name = printable(str(report.path))
    if report.is_sound:
        print(f"{name} is sound: {report.kept} messages, nothing written")
        return
    rows = [[topic.topic, topic.kept, topic.doubtful, topic.lost] for topic in report.topics]
    print_table(["topic", "kept", "doubtful", "lost"], rows)
    for gap in report.gaps[:_MOST_PLACES]:
        say(f"bytes {gap.start} to {gap.end}: {gap.what}")
    if len(report.gaps) > _MOST_PLACES:
        say(f"{len(report.gaps) - _MOST_PLACES} more such places: --json lists them")
    if not report.lost_is_known:
        where = "its chunk table is not whole" if report.cut_at is None else f"it is cut, from byte {report.cut_at} on"
        say(f"{where}: nothing tells how many messages more there were")
    if report.doubtful:
        say("doubtful messages are kept: they stand beside damage, or no checksum or index confirms them")
    print(f"{report.kept} messages kept, {report.lost} known to be lost: {printable(str(report.out))}")
