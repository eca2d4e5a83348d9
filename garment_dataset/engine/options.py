"""What a caller chooses about one run."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Options:
    """How a graph is run.

    Parameters
    ----------
    slots : int
        Number of tasks to keep running.
    retry_failed : bool
        Run again what failed before with the very same inputs.
    forced : bool
        Run everything, fresh or not.
    orphans : frozenset of tuple of str
        Published nodes that no graph has any more: one whose result goes on under another subject is withdrawn.
    ahead : int
        How many sources are brought into this machine's memory ahead of those that are worked on.
    """

    slots: int = 1
    retry_failed: bool = False
    forced: bool = False
    orphans: frozenset[tuple[str, ...]] = frozenset()
    ahead: int = 0
