"""What commands say of a plan beside its states: counts in words, what is left out, orphaned or not as it should be."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.cli.output import say
from garment_dataset.errors import printable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from garment_dataset.engine.plan import Plan
    from garment_dataset.workspace.session import Session
    from garment_dataset.workspace.settled import Settled

QUALITY_STAGE = "quality"
"""The stage whose notes say that a recording is not ok."""

_SHOWN = 20


def recalled(workspace: Path | None) -> Settled | None:
    """Return what the last build of everything found, if it was all fresh and nothing has changed since."""
    from garment_dataset.layout import Layout
    from garment_dataset.workspace.settled import recall

    return recall(Layout.find(workspace))


def what_is_settled(plan: Plan, session: Session) -> Settled:
    """Return what there is to say of a plan by which everything is fresh."""
    from garment_dataset.workspace.settled import Settled

    absent = len(session.selection.absent)
    return Settled(len(session.graph), count_recordings(session), absent, tuple(beside(plan, session)))


def beside(plan: Plan, session: Session) -> list[str]:
    """Return what is to be said beside the state of a plan: what is left out, orphaned or not as it should be."""
    notes = {decision.node.subject: decision.notes for decision in plan if decision.node.stage == QUALITY_STAGE}
    return [*left_out_lines(session), *orphan_lines(session), *quality_lines(notes)]


def say_all(lines: Iterable[str]) -> None:
    """Say line after line."""
    for text in lines:
        say(text)


def quality_lines(notes: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """Yield which recordings are not as they should be: built, or fresh, is not all there is to say of them."""
    found = {subject: texts for subject, texts in notes.items() if texts}
    if not found:
        return
    yield f"{_count(len(found), 'recording')} not ok (`garment show NAME` says all that is known of one):"
    for subject, texts in list(found.items())[:_SHOWN]:
        for text in texts:
            yield f"  {subject}: {text}"
    if len(found) > _SHOWN:
        yield f"  ... and {len(found) - _SHOWN} more: `garment list quality!=ok`"


def left_out_lines(session: Session) -> Iterator[str]:
    """Yield which bags of the folder are not built, since their names say nothing, or the recorder did not finish."""
    found = session.catalog.found
    if found is None:
        return
    left_out = [f"{printable(path.name)}: {error.what}" for path, error in found.refused]
    left_out += [f"{printable(path.name)}: not finished" for path in found.unfinished]
    for text in left_out[:_SHOWN]:
        yield f"left out: {text} (`garment lint`)"
    if len(left_out) > _SHOWN:
        yield f"left out: {len(left_out) - _SHOWN} more (`garment lint`)"


def orphan_lines(session: Session) -> Iterator[str]:
    """Yield which files in the features folder nothing asks for any more: whoever reads the folder finds them there."""
    found = session.orphaned_files()
    if not found:
        return
    names = list(dict.fromkeys((path.stem, why) for path, why in found.items()))
    for name, why in names[:_SHOWN]:
        yield f"orphaned: {name}: {why}"
    if len(names) > _SHOWN:
        yield f"orphaned: ... and {len(names) - _SHOWN} more"
    yield f"{_count(len(found), 'orphaned file')} in {session.layout.features_dir}: `garment gc` lists and removes them"


def say_partial(session: Session) -> None:
    """Say which groups a selection leaves out."""
    if session.partial_groups:
        names = ", ".join(dict.fromkeys(node.subject for node in session.partial_groups))
        say(f"left out, since not all of their recordings are selected: {names}")


def results_text(count: int) -> str:
    """Return a number of results in words."""
    return _count(count, "result")


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def recordings_text(count: int) -> str:
    """Return a number of recordings in words."""
    return _count(count, "recording")


def count_recordings(session: Session) -> int:
    """Return how many recordings a session builds."""
    return len({row.recording for row in session.selection.rows} & {node.subject for node in session.graph})
