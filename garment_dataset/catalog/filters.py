"""The filter language that every verb understands.

A filter is a list of terms:

- ``key=value[,value]`` keeps what has one of the values, ``key!=value[,value]`` what has none of them;
- ``key<number``, ``<=``, ``>`` and ``>=`` keep what is known to be so;
- anything else is a glob on the recording's name: ``'GreenTowel_Ruler_*'``.

Terms of different keys must all hold; of several terms on one key, or several globs, one suffices. A text value may be
a glob (``garment=*Shirt``); numbers compare as numbers (``speed=0.5`` finds 0.50, and ``pi16`` or ``pi/16`` is one),
dates as dates (``day>=2026-11-25``); ``yes``, ``no``, ``true`` and ``false`` are the flags; an empty value stands for a
missing one (``repeat=``).

Where the words of a key are known, a value that is no glob must be one of them: a typing error is told apart from an
answer that is empty.
"""

from __future__ import annotations

import math
import operator
import re
import unicodedata
from collections.abc import Callable, Collection, Iterable, Mapping
from datetime import date
from fnmatch import translate
from typing import Any, NamedTuple

from garment_dataset.catalog.names import parse_bag_name
from garment_dataset.errors import FilterError, RecordingNameError, did_you_mean, nearest_word, one_of

Kind = type[str | float | bool | date]
Keys = Mapping[str, Kind]
"""What may be asked for: the name of each value, and whether it is text, a number, a flag or a date."""

Words = Mapping[str, Collection[str]]
"""All words that the values of a key can be, where they are known."""

Predicate = Callable[[object], bool]
"""Whether a record (a mapping, or an object with attributes) is wanted."""

NAME_KEY = "recording"
"""What a bare glob is matched with."""

