"""How the value of a name may be used, what kinds of values there are, and which use may change which."""

from __future__ import annotations

READ, HELD, GIVEN, CHANGED, METHOD, CALLED, LENT, PART, ITERATED, INTO = (1 << bit for bit in range(10))
"""How a value is used: only looked at, stored elsewhere, given to first-party code, changed, a method of it called,
called itself, given to a library, an attribute or item of it taken, gone through, made into an object of a class."""

LATER = 16
"""Shift of the same flags for uses in a function's body, which importing the module does not run."""

NOW = (1 << LATER) - 1
"""Mask of the uses that importing the module makes."""

CODE, FROZEN, FLAT, CONTAINER, INSTANCE, UNKNOWN = "code", "frozen", "flat", "container", "instance", "unknown"
"""A function or class; what never changes, nor does anything in it; a builtin container of such; one of anything; an
object of first-party code; anything else."""

ACTS = {
    CODE: CHANGED,
    FROZEN: CHANGED,
    FLAT: CHANGED | GIVEN | LENT | INTO,
    CONTAINER: CHANGED | GIVEN | LENT | INTO,
    INSTANCE: NOW & ~HELD,
    UNKNOWN: CHANGED | GIVEN | LENT | INTO | METHOD | CALLED | ITERATED,
}
"""Uses on import that may change a value, by its kind."""

ACTS_IN_COMPANY = {
    CODE: 0,
    FROZEN: 0,
    FLAT: HELD,
    CONTAINER: HELD | PART | METHOD,
    INSTANCE: HELD,
    UNKNOWN: HELD | PART,
}
"""Uses on import that may change a value where the same statement calls something."""

CHANGES = {
    CODE: CHANGED,
    FROZEN: CHANGED,
    FLAT: CHANGED,
    CONTAINER: CHANGED,
    INSTANCE: CHANGED | METHOD | CALLED,
    UNKNOWN: CHANGED,
}
"""Uses in a function that change a value, by its kind."""

MAY_CHANGE = {
    CODE: 0,
    FROZEN: 0,
    FLAT: GIVEN | HELD | LENT | INTO,
    CONTAINER: NOW & ~READ,
    INSTANCE: NOW,
    UNKNOWN: NOW & ~READ,
}
"""Uses in a function that may change a value: they count where importing the modules calls the function."""

CALLS = CALLED | LENT | METHOD | GIVEN
"""Uses on import by which a function may be called."""
