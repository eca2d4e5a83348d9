"""What a machine and a workspace are like: checks, each in a guard of its own, none of which imports what is heavy.

Nothing is changed: what must be tried is tried with temporary files that are removed.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from garment_dataset.doctor.check import Check, guarded
from garment_dataset.doctor.folders import bags, case, clock, links, permissions, space, stamps
from garment_dataset.doctor.machine import encoding, file_names, memory, processors, year
from garment_dataset.doctor.software import dependencies, extras, opencv, package, python, ros

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from garment_dataset.layout import Layout

__all__ = ["Check", "examine"]

_MACHINE: dict[str, Callable[[], Iterable[Check]]] = {
    "python": python,
    "package": package,
    "dependencies": dependencies,
    "extras": extras,
    "opencv": opencv,
    "ros": ros,
    "processors": processors,
    "memory": memory,
    "year": year,
    "encoding": encoding,
    "file names": file_names,
}
_WORKSPACE: dict[str, Callable[[Layout], Iterable[Check]]] = {
    "permissions": permissions,
    "recordings": bags,
    "links": links,
    "time stamps": stamps,
    "letter case": case,
    "clock": clock,
}


def examine(layout: Layout | None = None) -> list[Check]:
    """Look at this machine, and at a workspace if there is one.

    Parameters
    ----------
    layout : Layout, optional
        The workspace.
    """
    found = [check for name, checks in _MACHINE.items() for check in guarded(name, checks)]
    found += guarded("disk space", partial(space, layout))
    if layout is not None:
        found += [check for name, checks in _WORKSPACE.items() for check in guarded(name, partial(checks, layout))]
    return found