_TERM = re.compile(r"(?P<key>[^=!<>]*)(?P<operator>[<>]=?|!?=)(?P<values>.*)", re.DOTALL)
_COMPARISONS: dict[str, Callable[[Any, Any], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
_PI = re.compile(r"pi/?(?P<divisor>[1-9][0-9]{0,2})")
_FLAGS = {"yes": True, "true": True, "no": False, "false": False}


class Term(NamedTuple):
    """One term: a key, how values are compared with it, and the values; the text is as typed."""

    text: str
    key: str
    sign: str
    values: tuple[str, ...]


def compile_filter(terms: Iterable[str], keys: Keys, words: Words | None = None) -> Predicate:
    """Make one predicate of all terms; no term at all wants everything.

    Parameters
    ----------
    terms : iterable of str
        As typed after a verb.
    keys : mapping of str to {str, float, bool, date}
        The values that a record has, and of which type.
    words : mapping of str to collection of str, optional
        Of keys that are text, all words that there are; of keys that are not in it, any word may be asked for.

    Raises
    ------
    FilterError
        If a term names no key, or its value is no number, flag, date or known word where one is needed.
    """
    wanted: dict[str, list[Predicate]] = {}
    refused: list[tuple[str, Predicate]] = []
    compared: list[tuple[str, Predicate]] = []
    for text in terms:
        term = parse_term(text, keys, words)
        _refuse_unknown(term, keys, words or {})
        _, key, sign, values = term
        if sign in _COMPARISONS:
            compared.append((key, _comparison(term, keys)))
            continue
        tests = [_test(key, value, keys[key]) for value in values]
        if sign == "=":
            wanted.setdefault(key, []).extend(tests)
        else:
            refused.extend((key, test) for test in tests)

    def predicate(record: object) -> bool:
        return (
            all(any(test(_value(record, key)) for test in tests) for key, tests in wanted.items())
            and not any(test(_value(record, key)) for key, test in refused)
            and all(test(_value(record, key)) for key, test in compared)
        )

    return predicate


def terms_of(filters: Mapping[str, object]) -> tuple[str, ...]:
    """Write keyword filters as terms: ``garment="GreenTowel", repeat=[1, 2]`` is ``garment=GreenTowel repeat=1,2``.

    None asks for a missing value, and an empty list for nothing at all.
    """
    terms: list[str] = []
    for key, value in filters.items():
        values = _written(value)
        # there is no term for nothing, but nothing is both missing and not missing; a name is never missing
        some = "*" if key == NAME_KEY else ""
        terms += [f"{key}={','.join(values)}"] if values else [f"{key}={some}", f"{key}!={some}"]
    return tuple(terms)


def _written(value: object) -> list[str]:
    """Return the values of a keyword filter as they stand in a term."""
    if (as_list := getattr(value, "tolist", None)) is not None:
        value = as_list()  # numpy and pandas
    if isinstance(value, Iterable) and not isinstance(value, str | bytes):
        return sorted(text for item in value for text in _written(item))
    if isinstance(value, bool):
        return ["yes" if value else "no"]
    if isinstance(value, str):
        return [value]
    return ["" if value is None or str(value) in {"nan", "<NA>"} else str(value)]  # as numpy and pandas say missing


def parse_term(text: str, keys: Keys, words: Words | None = None) -> Term:
    """Take a term apart; a name that is among the words is taken as it is.

    Raises
    ------
    FilterError
        If it is empty, or names no key.
    """
    known = (words or {}).get(NAME_KEY, ())
    text = unicodedata.normalize("NFC", text)  # as the tables are read
    if (found := _TERM.fullmatch(text)) is None:
        return Term(text, NAME_KEY, "=", (_name_pattern(text, known),))
    key, values = found["key"].strip(), tuple(value.strip() for value in found["values"].split(","))
    if key not in keys:
        nearest = nearest_word(key, keys)
        # a number's value is not repeated: 100 may be meant in g, and the key be in kg
        rest = "" if nearest is None or keys[nearest] is float else f"{found['operator']}{found['values']}"
        hint = None if nearest is None else f"Did you mean {nearest}{rest}?"
        raise FilterError("no such key", where=text, expected=", ".join(keys), found=repr(key), hint=hint)
    if key == NAME_KEY:
        values = tuple(_name_pattern(value, known) for value in values)
    return Term(text, key, found["operator"], values)


def is_glob(value: str) -> bool:
    """Say whether a value stands for all that look like it."""
    return any(letter in value for letter in "*?[")


def _refuse_unknown(term: Term, keys: Keys, words: Words) -> None:
    """Refuse a word that is not among the known ones of its key."""
    if (known := words.get(term.key)) is None or keys[term.key] is not str or term.sign in _COMPARISONS:
        return
    for value in term.values:
        if value and not is_glob(value) and value not in known:
            raise FilterError(
                f"no such {term.key}",
                where=term.text,
                expected=one_of(known),
                found=repr(value),
                hint=_what_is_meant(term, value, keys, words),
            )


def _what_is_meant(term: Term, value: str, keys: Keys, words: Words) -> str | None:
    """Return the hint for an unknown word; a word alone may be one of another key."""
    if term.key == NAME_KEY:
        if keys.get(value) is float:
            return f"{value} is a key: write '{value}>0.1' in quotes, for the shell takes < and > for itself."
        if value in keys:
            return f"{value} is a key: write {value}=VALUE."
        for key, known in words.items():
            if key != NAME_KEY and value in known:
                return f"Did you mean {key}={value}?"
    prefix = "" if term.text == value else f"{term.key}{term.sign}"
    return did_you_mean(value, words[term.key], prefix)


def _name_pattern(text: str, known: Collection[str]) -> str:
    """Let a file name as the shell completes it, or as table B.3 prints it, name its recording."""
    if not text:
        raise FilterError("empty filter", expected="key=value[,value] or a glob on the recording's name")
    if (stem := text.removesuffix(".bag")) in known:
        return stem
    try:
        return str(parse_bag_name(text))
    except RecordingNameError:
        return stem


def _test(key: str, value: str, kind: Kind) -> Predicate:
    if value == "":
        return lambda found: found is None
    if kind is float:
        number = _number(key, value)
        return lambda found: isinstance(found, int | float) and math.isclose(found, number, rel_tol=1e-9)
    if kind is bool:
        if value.lower() not in _FLAGS:
            raise FilterError("not a flag", where=f"{key}={value}", expected="yes or no", found=repr(value))
        flag = _FLAGS[value.lower()]
        return lambda found: found is flag
    if kind is date:
        day = _date(key, value)
        return lambda found: found == day
    pattern = re.compile(translate(value))
    return lambda found: isinstance(found, str) and pattern.match(found) is not None


def _comparison(term: Term, keys: Keys) -> Predicate:
    """Return the test of ``key<number`` and the like: what is not known is neither less nor more."""
    if (kind := keys[term.key]) not in (float, date):
        known = one_of(key for key, kind in keys.items() if kind in (float, date))
        what = f"{term.sign} compares numbers, and {term.key} is none"
        raise FilterError(what, where=term.text, expected=known)
    if len(term.values) != 1:
        raise FilterError(f"{term.sign} compares with one number", where=term.text, expected="one number")
    compare = _COMPARISONS[term.sign]
    if kind is date:
        day = _date(term.key, term.values[0])
        return lambda found: isinstance(found, date) and compare(found, day)
    bound = _number(term.key, term.values[0])
    return lambda found: isinstance(found, int | float) and not isinstance(found, bool) and compare(found, bound)


def _date(key: str, text: str) -> date:
    try:
        return date.fromisoformat(text)
    except ValueError:
        pass
    raise FilterError("not a date", where=f"{key}={text}", expected="a date such as 2026-11-25", found=repr(text))


def _number(key: str, text: str) -> float:
    if (found := _PI.fullmatch(text)) is not None:
        return math.pi / int(found["divisor"])
    if _NUMBER.fullmatch(text) is None:
        raise FilterError("not a number", where=f"{key}={text}", expected="a number", found=repr(text))
    return float(text)


def _value(record: Any, key: str) -> object:  # noqa: ANN401 - a mapping, or an object with attributes
    return record[key] if hasattr(record, "__getitem__") else getattr(record, key)
