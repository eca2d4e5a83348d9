"""All checks of one recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

from garment_dataset.bags import open_bag
from garment_dataset.bags.condition import look
from garment_dataset.checks.cameras import check_cameras
from garment_dataset.checks.finding import SEVERITIES, CheckFinding, Found
from garment_dataset.checks.gripper import check_background, check_gripper
from garment_dataset.checks.images import check_images
from garment_dataset.checks.reading import read_facts
from garment_dataset.checks.timing import check_duration, check_messages, check_timing
from garment_dataset.checks.topics import check_topics
from garment_dataset.errors import BagError, SourceError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from garment_dataset.checks.contract import Contract
    from garment_dataset.checks.facts import Facts

    Check = Callable[[Facts, Contract], Iterator[Found]]


def _check_index(facts: Facts, _: Contract) -> Iterator[Found]:
    """Yield ``index``."""
    for text in facts.contradictions:
        yield Found("index", text, hint="`garment salvage` writes a bag whose index is sound.")


def _check_reading(facts: Facts, _: Contract) -> Iterator[Found]:
    """Yield ``reading``: what the readers warned of."""
    for text in facts.notes:
        yield Found("reading", text)


CHECKS: tuple[Check, ...] = (
    _check_index,
    check_topics,
    check_duration,
    check_timing,
    check_messages,
    check_images,
    check_cameras,
    check_gripper,
    check_background,
    _check_reading,
)
"""Each takes the facts of a recording and the contract; a new one is a function here."""


def judge(recording: str, facts: Facts, contract: Contract) -> list[CheckFinding]:
    """Hold the facts of a recording against a contract; the gravest findings first."""
    order = list(SEVERITIES)
    found = [each for check in CHECKS for each in check(facts, contract)]
    return [CheckFinding.of(recording, each) for each in sorted(found, key=lambda each: order.index(each.code))]


def check_bag(
    path: Path, contract: Contract, *, recording: str, axis: str | None = None, background: str | None = None
) -> list[CheckFinding]:
    """Read a recording and hold it against a contract.

    Parameters
    ----------
    path : Path
        The bag.
    contract : Contract
        What it must be like; see :meth:`~garment_dataset.checks.contract.Contract.of_empty_scene` for such bags.
    recording : str
        What findings call it.
    axis, background
        See :class:`~garment_dataset.checks.facts.Facts`.

    Returns
    -------
    list of CheckFinding
        The gravest first; a bag that cannot be read is a finding, too.
    """
    try:
        with open_bag(path) as bag:
            facts = read_facts(bag, contract, axis=axis, background=background)
    except (BagError, SourceError) as error:
        condition = look(path) if path.exists() else None
        text = error.what if error.found is None else f"{error.what}: {error.found}"
        hint = condition.hint if condition is not None else error.hint
        return [CheckFinding.of(recording, Found("unreadable", condition.text if condition else text, hint=hint))]
    return judge(recording, facts, contract)
