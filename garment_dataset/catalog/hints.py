"""Why a filter that can be understood finds nothing: what is nearest, and between which bounds the numbers lie."""

from __future__ import annotations

import difflib
import math
from datetime import date
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from garment_dataset.catalog.filters import compile_filter, is_glob, parse_term

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from garment_dataset.catalog.filters import Keys, Words

_MIN_SHARE = 0.6
"""How much of a glob must stand in a name, in order, for the name to be offered."""
_MAX_WORDS = 2000
"""Among how many names the nearest is looked for: about a tenth of a second's worth."""


def idle_globs(terms: Iterable[str], keys: Keys, words: Words) -> Iterator[str]:
    """Yield a sentence for each glob that no word of its key looks like, with the nearest word."""
    for text in terms:
        term = parse_term(text, keys)
        for value in term.values if term.key in words else ():
            if is_glob(value) and not any(fnmatchcase(word, value) for word in words[term.key]):
                nearest = nearest_to_glob(value, words[term.key])
                offer = "" if nearest is None else f"; the nearest is {nearest}"
                yield f"no {term.key} looks like {value!r}{offer}"


def why_nothing(
    terms: Sequence[str],
    records: Sequence[Mapping[str, object]],
    keys: Keys,
    words: Words,
    units: Mapping[str, str],
) -> list[str]:
    """Return sentences that say why no record is wanted; none where no term alone is to blame.

    Parameters
    ----------
    terms : sequence of str
        The filter, which can be understood.
    records : sequence of mapping
        All that there are.
    keys, words
        See :func:`~garment_dataset.catalog.filters.compile_filter`.
    units : mapping of str to str
        Of the keys that are quantities.
    """
    found = list(idle_globs(terms, keys, words))
    for text in terms:
        key = parse_term(text, keys).key
        if keys[key] is str and all(record[key] is None for record in records):
            found.append(f"no {key} is known")
        elif keys[key] is not str and not any(map(compile_filter([text], keys), records)):
            found.append(f"{text!r} holds of none: {_known(key, records, units)}")
    return list(dict.fromkeys(found))


def nearest_to_glob(pattern: str, words: Collection[str]) -> str | None:
    """Return the word that has most of what a glob says, in its order; None when none has much of it."""
    letters = "".join(letter for letter in pattern if letter not in "*?[]").casefold()
    if not letters or len(words) > _MAX_WORDS:
        return None

    def likeness(word: str) -> tuple[float, float]:
        matcher = difflib.SequenceMatcher(None, letters, word.casefold(), autojunk=False)
        blocks = [block.size for block in matcher.get_matching_blocks()]
        # one long block is worth more than its letters strewn over the word
        return sum(blocks) / len(letters), math.hypot(*blocks) / len(word)

    nearest = max(words, key=likeness, default=None)
    return None if nearest is None or likeness(nearest)[0] < _MIN_SHARE else nearest


def nearest_names(name: str, known: Collection[str], most: int = 3) -> list[str]:
    """Return the known names that look most like one that is not, or like a part of one; the nearest first."""
    if len(known) > _MAX_WORDS:
        return []
    folded = {each.casefold(): each for each in reversed(list(known))}
    if name.casefold() in folded:
        return [folded[name.casefold()]]
    found = difflib.get_close_matches(name.casefold(), list(folded), n=most, cutoff=0.8)
    part = None if found else nearest_to_glob(name, known)
    return [folded[each] for each in found] if part is None else [part]


def _known(key: str, records: Iterable[Mapping[str, object]], units: Mapping[str, str]) -> str:
    """Say which values of a key there are."""
    days = sorted(value for record in records if isinstance(value := record[key], date))
    if days:
        return f"{key} is {days[0]}" + ("" if days[0] == days[-1] else f" to {days[-1]}")
    values = [value for record in records if isinstance(value := record[key], int | float)]
    if not values:
        return f"no {key} is known"
    if all(isinstance(value, bool) for value in values):
        return f"{key} is {' or '.join(sorted({'yes' if value else 'no' for value in values}))}"
    unit = "" if units.get(key, "1") == "1" else f" {units[key]}"
    low, high = min(values), max(values)
    return f"{key} is {low:g}{unit}" + ("" if low == high else f" to {high:g}{unit}")
